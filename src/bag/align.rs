//! What rows may be, and values between two samples, by points 3 to 6 of the rule that `bag` states.

use std::path::Path;

use super::BagError;
use super::streams::Sample;
use govtwin_model::frame::Frame;
use govtwin_model::units::seconds_from_nanos;

/// The most rows that resampling may make of a recording: 2.7 h at 1 ms, about 0.8 GB, and several times that in a fit.
pub(crate) const ROW_LIMIT: i64 = 10_000_000;

/// Rows further apart than this are of two clocks, ns: a day.
pub const FARTHEST_NS: i64 = 86_400_000_000_000;

/// Whether rows are of one clock, and no more than can be simulated, with a grid of this period below them.
///
/// A twin runs a row each tick between the rows of a recording, which are bounded by the rows there are: one in a thousand ticks at least.
///
/// # Errors
/// Where the grid would have too many points, rows are too sparse, or the streams have clocks that differ by more than a day.
pub(super) fn check(rows: &[Frame], grid_ns: Option<i64>, tick_ns: Option<i64>, path: &Path) -> Result<(), BagError> {
    let (Some(first), Some(last)) = (rows.first(), rows.last()) else { return Ok(()) };
    let apart_ns = |pair: &[Frame]| pair[1].time_ns.saturating_sub(pair[0].time_ns);
    if let Some(pair) = rows.windows(2).find(|pair| apart_ns(pair) > FARTHEST_NS) {
        let (from_ns, to_ns, gap_s) = (pair[0].time_ns, pair[1].time_ns, seconds_from_nanos(apart_ns(pair)));
        return Err(BagError::TwoClocks { path: path.to_owned(), from_ns, to_ns, gap_s });
    }
    let span_ns = last.time_ns.saturating_sub(first.time_ns);
    let at_most = |limit: i64, period_ns: i64| {
        let (rows, duration_s) = (span_ns / period_ns, seconds_from_nanos(span_ns));
        let too_many = || BagError::TooManyRows { path: path.to_owned(), period_ns, duration_s, rows, limit };
        if rows > limit { Err(too_many()) } else { Ok(rows) }
    };
    let laid = grid_ns.map_or(Ok(0), |period_ns| at_most(ROW_LIMIT, period_ns))?;
    let Some(tick_ns) = tick_ns else { return Ok(()) };
    at_most(most_ticks(rows.len().saturating_add(usize::try_from(laid).unwrap_or_default())), tick_ns).map(drop)
}

/// Of a recording that is longer, so many ticks for each of its rows.
const TICKS_A_ROW: i64 = 1000;

/// The most ticks that so many rows are simulated over.
pub(super) fn most_ticks(rows: usize) -> i64 {
    i64::try_from(rows).unwrap_or(i64::MAX).saturating_mul(TICKS_A_ROW).max(ROW_LIMIT)
}

/// Walks along a stream as time goes on.
pub(super) struct Cursor<'a, V> {
    pub(super) samples: &'a [Sample<V>],
    /// Samples at or before the time last asked for.
    pub(super) passed: usize,
}

impl<V: Copy> Cursor<'_, V> {
    /// Goes on to a time, which must not fall from call to call.
    pub(super) fn pass(&mut self, time_ns: i64) {
        while self.samples.get(self.passed).is_some_and(|sample| sample.stamp_ns <= time_ns) {
            self.passed += 1;
        }
    }

    /// The value on the straight line between the samples around the time; the last holds after the end.
    pub(super) fn between(&self, time_ns: i64, number: impl Fn(V) -> f64) -> f64 {
        let Some(before) = self.passed.checked_sub(1).and_then(|newest| self.samples.get(newest)) else {
            return f64::NAN;
        };
        let Some(after) = self.samples.get(self.passed) else { return number(before.value) };
        let share = share(time_ns - before.stamp_ns, after.stamp_ns.saturating_sub(before.stamp_ns));
        number(before.value) + share * (number(after.value) - number(before.value))
    }

    /// As [`Cursor::between`], but round a sharp bend inside the interval along the lines of both sides.
    pub(super) fn bent(&self, time_ns: i64, number: impl Fn(V) -> f64 + Copy) -> f64 {
        let straight = self.between(time_ns, number);
        // Three samples on either side: two for the line, one more to see that the bend is no part of a curve.
        let Some(around) = self.passed.checked_sub(3).and_then(|from| self.samples.get(from..from + 6)) else {
            return straight;
        };
        let origin_ns = around[2].stamp_ns;
        let points: [(f64, f64); 6] =
            std::array::from_fn(|k| (seconds_from_nanos(around[k].stamp_ns - origin_ns), number(around[k].value)));
        match bend(&points) {
            Some((bend_s, bend)) => {
                let at_s = seconds_from_nanos(time_ns - origin_ns);
                let (from, to) = if at_s < bend_s { (points[2], (bend_s, bend)) } else { ((bend_s, bend), points[3]) };
                from.1 + (to.1 - from.1) * (at_s - from.0) / (to.0 - from.0)
            }
            None => straight,
        }
    }
}

/// A bend must be so many times as sharp as what the curve does on either side.
const SHARP: f64 = 4.0;

/// Smallest bend that counts, as a deviation from a straight line.
const LEAST_BEND: f64 = 2e-3;

/// Where the line through the second and third point meets that through the fourth and fifth, between the third and the fourth; none where
/// there is no sharp bend (subcell resolution; Harten 1989).
fn bend(points: &[(f64, f64); 6]) -> Option<(f64, f64)> {
    let slope = |k: usize| (points[k + 1].1 - points[k].1) / (points[k + 1].0 - points[k].0);
    let (before, after) = (slope(1), slope(3));
    let width_s = points[3].0 - points[2].0;
    let sharpness = (after - before).abs() * width_s;
    let curved = ((before - slope(0)).abs() + (slope(4) - after).abs()) * width_s;
    if !sharpness.is_finite() || sharpness < LEAST_BEND || sharpness < SHARP * curved {
        return None;
    }
    let at_s = points[2].0 + (points[3].1 - points[2].1 - after * width_s) / (before - after);
    (at_s > points[2].0 && at_s < points[3].0).then(|| (at_s, points[2].1 + before * (at_s - points[2].0)))
}

#[expect(clippy::cast_precision_loss, reason = "a share of an interval needs no more digits than f64 has")]
fn share(part_ns: i64, whole_ns: i64) -> f64 {
    if whole_ns > 0 { part_ns as f64 / whole_ns as f64 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::super::streams::OpeningCommand;
    use super::*;

    /// A ramp that begins between two samples, sampled at 5 Hz.
    fn ramp(begins_s: f64, rate: f64) -> Vec<Sample<OpeningCommand>> {
        (0..20)
            .map(|k| {
                let stamp_ns = k * 200_000_000;
                let value = OpeningCommand(0.9 + rate * (seconds_from_nanos(stamp_ns) - begins_s).max(0.0));
                Sample { stamp_ns, log_time_ns: stamp_ns, value }
            })
            .collect()
    }

    #[test]
    fn a_ramp_that_begins_between_two_samples_begins_in_time() {
        let samples = ramp(1.87, -0.5);
        let mut cursor = Cursor { samples: &samples, passed: 0 };
        let (mut sharp, mut straight) = (0.0_f64, 0.0_f64);
        for ms in (0..3800).step_by(3) {
            let time_ns = ms * 1_000_000;
            cursor.pass(time_ns);
            let truth = 0.9 - 0.5 * (seconds_from_nanos(time_ns) - 1.87).max(0.0);
            sharp = sharp.max((cursor.bent(time_ns, |value| value.0) - truth).abs());
            straight = straight.max((cursor.between(time_ns, |value| value.0) - truth).abs());
        }
        assert!(sharp < 1e-12 && straight > 0.01, "{sharp} {straight}");
    }

    #[test]
    fn curves_and_steps_stay_as_they_are() {
        for shape in
            [|t: f64| 0.1 * t * t, |t: f64| if t > 1.87 { 0.2 } else { 0.9 }, |t: f64| 0.5 + 0.1 * (3.0 * t).sin()]
        {
            let samples: Vec<Sample<OpeningCommand>> = (0..20)
                .map(|k| {
                    let stamp_ns = k * 200_000_000;
                    Sample {
                        stamp_ns,
                        log_time_ns: stamp_ns,
                        value: OpeningCommand(shape(seconds_from_nanos(stamp_ns))),
                    }
                })
                .collect();
            let mut cursor = Cursor { samples: &samples, passed: 0 };
            for ms in (0..3800).step_by(7) {
                cursor.pass(ms * 1_000_000);
                let (bent, straight) =
                    (cursor.bent(ms * 1_000_000, |value| value.0), cursor.between(ms * 1_000_000, |value| value.0));
                assert_eq!(bent.to_bits(), straight.to_bits(), "at {ms} ms");
            }
        }
    }
}
