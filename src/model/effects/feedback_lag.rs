//! A slow transducer of the servomotor: a filter in its electronics, a rope or a lever that gives way.
//!
//! `τ Y_r' + Y_r = Y`, stepped exactly for a position that runs linearly over a tick (first-order hold: Åström & Wittenmark 1997,
//! *Computer-Controlled Systems*, section 7.3). The regulator and the recording both read `Y_r`.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | τ | time constant `time_constant_s` | s |
//! | Y, Y_r | piston position, reading | pu |
//!
//! Without it the real reading trails the simulated one by τ in every ramp and the loop overshoots at its end. Limits: one
//! linear lag.

use crate::effects::{EffectDefinition, EffectLaw, EffectParameter, EffectSpec, Scaling, Stage};
use crate::plant::Plant;
use crate::plant::lag::lag;
use crate::plant::term::Point;

/// The effect.
pub(crate) const SPEC: EffectSpec = EffectSpec::new(EffectDefinition {
    id: "feedback_lag",
    stage: Stage::Sensor,
    source: include_str!("feedback_lag.rs"),
    parameters: &[EffectParameter {
        name: "time_constant_s",
        unit: "s",
        neutral: 0.0,
        min: 0.0,
        max: 1.0,
        typical: 0.05,
        scaling: Scaling::Fixed,
        doc: "time constant of the servomotor's transducer",
    }],
    apply: &EffectLaw(apply),
});

fn apply([time_constant_s]: [f64; 1], plant: &mut Plant) {
    if time_constant_s > 0.0 {
        let tick_s = plant.regulator.small_loop_period_s();
        plant.terms.push(lag(Point::ServomotorReading, time_constant_s, tick_s));
    }
}
