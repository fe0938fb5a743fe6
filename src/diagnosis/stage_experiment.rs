//! Which test of the servomotor stage alone would tell rivals apart: the spool is moved by hand, by a script, or by its own regulator.

use crate::diagnosis::outcome::Experiment;
use crate::frame::{Estimate, EsvState, Frame, Inputs, Signals};
use crate::parameters::Unit;
use crate::twin::{Cut, Twin};
use crate::units::nanos_from_seconds;

/// A test: words, length in stroke times, spool position in pu at a time in stroke times, first opening.
struct Test {
    words: &'static str,
    length: f64,
    spool_pu: fn(f64) -> f64,
    start_pu: f64,
    /// Judged by the pressures of both chambers instead of the position.
    pressures: bool,
}

const TESTS: [Test; 5] = [
    Test {
        words: "hold the spool at 10 %, 25 %, 50 % and 100 % of its stroke in turn, each as long one way as the other, from half opening",
        length: 4.0,
        spool_pu: |t| [0.1, -0.1, 0.25, -0.25, 0.5, -0.5, 1.0, -1.0][index(t, 0.5, 8)] * hold(t),
        start_pu: 0.5,
        pressures: false,
    },
    Test {
        words: "move the spool in a small triangle of 5 % through neutral, three times, at half opening",
        length: 6.0,
        spool_pu: |t| 0.05 * (1.0 - 4.0 * ((t / 2.0 + 0.25).fract() - 0.5).abs()),
        start_pu: 0.5,
        pressures: false,
    },
    Test {
        words: "centre the spool at half opening and watch the servomotor creep, then drive it both ways at half spool stroke",
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
        pressures: false,
    },
    Test {
        words: "drive the servomotor over its whole stroke and back with the spool fully open",
        length: 3.0,
        spool_pu: |t| if t < 1.5 { 1.0 } else { -1.0 },
        start_pu: 0.05,
        pressures: false,
    },
    Test {
        words: "record the pressures of both servomotor chambers while it moves each way at a quarter and at full spool stroke",
        length: 4.0,
        spool_pu: |t| [0.25, -0.25, 1.0, -1.0][index(t, 1.0, 4)] * hold(t),
        start_pu: 0.5,
        pressures: true,
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
/// Accuracy of a pressure transducer, Pa: half a percent of a usual tank.
const PRESSURE_NOISE_PA: f64 = 3.0e4;

fn frame(unit: &Unit, time_s: f64, spool_position_pu: f64, start_pu: f64) -> Frame {
    Frame {
        time_ns: nanos_from_seconds(time_s),
        inputs: Inputs {
            opening_command_pu: f64::NAN,
            esv: EsvState::Normal,
            tank_pressure_pa: unit.parameters.oil.tank_pressure_pa,
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

fn answer(test: &Test, unit: &Unit, stroke_s: f64) -> Vec<Estimate> {
    let mut twin = Twin::new(unit).with_cut(Cut::Spool);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few thousand rows")]
    let rows = (test.length * ROWS) as u32;
    let row = |k: u32| {
        let t = f64::from(k) / ROWS;
        twin.step(&frame(unit, t * stroke_s, (test.spool_pu)(t), test.start_pu))
    };
    (0..rows).map(row).collect()
}

/// The best test for telling two models of a stage apart; `noise_pu` is what a free run misses anyway.
#[must_use]
pub fn between(ids: [&str; 2], units: [&Unit; 2], noise_pu: f64) -> Option<Experiment> {
    let stroke_s = stroke_s(units[0]);
    TESTS
        .iter()
        .map(|test| {
            let [one, other] = units.map(|unit| answer(test, unit, stroke_s));
            let square = |a: &Estimate, b: &Estimate| {
                if test.pressures {
                    let opening = a.opening_chamber_pressure_pa - b.opening_chamber_pressure_pa;
                    let closing = a.closing_chamber_pressure_pa - b.closing_chamber_pressure_pa;
                    0.5 * (opening * opening + closing * closing) / (PRESSURE_NOISE_PA * PRESSURE_NOISE_PA)
                } else {
                    let miss = a.signals.servomotor_position_pu - b.signals.servomotor_position_pu;
                    miss * miss / (noise_pu * noise_pu).max(1e-12)
                }
            };
            let mean = one.iter().zip(&other).map(|(a, b)| square(a, b)).sum::<f64>() / one.len().max(1) as f64;
            (mean.sqrt(), test)
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(separation, test)| Experiment {
            separates: ids.iter().map(|id| (*id).to_owned()).collect(),
            test: test.words.to_owned(),
            separation,
        })
}
