//! Admissibility: what each channel of each recording is like, and what is wrong with it.

use crate::result::{ChannelReport, Setup};
use crate::words::WRONG_DATA;
use govtwin_model::metrics::{median, noise_of_bends};
use govtwin_model::parameters::Sensors;
use govtwin_model::recording::{Recording, SLOW_NS};
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

/// A position with a smaller share of its transducer's noise is a mean: that of four readings has half of it.
const QUIET: f64 = 0.5;

/// Noise is known where it is so many times the smallest step of the values.
const RESOLVED: f64 = 2.0;

/// Says in a sentence that positions of a slow recorder are means, where they are: the servomotor's has less noise than one reading has by the data sheet.
///
/// A mean over the time between rows shows trips and limits later and softer than they are, as delays and lags do. The spool tells nothing: at rest it
/// follows the noise that the regulator hears. Only a data sheet of the chain's own says how noisy a reading is.
pub fn averaged(channels: &[ChannelReport], sensors: &Sensors, setup: Setup) -> Option<String> {
    if setup != Setup::Chain {
        return None;
    }
    let slowest_hz = 1.0 / seconds_from_nanos(SLOW_NS);
    let is_known = |channel: &&ChannelReport| {
        channel.signal == Signal::ServomotorPosition
            && channel.rate_hz < slowest_hz
            && channel.step > 0.0
            && channel.noise > RESOLVED * channel.step
    };
    // What moves between rows adds to the noise: the quietest recording shows it best.
    let least = channels.iter().filter(is_known).map(|channel| channel.noise).min_by(f64::total_cmp)?;
    let share = least / sensors.servomotor_position_pu.noise;
    (share < QUIET).then(|| {
        format!(
            "The servomotor position has {:.0} % of the noise that one reading of its transducer has by the data sheet: it is a mean over the time between \
             rows, or filtered, in which trips and limits look later and softer. {WRONG_DATA} Record samples as they are read; \
             if the transducer is that good, correct `noise` of `sensors.servomotor_position_pu` in the data sheet.",
            share * 100.0
        )
    })
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

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_model::params::reference;

    #[test]
    fn means_are_known_by_less_noise_than_a_reading_has_where_a_recorder_is_slow() {
        let sensors = reference().sensors;
        let said = |rate_hz: f64, step: f64, share: f64| {
            let channel = |signal: Signal, noise: f64| ChannelReport {
                recording: "a".to_owned(),
                signal,
                samples: 200,
                rate_hz,
                step,
                noise,
                troubles: Vec::new(),
            };
            let still = channel(Signal::ServomotorPosition, share * sensors.servomotor_position_pu.noise);
            let moving = channel(Signal::ServomotorPosition, 1.0);
            averaged(&[moving, still, channel(Signal::SpoolPosition, 2e-5)], &sensors, Setup::Chain)
        };
        let found = said(5.0, 1e-6, 0.25).unwrap();
        assert!(found.contains("has 25 % of the noise"), "{found}");
        assert_eq!(said(5.0, 1e-6, 0.9), None);
        assert_eq!(said(100.0, 1e-6, 0.25), None, "a fast recorder shows what a filter does");
        assert_eq!(said(5.0, 1e-4, 0.25), None, "in steps as coarse nobody knows the noise");
    }
}
