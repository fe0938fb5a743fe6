//! A pure delay between the opening command and the regulator: a slow bus, a queue, a scan.
//!
//! The regulator sees `Y_pid(t − T)` (Åström & Wittenmark 1997, *Computer-Controlled Systems*, section 2.3).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | T | delay `delay_s` | s |
//!
//! Without it the simulated servomotor leads the real one by T in every ramp, while the response to the ESV is on time.
//! Limits: constant; between two runs of the large loop the command is interpolated linearly, so that the response is
//! smooth in T.

use std::sync::Arc;

use crate::effects::EffectSpec;
use crate::plant::Plant;
use crate::plant::term::Point;
use crate::plant::term::delay::Delay;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "command_delay", Regulator, apply;
    "delay_s" ["s"] 0.0 ..= 1.0, neutral 0.0, typical 0.05:
        "delay between the issue of the command and its use by the regulator";
};

fn apply([delay_s]: [f64; 1], plant: &mut Plant) {
    if delay_s > 0.0 {
        let (tick_s, grid_ticks) = (plant.regulator.small_loop_period_s(), plant.regulator.ticks_per_large_loop());
        plant.terms.push(Arc::new(Delay::new(Point::Command, delay_s, tick_s, grid_ticks)));
    }
}
