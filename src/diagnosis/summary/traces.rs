//! Recordings beside the twins' answers, for pictures.

use crate::diagnosis::result::Trace;
use crate::frame::Estimate;
use crate::likelihood::problem::Problem;
use crate::units::seconds_from_nanos;

/// One trace for each recording: measured, delivered, refitted, with effects.
#[must_use]
pub fn traces(problem: &Problem, twins: [&[Vec<Estimate>]; 3]) -> Vec<Trace> {
    problem
        .trials
        .iter()
        .enumerate()
        .map(|(index, trial)| {
            let start_ns = trial.frames.first().map_or(0, |frame| frame.time_ns);
            let time_s =
                trial.samples.iter().map(|&row| seconds_from_nanos(trial.frames[row].time_ns - start_ns)).collect();
            let signals = trial
                .signals()
                .map(|signal| {
                    let [a, b, c] = twins.map(|twin| signal.of_estimates(&twin[index]));
                    (signal, [trial.measured(signal), a, b, c])
                })
                .collect();
            Trace { name: trial.name.clone(), process: trial.process, time_s, signals }
        })
        .collect()
}
