//! A loss in the return line: a clogged return filter, a throttled valve, a line too narrow, and the chamber that empties does so against it.
//!
//! `P_r = P_t + R Q²` behind the draining port, with Q what leaves the servomotor (Merritt 1967, *Hydraulic Control Systems*, chapter 3; Idelchik
//! 2007, *Handbook of Hydraulic Resistance*).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | R | quadratic loss of the return line `loss_pa_s2_m6` | Pa s²/m⁶ |
//! | Q | flow out of the chamber that empties | m³/s |
//! | P_t, P_r | return pressure at the tank, pressure behind the port | Pa |
//!
//! Without it the simulated servomotor is too fast in large movements and right in small ones, more so in the direction that empties the
//! larger chamber: a loss in the pressure line does it the other way round. Limits: no inertia of the oil; pilot valve and ESV
//! drain by a line of their own.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "return_loss", Supply, apply;
    "loss_pa_s2_m6" ["Pa s2/m6"] 0.0 ..= 5.0e10, neutral 0.0, typical 2.0e9, scales with LineLoss:
        "quadratic loss of the return line behind the main ports";
};

fn apply([loss_pa_s2_m6]: [f64; 1], plant: &mut Plant) {
    plant.supply.return_root = plant.supply.return_root.hypot(loss_pa_s2_m6.max(0.0).sqrt());
}
