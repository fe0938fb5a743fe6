//! An offset of the spool's transducer: a shifted core or a drifted amplifier.
//!
//! `y_r = y + b`; the regulator and the recording both read `y_r` (Isermann 2006, *Fault-Diagnosis Systems*, sensor faults: offset).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | b | offset `bias_pu` | pu of reference stroke |
//! | y, y_r | spool position, reading | pu |
//!
//! Without it the real spool reads b at its stops beyond what the nuts allow, and the servomotor drifts to one side of its dead
//! band. Limits: constant over all recordings.

use crate::effects::{EffectDefinition, EffectLaw, EffectParameter, EffectSpec, Scaling, Stage};
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = EffectSpec::new(EffectDefinition {
    id: "lvdt_bias",
    stage: Stage::Sensor,
    source: include_str!("lvdt_bias.rs"),
    parameters: &[EffectParameter {
        name: "bias_pu",
        unit: "pu",
        neutral: 0.0,
        min: -0.3,
        max: 0.3,
        typical: 0.03,
        scaling: Scaling::Fixed,
        doc: "offset of the spool's transducer",
    }],
    apply: &EffectLaw(apply),
});

fn apply([bias_pu]: [f64; 1], plant: &mut Plant) {
    plant.spool.reading_bias_pu += bias_pu;
}
