//! The time scale of a stage, from its position alone, and how long free runs of it are.
//!
//! The mean square by which the position changes over a time (its structure function) grows from nothing to what two unrelated samples differ by. Where it
//! reaches a quarter of that, the position has moved by half of what it varies by: a property of the movement, whatever the unit, rate or clock.

use crate::stage_alone::run::Run;

/// Share of the mean square between unrelated samples at which the position counts as moved.
const MOVED_SHARE: f64 = 0.25;
/// Each time that is tried, over the one before.
const RATIO: f64 = 1.1;
/// Length of a free run, in times of a movement: about one travel there and back.
const MOVEMENTS: f64 = 6.0;
/// Length of a free run as shares of all that was recorded: a hundred runs at most, and four in each half at least, behind what drove the first.
const SHARES: (f64, f64) = (0.01, 0.1175);
/// Samples of a recording that are looked at.
const LOOKED_AT: usize = 20_000;

/// How long free runs are, s, of recordings as a whole.
pub(crate) fn free_run_s(whole: &[Run]) -> f64 {
    let recorded_s: f64 = whole.iter().map(Run::length_s).sum();
    let movement_s = movement_s(whole).unwrap_or(recorded_s);
    (MOVEMENTS * movement_s).clamp(SHARES.0 * recorded_s, SHARES.1 * recorded_s)
}

/// Time in which the position changes by half of what it varies by, s; none where it never does.
fn movement_s(whole: &[Run]) -> Option<f64> {
    let runs: Vec<Run> = whole.iter().map(|run| run.thinned(LOOKED_AT)).collect();
    let openings = || runs.iter().flat_map(|run| run.opening.iter());
    let count = openings().count().max(1) as f64;
    let mean = openings().sum::<f64>() / count;
    let moved = MOVED_SHARE * 2.0 * openings().map(|y| (y - mean).powi(2)).sum::<f64>() / count;
    let longest_s = runs.iter().map(Run::length_s).fold(0.0, f64::max);
    let steps = runs.iter().flat_map(|run| run.time_s.windows(2).map(|two| two[1] - two[0]));
    let shortest_s = steps.filter(|step_s| *step_s > 0.0).fold(f64::INFINITY, f64::min);
    let mut before: Option<(f64, f64)> = None;
    for time_s in std::iter::successors(Some(shortest_s), |time_s| Some(time_s * RATIO)) {
        // Beyond half of a recording few pairs are left.
        if moved <= 0.0 || time_s.partial_cmp(&(0.5 * longest_s)) != Some(std::cmp::Ordering::Less) {
            return None;
        }
        let Some(changed) = change_square(&runs, time_s) else { continue };
        if changed >= moved {
            // Straight between the times that were tried, so that these make no difference.
            return Some(match before {
                Some((earlier_s, less)) => earlier_s + (time_s - earlier_s) * (moved - less) / (changed - less),
                None => time_s,
            });
        }
        before = Some((time_s, changed));
    }
    None
}

/// Mean square by which the position changes over a time; none where no samples are so far apart.
fn change_square(runs: &[Run], time_s: f64) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0_usize);
    for run in runs {
        let mut from = 0;
        for to in 0..run.time_s.len() {
            while from < to && run.time_s[to] - run.time_s[from + 1] >= time_s {
                from += 1;
            }
            if run.time_s[to] - run.time_s[from] >= time_s {
                sum += (run.opening[to] - run.opening[from]).powi(2);
                count += 1;
            }
        }
    }
    (count > 0).then(|| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sine of a period, s, over so many of them.
    fn sine(period_s: f64, rate: f64, scale: f64) -> Run {
        let time_s: Vec<f64> = (0..4000).map(|k| f64::from(k) * period_s / rate).collect();
        let opening =
            time_s.iter().map(|t| scale * (std::f64::consts::TAU * t / period_s).sin() + 7.0 * scale).collect();
        Run { spool: vec![0.0; time_s.len()], time_s, opening, ..Run::default() }
    }

    #[test]
    fn a_movement_is_a_share_of_a_period_at_any_clock_rate_and_unit() {
        // 1 − cos φ = ¼ at φ = 0.7227.
        let wanted = 0.7227 / std::f64::consts::TAU;
        for (period_s, rate, scale) in [(8.0, 100.0, 1.0), (0.08, 100.0, -40.0), (800.0, 37.0, 1e-3)] {
            let found_s = movement_s(&[sine(period_s, rate, scale)]).unwrap();
            assert!((found_s / period_s / wanted - 1.0).abs() < 0.1, "{found_s} of {period_s}");
        }
        let [one, other] = [1.0, 100.0].map(|period_s| free_run_s(&[sine(period_s, 100.0, 1.0)]));
        assert!((other / one - 100.0).abs() < 1e-6, "{one} {other}");
        assert!(movement_s(&[Run { opening: vec![1.0; 4000], ..sine(1.0, 10.0, 1.0) }]).is_none());
    }
}
