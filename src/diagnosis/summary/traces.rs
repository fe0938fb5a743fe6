//! Recordings beside the twins' answers, for pictures.

use crate::likelihood::problem::Problem;
use crate::result::Trace;
use govtwin_model::frame::Estimate;
use govtwin_model::units::seconds_from_nanos;

/// One trace for each recording: measured, delivered, refitted, with effects.
#[must_use]
pub fn traces(problem: &Problem, twins: [&[Vec<Estimate>]; 3]) -> Vec<Trace> {
    problem
        .recordings
        .iter()
        .enumerate()
        .map(|(index, recording)| {
            let start_ns = recording.frames.first().map_or(0, |frame| frame.time_ns);
            let time_s = recording
                .samples
                .iter()
                .map(|&row| seconds_from_nanos(recording.frames[row].time_ns - start_ns))
                .collect();
            let signals = recording
                .signals()
                .map(|signal| {
                    let [a, b, c] = twins.map(|twin| signal.of_estimates(&twin[index]));
                    (signal, [recording.measured(signal), a, b, c])
                })
                .collect();
            Trace { name: recording.name.clone(), process: recording.process, time_s, signals }
        })
        .collect()
}
