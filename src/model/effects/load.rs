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

use crate::effects::{EffectDefinition, EffectLaw, EffectParameter, EffectSpec, Scaling, Stage};
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = EffectSpec::new(EffectDefinition {
    id: "load",
    stage: Stage::Servomotor,
    source: include_str!("load.rs"),
    parameters: &[EffectParameter {
        name: "extra_ratio",
        unit: "1",
        neutral: 0.0,
        min: -0.95,
        max: 3.0,
        typical: 0.4,
        scaling: Scaling::Fixed,
        doc: "guide-vane load above the sheet's, relative",
    }],
    apply: &EffectLaw(apply),
});

fn apply([extra_ratio]: [f64; 1], plant: &mut Plant) {
    let servo = &mut plant.servomotor;
    servo.load_closed_n *= 1.0 + extra_ratio;
    servo.load_slope_n *= 1.0 + extra_ratio;
}
