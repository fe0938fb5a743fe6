//! A lag of first order on a signal of the chain, which several effects are made of.

use std::sync::Arc;

use crate::plant::term::{Point, Term, View};

/// The lag as a term at a point: `τ x' + x = s`, stepped exactly for a signal that runs linearly over a tick (first-order hold: Åström &
/// Wittenmark 1997, *Computer-Controlled Systems*, section 7.3).
pub(crate) fn lag(point: Point, time_constant_s: f64, tick_s: f64) -> Arc<dyn Term> {
    let ticks = time_constant_s / tick_s;
    Arc::new(LagLaw { point, decay_ratio: (-1.0 / ticks).exp(), ticks_count: ticks })
}

#[derive(Debug)]
struct LagLaw {
    point: Point,
    /// The share of a difference that remains after a tick.
    decay_ratio: f64,
    /// The time constant in ticks.
    ticks_count: f64,
}

impl Term for LagLaw {
    fn point(&self) -> Point {
        self.point
    }

    fn memory_len(&self) -> usize {
        2
    }

    fn reset(&self, signal: f64, memory: &mut [f64]) {
        memory.fill(signal);
    }

    fn apply(&self, signal: f64, _view: &View<'_>, memory: &mut [f64]) -> f64 {
        let (before, late) = (memory[0], memory[1]);
        // Behind a ramp the output settles `time constant × slope` below the signal.
        let behind = self.ticks_count * (signal - before);
        memory[0] = signal;
        memory[1] = signal - behind + self.decay_ratio * (late - before + behind);
        memory[1]
    }
}
