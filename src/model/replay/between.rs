//! What drives a unit between slow samples: inputs that run straight, and trips amid the pause in which they came.
//!
//! A recorder with a row every 0.2 s has no information on the time between. A twin that holds the inputs of a row until the next one
//! lags by half a pause on a ramp, and moves after a trip one row later than the unit. Here command, tank pressure and measured opening run
//! straight from row to row, and a trip that a slow recorder wrote down with the next row comes amid the pause: half a pause is the mean
//! of what is not known. A row is estimated from itself and from rows before it, and from nothing that is corrected or evaluated.

use super::simulate;
use crate::frame::{Estimate, EsvState, Frame, Signals};
use crate::recording::{Recording, SLOW_NS};
use crate::twin::Twin;

/// Rows farther apart than this are a gap: the time of a trip in it is not known, ns.
pub(super) const GAP_NS: i64 = 1_000_000_000;

/// One estimate for each row of a recording, the inputs running straight between them on a grid of `period_ns`.
#[must_use]
pub fn simulate_between(twin: &mut Twin, recording: &Recording, period_ns: i64) -> Vec<Estimate> {
    let (drawn, rows) = drawn(recording, period_ns);
    let estimates = simulate(twin, &drawn);
    rows.iter().filter_map(|&row| estimates.get(row).copied()).collect()
}

/// A recording with rows on a grid between slow ones, and where its own rows stand now. Added rows hold no spool.
pub fn drawn(recording: &Recording, period_ns: i64) -> (Recording, Vec<usize>) {
    let period_ns = period_ns.max(1);
    let begin_ns = recording.frames.first().map_or(0, |frame| frame.time_ns);
    let (mut frames, mut rows) = (Vec::<Frame>::new(), Vec::with_capacity(recording.frames.len()));
    for frame in &recording.frames {
        if let Some(last) = frames.last().copied() {
            let pause_ns = frame.time_ns.saturating_sub(last.time_ns);
            if pause_ns > SLOW_NS {
                let mut at_ns = begin_ns + ((last.time_ns - begin_ns) / period_ns + 1) * period_ns;
                while at_ns < frame.time_ns {
                    frames.push(amid(&last, frame, at_ns));
                    at_ns += period_ns;
                }
            }
        }
        rows.push(frames.len());
        frames.push(*frame);
    }
    let mut drawn = Recording { frames, ..recording.clone() };
    trips_amid(&mut drawn);
    (drawn, rows)
}

/// Puts every trip that a slow recorder wrote down with a row into the middle of the pause before that row.
///
/// Rows that hold nothing measured count as added ones.
pub fn trips_amid(recording: &mut Recording) {
    let frames = &mut recording.frames;
    for row in 1..frames.len() {
        let trips = frames[row].inputs.esv == EsvState::Shutdown && frames[row - 1].inputs.esv != EsvState::Shutdown;
        if !trips || !is_own(&frames[row]) {
            continue;
        }
        let Some(before) = frames[..row].iter().rposition(is_own) else { continue };
        let pause_ns = frames[row].time_ns - frames[before].time_ns;
        if pause_ns <= SLOW_NS || pause_ns > GAP_NS {
            continue;
        }
        let middle_ns = frames[before].time_ns + pause_ns / 2;
        for frame in frames[before + 1..row].iter_mut().filter(|frame| frame.time_ns >= middle_ns) {
            frame.inputs.esv = EsvState::Shutdown;
        }
    }
}

/// Whether a row was recorded.
pub(super) fn is_own(frame: &Frame) -> bool {
    frame.measured.servomotor_position_pu.is_finite() && !is_added(frame)
}

/// Whether a row was added: it may hold an opening that was drawn, and never a spool.
fn is_added(frame: &Frame) -> bool {
    frame.measured.spool_position_pu.is_nan()
}

/// The row at a time between two others.
fn amid(last: &Frame, next: &Frame, at_ns: i64) -> Frame {
    let share = (at_ns - last.time_ns) as f64 / (next.time_ns - last.time_ns) as f64;
    let straight = |from: f64, to: f64| if to.is_finite() { from + share * (to - from) } else { from };
    let mut inputs = last.inputs;
    inputs.opening_command_pu = straight(last.inputs.opening_command_pu, next.inputs.opening_command_pu);
    inputs.tank_pressure_pa = straight(last.inputs.tank_pressure_pa, next.inputs.tank_pressure_pa);
    let servomotor_position_pu = straight(last.measured.servomotor_position_pu, next.measured.servomotor_position_pu);
    Frame { time_ns: at_ns, inputs, measured: Signals { servomotor_position_pu, ..Signals::NONE } }
}

#[cfg(test)]
mod tests {
    use super::{drawn, simulate_between};
    use crate::frame::{EsvState, Frame, Inputs, Signals};
    use crate::recording::Recording;
    use crate::replay::simulate;
    use crate::twin::Twin;

    const MS: i64 = 1_000_000;

    /// A ramp that ends in a trip at 1,070 ms, in rows every so many ms.
    fn recording(every_ms: i64) -> Recording {
        let rows = (0..=2000 / every_ms).map(|k| {
            let time_ms = k * every_ms;
            let shut = time_ms >= 1070;
            let opening_command_pu = if shut { 0.0 } else { 0.4 + 0.05e-3 * time_ms as f64 };
            let esv = if shut { EsvState::Shutdown } else { EsvState::Normal };
            let inputs = Inputs { opening_command_pu, esv, tank_pressure_pa: 6.3e6, piston_force_n: 0.0 };
            let measured = Signals { spool_position_pu: 0.0, servomotor_position_pu: 0.4, ..Signals::NONE };
            Frame { time_ns: time_ms * MS, inputs, measured }
        });
        Recording::new("a", rows.collect())
    }

    #[test]
    fn inputs_run_straight_and_a_trip_comes_amid_its_pause() {
        let slow = recording(200);
        let (drawn, rows) = drawn(&slow, 10 * MS);
        assert_eq!(drawn.frames.len(), 10 * 20 + 1);
        assert!(rows.iter().zip(&slow.frames).all(|(&row, own)| drawn.frames[row].time_ns == own.time_ns));
        let at = |ms: i64| drawn.frames.iter().find(|frame| frame.time_ns == ms * MS).unwrap();
        assert!((at(300).inputs.opening_command_pu - 0.415).abs() < 1e-12);
        assert!(at(300).measured.spool_position_pu.is_nan() && at(300).measured.servomotor_position_pu == 0.4);
        assert_eq!([1090, 1100, 1200].map(|ms| at(ms).inputs.esv == EsvState::Shutdown), [false, true, true]);
        // A fast recording is left as it is.
        let (fast, own) = (super::drawn(&recording(10), 10 * MS).0, recording(10));
        let seen = |one: &Recording| one.frames.iter().map(|frame| (frame.time_ns, frame.inputs)).collect::<Vec<_>>();
        assert_eq!(seen(&fast), seen(&own));
    }

    #[test]
    fn a_slow_recording_drawn_in_is_nearer_to_the_fast_one_than_with_inputs_held() {
        let mut twin = Twin::new(&crate::params::reference());
        let fast = simulate(&mut twin, &recording(10));
        for (rows, share) in [(4, 0.6), (20, 0.5)] {
            let slow = recording(10 * rows);
            let truth = fast.iter().step_by(usize::try_from(rows).unwrap());
            let error_pu = |estimates: &[crate::frame::Estimate]| -> f64 {
                let spools = estimates.iter().zip(truth.clone());
                spools.map(|(one, truth)| (one.signals.spool_position_pu - truth.signals.spool_position_pu).abs()).sum()
            };
            let held_pu = error_pu(&simulate(&mut twin, &slow));
            let drawn_pu = error_pu(&simulate_between(&mut twin, &slow, 10 * MS));
            assert!(drawn_pu < share * held_pu, "every {rows}0 ms: {drawn_pu} against {held_pu}");
        }
    }

    #[test]
    fn no_row_sees_a_later_one() {
        let mut twin = Twin::new(&crate::params::reference());
        let whole = recording(200);
        let all = simulate_between(&mut twin, &whole, 10 * MS);
        for rows in 2..whole.frames.len() {
            let part = Recording::new("a", whole.frames[..rows].to_vec());
            assert_eq!(simulate_between(&mut twin, &part, 10 * MS)[..], all[..rows]);
        }
    }
}
