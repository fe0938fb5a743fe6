//! A guide-vane load off the sheet: another head, trash between the vanes, worn profiles.
//!
//! `F_l = (1 + r) (F_0 + F_1 Y)` towards closing (guide-vane torque over opening: IEC 60193:2019).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | r | load above the sheet's, relative `extra_ratio` | 1 |
//! | F_0, F_1, Y | load at closed, load added at open, opening | N, N, pu |
//!
//! Without it the real servomotor opens slower and closes faster than simulated at the same spool position. Limits: linear in the
//! opening, the same shape as on the sheet, without the flow's dynamics.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "load", Servomotor, apply;
    "extra_ratio" ["1"] -0.95 ..= 3.0, neutral 0.0, typical 0.4: "guide-vane load above the sheet's, relative";
};

fn apply([extra_ratio]: [f64; 1], plant: &mut Plant) {
    let servo = &mut plant.servomotor;
    servo.load_closed_n *= 1.0 + extra_ratio;
    servo.load_slope_n *= 1.0 + extra_ratio;
}
