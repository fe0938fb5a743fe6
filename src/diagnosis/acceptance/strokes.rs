//! Strokes at full rate: opening and closing times, and the cushion at the end of closing.

use super::series::{FULL_RATE_ERROR_PU, Series, rate, slope, smooth};
use super::statistics::{MeasuredEvent, found, mean_and_sd, missing};
use super::{Measure, MeasureFound};

/// A stroke shorter than this shows no rate, pu.
const LEAST_TRAVEL_PU: f64 = 0.08;
/// Time until the spool is where it is driven to and the piston at its speed, s.
const GETTING_UP_S: f64 = 0.4;
/// Below this opening a cushion may act, above it an end stop is near, pu.
const WITHOUT_ENDS_PU: [f64; 2] = [0.12, 0.97];
/// The same after a trip, whose strokes often begin low, pu.
const WITHOUT_STOP_PU: [f64; 2] = [0.03, 0.97];
/// Window for the speed, s.
const SPEED_WINDOW_S: f64 = 0.2;
/// Share of the full rate below which a stroke is slowed.
const SLOWED_SHARE: f64 = 0.8;
/// Distance from the closed position that counts as closed, pu.
const CLOSED_PU: f64 = 0.002;
/// A stroke that ends above this opening does not end closed, pu.
const NOT_CLOSED_PU: f64 = 0.02;

/// A stroke at full rate: samples from, to (exclusive), and what drives it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stroke {
    from: usize,
    to: usize,
    speed_pu_s: f64,
    event: MeasuredEvent,
}

/// Full-stroke time at the full rate.
pub fn stroke_time(all: &[Series], measure: Measure) -> MeasureFound {
    let strokes: Vec<Stroke> = all.iter().flat_map(|series| strokes(series, measure)).collect();
    let events: Vec<MeasuredEvent> = strokes.iter().map(|stroke| stroke.event).collect();
    let missing = match measure {
        Measure::TripClosingTime => "no trip with 8 % of travel or more",
        Measure::OpeningTime => "no opening stroke of 8 % or more with the command over 5 % ahead",
        _ => "no closing stroke of 8 % or more with the command over 5 % ahead",
    };
    found(measure, &events, missing)
}

/// Strokes of one kind.
fn strokes(series: &Series, measure: Measure) -> Vec<Stroke> {
    let opens = measure == Measure::OpeningTime;
    let by_trip = measure == Measure::TripClosingTime;
    let ends_pu = if by_trip { WITHOUT_STOP_PU } else { WITHOUT_ENDS_PU };
    let driven = |i: usize| {
        if by_trip || series.tripped[i] {
            return by_trip && series.tripped[i];
        }
        let ahead_pu = series.error_pu(i);
        if opens { ahead_pu > FULL_RATE_ERROR_PU } else { ahead_pu < -FULL_RATE_ERROR_PU }
    };
    let mut strokes = vec![];
    let mut i = 0;
    while i < series.len() {
        if !driven(i) {
            i += 1;
            continue;
        }
        let start = i;
        while i < series.len() && driven(i) {
            i += 1;
        }
        let from = series.at(series.time_s[start] + GETTING_UP_S).min(i);
        let inside = |&k: &usize| (ends_pu[0]..=ends_pu[1]).contains(&series.position_pu[k]);
        let rows: Vec<usize> = (from..i).filter(inside).collect();
        strokes.extend(stroke(series, &rows, opens));
    }
    strokes
}

fn stroke(series: &Series, rows: &[usize], opens: bool) -> Option<Stroke> {
    let (&from, &last) = (rows.first()?, rows.last()?);
    let to = last + 1;
    let travel_pu = (series.position_pu[last] - series.position_pu[from]).abs();
    if travel_pu < LEAST_TRAVEL_PU || to - from < 5 {
        return None;
    }
    let (times, positions) = (&series.time_s[from..to], &series.position_pu[from..to]);
    let (speed_pu_s, sd) = slope(times, positions, series.noise_pu);
    let along = if opens { speed_pu_s } else { -speed_pu_s };
    if along <= 1e-3 {
        return None;
    }
    // The rest of the stroke was not seen: its rate may differ by as much as the rates of the quarters do.
    let quarter = (to - from) / 4;
    let unlike = if quarter >= 3 {
        let of = |k: usize| slope(&times[k * quarter..][..quarter], &positions[k * quarter..][..quarter], 0.0).0;
        mean_and_sd(&[of(0), of(1), of(2), of(3)]).1 / along
    } else {
        0.05
    };
    let unseen = unlike * (1.0 - travel_pu).max(0.0);
    let time_s = 1.0 / along;
    let event = MeasuredEvent { value: time_s, sd: time_s * (sd / along).hypot(unseen) };
    Some(Stroke { from, to, speed_pu_s: along, event })
}

/// How long the last part of closing strokes is slowed.
pub fn cushion_time(all: &[Series]) -> MeasureFound {
    let mut events = vec![];
    for series in all {
        for stroke in strokes(series, Measure::ClosingTime) {
            events.extend(cushion(series, stroke));
        }
    }
    if events.is_empty() {
        return missing(Measure::CushionTime, "no closing stroke at full rate that ends closed");
    }
    found(Measure::CushionTime, &events, "")
}

fn cushion(series: &Series, stroke: Stroke) -> Option<MeasuredEvent> {
    let smoothed = smooth(&series.time_s, &series.position_pu, (SPEED_WINDOW_S / 4.0).max(series.period_s));
    let rest = stroke.from..series.len();
    let closed_pu = rest.clone().map(|i| smoothed[i]).fold(f64::INFINITY, f64::min);
    if closed_pu > NOT_CLOSED_PU {
        return None;
    }
    let margin_pu = CLOSED_PU.max(5.0 * series.margin_pu);
    let end = rest.clone().find(|&i| smoothed[i] <= closed_pu + margin_pu)?;
    // A stroke that turns back or waits on its way ends no closing.
    if (stroke.from..end).any(|i| series.command_pu[i] > smoothed[i]) {
        return None;
    }
    let window_s = SPEED_WINDOW_S.max(3.0 * series.period_s);
    let speeds = rate(&series.time_s, &smoothed, window_s);
    let knee = (stroke.from..end).rev().find(|&i| -speeds[i] >= SLOWED_SHARE * stroke.speed_pu_s)?;
    let time_s = (series.time_s[end] - series.time_s[knee]).max(0.0);
    // The end is crossed slowly, the knee is known to the window of the speed.
    let slow_pu_s = (margin_pu / time_s.max(series.period_s)).max(1e-4);
    let crossing_s = series.noise_pu / series.samples_in(SPEED_WINDOW_S / 4.0).sqrt() / slow_pu_s;
    let knee_s = window_s / 12.0_f64.sqrt();
    Some(MeasuredEvent { value: time_s, sd: crossing_s.hypot(knee_s).hypot(series.period_s / 12.0_f64.sqrt()) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A full opening and closing stroke at 0.14 and 0.2 pu/s, slowed to 0.04 pu/s below 10 %.
    fn strokes_of(noise_pu: f64) -> Series {
        let (mut time_s, mut command_pu, mut position_pu) = (vec![], vec![], vec![]);
        let mut y: f64 = 0.0;
        for i in 0..3000_u32 {
            let t = f64::from(i) * 0.01;
            let command = if (1.0..15.0).contains(&t) { 1.0 } else { 0.0 };
            let speed = if command > y {
                0.14
            } else if y > 0.1 {
                -0.2
            } else {
                -0.04
            };
            y = (y + 0.01 * speed).clamp(0.0, 1.0);
            let shake = noise_pu * (f64::from(i) * 12.9898).sin() * 1.4;
            time_s.push(t);
            command_pu.push(command);
            position_pu.push(y + shake);
        }
        let count = time_s.len();
        Series::new("strokes", time_s, command_pu, position_pu, vec![false; count]).unwrap()
    }

    #[test]
    fn strokes_at_known_rates_have_their_times() {
        for noise_pu in [0.0, 2e-4] {
            let all = [strokes_of(noise_pu)];
            for (measure, expected) in [(Measure::OpeningTime, 1.0 / 0.14), (Measure::ClosingTime, 1.0 / 0.2)] {
                let value = stroke_time(&all, measure).value.unwrap();
                assert!((value.value - expected).abs() < 2e-3 * expected, "{measure:?}: {value:?}");
                assert!(value.low <= expected * 1.0005 && value.high >= expected * 0.9995, "{measure:?}: {value:?}");
            }
            let cushion = cushion_time(&all).value.unwrap();
            // From 10 % to 0.2 % of stroke at 0.04 pu/s.
            assert!(cushion.low < 2.45 && cushion.high > 2.45 && (cushion.value - 2.45).abs() < 0.1, "{cushion:?}");
            assert!(stroke_time(&all, Measure::TripClosingTime).value.is_none());
        }
    }
}
