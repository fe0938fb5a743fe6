//! Movements of the command from rest to rest: dead time, overshoot and settling time; and how far the position is behind on the way.

use super::series::{FULL_RATE_ERROR_PU, Series, smooth};
use super::statistics::{MeasuredEvent, found, mean_and_sd, missing, student_90};
use super::{Measure, MeasureFound};
use crate::result::Interval;
use govtwin_model::units::NORMAL_90;

/// Movement that counts as a departure, pu.
const DEPARTED_PU: f64 = 0.001;
/// A command that moves by less than this is at rest, pu from its middle.
const REST_PU: f64 = 0.002;
/// How long it rests before a departure, s.
const REST_BEFORE_S: f64 = 0.5;
/// How long it rests after one, s.
const REST_AFTER_S: f64 = 2.0;
/// Slowest command that departs, pu/s.
const LEAST_RATE_PU_S: f64 = 0.02;
/// Window for that rate, s.
const RATE_WINDOW_S: f64 = 0.3;
/// Longest time by which a position follows, s.
const LONGEST_S: f64 = 5.0;
/// Smallest change that is evaluated for overshoot and settling, pu.
const LEAST_CHANGE_PU: f64 = 0.01;
/// Share of the change within which a position has settled.
const SETTLED_SHARE: f64 = 0.02;
/// Window over which noise is averaged, s.
const MEAN_WINDOW_S: f64 = 0.1;
/// Length of the stretches whose mean squares are taken as independent, s.
const BLOCK_S: f64 = 2.0;

/// A command that leaves its rest.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Departure {
    /// The first sample at which it has moved by [`DEPARTED_PU`].
    at: usize,
    /// When it had, between samples, s.
    time_s: f64,
    direction: f64,
    command_pu: f64,
    position_pu: f64,
}

/// The largest and smallest of some values.
fn range(values: &[f64]) -> f64 {
    let (low, high) = values.iter().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(*v), high.max(*v)));
    high - low
}

fn departures(series: &Series) -> Vec<Departure> {
    let command = &series.command_pu;
    let threshold_pu = DEPARTED_PU.max(6.0 * series.margin_pu);
    let mut all = vec![];
    let mut i = series.at(REST_BEFORE_S);
    while i < series.len() {
        let before = series.at(series.time_s[i] - REST_BEFORE_S)..i;
        let later = series.at(series.time_s[i] + RATE_WINDOW_S).min(series.len() - 1);
        let elapsed_s = (series.time_s[later] - series.time_s[i]).max(series.period_s);
        let is_rest = before.len() >= 2 && range(&command[before.clone()]) <= 2.0 * REST_PU;
        let middle_pu = command[before.clone()].iter().sum::<f64>() / before.len().max(1) as f64;
        let moved_pu = command[i] - middle_pu;
        let direction = moved_pu.signum();
        let fast = direction * (command[later] - middle_pu) >= LEAST_RATE_PU_S * elapsed_s.min(RATE_WINDOW_S);
        if !is_rest || moved_pu.abs() < threshold_pu || !fast || series.tripped[i] {
            i += 1;
            continue;
        }
        let positions = &series.position_pu[before.clone()];
        if range(positions) <= 2.0 * REST_PU + 8.0 * series.margin_pu {
            let position_pu = positions.iter().sum::<f64>() / positions.len() as f64;
            let (last, next) = (direction * (command[i - 1] - middle_pu), direction * moved_pu);
            // A ramp began where its slope points back to; a jump is at its own stamp.
            let ahead = direction * (command[(i + 1).min(series.len() - 1)] - middle_pu);
            let slope = (ahead - next).max(0.0);
            let between = if next - last <= 3.0 * threshold_pu {
                ((threshold_pu - last) / (next - last)).clamp(0.0, 1.0)
            } else if slope > 0.3 * (next - last) {
                (1.0 - (next - threshold_pu) / slope).clamp(0.0, 1.0)
            } else {
                1.0
            };
            let time_s = series.time_s[i - 1] + between * (series.time_s[i] - series.time_s[i - 1]);
            all.push(Departure { at: i, time_s, direction, command_pu: middle_pu, position_pu });
        }
        i = series.at(series.time_s[i] + REST_BEFORE_S).max(i + 1);
    }
    all
}

/// From the command's departure to the position's.
pub fn dead_time(all: &[Series]) -> MeasureFound {
    let mut events = vec![];
    for series in all {
        events.extend(departures(series).iter().filter_map(|departure| follows_after(series, departure)));
    }
    found(Measure::DeadTime, &events, "no command that leaves its rest at 2 %/s or faster")
}

fn follows_after(series: &Series, departure: &Departure) -> Option<MeasuredEvent> {
    let threshold_pu = DEPARTED_PU.max(6.0 * series.margin_pu);
    let beyond = |i: usize| departure.direction * (series.position_pu[i] - departure.position_pu) >= threshold_pu;
    let end = series.at(departure.time_s + LONGEST_S).min(series.len() - 1);
    let first = (departure.at.saturating_sub(1)..end).find(|&i| beyond(i) && beyond(i + 1))?;
    let moved = |i: usize| departure.direction * (series.position_pu[i] - departure.position_pu);
    let before = first.checked_sub(1)?;
    let (low, high) = (moved(before), moved(first));
    if high <= low || (departure.at..=first).any(|i| series.tripped[i]) {
        return None;
    }
    let apart_s = series.time_s[first] - series.time_s[before];
    let crossed_s = series.time_s[before] + apart_s * ((threshold_pu - low) / (high - low)).clamp(0.0, 1.0);
    // Speed about the crossing, over a few samples on either side.
    let (from, to) = (before.saturating_sub(2), (first + 2).min(series.len() - 1));
    let speed_pu_s = (moved(to) - moved(from)) / (series.time_s[to] - series.time_s[from]);
    let noise_s = 1.2 * series.noise_pu / speed_pu_s.max(threshold_pu / LONGEST_S);
    // Between two samples command and position are known no better than by a straight line.
    let between_s = apart_s / 12.0_f64.sqrt();
    Some(MeasuredEvent { value: (crossed_s - departure.time_s).max(0.0), sd: noise_s.hypot(between_s) })
}

/// A movement from rest to rest.
struct Movement {
    change_pu: f64,
    final_pu: f64,
    /// The sample at which the command has arrived.
    arrived: usize,
    /// The sample behind the last at which it rests.
    end: usize,
    departure: Departure,
}

fn movements(series: &Series) -> Vec<Movement> {
    departures(series).into_iter().filter_map(|departure| movement(series, departure)).collect()
}

fn movement(series: &Series, departure: Departure) -> Option<Movement> {
    let command = &series.command_pu;
    let rests = |i: usize| {
        let after = i..series.at(series.time_s[i] + REST_AFTER_S).min(series.len());
        after.len() >= 3
            && series.time_s[after.end - 1] - series.time_s[i] >= REST_AFTER_S - 2.0 * series.period_s
            && range(&command[after]) <= 2.0 * REST_PU
    };
    let arrived = (departure.at..series.len()).find(|&i| rests(i))?;
    let settled = &command[arrived..series.at(series.time_s[arrived] + REST_AFTER_S).min(series.len())];
    let command_pu = settled.iter().sum::<f64>() / settled.len() as f64;
    let change_pu = command_pu - departure.command_pu;
    let end = (arrived..series.len()).find(|&i| (command[i] - command_pu).abs() > REST_PU).unwrap_or(series.len());
    let crosses = (departure.at..arrived)
        .any(|i| departure.direction * (command[i] - command_pu) > REST_PU + 0.01 * change_pu.abs());
    let trips = (departure.at..end).any(|i| series.tripped[i]);
    if change_pu.abs() < LEAST_CHANGE_PU || change_pu * departure.direction < 0.0 || crosses || trips {
        return None;
    }
    let half = arrived + (end - arrived) / 2;
    let last = &series.position_pu[half..end];
    let final_pu = last.iter().sum::<f64>() / last.len() as f64;
    // What is still on its way has no final position.
    let unsettled = range(&smooth(&series.time_s[half..end], last, MEAN_WINDOW_S));
    (unsettled <= (SETTLED_SHARE * change_pu.abs()).max(2.0 * REST_PU)).then_some(Movement {
        change_pu,
        final_pu,
        arrived,
        end,
        departure,
    })
}

/// Which movement it takes.
const FROM_REST_TO_REST: &str = "no command that leaves its rest, moves by 1 % or more and rests for 2 s or longer";

/// How far the position goes beyond its final value.
pub fn overshoot(all: &[Series]) -> MeasureFound {
    let mut events = vec![];
    for series in all {
        let means = series.smooth_pu(MEAN_WINDOW_S);
        let noise_pu = series.noise_pu / series.samples_in(MEAN_WINDOW_S).sqrt();
        for one in movements(series) {
            let direction = one.departure.direction;
            let beyond = (one.departure.at..one.end).map(|i| direction * (means[i] - one.final_pu));
            let peak_pu = beyond.fold(0.0, f64::max);
            // The largest of many noisy means lies about two of their deviations too high.
            let value = ((peak_pu - 2.0 * noise_pu).max(0.0)) / one.change_pu.abs();
            events.push(MeasuredEvent { value, sd: 1.5 * noise_pu / one.change_pu.abs() });
        }
    }
    found(Measure::Overshoot, &events, FROM_REST_TO_REST)
}

/// From the command's arrival until the position stays near its final value.
pub fn settling_time(all: &[Series]) -> MeasureFound {
    let mut events = vec![];
    for series in all {
        let means = series.smooth_pu(MEAN_WINDOW_S);
        for one in movements(series) {
            let band_pu = (SETTLED_SHARE * one.change_pu.abs()).max(DEPARTED_PU).max(5.0 * series.margin_pu);
            let outside = |i: &usize| (means[*i] - one.final_pu).abs() > band_pu;
            let last = (one.departure.at..one.end).rev().find(outside).map_or(one.departure.at, |i| i + 1);
            let last = last.min(series.len() - 1);
            let value = (series.time_s[last] - series.time_s[one.arrived]).max(0.0);
            let from = last.saturating_sub(3);
            let apart_s = series.time_s[last] - series.time_s[from];
            let speed_pu_s = (means[last] - means[from]).abs() / apart_s.max(1e-9);
            let noise_pu = series.noise_pu / series.samples_in(MEAN_WINDOW_S).sqrt();
            let crossing_s = (noise_pu / speed_pu_s.max(1e-9)).min(MEAN_WINDOW_S);
            events.push(MeasuredEvent {
                value,
                sd: crossing_s.hypot(series.period_s / 3.0_f64.sqrt()).hypot(0.25 * MEAN_WINDOW_S),
            });
        }
    }
    found(Measure::SettlingTime, &events, FROM_REST_TO_REST)
}

/// Command less position, RMS, where the command is less than 5 % ahead.
pub fn tracking_error(all: &[Series]) -> MeasureFound {
    let mut squares = vec![];
    for series in all {
        let (mut sum, mut count, mut block) = (0.0, 0.0, 0.0);
        for i in 0..series.len() {
            if series.tripped[i] || series.error_pu(i).abs() > FULL_RATE_ERROR_PU {
                continue;
            }
            let own = (series.time_s[i] / BLOCK_S).floor();
            if own > block && count > 0.0 {
                squares.push(sum / count - series.noise_pu.powi(2));
                (sum, count) = (0.0, 0.0);
            }
            block = own;
            sum += series.error_pu(i).powi(2);
            count += 1.0;
        }
        if count > 0.0 {
            squares.push(sum / count - series.noise_pu.powi(2));
        }
    }
    if squares.len() < 3 {
        return missing(Measure::TrackingError, "fewer than 6 s in which the command is less than 5 % ahead");
    }
    let count = squares.len() as f64;
    let (mean, sd) = mean_and_sd(&squares);
    // Neighbouring stretches share what is slow: half of them count.
    let half = student_90((0.5 * count - 1.0).max(1.0)).max(NORMAL_90) * sd / (0.5 * count).sqrt();
    let root = |square: f64| square.max(0.0).sqrt();
    let value = Interval { value: root(mean), low: root(mean - half), high: root(mean + half) };
    MeasureFound { measure: Measure::TrackingError, value: Some(value), events: squares.len(), note: String::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps of 5 % through a dead time of 0.12 s and a second-order lag with a known overshoot.
    fn steps(damping: f64, noise_pu: f64) -> Series {
        let (mut time_s, mut command_pu, mut position_pu) = (vec![], vec![], vec![]);
        let (mut y, mut v, dt) = (0.5_f64, 0.0_f64, 0.001);
        let command = |t: f64| if (t / 8.0).floor() as i64 % 2 == 1 { 0.55 } else { 0.5 };
        for i in 0..64_000_u32 {
            let t = f64::from(i) * dt;
            let omega = 6.0;
            v += dt * (omega * omega * (command(t - 0.12) - y) - 2.0 * damping * omega * v);
            y += dt * v;
            if i % 10 == 0 {
                let shake = noise_pu * (f64::from(i) * 12.9898).sin() * 1.4;
                time_s.push(t);
                command_pu.push(command(t));
                position_pu.push(y + shake);
            }
        }
        let count = time_s.len();
        Series::new("steps", time_s, command_pu, position_pu, vec![false; count]).unwrap()
    }

    #[test]
    fn steps_of_a_known_system_have_its_dead_time_overshoot_and_settling() {
        for noise_pu in [0.0, 1e-4] {
            let all = [steps(0.5, noise_pu)];
            // 0.1 % of 5 % of a second-order lag is reached after √(2·0.02)/6 s, a little more for its damping.
            let expected_s = 0.12 + 0.034;
            let dead = dead_time(&all).value.unwrap();
            assert!(
                (dead.value - expected_s).abs() < 0.006 && dead.low < expected_s && dead.high > expected_s,
                "{dead:?}"
            );
            // exp(−π ζ / √(1 − ζ²)) = 16.3 %
            let over = overshoot(&all).value.unwrap();
            assert!((over.value - 0.163).abs() < 0.012, "{over:?}");
            // Within 2 %: the envelope is passed at the fourth crossing, about 1.35 s, and the dead time before.
            let settled = settling_time(&all).value.unwrap();
            assert!((1.2..1.6).contains(&settled.value), "{settled:?}");
        }
        let still = [steps(1.0, 0.0)];
        assert!(overshoot(&still).value.unwrap().value < 1e-3);
    }

    #[test]
    fn a_constant_lag_is_the_tracking_error() {
        let time_s: Vec<f64> = (0..4000).map(|i| f64::from(i) * 0.01).collect();
        let command_pu: Vec<f64> = time_s.iter().map(|t| 0.3 + 0.01 * t).collect();
        let position_pu: Vec<f64> = command_pu.iter().map(|c| c - 0.004).collect();
        let series = Series::new("ramp", time_s, command_pu, position_pu, vec![false; 4000]).unwrap();
        let value = tracking_error(&[series]).value.unwrap();
        assert!((value.value - 0.004).abs() < 1e-6, "{value:?}");
    }
}
