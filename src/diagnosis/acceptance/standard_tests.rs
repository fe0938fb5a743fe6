//! The movements of an acceptance test, run by a twin: strokes, steps, a slow triangle, a sum of sines, a trip.
//!
//! They show what recordings of ordinary operation do not: a running unit is never opened at its full rate.

use std::f64::consts::TAU;

use super::series::Series;
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::parameters::Unit;
use govtwin_model::twin::Twin;
use govtwin_model::units::nanos_from_seconds;

/// Time between two samples, s.
const PERIOD_S: f64 = 0.01;
/// Steps about half opening, pu, each held for [`STEP_S`].
const STEPS_PU: [f64; 8] = [0.50, 0.52, 0.50, 0.55, 0.50, 0.40, 0.45, 0.50];
/// How long each is held, s.
const STEP_S: f64 = 7.0;
/// Longest stroke that is waited for, s.
const STROKE_S: f64 = 40.0;
/// Amplitude of the slow triangle, pu, and its period, s.
const TRIANGLE: (f64, f64) = (0.005, 12.0);
/// Frequencies of the sines, Hz; all are whole cycles of 10 s.
const SINES_HZ: [f64; 12] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6];
/// Amplitude of each, pu, falling with the square root of frequency.
const SINE_PU: f64 = 0.004;

/// Command and ESV over time, s.
type InputCourse = dyn Fn(f64) -> (f64, EsvState);

/// Runs all tests; a series for each.
pub fn run(unit: &Unit) -> Vec<Series> {
    let tests: [(&str, f64, f64, &InputCourse); 5] = [
        ("strokes", 0.0, 2.0 * STROKE_S + 2.0, &strokes),
        ("steps", 0.5, STEP_S * STEPS_PU.len() as f64, &steps),
        ("slow triangle", 0.5, 4.5 * TRIANGLE.1, &triangle),
        ("sines", 0.5, 50.0, &sines),
        ("trip", 0.8, STROKE_S, &trip),
    ];
    tests
        .into_iter()
        .filter_map(|(name, start_pu, length_s, test)| series(unit, name, (start_pu, length_s), test))
        .collect()
}

fn strokes(time_s: f64) -> (f64, EsvState) {
    let open = (2.0..2.0 + STROKE_S).contains(&time_s);
    (if open { 1.0 } else { 0.0 }, EsvState::Normal)
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a handful of steps")]
fn steps(time_s: f64) -> (f64, EsvState) {
    let at = (time_s / STEP_S).floor().clamp(0.0, STEPS_PU.len() as f64 - 1.0) as usize;
    (STEPS_PU[at], EsvState::Normal)
}

fn triangle(time_s: f64) -> (f64, EsvState) {
    let turn = (time_s / TRIANGLE.1 + 0.25).rem_euclid(1.0);
    let shape = if turn < 0.5 { 4.0 * turn - 1.0 } else { 3.0 - 4.0 * turn };
    (0.5 + TRIANGLE.0 * shape, EsvState::Normal)
}

fn sines(time_s: f64) -> (f64, EsvState) {
    let of = |(k, frequency_hz): (usize, &f64)| {
        // Phases by Schroeder's rule (1970), which keep the sum low.
        let phase = -std::f64::consts::PI * (k * (k + 1)) as f64 / SINES_HZ.len() as f64;
        SINE_PU / (frequency_hz / SINES_HZ[0]).sqrt() * (TAU * frequency_hz * time_s + phase).cos()
    };
    (0.5 + SINES_HZ.iter().enumerate().map(of).sum::<f64>(), EsvState::Normal)
}

fn trip(time_s: f64) -> (f64, EsvState) {
    if time_s < 2.0 { (0.8, EsvState::Normal) } else { (0.0, EsvState::Shutdown) }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few thousand samples")]
fn series(unit: &Unit, name: &str, (start_pu, length_s): (f64, f64), test: &InputCourse) -> Option<Series> {
    let mut twin = Twin::new(unit);
    let count = (length_s / PERIOD_S) as usize;
    let time_s: Vec<f64> = (0..count).map(|i| i as f64 * PERIOD_S).collect();
    let acting: Vec<(f64, EsvState)> = time_s.iter().map(|t| test(*t)).collect();
    let lookahead_s = twin.plant().lookahead_s;
    let mut positions_pu = Vec::with_capacity(count);
    for time in &time_s {
        // An input clock that is ahead brings the command earlier.
        let (opening_command_pu, esv) = test((time + lookahead_s).max(0.0));
        let tank_pressure_pa = unit.parameters.oil.tank_pressure_pa;
        let measured = Signals { servomotor_position_pu: start_pu, ..Signals::NONE };
        let inputs = Inputs { opening_command_pu, esv, tank_pressure_pa, piston_force_n: 0.0 };
        let frame = Frame { time_ns: nanos_from_seconds(*time), inputs, measured };
        positions_pu.push(twin.step(&frame).signals.servomotor_position_pu);
    }
    let command_pu = acting.iter().map(|acting| acting.0).collect();
    let tripped = acting.iter().map(|acting| acting.1 == EsvState::Shutdown).collect();
    let series = Series::new(name, time_s, command_pu, positions_pu, tripped)?;
    Some(Series { noise_pu: 0.0, margin_pu: 0.0, ..series })
}

#[cfg(test)]
mod tests {
    use super::run;
    use crate::acceptance::{Measure, measure};
    use govtwin_model::params;

    #[test]
    fn the_tests_show_every_measure_of_the_reference_unit() {
        let measures = measure(&run(&params::reference()));
        for found in &measures.found {
            assert!(found.value.is_some(), "{found:?}");
        }
        let value = |measure| measures.value(measure).unwrap().value;
        // The plate of the reference unit: its dead band is 0.1 % of stroke.
        assert!((value(Measure::DeadBand) - 1.0e-3).abs() < 3e-4, "{:?}", measures.of(Measure::DeadBand));
        assert!((3.0..12.0).contains(&value(Measure::OpeningTime)), "{:?}", measures.of(Measure::OpeningTime));
        assert!((3.0..12.0).contains(&value(Measure::ClosingTime)), "{:?}", measures.of(Measure::ClosingTime));
        assert!(value(Measure::Overshoot) < 0.2 && value(Measure::DeadTime) < 0.3);
    }
}
