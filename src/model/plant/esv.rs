//! The emergency shutdown valve: passes pilot oil, or drains the control chamber to return.
//!
//! `Q_e = s Q_x − (1 − s) C_d A_e √(2 (P_ctrl − P_t)/ρ)`, with s = 1 in NORMAL and 0 in SHUTDOWN; values between belong to
//! a valve on its way. Source: Liu et al. 2025, equation 13; the paper prints the drain as positive, it empties the chamber.

use crate::parameters;
use crate::plant::lanes::abreast;
use crate::plant::orifice::{Flow, root};
use crate::plant::real::{Real, either};

abreast! {
    /// Law and parameters of the emergency shutdown valve.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct Esv<T = f64> {
        /// Drain flow per root of pressure drop, m³/(s √Pa).
        pub conductance: T,
    }
}

impl Esv {
    /// From the sheet.
    pub fn new(p: &parameters::Esv, oil: &parameters::Oil) -> Self {
        Self { conductance: p.discharge_coefficient * p.drain_area_m2 * (2.0 / oil.density_kg_m3).sqrt() }
    }
}

impl<T: Real> Esv<T> {
    /// Flow into the control chamber, given the flow of the pilot valve.
    #[inline(always)]
    pub fn flow(&self, opening_pu: T, pilot: Flow<T>, control_pressure_pa: T, return_pa: T) -> Flow<T> {
        let one = opening_pu.like(1.0);
        either!(opening_pu.ge(one), pilot, {
            let (value, slope) = root(control_pressure_pa - return_pa);
            let drain = (one - opening_pu) * self.conductance;
            Flow {
                m3_s: opening_pu * pilot.m3_s - drain * value,
                slope_m3_s_pa: opening_pu * pilot.slope_m3_s_pa - drain * slope,
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_drain_empties_the_chamber() {
        let esv = Esv { conductance: 0.62 * 2.0e-5 * (2.0_f64 / 870.0).sqrt() };
        let pilot = Flow { m3_s: 1e-4, slope_m3_s_pa: -1e-11 };
        assert_eq!(esv.flow(1.0, pilot, 3.3e6, 0.1e6), pilot);
        let drained = esv.flow(0.0, pilot, 3.3e6, 0.1e6);
        let expected = -0.62 * 2.0e-5 * (2.0 * 3.2e6 / 870.0_f64).sqrt();
        assert!((drained.m3_s - expected).abs() < 1e-12 && drained.slope_m3_s_pa < 0.0);
    }
}
