//! Play: the output stays until the input has crossed a gap, and is then dragged along.
//!
//! `y` stays while `|u − y| ≤ b/2` and moves with the edge of the gap otherwise: the play operator
//! (Krasnosel'skii & Pokrovskii 1989, *Systems with Hysteresis*, section 2).

use crate::plant::term::{Point, Term, View};

/// A gap at a point of the chain; it starts in mid-gap.
#[derive(Clone, Debug)]
pub(crate) struct Play {
    point: Point,
    half_width_pu: f64,
}

impl Play {
    /// A gap of `width_pu` in all; a width below 0 counts as 0.
    pub(crate) fn new(point: Point, width_pu: f64) -> Self {
        Self { point, half_width_pu: (0.5 * width_pu).max(0.0) }
    }
}

impl Term for Play {
    fn point(&self) -> Point {
        self.point
    }

    fn memory_len(&self) -> usize {
        1
    }

    fn reset(&self, signal: f64, memory: &mut [f64]) {
        memory[0] = signal;
    }

    fn apply(&self, signal: f64, _view: &View<'_>, memory: &mut [f64]) -> f64 {
        memory[0] = self.settled(signal, memory);
        memory[0]
    }

    fn settled(&self, signal: f64, memory: &[f64]) -> f64 {
        memory[0].clamp(signal - self.half_width_pu, signal + self.half_width_pu)
    }
}
