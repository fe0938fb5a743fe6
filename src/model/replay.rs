//! Replay: a recording through a twin, and how far apart the two are.

pub mod between;
pub mod figures;
pub mod ladder;
pub mod rows;
pub mod trips;

use crate::frame::{Estimate, Frame};
use crate::metrics::{Accumulator, Figures};
use crate::parameters::Unit;
use crate::recording::{Recording, median_spacing_ns};
use crate::signal::Signal;
use crate::twin::{Cut, Twin};
use rows::Simulator;

/// Runs a recording through a twin from its start; one estimate for each frame.
///
/// Where the twin's plant has an input clock of its own ([`crate::plant::Plant::lookahead_s`]), commands and
/// ESV edges reach the twin earlier than their rows.
#[must_use]
pub fn simulate(twin: &mut Twin, recording: &Recording) -> Vec<Estimate> {
    let mut simulator = Simulator::new(twin);
    let mut estimates = Vec::with_capacity(recording.frames.len());
    let mut take = |_: &Frame, estimate| estimates.push(estimate);
    for frame in &recording.frames {
        simulator.row(frame, &mut take);
    }
    simulator.finish(&mut take);
    estimates
}

/// Runs a recording through the twin of a unit, closed loop from its first row, and compares: estimates row by row, and how far they are from what
/// was measured. Deterministic; [`Replayed::new`] takes a twin with a cut or another method.
pub fn replay(unit: &Unit, recording: Recording) -> Replayed {
    Replayed::new(&mut Twin::new(unit), recording)
}

/// Whether anything was measured at a row.
pub fn is_measured(frame: &Frame) -> bool {
    Signal::ALL.iter().any(|signal| signal.of(&frame.measured).is_finite())
}

/// The signal that a cut takes from the recording, and that therefore says nothing about the twin.
pub fn stands_in(cut: Cut) -> Option<Signal> {
    match cut {
        Cut::None => None,
        Cut::Servomotor => Some(Signal::ServomotorPosition),
        Cut::Spool => Some(Signal::SpoolPosition),
    }
}

/// How far apart measured and simulated are, signal by signal.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Scores([Accumulator; Signal::ALL.len()]);

impl Scores {
    /// Compares row by row; rows at which a signal was not measured do not count for it.
    ///
    /// A row that was measured and for which the twin has no finite value is counted as left out.
    pub fn of(recording: &Recording, estimates: &[Estimate]) -> Self {
        let mut scores = Self::default();
        for (frame, estimate) in recording.frames.iter().zip(estimates) {
            scores.push(frame, estimate);
        }
        scores
    }

    /// Adds one row.
    pub fn push(&mut self, frame: &Frame, estimate: &Estimate) {
        for (signal, whole) in Signal::ALL.into_iter().zip(&mut self.0) {
            let measured = signal.of(&frame.measured);
            if measured.is_finite() {
                whole.push(measured, signal.of(&estimate.signals));
            }
        }
    }

    /// Whether anything was measured at all.
    pub fn are_measured(&self) -> bool {
        self.0.iter().map(Accumulator::figures).any(|figures| figures.count + figures.skipped > 0)
    }

    /// Adds the rows of another recording.
    pub fn merge(&mut self, other: &Self) {
        for (own, others) in self.0.iter_mut().zip(&other.0) {
            own.merge(others);
        }
    }

    /// The figures of one signal, in its unit.
    pub fn figures(&self, signal: Signal) -> Figures {
        self.0[signal as usize].figures()
    }
}

/// One recording, simulated and compared.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Replayed {
    /// What was measured: all rows, or as many as pictures need.
    pub recording: Recording,
    /// What the twin says, frame by frame of `recording`.
    pub estimates: Vec<Estimate>,
    /// How far apart they are, over all rows.
    pub scores: Scores,
    /// All rows.
    pub rows: usize,
    /// One in so many rows is in `recording`; 1 where all are.
    pub every: usize,
}

impl Replayed {
    /// Simulates a recording and compares.
    #[must_use]
    pub fn new(twin: &mut Twin, recording: Recording) -> Self {
        let estimates = simulate(twin, &recording);
        let scores = Scores::of(&recording, &estimates);
        let rows = recording.frames.len();
        Self { recording, estimates, scores, rows, every: 1 }
    }

    /// The usual time between two rows, ns; 0 where there is one row at most.
    pub fn row_ns(&self) -> i64 {
        let step_ns = median_spacing_ns(self.recording.frames.iter().map(|frame| frame.time_ns));
        step_ns / i64::try_from(self.every).unwrap_or(i64::MAX)
    }

    /// The same recording with other estimates, one for each frame of it, compared anew.
    #[must_use]
    pub fn with_estimates(&self, estimates: Vec<Estimate>) -> Self {
        let scores = Scores::of(&self.recording, &estimates);
        Self { recording: self.recording.clone(), estimates, scores, rows: self.rows, every: self.every }
    }
}
