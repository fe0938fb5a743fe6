//! Replay: a recording through a twin, and how far apart the two are.

pub mod summary;

use crate::frame::Estimate;
use crate::metrics::{Accumulator, Figures};
use crate::recording::Recording;
use crate::signal::Signal;
use crate::twin::{Cut, Twin};

/// Runs a recording through a twin from its start; one estimate for each frame.
#[must_use]
pub fn simulate(twin: &mut Twin, recording: &Recording) -> Vec<Estimate> {
    twin.reset();
    recording.frames.iter().map(|frame| twin.step(frame)).collect()
}

/// The signal that a cut takes from the recording, and that therefore says nothing about the twin.
#[must_use]
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
    #[must_use]
    pub fn of(recording: &Recording, estimates: &[Estimate]) -> Self {
        let mut scores = Self::default();
        for (frame, estimate) in recording.frames.iter().zip(estimates) {
            for (signal, whole) in Signal::ALL.into_iter().zip(&mut scores.0) {
                let measured = signal.of(&frame.measured);
                if measured.is_finite() {
                    whole.push(measured, signal.of(&estimate.signals));
                }
            }
        }
        scores
    }

    /// Adds the rows of another recording.
    pub fn merge(&mut self, other: &Self) {
        for (own, others) in self.0.iter_mut().zip(&other.0) {
            own.merge(others);
        }
    }

    /// The figures of one signal, in its unit.
    #[must_use]
    pub fn figures(&self, signal: Signal) -> Figures {
        self.0[signal as usize].figures()
    }
}

/// One recording, simulated and compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Replayed {
    /// What was measured.
    pub recording: Recording,
    /// What the twin says, frame by frame.
    pub estimates: Vec<Estimate>,
    /// How far apart they are.
    pub scores: Scores,
}

impl Replayed {
    /// Simulates a recording and compares.
    #[must_use]
    pub fn new(twin: &mut Twin, recording: Recording) -> Self {
        let estimates = simulate(twin, &recording);
        let scores = Scores::of(&recording, &estimates);
        Self { recording, estimates, scores }
    }
}
