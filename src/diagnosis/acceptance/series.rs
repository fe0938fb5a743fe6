//! Command and position over time, of a recording or of a twin that ran along it.

use govtwin_model::frame::{Estimate, EsvState};
use govtwin_model::metrics::{median, noise_of_bends};
use govtwin_model::recording::Recording;
use govtwin_model::units::seconds_from_nanos;

/// Fewer samples than this show nothing.
const FEWEST: usize = 20;

/// What is ahead of the position by more than this drives the unit at its full rate, pu.
pub(crate) const FULL_RATE_ERROR_PU: f64 = 0.05;

/// Command and position at the instants at which the position was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// The recording's name.
    pub name: String,
    /// Time since the first sample, s.
    pub time_s: Vec<f64>,
    /// Opening command in force, pu.
    pub command_pu: Vec<f64>,
    /// Servomotor position, pu.
    pub position_pu: Vec<f64>,
    /// Whether the emergency shutdown valve has tripped.
    pub tripped: Vec<bool>,
    /// Standard deviation of the position from sample to sample, pu.
    pub noise_pu: f64,
    /// The noise that thresholds allow for, pu; a twin has the thresholds of the recording that it ran along.
    pub margin_pu: f64,
    /// Time between two samples, s.
    pub period_s: f64,
}

impl Series {
    /// What was measured; none where there is no command or position.
    pub fn measured(recording: &Recording) -> Option<Self> {
        Self::of(recording, |row| recording.frames[row].measured.servomotor_position_pu)
    }

    /// A twin's estimates at the same instants.
    pub fn simulated(recording: &Recording, estimates: &[Estimate]) -> Option<Self> {
        let simulated = Self::of(recording, |row| estimates[row].signals.servomotor_position_pu)?;
        // What a twin bends is movement.
        Some(Self { noise_pu: 0.0, margin_pu: Self::measured(recording)?.noise_pu, ..simulated })
    }

    fn of(recording: &Recording, position_pu: impl Fn(usize) -> f64) -> Option<Self> {
        let frames = &recording.frames;
        let is_sample = |row: &usize| {
            let frame = &frames[*row];
            frame.measured.servomotor_position_pu.is_finite()
                && frame.inputs.opening_command_pu.is_finite()
                && position_pu(*row).is_finite()
        };
        let rows: Vec<usize> = (0..frames.len()).filter(is_sample).collect();
        let start_ns = frames[*rows.first()?].time_ns;
        let time_s = rows.iter().map(|&row| seconds_from_nanos(frames[row].time_ns - start_ns)).collect();
        let command_pu = rows.iter().map(|&row| frames[row].inputs.opening_command_pu).collect();
        let tripped = rows.iter().map(|&row| frames[row].inputs.esv == EsvState::Shutdown).collect();
        Self::new(&recording.name, time_s, command_pu, rows.iter().map(|&row| position_pu(row)).collect(), tripped)
    }

    /// Of samples; none where they are too few.
    pub fn new(
        name: &str,
        time_s: Vec<f64>,
        command_pu: Vec<f64>,
        position_pu: Vec<f64>,
        tripped: Vec<bool>,
    ) -> Option<Self> {
        if time_s.len() < FEWEST {
            return None;
        }
        let period_s = median(time_s.windows(2).map(|pair| pair[1] - pair[0]).collect());
        // Second differences of a signal at rest or in even motion are noise alone, times √6.
        let bends = position_pu.windows(3).map(|y| (y[0] - 2.0 * y[1] + y[2]).abs());
        let still = bends.filter(|bend| *bend > 0.0).collect::<Vec<_>>();
        let noise_pu = if still.is_empty() { 0.0 } else { noise_of_bends(still) };
        Some(Self {
            name: name.to_owned(),
            time_s,
            command_pu,
            position_pu,
            tripped,
            noise_pu,
            margin_pu: noise_pu,
            period_s,
        })
    }

    /// Number of samples.
    pub fn len(&self) -> usize {
        self.time_s.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.time_s.is_empty()
    }

    /// The first sample at or after a time, s.
    pub fn at(&self, time_s: f64) -> usize {
        self.time_s.partition_point(|time| *time < time_s)
    }

    /// Command less position at a sample, pu.
    pub fn error_pu(&self, i: usize) -> f64 {
        self.command_pu[i] - self.position_pu[i]
    }

    /// The position's mean over a window about each sample, pu.
    pub(crate) fn smooth_pu(&self, window_s: f64) -> Vec<f64> {
        smooth(&self.time_s, &self.position_pu, window_s)
    }

    /// Number of samples that a window of this length holds.
    pub(crate) fn samples_in(&self, window_s: f64) -> f64 {
        (window_s / self.period_s.max(1e-9)).floor().max(1.0)
    }
}

/// The mean over a window about each sample.
pub fn smooth(time_s: &[f64], values: &[f64], window_s: f64) -> Vec<f64> {
    let (mut from, mut to, mut sum) = (0, 0, 0.0);
    let mut means = Vec::with_capacity(values.len());
    for &now_s in time_s {
        while to < values.len() && time_s[to] <= now_s + 0.5 * window_s + 1e-9 {
            sum += values[to];
            to += 1;
        }
        while time_s[from] < now_s - 0.5 * window_s - 1e-9 {
            sum -= values[from];
            from += 1;
        }
        means.push(sum / (to - from) as f64);
    }
    means
}

/// Change per second over a window about each sample, by its ends; 0 where the window holds one sample.
pub fn rate(time_s: &[f64], values: &[f64], window_s: f64) -> Vec<f64> {
    let (mut from, mut to) = (0, 0);
    let mut rates = Vec::with_capacity(values.len());
    for &now_s in time_s {
        while to + 1 < values.len() && time_s[to + 1] <= now_s + 0.5 * window_s + 1e-9 {
            to += 1;
        }
        while time_s[from] < now_s - 0.5 * window_s - 1e-9 {
            from += 1;
        }
        let apart_s = time_s[to] - time_s[from];
        rates.push(if apart_s > 0.0 { (values[to] - values[from]) / apart_s } else { 0.0 });
    }
    rates
}

/// Slope and its standard deviation for noise of this size, by least squares.
pub fn slope(time_s: &[f64], values: &[f64], noise: f64) -> (f64, f64) {
    let count = time_s.len() as f64;
    let (mean_t, mean_y) = (time_s.iter().sum::<f64>() / count, values.iter().sum::<f64>() / count);
    let square: f64 = time_s.iter().map(|t| (t - mean_t).powi(2)).sum();
    let along: f64 = time_s.iter().zip(values).map(|(t, y)| (t - mean_t) * (y - mean_y)).sum();
    (along / square, noise / square.sqrt())
}

#[cfg(test)]
mod tests {
    use super::{rate, slope, smooth};

    #[test]
    fn means_rates_and_slopes_of_a_line_are_the_line() {
        let time_s: Vec<f64> = (0..50).map(|i| f64::from(i) * 0.02).collect();
        let line: Vec<f64> = time_s.iter().map(|t| 0.1 + 0.3 * t).collect();
        let means = smooth(&time_s, &line, 0.1);
        assert!((means[20] - line[20]).abs() < 1e-12);
        assert!(rate(&time_s, &line, 0.1).iter().all(|rate| (rate - 0.3).abs() < 1e-9));
        let (along, sd) = slope(&time_s, &line, 0.001);
        assert!((along - 0.3).abs() < 1e-12 && sd > 0.0 && sd < 0.001);
    }
}
