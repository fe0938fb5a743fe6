//! Rest: long stretches of a recording in which nothing moves, of which a fit simulates beginning and end alone.

use std::ops::Range;

use govtwin_model::frame::{EsvState, Frame};
use govtwin_model::units::{nanos_from_seconds, seconds_from_nanos};

/// How far command and servomotor may stray from where a stretch begins, pu: the width of a usual dead band.
const STILL_PU: f64 = 1e-3;
/// Kept of a stretch: after the last movement, for whatever settles or creeps, and before the next one, s.
const KEPT_S: (f64, f64) = (15.0, 5.0);
/// A shorter cut is not worth its seam, s.
const LEAST_CUT_S: f64 = 10.0;

/// The rows that a fit may pass over, in their order; a row behind each is still at rest. Without a command there are none.
pub fn idle_segments(frames: &[Frame]) -> Vec<Range<usize>> {
    let mut idle_segments = Vec::new();
    let Some(first) = frames.first() else { return idle_segments };
    let (mut from, mut anchor) = (0, Anchor::at(first));
    for (row, frame) in frames.iter().enumerate() {
        if !anchor.holds(frame) {
            idle_segments.extend(middle(frames, from..row));
            (from, anchor) = (row, Anchor::at(frame));
        }
    }
    idle_segments.extend(middle(frames, from..frames.len()));
    idle_segments
}

/// Where a stretch began.
struct Anchor {
    esv: EsvState,
    command_pu: f64,
    servomotor_pu: f64,
}

impl Anchor {
    fn at(frame: &Frame) -> Self {
        Self {
            esv: frame.inputs.esv,
            command_pu: frame.inputs.opening_command_pu,
            servomotor_pu: frame.measured.servomotor_position_pu,
        }
    }

    /// Whether a frame is still at rest there. The first position measured is taken in.
    fn holds(&mut self, frame: &Frame) -> bool {
        let servomotor_pu = frame.measured.servomotor_position_pu;
        if self.servomotor_pu.is_nan() {
            self.servomotor_pu = servomotor_pu;
        }
        frame.inputs.esv == self.esv
            && (frame.inputs.opening_command_pu - self.command_pu).abs() <= STILL_PU
            && (servomotor_pu.is_nan() || (servomotor_pu - self.servomotor_pu).abs() <= STILL_PU)
    }
}

/// The rows of a stretch behind what is kept of its beginning and before what is kept of its end.
fn middle(frames: &[Frame], stretch: Range<usize>) -> Option<Range<usize>> {
    let (first, last) = (frames.get(stretch.start)?, frames.get(stretch.end.checked_sub(1)?)?);
    let from_ns = first.time_ns + nanos_from_seconds(KEPT_S.0);
    let to_ns = last.time_ns - nanos_from_seconds(KEPT_S.1);
    if seconds_from_nanos(to_ns - from_ns) < LEAST_CUT_S {
        return None;
    }
    let rows = &frames[stretch.clone()];
    let at = |time_ns: i64| stretch.start + rows.partition_point(|frame| frame.time_ns < time_ns);
    Some(at(from_ns)..at(to_ns))
}

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_model::frame::{Inputs, Signals};

    /// A row each 0.1 s; the command steps at 50 s, the piston follows in 10 s; measured in every second row.
    fn frames(length_s: i64) -> Vec<Frame> {
        let frame = |k: i64| {
            let time_s = k as f64 * 0.1;
            let opening_command_pu = if time_s < 50.0 { 0.5 } else { 0.6 };
            let servomotor_position_pu =
                if k % 2 == 0 { 0.5 + 0.1 * ((time_s - 50.0) / 10.0).clamp(0.0, 1.0) } else { f64::NAN };
            Frame {
                time_ns: k * 100_000_000,
                inputs: Inputs {
                    opening_command_pu,
                    esv: EsvState::Normal,
                    tank_pressure_pa: 6e6,
                    piston_force_n: 0.0,
                },
                measured: Signals { servomotor_position_pu, ..Signals::NONE },
            }
        };
        (0..length_s * 10).map(frame).collect()
    }

    #[test]
    fn what_moves_and_what_stands_around_it_is_kept() {
        let frames = frames(200);
        let idle_segments = idle_segments(&frames);
        let times_s: Vec<(f64, f64)> = idle_segments
            .iter()
            .map(|rest| (frames[rest.start].time_ns as f64 * 1e-9, frames[rest.end].time_ns as f64 * 1e-9))
            .collect();
        assert_eq!(idle_segments.len(), 2, "{times_s:?}");
        // Before the step; and after the piston has come to rest at 60 s, to within the dead band.
        assert!((times_s[0].0 - 15.0).abs() < 0.11 && (times_s[0].1 - 44.9).abs() < 0.11, "{times_s:?}");
        assert!((times_s[1].0 - 75.0).abs() < 0.4 && (times_s[1].1 - 194.9).abs() < 0.11, "{times_s:?}");
    }

    #[test]
    fn short_recordings_and_those_without_a_command_stay_whole() {
        assert!(idle_segments(&frames(29)).is_empty());
        let mut silent = frames(200);
        silent.iter_mut().for_each(|frame| frame.inputs.opening_command_pu = f64::NAN);
        assert!(idle_segments(&silent).is_empty());
        assert!(idle_segments(&[]).is_empty());
    }
}
