//! Admissibility: what each channel of each recording is like, and what is wrong with it.

use crate::result::ChannelReport;
use govtwin_model::metrics::{median, noise_of_bends};
use govtwin_model::recording::Recording;
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// Samples of one signal: time in s and value.
fn samples(recording: &Recording, signal: Signal) -> Vec<(f64, f64)> {
    let start_ns = recording.frames.first().map_or(0, |frame| frame.time_ns);
    recording
        .frames
        .iter()
        .map(|frame| (seconds_from_nanos(frame.time_ns - start_ns), signal.of(&frame.measured)))
        .filter(|(_, value)| value.is_finite())
        .collect()
}

/// The channels of all recordings.
pub fn survey(recordings: &[Recording]) -> Vec<ChannelReport> {
    recordings
        .iter()
        .flat_map(|recording| Signal::ALL.into_iter().map(move |signal| (recording, signal)))
        .filter_map(|(recording, signal)| {
            let samples = samples(recording, signal);
            (!samples.is_empty()).then(|| channel(recording, signal, &samples))
        })
        .collect()
}

fn channel(recording: &Recording, signal: Signal, samples: &[(f64, f64)]) -> ChannelReport {
    let periods: Vec<f64> = samples.windows(2).map(|pair| pair[1].0 - pair[0].0).collect();
    let period_s = median(periods.clone());
    let mut steps: Vec<f64> =
        samples.windows(2).map(|pair| (pair[1].1 - pair[0].1).abs()).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    // Second differences of slow signals are noise: their variance is six times that of one sample.
    let bends: Vec<f64> = samples.windows(3).map(|three| (three[0].1 - 2.0 * three[1].1 + three[2].1).abs()).collect();
    let noise = noise_of_bends(bends);
    let (low, high) = samples
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (_, value)| (low.min(*value), high.max(*value)));
    let mut troubles = Vec::new();
    if low == high {
        troubles.push(format!("constant at {low} {}; is the transducer connected?", signal.unit()));
    } else {
        let at_edge = samples.iter().filter(|(_, value)| *value == low || *value == high).count();
        let still = samples.windows(2).filter(|pair| pair[0].1 == pair[1].1).count();
        if at_edge * 5 > samples.len() && still * 2 < samples.len() {
            troubles.push(format!("{at_edge} of {} samples are at the ends of its range: saturated?", samples.len()));
        }
    }
    let longest = periods.iter().copied().fold(0.0, f64::max);
    if longest > 5.0 * period_s && longest > 1.0 {
        troubles.push(format!("a gap of {longest:.1} s"));
    }
    ChannelReport {
        recording: recording.name.clone(),
        signal,
        samples: samples.len(),
        rate_hz: if period_s > 0.0 { 1.0 / period_s } else { f64::NAN },
        step: steps.first().copied().unwrap_or(0.0),
        noise,
        troubles,
    }
}
