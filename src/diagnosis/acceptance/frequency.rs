//! Frequency response from command to position, where the command excites it.
//!
//! Welch's averages of periodograms over 10 s with a Hann window and half overlap (Welch 1967, *IEEE Transactions on Audio and Electroacoustics*
//! 15(2):70); intervals from the coherence, whose standard deviation of the gain is |H| √((1 − γ²) / (2 n γ²)) (Bendat & Piersol 2010, *Random Data*,
//! section 9.2).

use serde::Serialize;

use super::series::{FULL_RATE_ERROR_PU, Series};
use super::statistics::missing;
use super::{Measure, MeasureFound};
use crate::result::Interval;
use govtwin_model::units::NORMAL_90;

/// Length of a segment, s.
const SEGMENT_S: f64 = 10.0;
/// Frequencies, in cycles per segment.
const CYCLES: [f64; 14] = [1.0, 2.0, 3.0, 4.0, 5.0, 7.0, 10.0, 14.0, 20.0, 28.0, 40.0, 56.0, 80.0, 110.0];
/// Fewest segments.
const FEWEST: usize = 4;
/// Least coherence that counts as excited.
const LEAST_COHERENCE: f64 = 0.75;
/// Gain at the bandwidth, −3 dB.
const HALF_POWER: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// The response at one frequency.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Response {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Amplitude of the position over that of the command.
    pub gain: f64,
    /// Half-width of its interval of nine in ten, a gain too.
    pub gain_half: f64,
    /// Phase of the position, ° against the command; below zero it lags.
    pub phase_deg: f64,
    /// Half-width of its interval of nine in ten, °.
    pub phase_half_deg: f64,
    /// Coherence, 0 to 1.
    pub coherence: f64,
}

/// Power of command and position and their cross power, at one frequency.
#[derive(Clone, Copy, Default)]
struct Power {
    command: f64,
    position: f64,
    cross: [f64; 2],
}

/// The response at the frequencies that are excited, and the bandwidth where it lies among them.
pub fn response(all: &[Series]) -> (Vec<Response>, MeasureFound) {
    let mut powers = [Power::default(); CYCLES.len()];
    let mut segments = 0;
    let mut period_s: f64 = 0.0;
    for series in all {
        period_s = period_s.max(series.period_s);
        let mut from_s = 0.0;
        while from_s + SEGMENT_S <= series.time_s[series.len() - 1] + series.period_s {
            let rows = series.at(from_s)..series.at(from_s + SEGMENT_S);
            from_s += 0.5 * SEGMENT_S;
            let steady = rows.clone().all(|i| !series.tripped[i] && series.error_pu(i).abs() <= FULL_RATE_ERROR_PU);
            if steady && rows.len() >= 20 {
                segments += 1;
                add(series, rows, &mut powers);
            }
        }
    }
    let measure = Measure::Bandwidth;
    if segments < FEWEST {
        return (vec![], missing(measure, "less than 25 s in which the command is less than 5 % ahead"));
    }
    let fastest_hz = 0.4 / period_s.max(1e-9);
    let at = |(cycles, power): (&f64, &Power)| {
        let frequency_hz = cycles / SEGMENT_S;
        let square = power.cross[0].powi(2) + power.cross[1].powi(2);
        let coherence = square / (power.command * power.position).max(f64::MIN_POSITIVE);
        let relative = ((1.0 - coherence).max(0.0) / (2.0 * segments as f64 * coherence.max(1e-9))).sqrt();
        let gain = square.sqrt() / power.command.max(f64::MIN_POSITIVE);
        Response {
            frequency_hz,
            gain,
            gain_half: NORMAL_90 * gain * relative,
            phase_deg: power.cross[1].atan2(power.cross[0]).to_degrees(),
            phase_half_deg: (NORMAL_90 * relative).to_degrees(),
            coherence,
        }
    };
    let excited: Vec<Response> = CYCLES
        .iter()
        .zip(&powers)
        .map(at)
        .filter(|one| one.coherence >= LEAST_COHERENCE && one.frequency_hz <= fastest_hz)
        .collect();
    let bandwidth = bandwidth(&excited, segments);
    (excited, bandwidth)
}

fn add(series: &Series, rows: std::ops::Range<usize>, powers: &mut [Power]) {
    let count = rows.len() as f64;
    let start_s = series.time_s[rows.start];
    let line = |values: &[f64]| {
        let times = &series.time_s[rows.clone()];
        let (slope, _) = super::series::slope(times, values, 0.0);
        let mean = values.iter().sum::<f64>() / count;
        let middle_s = times.iter().sum::<f64>() / count;
        times.iter().zip(values).map(|(t, v)| v - mean - slope * (t - middle_s)).collect::<Vec<f64>>()
    };
    let (command, position) = (line(&series.command_pu[rows.clone()]), line(&series.position_pu[rows.clone()]));
    for (cycles, power) in CYCLES.iter().zip(powers) {
        let (mut u, mut y) = ([0.0; 2], [0.0; 2]);
        for (k, i) in rows.clone().enumerate() {
            let share = (series.time_s[i] - start_s) / SEGMENT_S;
            let window = 0.5 - 0.5 * (std::f64::consts::TAU * share).cos();
            let (sine, cosine) = (std::f64::consts::TAU * cycles * share).sin_cos();
            for (sum, value) in [(&mut u, command[k]), (&mut y, position[k])] {
                sum[0] += window * value * cosine;
                sum[1] -= window * value * sine;
            }
        }
        power.command += u[0] * u[0] + u[1] * u[1];
        power.position += y[0] * y[0] + y[1] * y[1];
        power.cross[0] += u[0] * y[0] + u[1] * y[1];
        power.cross[1] += u[0] * y[1] - u[1] * y[0];
    }
}

/// Where the gain passes −3 dB, between two excited frequencies.
fn bandwidth(excited: &[Response], segments: usize) -> MeasureFound {
    let measure = Measure::Bandwidth;
    let pair = excited.windows(2).find(|pair| pair[0].gain >= HALF_POWER && pair[1].gain < HALF_POWER);
    let Some([above, below]) = pair else {
        let note = match excited.last() {
            Some(last) if excited.iter().all(|one| one.gain >= HALF_POWER) => {
                format!("above {} Hz, the highest frequency that the command excites", last.frequency_hz)
            }
            _ => "the command excites no frequency at which the position falls to 0.707 of it".to_owned(),
        };
        return missing(measure, note);
    };
    let cross = |shift: f64| {
        let (a, b) = (above.gain + shift * above.gain_half, below.gain + shift * below.gain_half);
        let share = (a.max(1e-9) / HALF_POWER).ln() / (a.max(1e-9) / b.max(1e-9)).ln().max(1e-9);
        above.frequency_hz * (below.frequency_hz / above.frequency_hz).powf(share.clamp(-1.0, 2.0))
    };
    let value = Interval { value: cross(0.0), low: cross(-1.0).min(cross(0.0)), high: cross(1.0).max(cross(0.0)) };
    MeasureFound { measure, value: Some(value), events: segments, note: String::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_first_order_lag_has_its_gain_phase_and_bandwidth() {
        use rand::SeedableRng as _;
        use rand_distr::Distribution as _;
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let normal = rand_distr::Normal::new(0.0, 1.0).unwrap();
        let (dt, lag_s) = (0.01, 0.25);
        let (mut y, mut held) = (0.5_f64, 0.5_f64);
        let (mut time_s, mut command_pu, mut position_pu) = (vec![], vec![], vec![]);
        for i in 0..12_000_u32 {
            // What was recorded up to now moves the lag up to now.
            y += (held - y) * (1.0 - f64::exp(-dt / lag_s));
            held += -0.02 * (held - 0.5) + 1e-3 * normal.sample(&mut rng);
            time_s.push(f64::from(i) * dt);
            command_pu.push(held);
            position_pu.push(y + 2e-5 * normal.sample(&mut rng));
        }
        let series = Series::new("lag", time_s, command_pu, position_pu, vec![false; 12_000]).unwrap();
        let (response, bandwidth) = response(&[series]);
        assert!(response.len() >= 8, "{response:?}");
        for one in &response {
            let turn = std::f64::consts::TAU * one.frequency_hz * lag_s;
            let gain = 1.0 / (1.0 + turn * turn).sqrt();
            assert!((one.gain - gain).abs() < 0.03 + 2.0 * one.gain_half, "{one:?} {gain}");
            // A command that is held from sample to sample is half a sample late.
            let phase_deg = -turn.atan().to_degrees() - 180.0 * one.frequency_hz * dt;
            assert!((one.phase_deg - phase_deg).abs() < 2.0 + 2.0 * one.phase_half_deg, "{one:?} {phase_deg}");
        }
        // 1 / (2 π 0.25 s)
        let value = bandwidth.value.unwrap();
        assert!((value.value - 0.637).abs() < 0.04, "{value:?}");
    }
}
