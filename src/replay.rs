//! Replay: a recording through a twin, and how far apart the two are.

pub mod ladder;
pub mod summary;

use crate::frame::{Estimate, Frame, Inputs, Signals};
use crate::metrics::{Accumulator, Figures};
use crate::recording::Recording;
use crate::signal::Signal;
use crate::twin::{Cut, Twin};
use crate::units::nanos_from_seconds;

/// Runs a recording through a twin from its start; one estimate for each frame.
///
/// Where the twin's plant has an input clock of its own ([`crate::plant::Plant::lookahead_s`]), commands and
/// ESV edges reach the twin earlier than their rows.
#[must_use]
pub fn simulate(twin: &mut Twin, recording: &Recording) -> Vec<Estimate> {
    twin.reset();
    let lookahead_ns = nanos_from_seconds(twin.plant().lookahead_s);
    // Behind a spool cut neither command nor ESV counts.
    if lookahead_ns > 0 && twin.cut() != Cut::Spool {
        return simulate_ahead(twin, &recording.frames, lookahead_ns);
    }
    recording.frames.iter().map(|frame| twin.step(frame)).collect()
}

/// The same with commands and ESV edges handed on earlier by `lookahead_ns`, between rows where they fall there.
fn simulate_ahead(twin: &mut Twin, frames: &[Frame], lookahead_ns: i64) -> Vec<Estimate> {
    let mut ahead = frames.iter().map(|frame| (frame.time_ns.saturating_sub(lookahead_ns), frame.inputs)).peekable();
    let mut newest = match frames.first() {
        Some(first) => first.inputs,
        None => return vec![],
    };
    let mut estimates = Vec::with_capacity(frames.len());
    for frame in frames {
        while let Some((time_ns, inputs)) = ahead.next_if(|(time_ns, _)| *time_ns <= frame.time_ns) {
            newest = inputs;
            if time_ns < frame.time_ns && !estimates.is_empty() {
                let inputs = Inputs { tank_pressure_pa: f64::NAN, ..newest };
                twin.advance(&Frame { time_ns, inputs, measured: Signals::NONE });
            }
        }
        let inputs = Inputs { tank_pressure_pa: frame.inputs.tank_pressure_pa, ..newest };
        estimates.push(twin.step(&Frame { inputs, ..*frame }));
    }
    estimates
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
