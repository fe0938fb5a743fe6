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

use crate::effects::EffectSpec;
use crate::plant::Plant;
use crate::plant::lag::lag;
use crate::plant::term::Point;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "feedback_lag", Sensor, apply;
    "time_constant_s" ["s"] 0.0 ..= 1.0, neutral 0.0, typical 0.05: "time constant of the servomotor's transducer";
};

fn apply([time_constant_s]: [f64; 1], plant: &mut Plant) {
    if time_constant_s > 0.0 {
        let tick_s = plant.regulator.small_loop_period_s();
        plant.terms.push(lag(Point::ServomotorReading, time_constant_s, tick_s));
    }
}
