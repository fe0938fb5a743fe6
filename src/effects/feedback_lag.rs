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

use std::sync::Arc;

use crate::effects::{EffectParameter, EffectSpec, Stage};
use crate::plant::Plant;
use crate::plant::term::{Point, Term, View};

/// The effect.
pub const SPEC: EffectSpec = EffectSpec {
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
        doc: "time constant of the servomotor's transducer",
    }],
    apply: &apply,
};

fn apply(values: &[f64], plant: &mut Plant) {
    if values[0] > 0.0 {
        let ticks = values[0] / plant.regulator.small_loop_period_s();
        plant.terms.push(Arc::new(Lag { decay_ratio: (-1.0 / ticks).exp(), ticks_count: ticks }));
    }
}

#[derive(Debug)]
struct Lag {
    /// What a tick leaves of a difference.
    decay_ratio: f64,
    /// The time constant in ticks.
    ticks_count: f64,
}

impl Term for Lag {
    fn point(&self) -> Point {
        Point::ServomotorReading
    }

    fn memory_len(&self) -> usize {
        2
    }

    fn reset(&self, signal: f64, memory: &mut [f64]) {
        memory.fill(signal);
    }

    fn apply(&self, signal: f64, _view: &View<'_>, memory: &mut [f64]) -> f64 {
        let (before, reading) = (memory[0], memory[1]);
        // Behind a ramp the reading settles `time constant × slope` below the signal.
        let behind = self.ticks_count * (signal - before);
        memory[0] = signal;
        memory[1] = signal - behind + self.decay_ratio * (reading - before + behind);
        memory[1]
    }
}
