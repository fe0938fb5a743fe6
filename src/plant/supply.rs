//! The supply: tank, line to the valve, return, and how cold the oil is.
//!
//! `P_s = P_tank − R Q²`, with Q the flow that the servomotor draws; R = 0 on the sheet.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | P_s | pressure at the valve | Pa |
//! | R | quadratic loss of the line | Pa s²/m⁶ |

use crate::parameters;

/// Law and parameters of the supply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    /// Return pressure `P_t`, Pa gauge.
    pub return_pressure_pa: f64,
    /// √R: the inverse conductance of the line, √Pa s/m³.
    pub line_root: f64,
    /// Viscosity at the first frame over the sheet's, less 1.
    pub cold_excess: f64,
    /// Time constant with which cold oil warms, s.
    pub warming_time_s: f64,
}

impl Supply {
    /// From the sheet: no line loss.
    #[must_use]
    pub fn new(p: &parameters::Oil) -> Self {
        Self { return_pressure_pa: p.return_pressure_pa, line_root: 0.0, cold_excess: 0.0, warming_time_s: 1.0 }
    }

    /// Viscosity over the sheet's: `1 + c e^(−t/τ)` for oil that starts cold and warms.
    #[inline]
    #[must_use]
    pub fn viscosity(&self, time_s: f64) -> f64 {
        if self.cold_excess == 0.0 { 1.0 } else { 1.0 + self.cold_excess * (-time_s / self.warming_time_s).exp() }
    }

    /// Pressure at the valve while the servomotor draws `drawn_m3_s`, Pa.
    #[inline]
    #[must_use]
    pub fn pressure_pa(&self, tank_pressure_pa: f64, drawn_m3_s: f64) -> f64 {
        let root = self.line_root * drawn_m3_s;
        tank_pressure_pa - root * root.abs()
    }
}
