//! Inputs between slow samples: a command runs straight from each sample to the next, and the tank pressure with it.
//!
//! A twin holds the last command it heard. Where a recorder writes five rows a second, a held command is late by half a row on average: along a
//! ramp of 0.04 pu/s the servomotor then misses its place by 0.004 pu, thirty times its transducer's noise.

use crate::frame::Frame;
use crate::units::nanos_from_seconds;

/// Time between the rows laid in, s: the period of a usual regulator.
const STEP_S: f64 = 0.010;

/// A command that stays away for longer than so many sampling periods is held.
const LONGEST_PERIODS: f64 = 3.0;

/// Rows with further ones between, where the command and the tank pressure run straight from sample to sample; the ESV stays as recorded, and where
/// it trips nothing runs straight.
///
/// `is_sample` tells the rows at which a command came with a sample; rows between them take the straight line's command too.
#[must_use]
pub fn filled(frames: &[Frame], is_sample: impl Fn(&Frame) -> bool, period_s: f64) -> Vec<Frame> {
    let step_ns = nanos_from_seconds(STEP_S);
    let longest_ns = nanos_from_seconds(LONGEST_PERIODS * period_s);
    let mut all = Vec::with_capacity(frames.len());
    let mut from = 0;
    for to in 1..frames.len() {
        let is_new = frames[to].inputs.opening_command_pu != frames[to - 1].inputs.opening_command_pu;
        if !is_new && !is_sample(&frames[to]) {
            continue;
        }
        let (first, last) = (&frames[from], &frames[to]);
        let span_ns = last.time_ns - first.time_ns;
        // Who trips drops the command too.
        if span_ns <= longest_ns && first.inputs.esv == last.inputs.esv {
            for pair in frames[from..=to].windows(2) {
                let count = (pair[1].time_ns - pair[0].time_ns + step_ns - 1) / step_ns;
                for k in 0..count.max(1) {
                    let time_ns = pair[0].time_ns + k * step_ns;
                    let mut frame = straight(first, last, time_ns);
                    frame.inputs.esv = pair[0].inputs.esv;
                    if k == 0 {
                        frame.measured = pair[0].measured;
                    }
                    all.push(frame);
                }
            }
        } else {
            all.extend_from_slice(&frames[from..to]);
        }
        from = to;
    }
    all.extend_from_slice(&frames[from..]);
    all
}

/// What two frames' inputs are between them, with nothing measured.
fn straight(first: &Frame, last: &Frame, time_ns: i64) -> Frame {
    let share = (time_ns - first.time_ns) as f64 / (last.time_ns - first.time_ns).max(1) as f64;
    let between = |first: f64, last: f64| if last.is_finite() { first + share * (last - first) } else { first };
    let mut inputs = first.inputs;
    inputs.opening_command_pu = between(inputs.opening_command_pu, last.inputs.opening_command_pu);
    inputs.tank_pressure_pa = between(inputs.tank_pressure_pa, last.inputs.tank_pressure_pa);
    Frame { time_ns, inputs, measured: crate::frame::Signals::NONE }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{EsvState, Inputs, Signals};

    /// A row each 0.2 s of a command that rises by 0.1 pu/s, with a heartbeat of the ESV between the second and the third.
    fn rows() -> Vec<Frame> {
        let row = |time_ms: i64, command_pu: f64, servomotor_pu: f64| Frame {
            time_ns: time_ms * 1_000_000,
            inputs: Inputs { opening_command_pu: command_pu, esv: EsvState::Normal, tank_pressure_pa: 6e6 },
            measured: Signals { servomotor_position_pu: servomotor_pu, ..Signals::NONE },
        };
        vec![row(0, 0.3, 0.3), row(200, 0.32, 0.31), row(305, 0.32, f64::NAN), row(400, 0.34, 0.33)]
    }

    fn is_sample(frame: &Frame) -> bool {
        frame.measured.servomotor_position_pu.is_finite()
    }

    /// Rows so that those at which nothing was measured compare equal.
    fn said(frames: &[Frame]) -> String {
        format!("{frames:?}")
    }

    #[test]
    fn a_command_runs_straight_between_slow_samples() {
        let filled = filled(&rows(), is_sample, 0.2);
        assert!(filled.windows(2).all(|two| (1..=10_000_000).contains(&(two[1].time_ns - two[0].time_ns))));
        for frame in &filled {
            let expected_pu = 0.3 + 1e-10 * frame.time_ns as f64;
            assert!((frame.inputs.opening_command_pu - expected_pu).abs() < 1e-12, "{frame:?}");
        }
        let kept: Vec<Frame> = filled.into_iter().filter(is_sample).collect();
        assert_eq!(said(&kept), said(&rows().into_iter().filter(is_sample).collect::<Vec<_>>()));
    }

    #[test]
    fn nothing_runs_straight_through_a_trip_or_a_long_silence() {
        let mut tripped = rows();
        tripped[3].inputs.esv = EsvState::Shutdown;
        let held = |frames: &[Frame], period_s: f64| {
            let filled = filled(frames, is_sample, period_s);
            filled.iter().filter(|frame| frame.time_ns > 200_000_000).copied().collect::<Vec<_>>()
        };
        assert_eq!(said(&held(&tripped, 0.2)), said(&tripped[2..]));
        assert_eq!(said(&held(&rows(), 0.06)), said(&rows()[2..]), "0.2 s are more than three periods of 0.06 s");
    }
}
