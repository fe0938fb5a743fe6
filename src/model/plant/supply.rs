//! The supply: tank, line to the valve, return, and how cold the oil is.
//!
//! `P_s = P_tank − R Q²`, with Q the flow that the servomotor draws; `P_r = P_t + R_r Q_r²` behind the main ports, with Q_r the flow that
//! it gives back. Both losses are 0 on the sheet.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | P_s | pressure at the valve | Pa |
//! | P_t, P_r | return pressure at the tank and behind the main ports | Pa |
//! | R, R_r | quadratic loss of the pressure line and of the return line | Pa s²/m⁶ |

use crate::parameters;
use crate::plant::lanes::abreast;
use crate::plant::real::{Real, either};

abreast! {
    /// Law and parameters of the supply.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Supply<T = f64> {
        /// Return pressure `P_t`, Pa gauge.
        pub return_pressure_pa: T,
        /// √R: the inverse conductance of the line, √Pa s/m³.
        pub line_root: T,
        /// √R_r: the inverse conductance of the return line behind the main ports, √Pa s/m³.
        pub return_root: T,
        /// Viscosity at the first frame over the sheet's, less 1.
        pub cold_excess: T,
        /// Time constant with which cold oil warms, s.
        pub warming_time_s: T,
    }
}

impl Supply {
    /// From the sheet: no losses in lines.
    pub fn new(p: &parameters::Oil) -> Self {
        Self {
            return_pressure_pa: p.return_pressure_pa,
            line_root: 0.0,
            return_root: 0.0,
            cold_excess: 0.0,
            warming_time_s: 1.0,
        }
    }
}

impl<T: Real> Supply<T> {
    /// Viscosity over the sheet's: `1 + c e^(−t/τ)` for oil that starts cold and warms.
    #[inline(always)]
    pub fn viscosity(&self, time_s: f64) -> T {
        let warm = self.cold_excess.is(0.0);
        let one = self.cold_excess.like(1.0);
        either!(warm, one, one + self.cold_excess * (one.like(-time_s) / self.warming_time_s).exp_unless(warm))
    }

    /// Pressure at the valve while the servomotor draws `drawn_m3_s`, Pa.
    #[inline(always)]
    pub fn pressure_pa(&self, tank_pressure_pa: T, drawn_m3_s: T) -> T {
        let root = self.line_root * drawn_m3_s;
        tank_pressure_pa - root * root.abs()
    }
}
