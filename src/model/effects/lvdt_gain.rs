//! A wrong gain of the spool's transducer: a bad calibration, an ageing oscillator.
//!
//! `y_r = g y`; the regulator and the recording both read `y_r` (Isermann 2006, *Fault-Diagnosis Systems*, sensor faults: changed gain).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | g | reading over position `gain_ratio` | 1 |
//! | y, y_r | spool position, reading | pu |
//!
//! Without it the real spool reading has another value at the stops, and the servomotor moves at 1/g of the speed that the reading
//! promises in slow movements. Limits: linear.

use crate::effects::{EffectDefinition, EffectLaw, EffectParameter, EffectSpec, Scaling, Stage};
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = EffectSpec::new(EffectDefinition {
    id: "lvdt_gain",
    stage: Stage::Sensor,
    source: include_str!("lvdt_gain.rs"),
    parameters: &[EffectParameter {
        name: "gain_ratio",
        unit: "1",
        neutral: 1.0,
        min: 0.5,
        max: 2.0,
        typical: 1.08,
        scaling: Scaling::Fixed,
        doc: "reading of the spool's transducer over the true position",
    }],
    apply: &EffectLaw(apply),
});

fn apply([gain_ratio]: [f64; 1], plant: &mut Plant) {
    plant.spool.reading_gain *= gain_ratio;
}
