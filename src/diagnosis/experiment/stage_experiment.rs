//! Tests of the servomotor stage alone that an operator could run next: the spool is moved by hand, by a script, or by its own regulator.

use crate::experiment::candidate_test::Candidate;
use crate::likelihood::prepared::PreparedRecording;
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::twin::{Cut, Twin};
use govtwin_model::units::nanos_from_seconds;

/// A test: words, length in stroke times, spool position in pu at a time in stroke times, first opening.
struct SpoolCourse {
    words: &'static str,
    length: f64,
    spool_pu: fn(f64) -> f64,
    start_pu: f64,
}

const TESTS: [SpoolCourse; 4] = [
    SpoolCourse {
        words: "hold the spool at 10 %, 25 %, 50 % and 100 % of its stroke in turn, equally long in both directions, from half opening",
        length: 4.0,
        spool_pu: |t| [0.1, -0.1, 0.25, -0.25, 0.5, -0.5, 1.0, -1.0][index(t, 0.5, 8)] * hold(t),
        start_pu: 0.5,
    },
    SpoolCourse {
        words: "move the spool in a small triangle of 5 % through neutral, three times, at half opening",
        length: 6.0,
        spool_pu: |t| 0.05 * (1.0 - 4.0 * ((t / 2.0 + 0.25).fract() - 0.5).abs()),
        start_pu: 0.5,
    },
    SpoolCourse {
        words: "centre the spool at half opening and record the creep of the servomotor, then drive it in both directions at half spool stroke",
        length: 10.0,
        spool_pu: |t| {
            if t < 8.0 {
                0.0
            } else if t < 9.0 {
                0.5
            } else {
                -0.5
            }
        },
        start_pu: 0.5,
    },
    SpoolCourse {
        words: "drive the servomotor over its full stroke and back with the spool fully open",
        length: 3.0,
        spool_pu: |t| if t < 1.5 { 1.0 } else { -1.0 },
        start_pu: 0.05,
    },
];

/// Which part of a test a time falls into.
fn index(t: f64, length: f64, count: usize) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small count, cut off below")]
    let part = (t / length) as usize;
    part.min(count - 1)
}

/// The spool is centred in the last fifth of each half.
fn hold(t: f64) -> f64 {
    if (2.0 * t).fract() < 0.8 { 1.0 } else { 0.0 }
}

/// Rows in a stroke time.
const ROWS: f64 = 400.0;
/// A stroke longer than this is given up, s.
const LONGEST_S: f64 = 1000.0;

fn frame(unit: &Unit, time_s: f64, spool_position_pu: f64, start_pu: f64) -> Frame {
    Frame {
        time_ns: nanos_from_seconds(time_s),
        inputs: Inputs {
            opening_command_pu: f64::NAN,
            esv: EsvState::Normal,
            tank_pressure_pa: unit.parameters.oil.tank_pressure_pa,
            piston_force_n: 0.0,
        },
        measured: Signals { spool_position_pu, servomotor_position_pu: start_pu, ..Signals::NONE },
    }
}

/// Time for a full stroke with the spool fully open, s.
fn stroke_s(unit: &Unit) -> f64 {
    let mut twin = Twin::new(unit).with_cut(Cut::Spool);
    let mut step_s = unit.parameters.regulator.small_loop_period_s;
    let mut time_s = 0.0;
    while time_s < LONGEST_S {
        let opening_pu = twin.step(&frame(unit, time_s, 1.0, 0.02)).signals.servomotor_position_pu;
        if opening_pu > 0.9 {
            break;
        }
        time_s += step_s;
        step_s *= 1.01;
    }
    time_s.max(10.0 * unit.parameters.regulator.small_loop_period_s)
}

/// The tests as a stage would answer them.
pub fn candidates(unit: &Unit) -> Vec<Candidate> {
    let stroke_s = stroke_s(unit);
    let period_s = stroke_s / ROWS;
    let of = |test: &SpoolCourse| {
        let mut twin = Twin::new(unit).with_cut(Cut::Spool);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few thousand rows")]
        let rows = (test.length * ROWS) as u32;
        let row = |k: u32| {
            let t = f64::from(k) / ROWS;
            let mut frame = frame(unit, t * stroke_s, (test.spool_pu)(t), test.start_pu);
            frame.measured.servomotor_position_pu = twin.step(&frame).signals.servomotor_position_pu;
            frame
        };
        Candidate {
            test: test.words.to_owned(),
            unit_state: format!("Bring the servomotor to {:.0} % of its stroke first", 100.0 * test.start_pu),
            recording: PreparedRecording::servomotor_stage(Recording::new(test.words, (0..rows).map(row).collect())),
            script: None,
            rate_hz: (1.0 / period_s).round(),
            faster: false,
        }
    };
    TESTS.iter().map(of).collect()
}
