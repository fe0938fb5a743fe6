//! Which test would tell rivals apart: candidates are simulated with both, and the one in which they differ most is proposed.

use crate::diagnosis::outcome::Experiment;
use crate::frame::{EsvState, Frame, Inputs, Signals};
use crate::parameters::Unit;
use crate::recording::Recording;
use crate::tuning::bench::{Bench, square};
use crate::tuning::noise::expected;
use crate::tuning::trial::Trial;
use crate::twin::Twin;

/// A test: words, length in ms, command and ESV at a time in s, whether the pilot signals are recorded for it.
struct Test {
    words: &'static str,
    length_ms: i64,
    command_pu: fn(f64) -> f64,
    esv: fn(f64) -> EsvState,
    pilot: bool,
}

const NORMAL: fn(f64) -> EsvState = |_| EsvState::Normal;

const TESTS: [Test; 6] = [
    Test {
        words: "dwell at 40 % for 10 s, step to 42 %, dwell, and back, at 100 Hz",
        length_ms: 30_000,
        command_pu: |t| if (10.0..20.0).contains(&t) { 0.42 } else { 0.40 },
        esv: NORMAL,
        pilot: false,
    },
    Test {
        words: "a triangle of ±1.5 % about 40 % with a period of 20 s, through neutral both ways",
        length_ms: 40_000,
        command_pu: |t| 0.40 + 0.015 * (1.0 - 4.0 * ((t / 20.0 + 0.25).fract() - 0.5).abs()),
        esv: NORMAL,
        pilot: false,
    },
    Test {
        words: "trip the ESV from 60 % opening and record until closed",
        length_ms: 12_000,
        command_pu: |_| 0.6,
        esv: |t| if t < 4.0 { EsvState::Normal } else { EsvState::Shutdown },
        pilot: false,
    },
    Test {
        words: "a swept sine of ±1 % about 50 %, from 0.05 to 2 Hz in 40 s",
        length_ms: 40_000,
        command_pu: |t| 0.5 + 0.01 * (std::f64::consts::TAU * (0.05 * t + 0.5 * (1.95 / 40.0) * t * t)).sin(),
        esv: NORMAL,
        pilot: false,
    },
    Test {
        words: "a full stroke from 5 % to 95 % and back, at the speed limits",
        length_ms: 40_000,
        command_pu: |t| if (5.0..22.0).contains(&t) { 0.95 } else { 0.05 },
        esv: NORMAL,
        pilot: false,
    },
    Test {
        words: "record pilot-valve position and control pressure beside the positions, in a full stroke from 5 % to 95 % and back",
        length_ms: 40_000,
        command_pu: |t| if (5.0..22.0).contains(&t) { 0.95 } else { 0.05 },
        esv: NORMAL,
        pilot: true,
    },
];

/// The test as one unit would answer it, with the pilot signals or without.
fn answer(test: &Test, unit: &Unit, pilot: bool) -> Recording {
    let mut twin = Twin::new(unit).with_dither(unit.sensors.servomotor_position_pu.noise);
    let frames = (0..test.length_ms)
        .map(|row| {
            let time_s = row as f64 * 1e-3;
            let inputs = Inputs {
                opening_command_pu: (test.command_pu)(time_s),
                esv: (test.esv)(time_s),
                tank_pressure_pa: unit.parameters.oil.tank_pressure_pa,
            };
            let mut frame = Frame { time_ns: row * 1_000_000, inputs, measured: Signals::NONE };
            if row == 0 {
                frame.measured.servomotor_position_pu = inputs.opening_command_pu;
                frame.measured.spool_position_pu = 0.0;
            }
            let signals = twin.step(&frame).signals;
            if row % 10 == 0 {
                frame.measured = signals;
                if !pilot {
                    frame.measured.pilot_valve_position_pu = f64::NAN;
                    frame.measured.control_pressure_pa = f64::NAN;
                }
            }
            frame
        })
        .collect();
    Recording::new(test.words, frames)
}

/// The best test for telling two models of a unit apart; where the pilot signals are recorded already, nobody is asked to do so.
#[must_use]
pub fn between(ids: [&str; 2], units: [&Unit; 2], pilot_recorded: bool) -> Option<Experiment> {
    TESTS
        .iter()
        .filter(|test| !(test.pilot && pilot_recorded))
        .map(|test| {
            let trial = Trial::new(answer(test, units[0], test.pilot || pilot_recorded));
            let bench = Bench::new(vec![trial], units[0], &expected(&units[0].sensors));
            (square(&vec![bench.misses(units[1], 0)]).sqrt(), test)
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(separation, test)| Experiment {
            separates: ids.iter().map(|id| (*id).to_owned()).collect(),
            test: test.words.to_owned(),
            separation,
        })
}
