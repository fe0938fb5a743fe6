//! What acts on the rig by time alone: slow changes and oscillations.

use crate::battery::faults::Faults;

/// What changes with time alone: the same at every stage of a step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    pub(super) viscosity_ratio: f64,
    pub(super) ripple_pa: f64,
    pub(super) surge_n: f64,
    /// What is left of things that fade within 10, 20 and 30 s.
    pub(super) fading: [f64; 3],
}

impl Moment {
    pub(super) fn new(time_s: f64, f: &Faults) -> Self {
        use std::f64::consts::TAU;
        let since_s = time_s.max(0.0);
        // Viscosity falls exponentially with a temperature that settles exponentially.
        let viscosity_ratio =
            if f.cold_excess == 0.0 { 1.0 } else { (f.cold_excess.ln_1p() * (-since_s / 60.0).exp()).exp() };
        Self {
            viscosity_ratio,
            ripple_pa: f.ripple_pa * (TAU * 2.0 * time_s).sin(),
            surge_n: f.surge_n * (TAU * 0.7 * time_s).sin(),
            fading: [10.0, 20.0, 30.0].map(|within_s| (-since_s / within_s).exp()),
        }
    }
}
