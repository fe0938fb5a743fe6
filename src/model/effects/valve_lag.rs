//! A valve that follows its recorded signal late: the spool position was recorded as demanded, or before a pilot stage of its own.
//!
//! `τ x' + x = x_r`, stepped exactly for a signal that runs linearly over a tick (a servo valve as a lag of first order: Jelali & Kroll 2003,
//! *Hydraulic Servo-systems*, section 4.3; first-order hold: Åström & Wittenmark 1997, *Computer-Controlled Systems*, section 7.3).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | τ | time constant `time_constant_s` | s |
//! | x_r, x | spool position as recorded, as it opens the ports | m |
//!
//! Without it the real servomotor sets off later than simulated after every movement of the spool, and stops later. Limits: one linear lag; acts
//! only where the recorded spool drives the servomotor stage.

use crate::effects::EffectSpec;
use crate::plant::Plant;
use crate::plant::lag::lag;
use crate::plant::term::Point;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "valve_lag", Spool, apply;
    "time_constant_s" ["s"] 0.0 ..= 5.0, neutral 0.0, typical 0.1:
        "time constant of the valve behind its recorded signal";
};

fn apply([time_constant_s]: [f64; 1], plant: &mut Plant) {
    if time_constant_s > 0.0 {
        let tick_s = plant.regulator.small_loop_period_s();
        plant.terms.push(lag(Point::DrivingSpool, time_constant_s, tick_s));
    }
}
