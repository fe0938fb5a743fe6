//! A current that ends early: a weak amplifier, a sagging supply of it, a coil that has grown hot, and the pilot valve opens in part only.
//!
//! `u → sat(u, ±L)`: the saturation of the small loop's output (Liu et al. 2025, equation 4) at less than the rated current (current amplifier
//! of a valve: Gordić, Babić & Jovičić 2004, International Journal of Fluid Power 5(1)).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | L | greatest current over the rated one `limit_pu` | pu |
//! | u | current to the pilot valve | pu |
//!
//! Without it the real spool is slower than simulated in large movements, alike when opening and when closing, and as fast in small ones; an
//! ESV that trips drains past the pilot valve and is on time. Limits: sharp, the same for both signs, constant over the recording.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "current_limit", PilotValve, apply;
    "limit_pu" ["pu"] 0.02 ..= 1.0, neutral 1.0, typical 0.5:
        "greatest current that reaches the pilot valve, over the rated one";
};

fn apply([limit_pu]: [f64; 1], plant: &mut Plant) {
    let regulator = &mut plant.regulator;
    regulator.current_limit_pu = regulator.current_limit_pu.min(limit_pu.max(0.0));
}
