//! Whether a measured signal lies on straight lines: it was drawn between the few points that a historian or a slower logger kept.
//!
//! Lines are sought by a swinging door (Bristol 1987) as wide as the smallest change from value to value, which is at least their rounding. What was drawn
//! has as few lines by a door four times as wide; of a curve they are half as many (their length goes with the root of the width), of noise hardly any
//! are left. A transducer read at every tenth sample and drawn in between is found as well. Fewer than five samples a line, or steps above 0.02 % of the
//! stroke, tell nothing.

use super::copies::Pair;
use super::impossible::Impossible;
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// Widths of the door, pu: 32-bit numbers are not nearer than the first, and steps above the second hide what lies between.
const DOORS_PU: (f64, f64) = (2e-7, 2.1e-4);
/// Changes that are smaller are none, pu.
const EQUAL_PU: f64 = 1e-9;
/// The wider door, and how many times fewer lines it may leave of what was drawn.
const WIDER: f64 = 4.0;
const FEWER: f64 = 1.25;
/// A line moves the signal by more, pu, in so many samples at least, and most samples that move are on such lines; between two there may be a corner.
const MOVES_PU: f64 = 1e-3;
const SHORTEST: usize = 3;
const ON_LINES: f64 = 0.8;
/// So many lines and speeds there must be, and so many samples on each. A valve that is open or shut makes straight lines too, of two or three speeds.
const LINES: usize = 8;
const SPEEDS: usize = 6;
const SAMPLES: usize = 5;
/// Speeds that differ by a smaller share are one.
const ALIKE: f64 = 0.02;

/// The lines of one signal that move, speed, pu/s, and samples; and all samples that move.
#[derive(Default)]
struct Lines {
    long: Vec<(f64, usize)>,
    moving: usize,
}

/// The lines by which a signal was drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Drawn {
    pub(super) lines: usize,
    pub(super) samples: usize,
    /// The command runs on half as many lines at least, which a unit may follow, where nothing is noise.
    pub(super) may_follow: bool,
}

/// The first signal of some rows that was drawn.
pub(super) fn found(rows: &[Pair]) -> Option<Impossible> {
    let points = |of: fn(&Pair) -> f64| -> Vec<(i64, f64)> {
        rows.iter().map(|row| (row.time_ns, of(row))).filter(|(_, value)| value.is_finite()).collect()
    };
    let command = points(|row| row.command);
    let of = |signal: Signal, of: fn(&Pair) -> f64| {
        drawn(&points(of), &command).map(|drawn| Impossible::Drawn { signal, drawn })
    };
    let servomotor = of(Signal::ServomotorPosition, |row| row.position);
    servomotor.or_else(|| of(Signal::SpoolPosition, |row| row.spool))
}

/// How a signal was drawn; points of it and of its command are times, ns, and values, pu.
fn drawn(points: &[(i64, f64)], command: &[(i64, f64)]) -> Option<Drawn> {
    let changes = points.windows(2).map(|pair| (pair[1].1 - pair[0].1).abs()).filter(|change| *change > EQUAL_PU);
    let door_pu = changes.fold(f64::INFINITY, f64::min).max(DOORS_PU.0);
    if door_pu > DOORS_PU.1 {
        return None;
    }
    let Lines { long: lines, moving } = Lines::of(points, door_pu);
    let samples: usize = lines.iter().map(|(_, samples)| samples).sum();
    if lines.len() < LINES || samples < SAMPLES * lines.len() || (samples as f64) < ON_LINES * moving as f64 {
        return None;
    }
    let mut speeds: Vec<f64> = lines.iter().map(|(speed, _)| *speed).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup_by(|next, speed| (*next - *speed).abs() < ALIKE * speed.abs());
    let wider = || Lines::of(points, WIDER * door_pu).long.len();
    let is_drawn = speeds.len() >= SPEEDS && lines.len() as f64 <= FEWER * wider() as f64;
    is_drawn.then(|| {
        let may_follow = 2 * Lines::of(command, door_pu).long.len() >= lines.len();
        Drawn { lines: lines.len(), samples, may_follow }
    })
}

impl Lines {
    /// Lines that leave no value by more than a door, pu.
    fn of(points: &[(i64, f64)], door_pu: f64) -> Self {
        let (mut lines, mut from) = (Self::default(), 0);
        while from + 1 < points.len() {
            let (first_ns, first) = points[from];
            let (mut least, mut most, mut to, mut line_pu_s) = (f64::NEG_INFINITY, f64::INFINITY, from + 1, 0.0);
            for (k, (time_ns, value)) in points.iter().enumerate().skip(from + 1) {
                let after_s = seconds_from_nanos(time_ns.saturating_sub(first_ns)).max(f64::MIN_POSITIVE);
                let (speed, half) = ((value - first) / after_s, door_pu / after_s);
                if !(least..=most).contains(&speed) {
                    break;
                }
                (least, most, to, line_pu_s) = (least.max(speed - half), most.min(speed + half), k, speed);
            }
            if (points[to].1 - first).abs() > MOVES_PU {
                lines.moving += to - from;
                lines.long.extend((to - from >= SHORTEST).then_some((line_pu_s, to - from)));
            }
            from = to;
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::drawn;

    /// 80 s at 100 Hz of a course.
    fn points(course: impl Fn(f64) -> f64) -> Vec<(i64, f64)> {
        (0..8000_i64).map(|k| (k * 10_000_000, course(k as f64 * 0.01))).collect()
    }

    fn curve(time_s: f64) -> f64 {
        0.5 + 0.2 * (0.5 * time_s).sin() + 0.1 * (1.7 * time_s).sin()
    }

    /// The curve at points of uneven distances, and straight between them.
    fn straight(time_s: f64) -> f64 {
        let point = |k: f64| 0.37 * k + 0.1 * (k * k).sin();
        let mut k = (time_s / 0.37).floor() + 1.0;
        while point(k) > time_s {
            k -= 1.0;
        }
        let (from, to) = (point(k), point(k + 1.0));
        curve(from) + (time_s - from) / (to - from) * (curve(to) - curve(from))
    }

    #[test]
    fn what_was_drawn_is_found_however_it_was_rounded() {
        let lines = |course: &dyn Fn(f64) -> f64| drawn(&points(course), &[]).map(|drawn| drawn.lines);
        for rounding in [1e-6, 1e-5, 1e-4] {
            let rounded = |time_s: f64| (straight(time_s) / rounding).round() * rounding;
            assert!(
                lines(&rounded).is_some_and(|lines| (150..260).contains(&lines)),
                "{rounding}: {:?}",
                lines(&rounded)
            );
        }
        assert!(lines(&straight).is_some_and(|lines| (150..260).contains(&lines)), "{:?}", lines(&straight));
        assert!(lines(&|time_s| f64::from(straight(time_s) as f32)).is_some());
    }

    #[test]
    fn curves_noise_steps_and_valves_that_are_open_or_shut_are_not_drawn() {
        let noise = |time_s: f64| (12_345.678 * (78.233 * time_s).sin()).fract();
        // A servomotor that a relay moves at one speed each way.
        let relay = |time_s: f64| (0.1 * time_s).rem_euclid(1.0).min((-0.1 * time_s).rem_euclid(1.0));
        for rounding in [1e-9, 1e-6, 1e-5, 1e-4, 2e-4, 1.0 / 16_384.0, 1.0 / 27_648.0, 1.0 / 4096.0, 1e-3] {
            let round = |value: f64| (value / rounding).round() * rounding;
            assert_eq!(drawn(&points(|time_s| round(curve(time_s))), &[]), None, "{rounding}");
            assert_eq!(drawn(&points(|time_s| round(curve(time_s) + 0.002 * noise(time_s))), &[]), None, "{rounding}");
            assert_eq!(drawn(&points(|time_s| round(relay(time_s))), &[]), None, "{rounding}");
            assert_eq!(drawn(&points(|time_s| round(1.0 - (-time_s.rem_euclid(8.0)).exp())), &[]), None, "{rounding}");
        }
    }

    #[test]
    fn a_unit_may_follow_a_command_of_as_many_lines() {
        let [followed, command] = [0.3, 0.0].map(|lag_s| points(|time_s| straight(time_s - lag_s)));
        assert_eq!(drawn(&followed, &command).map(|drawn| drawn.may_follow), Some(true));
        assert_eq!(drawn(&followed, &points(|_| 0.5)).map(|drawn| drawn.may_follow), Some(false));
    }
}
