//! Dead time of the emergency shutdown valve: relay, solenoid and pilot stage act late.
//!
//! The valve does at t what its solenoid was told at `t − T` (dead time: ASME PTC 29-2005, *Speed-Governing Systems for Hydraulic Turbine-Generator Units*).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | T | dead time `delay_s` | s |
//!
//! Without it the simulated spool falls to its closing stop a time T before the real one after a trip; nothing else differs.
//! Limits: the same for trip and release; within the tick in which the dead time ends the valve counts as partly switched, so that the
//! response is continuous in T.

use std::sync::Arc;

use crate::effects::EffectSpec;
use crate::plant::Plant;
use crate::plant::term::Point;
use crate::plant::term::delay::Delay;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "esv_delay", Esv, apply;
    "delay_s" ["s"] 0.0 ..= 3.0, neutral 0.0, typical 0.3: "time from the ESV's signal to its switching";
};

fn apply([delay_s]: [f64; 1], plant: &mut Plant) {
    if delay_s > 0.0 {
        let tick_s = plant.regulator.small_loop_period_s();
        plant.terms.push(Arc::new(Delay::new(Point::EsvOpening, delay_s, tick_s, 1)));
    }
}
