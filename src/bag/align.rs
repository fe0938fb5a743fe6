//! Rows out of streams, by points 3 to 6 of the rule that `bag` states.

use super::streams::{OpeningCommand, PistonForce, Pressure, Sample};
use super::{BagError, Interpolation};
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::units::seconds_from_nanos;

/// The most rows that resampling may make of a recording: 2.7 h at 1 ms, about 0.8 GB, and several times that in a fit.
pub(super) const ROW_LIMIT: i64 = 10_000_000;

/// Rows further apart than this are of two clocks, ns: a day.
pub(super) const FARTHEST_NS: i64 = 86_400_000_000_000;

/// The streams, each strictly rising in stamp. An absent input is one sample at the beginning of time.
#[derive(Debug, Default)]
pub(super) struct Streams {
    pub(super) command: Vec<Sample<OpeningCommand>>,
    pub(super) esv: Vec<Sample<EsvState>>,
    pub(super) tank_pressure: Vec<Sample<Pressure>>,
    pub(super) servo_state: Vec<Sample<Signals>>,
    /// Empty in most recordings.
    pub(super) load: Vec<Sample<PistonForce>>,
}

/// Makes rows of the streams by the rule above.
///
/// # Errors
/// Where the grid would have too many points, or the streams have clocks that differ by more than a day.
pub(super) fn align(
    streams: &Streams,
    interpolation: Interpolation,
    path: &std::path::Path,
) -> Result<Vec<Frame>, BagError> {
    let mut times_ns: Vec<i64> = stamps(&streams.command)
        .chain(stamps(&streams.esv))
        .chain(stamps(&streams.tank_pressure))
        .chain(stamps(&streams.servo_state))
        .chain(stamps(&streams.load))
        .collect();
    times_ns.sort_unstable();
    let begin_ns = [first(&streams.command), first(&streams.esv), first(&streams.tank_pressure)].into_iter().max();
    let end_ns = end(streams);
    times_ns.retain(|time_ns| begin_ns.is_some_and(|begin_ns| (begin_ns..=end_ns.max(begin_ns)).contains(time_ns)));
    if let Some(pair) = times_ns.windows(2).find(|pair| pair[1].saturating_sub(pair[0]) > FARTHEST_NS) {
        let gap_s = seconds_from_nanos(pair[1].saturating_sub(pair[0]));
        return Err(BagError::TwoClocks { path: path.to_owned(), from_ns: pair[0], to_ns: pair[1], gap_s });
    }
    let bends = stamps(&streams.command).next().is_some() || !matches!(interpolation, Interpolation::Sharp { .. });
    if let (Some(period_ns), Some(&begin_ns), Some(&end_ns)) =
        (interpolation.period_ns().filter(|_| bends), times_ns.first(), times_ns.last())
    {
        let count = end_ns.saturating_sub(begin_ns) / period_ns;
        let limit = ROW_LIMIT;
        if count > limit {
            let duration_s = seconds_from_nanos(end_ns.saturating_sub(begin_ns));
            return Err(BagError::TooManyRows { path: path.to_owned(), period_ns, duration_s, rows: count, limit });
        }
        times_ns.extend((1..=count).map(|step| begin_ns + step * period_ns));
        times_ns.sort_unstable();
    }
    times_ns.dedup();
    check_sparse(&times_ns, path)?;

    let mut command = Cursor::new(&streams.command);
    let mut esv = Cursor::new(&streams.esv);
    let mut tank_pressure = Cursor::new(&streams.tank_pressure);
    let mut servo_state = Cursor::new(&streams.servo_state);
    let mut load = Cursor::new(&streams.load);
    let mut frames = Vec::with_capacity(times_ns.len());
    for time_ns in times_ns {
        let (Some(opening), Some(state), Some(pressure)) =
            (command.at(time_ns), esv.at(time_ns), tank_pressure.at(time_ns))
        else {
            continue;
        };
        let linear = interpolation != Interpolation::Hold;
        let inputs = Inputs {
            opening_command_pu: match interpolation {
                Interpolation::Hold => opening.value.0,
                Interpolation::Linear { .. } => command.between(time_ns, |value| value.0),
                Interpolation::Sharp { .. } => command.bent(time_ns, |value| value.0),
            },
            esv: state.value,
            tank_pressure_pa: if linear { tank_pressure.between(time_ns, |value| value.0) } else { pressure.value.0 },
            piston_force_n: load.at(time_ns).map_or(0.0, |sample| sample.value.0),
        };
        let measured = servo_state
            .at(time_ns)
            .filter(|sample| sample.stamp_ns == time_ns)
            .map_or(Signals::NONE, |sample| sample.value);
        frames.push(Frame { time_ns, inputs, measured });
    }
    Ok(frames)
}

/// Rows that a twin runs between the rows of a recording, one a tick of a millisecond, are bounded by the rows there are: one a second at least.
///
/// # Errors
/// Where there are fewer.
fn check_sparse(times_ns: &[i64], path: &std::path::Path) -> Result<(), BagError> {
    let (Some(&begin_ns), Some(&end_ns)) = (times_ns.first(), times_ns.last()) else { return Ok(()) };
    let (ticks, limit) = (end_ns.saturating_sub(begin_ns) / TICK_NS, most_ticks(times_ns.len()));
    if ticks <= limit {
        return Ok(());
    }
    let duration_s = seconds_from_nanos(end_ns.saturating_sub(begin_ns));
    Err(BagError::TooManyRows { path: path.to_owned(), period_ns: TICK_NS, duration_s, rows: ticks, limit })
}

/// The tick of a twin, ns.
pub(super) const TICK_NS: i64 = 1_000_000;
/// Of a recording that is longer, so many ticks for each of its rows.
const TICKS_A_ROW: i64 = 1000;

/// The most ticks that so many rows are simulated over.
pub(super) fn most_ticks(rows: usize) -> i64 {
    i64::try_from(rows).unwrap_or(i64::MAX).saturating_mul(TICKS_A_ROW).max(ROW_LIMIT)
}

/// An absent input's one sample lies before all time and makes no row.
const BEFORE_ALL_TIME_NS: i64 = i64::MIN;

/// The stream that replaces an absent input.
pub(super) fn constant<V>(value: V) -> Vec<Sample<V>> {
    vec![Sample { stamp_ns: BEFORE_ALL_TIME_NS, log_time_ns: BEFORE_ALL_TIME_NS, value }]
}

/// The stamps of the samples that were sent.
pub(super) fn stamps<V>(samples: &[Sample<V>]) -> impl Iterator<Item = i64> {
    samples.iter().map(|sample| sample.stamp_ns).filter(|stamp_ns| *stamp_ns != BEFORE_ALL_TIME_NS)
}

/// The last command or measurement: what senders that beat on report after it is no recording any more.
fn end(streams: &Streams) -> i64 {
    let last = |stamps: Option<i64>| stamps.unwrap_or(i64::MIN);
    let end_ns = last(stamps(&streams.command).last()).max(last(stamps(&streams.servo_state).last()));
    if end_ns == i64::MIN { i64::MAX } else { end_ns }
}

fn first<V>(samples: &[Sample<V>]) -> i64 {
    samples.first().map_or(i64::MAX, |sample| sample.stamp_ns)
}

/// Walks along a stream as time goes on.
pub(super) struct Cursor<'a, V> {
    pub(super) samples: &'a [Sample<V>],
    /// Samples at or before the time last asked for.
    pub(super) passed: usize,
}

impl<'a, V: Copy> Cursor<'a, V> {
    fn new(samples: &'a [Sample<V>]) -> Self {
        Self { samples, passed: 0 }
    }

    /// The newest sample at or before a time, which must not fall from call to call.
    pub(super) fn at(&mut self, time_ns: i64) -> Option<Sample<V>> {
        while self.samples.get(self.passed).is_some_and(|sample| sample.stamp_ns <= time_ns) {
            self.passed += 1;
        }
        self.passed.checked_sub(1).and_then(|newest| self.samples.get(newest)).copied()
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
}

impl<V: Copy> Cursor<'_, V> {
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
        let mut cursor = Cursor::new(&samples);
        let (mut sharp, mut straight) = (0.0_f64, 0.0_f64);
        for ms in (0..3800).step_by(3) {
            let time_ns = ms * 1_000_000;
            cursor.at(time_ns);
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
            let mut cursor = Cursor::new(&samples);
            for ms in (0..3800).step_by(7) {
                cursor.at(ms * 1_000_000);
                let (bent, straight) =
                    (cursor.bent(ms * 1_000_000, |value| value.0), cursor.between(ms * 1_000_000, |value| value.0));
                assert_eq!(bent.to_bits(), straight.to_bits(), "at {ms} ms");
            }
        }
    }
}
