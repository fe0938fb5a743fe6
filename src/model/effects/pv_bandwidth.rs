//! A pilot valve that follows its current slower, or faster, than specified: thick oil, dirt, a weak amplifier.
//!
//! `x_p'' + 2 ζ r ω_n x_p' + (r ω_n)² x_p = K (r ω_n)² u` (Liu et al. 2025, equation 5; Merritt 1967, *Hydraulic Control Systems*, chapter 5).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | r | natural frequency over the sheet's `frequency_ratio` | 1 |
//! | ζ, ω_n | damping ratio and natural frequency of the sheet | 1, rad/s |
//!
//! Without it the real spool starts a few milliseconds later than the simulated one and rings about its demand, in all manoeuvres
//! alike. Limits: linear; the damping ratio stays.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "pv_bandwidth", PilotValve, apply;
    "frequency_ratio" ["1"] 0.03 ..= 3.0, neutral 1.0, typical 0.4:
        "natural frequency of the pilot valve over the sheet's";
};

fn apply([frequency_ratio]: [f64; 1], plant: &mut Plant) {
    plant.proportional_valve.natural_frequency_rad_s *= frequency_ratio;
}
