//! A loss in the line between tank and valve: a throttled shut-off valve, a clogged strainer, a line too narrow.
//!
//! `P_s = P_tank − R Q²` with Q what the servomotor draws (Merritt 1967, *Hydraulic Control Systems*, chapter 3; Idelchik 2007,
//! *Handbook of Hydraulic Resistance*).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | R | quadratic loss of the line `loss_pa_s2_m6` | Pa s²/m⁶ |
//! | Q | flow out of the tank | m³/s |
//!
//! Without it the simulated servomotor is too fast in large movements and right in small ones, most at the spool's stops. Limits: no inertia of
//! the oil in the line, no accumulator behind the loss.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "supply_loss", Supply, apply;
    "loss_pa_s2_m6" ["Pa s2/m6"] 0.0 ..= 5.0e10, neutral 0.0, typical 2.0e9, scales with LineLoss:
        "quadratic loss of the line between tank and valve";
};

fn apply([loss_pa_s2_m6]: [f64; 1], plant: &mut Plant) {
    plant.supply.line_root = plant.supply.line_root.hypot(loss_pa_s2_m6.max(0.0).sqrt());
}
