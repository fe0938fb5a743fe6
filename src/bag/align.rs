//! Rows out of streams, by points 3 to 6 of the rule that `bag` states.

use super::streams::{Command, Pressure, Sample};
use super::{BagError, Interpolation};
use crate::frame::{EsvState, Frame, Inputs, Signals};
use crate::units::seconds_from_nanos;

/// The most rows that resampling may make: 100 s at 1 µs, a day at 1 ms, about 8 GB.
const ROW_LIMIT: i64 = 100_000_000;

/// The four streams, each strictly rising in stamp. An absent input is one sample at the beginning of time.
#[derive(Debug, Default)]
pub(super) struct Streams {
    pub(super) command: Vec<Sample<Command>>,
    pub(super) esv: Vec<Sample<EsvState>>,
    pub(super) tank_pressure: Vec<Sample<Pressure>>,
    pub(super) servo_state: Vec<Sample<Signals>>,
}

/// Makes rows of the streams by the rule above.
///
/// # Errors
/// Where the grid would have too many points.
pub(super) fn align(
    streams: &Streams,
    interpolation: Interpolation,
    path: &std::path::Path,
) -> Result<Vec<Frame>, BagError> {
    let mut times_ns: Vec<i64> = stamps(&streams.command)
        .chain(stamps(&streams.esv))
        .chain(stamps(&streams.tank_pressure))
        .chain(stamps(&streams.servo_state))
        .collect();
    times_ns.sort_unstable();
    let begin_ns = [first(&streams.command), first(&streams.esv), first(&streams.tank_pressure)].into_iter().max();
    times_ns.retain(|time_ns| begin_ns.is_some_and(|begin_ns| *time_ns >= begin_ns));
    if let (Interpolation::Linear { period_ns }, Some(&begin_ns), Some(&end_ns)) =
        (interpolation, times_ns.first(), times_ns.last())
    {
        let period_ns = period_ns.max(1);
        let count = end_ns.saturating_sub(begin_ns) / period_ns;
        if count > ROW_LIMIT {
            let duration_s = seconds_from_nanos(end_ns.saturating_sub(begin_ns));
            return Err(BagError::TooManyRows { path: path.to_owned(), period_ns, duration_s, limit: ROW_LIMIT });
        }
        times_ns.extend((1..=count).map(|step| begin_ns + step * period_ns));
        times_ns.sort_unstable();
    }
    times_ns.dedup();

    let mut command = Cursor::new(&streams.command);
    let mut esv = Cursor::new(&streams.esv);
    let mut tank_pressure = Cursor::new(&streams.tank_pressure);
    let mut servo_state = Cursor::new(&streams.servo_state);
    let mut frames = Vec::with_capacity(times_ns.len());
    for time_ns in times_ns {
        let (Some(opening), Some(state), Some(pressure)) =
            (command.at(time_ns), esv.at(time_ns), tank_pressure.at(time_ns))
        else {
            continue;
        };
        let linear = interpolation != Interpolation::Hold;
        let inputs = Inputs {
            opening_command_pu: if linear { command.between(time_ns, |value| value.0) } else { opening.value.0 },
            esv: state.value,
            tank_pressure_pa: if linear { tank_pressure.between(time_ns, |value| value.0) } else { pressure.value.0 },
        };
        let measured = servo_state
            .at(time_ns)
            .filter(|sample| sample.stamp_ns == time_ns)
            .map_or(Signals::NONE, |sample| sample.value);
        frames.push(Frame { time_ns, inputs, measured });
    }
    Ok(frames)
}

/// An absent input's one sample lies before all time and makes no row.
const BEFORE_ALL_TIME_NS: i64 = i64::MIN;

/// The stream that stands in for an absent input.
pub(super) fn constant<V>(value: V) -> Vec<Sample<V>> {
    vec![Sample { stamp_ns: BEFORE_ALL_TIME_NS, log_time_ns: BEFORE_ALL_TIME_NS, value }]
}

fn stamps<V>(samples: &[Sample<V>]) -> impl Iterator<Item = i64> {
    samples.iter().map(|sample| sample.stamp_ns).filter(|stamp_ns| *stamp_ns != BEFORE_ALL_TIME_NS)
}

fn first<V>(samples: &[Sample<V>]) -> i64 {
    samples.first().map_or(i64::MAX, |sample| sample.stamp_ns)
}

/// Walks along a stream as time goes on.
struct Cursor<'a, V> {
    samples: &'a [Sample<V>],
    /// Samples at or before the time last asked for.
    passed: usize,
}

impl<'a, V: Copy> Cursor<'a, V> {
    fn new(samples: &'a [Sample<V>]) -> Self {
        Self { samples, passed: 0 }
    }

    /// The newest sample at or before a time, which must not fall from call to call.
    fn at(&mut self, time_ns: i64) -> Option<Sample<V>> {
        while self.samples.get(self.passed).is_some_and(|sample| sample.stamp_ns <= time_ns) {
            self.passed += 1;
        }
        self.passed.checked_sub(1).and_then(|newest| self.samples.get(newest)).copied()
    }

    /// The value on the straight line between the samples around the time; the last holds after the end.
    fn between(&self, time_ns: i64, number: impl Fn(V) -> f64) -> f64 {
        let Some(before) = self.passed.checked_sub(1).and_then(|newest| self.samples.get(newest)) else {
            return f64::NAN;
        };
        let Some(after) = self.samples.get(self.passed) else { return number(before.value) };
        let share = share(time_ns - before.stamp_ns, after.stamp_ns.saturating_sub(before.stamp_ns));
        number(before.value) + share * (number(after.value) - number(before.value))
    }
}

#[expect(clippy::cast_precision_loss, reason = "a share of an interval needs no more digits than f64 has")]
fn share(part_ns: i64, whole_ns: i64) -> f64 {
    if whole_ns > 0 { part_ns as f64 / whole_ns as f64 } else { 0.0 }
}
