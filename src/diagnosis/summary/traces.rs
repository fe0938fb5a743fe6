//! Recordings beside the twins' answers, for pictures.

use crate::likelihood::problem::Problem;
use crate::result::Trace;
use govtwin_model::frame::Estimate;

/// One trace for each recording: measured, delivered, refitted, with effects.
pub fn traces(problem: &Problem, twins: [&[Vec<Estimate>]; 3]) -> Vec<Trace> {
    problem
        .recordings
        .iter()
        .enumerate()
        .map(|(index, recording)| {
            let time_s = (0..recording.samples.len()).map(|sample| recording.time_s(sample)).collect();
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
