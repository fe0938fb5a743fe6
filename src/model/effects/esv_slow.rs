//! An emergency shutdown valve that travels slowly from one end to the other: a sticky spool, a weak spring, a throttled pilot.
//!
//! `ds/dt = ±1/T` until s reaches 1 (normal) or 0 (shutdown); pilot oil passes in proportion to s, the drain to 1 − s
//! (port areas in proportion to the travel: Merritt 1967, *Hydraulic Control Systems*, chapter 5).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | T | time of a full travel `travel_s` | s |
//! | s | opening of the valve | 1 |
//!
//! Without it the simulated spool falls at once and at full speed after a trip, while the real one gathers speed. Limits: linear travel
//! and areas, the same both ways.

use std::sync::Arc;

use crate::effects::EffectSpec;
use crate::plant::Plant;
use crate::plant::term::{Point, Term, View};

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "esv_slow", Esv, apply;
    "travel_s" ["s"] 0.0 ..= 3.0, neutral 0.0, typical 0.3:
        "time that the ESV needs from one end of its travel to the other";
};

fn apply([travel_s]: [f64; 1], plant: &mut Plant) {
    if travel_s > 0.0 {
        plant.terms.push(Arc::new(Travel { travel_s }));
    }
}

#[derive(Debug)]
struct Travel {
    travel_s: f64,
}

impl Term for Travel {
    fn point(&self) -> Point {
        Point::EsvOpening
    }

    fn memory_len(&self) -> usize {
        1
    }

    fn reset(&self, signal: f64, memory: &mut [f64]) {
        memory[0] = signal;
    }

    /// The mean opening over the tick.
    fn apply(&self, signal: f64, view: &View<'_>, memory: &mut [f64]) -> f64 {
        let before = memory[0];
        let left = signal - before;
        let reach = view.tick_s / self.travel_s;
        if left.abs() > reach {
            memory[0] = before + reach.copysign(left);
            0.5 * (before + memory[0])
        } else {
            memory[0] = signal;
            signal - 0.5 * left * (left.abs() / reach)
        }
    }
}
