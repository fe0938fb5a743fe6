//! The battery's plants: as large as their unit, like the twin or not, and answering tests.

use rayon::prelude::IntoParallelRefIterator;

use super::*;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_diagnosis::result::test_script::{CommandShape, TestScript};
use govtwin_model::twin::Twin;

/// On a unit of another size faults are as many times as large as the unit is, and the plant runs as on the reference unit.
#[test]
fn faults_grow_with_the_unit() {
    let sheet = govtwin_model::params::reference();
    let mut large = sheet.clone();
    large.parameters.oil.tank_pressure_pa = 1.6e7;
    large.parameters.servomotor.opening_area_m2 *= 4.0;
    let drawn = |id: &str, unit: &Unit| truth(id, &mut Draw::new(3, Question::Size, 0), &unit.parameters).unwrap().size;
    let ratio = 4.0 * 1.6e7 / 6.3e6;
    for id in ["servo_friction", "surge"] {
        assert!((drawn(id, &large) / drawn(id, &sheet) / ratio - 1.0).abs() < 1e-12, "{id}");
    }
    assert_eq!(drawn("backlash", &large).to_bits(), drawn("backlash", &sheet).to_bits());
}

/// A unit of 4 m³ at 160 bar: its plant stays within its ends and pressures, and its noise is that of the reference unit.
#[test]
fn a_large_unit_runs_through_all_processes() {
    let given = [
        "tank_pressure=160 bar",
        "servomotor_stroke=1200 mm",
        "servomotor_volume=4 m3",
        "opening_time=12 s",
        "closing_time=9 s",
    ];
    let values = given.iter().map(|text| govtwin_diagnosis::sheet::plate_file::plate_value(text).unwrap()).collect();
    let plate = govtwin_diagnosis::sheet::Plate { name: String::new(), values };
    let mut unit = govtwin_diagnosis::sheet::derive(&plate, &govtwin_model::params::reference()).unwrap().unit;
    // Wide tolerances of a plate are no spread of units.
    unit.tolerances.iter_mut().for_each(|tolerance| *tolerance = None);
    for case in plan::plan(6, 4, &plan::BatteryRates::OneOf(vec![100.0]), &[1.0]) {
        for (process, streams) in make(&unit, &case).streams {
            let rows = &streams.servo_state;
            assert!(rows.len() > 1000, "{}, {process:?}: {} rows", case.name, rows.len());
            let position = |signals: &Signals| Signal::ServomotorPosition.of(signals);
            let out = rows.iter().find(|(_, signals)| !(-0.05..=1.05).contains(&position(signals)));
            assert!(out.is_none(), "{}, {process:?}: {out:?} of {} rows", case.name, rows.len());
        }
    }
}

/// The plant answers a proposed test from its first opening on; the twin itself, and a stage alone, answer none.
#[test]
fn a_plant_answers_a_proposed_test() {
    let sheet = govtwin_model::params::reference();
    let script = TestScript { start_pu: 0.4, shape: CommandShape::Step { by_pu: 0.1 }, length_s: 12.0 };
    let proposed = Experiment {
        records: vec![Signal::ControlPressure],
        rate_hz: 50.0,
        script: Some(script),
        ..Experiment::default()
    };
    let kind = CaseKind::Single("load".to_owned());
    let case = Case { name: String::new(), kind, rate_hz: 100.0, rich: false, mismatch: 1.0, seed: 4, alone: None };
    let streams = answer(&sheet, &case, &proposed).unwrap();
    let (rows, last) = (&streams.servo_state, streams.servo_state.len() - 1);
    assert_eq!(rows.len(), 601);
    let at = |row: usize| rows[row].1.servomotor_position_pu;
    assert!((at(0) - 0.4).abs() < 0.02 && (at(390) - 0.5).abs() < 0.02 && (at(last) - 0.4).abs() < 0.02);
    assert!(rows.iter().all(|(_, signals)| signals.control_pressure_pa.is_finite()));
    let silent = [Case { mismatch: 0.0, ..case.clone() }, Case { alone: Some(true), ..case }];
    assert!(silent.iter().all(|case| answer(&sheet, case, &proposed).is_none()));
}

/// Where the plant is the twin itself it has the twin's equations: with its true values the twin leaves the transducers' noise alone.
#[test]
fn at_no_mismatch_the_plant_is_the_twin() {
    let sheet = govtwin_model::params::reference();
    let kind = CaseKind::Single("servo_leak".to_owned());
    let case = Case { name: String::new(), kind, rate_hz: 100.0, rich: false, mismatch: 0.0, seed: 4, alone: None };
    let truth = true_values(&sheet, &case).unwrap();
    assert_eq!(truth.effects.len(), 1);
    assert!(strength(&sheet, &case) > 1.0);
    for recording in make(&sheet, &case).recordings() {
        let recording = PreparedRecording::new(recording);
        let estimates = recording.run(&mut Twin::new(&truth));
        let square = estimates.iter().zip(&recording.samples).map(|(estimate, &row)| {
            (recording.frames[row].measured.servomotor_position_pu - estimate.signals.servomotor_position_pu).powi(2)
        });
        let rms = (square.sum::<f64>() / estimates.len() as f64).sqrt();
        assert!(rms < 2.0 * truth.sensors.servomotor_position_pu.noise, "{}: {rms}", recording.name);
    }
}

/// Each fault is the catalogue's effect in kind and size, though not in its equation: the twin with the effect comes
/// near to what its transducer's noise allows, and not all the way in every case.
#[test]
fn faults_are_the_catalogues_in_kind_but_not_in_law() {
    let unit = govtwin_model::params::reference();
    let shown_by = [
        ("command_delay", Process::LoadRejection),
        ("command_gain", Process::LoadRejection),
        ("regulator_cycle", Process::LoadRejection),
        ("current_limit", Process::LoadRejection),
        ("esv_delay", Process::Shutdown),
        ("esv_slow", Process::Shutdown),
        ("viscosity", Process::LoadRejection),
        ("port_overlap", Process::LoadRejection),
        ("servo_friction", Process::LoadRejection),
        ("servo_leak", Process::LoadIncrease),
        ("cushion", Process::Shutdown),
        ("load", Process::LoadRejection),
        ("supply_loss", Process::LoadRejection),
        ("return_loss", Process::LoadRejection),
        ("feedback_bias", Process::Shutdown),
        ("lvdt_gain", Process::LoadRejection),
        ("feedback_lag", Process::LoadRejection),
    ];
    shown_by.par_iter().for_each(|&(id, process)| {
        let kind = CaseKind::Single(id.to_owned());
        let case =
            Case { name: String::new(), kind, rate_hz: 100.0, rich: false, mismatch: 1.0, seed: 21, alone: None };
        let (bench, effects) = bench(&unit, &case);
        let recording = PreparedRecording::new(Recording::new(id, bench.record(process).0.rows()));
        let residual = |effects: Vec<EffectSetting>| {
            let unit = Unit { parameters: bench.parameters, effects, ..unit.clone() };
            let estimates = recording.run(&mut Twin::new(&unit));
            let square = estimates.iter().zip(&recording.samples).map(|(estimate, &row)| {
                (recording.frames[row].measured.servomotor_position_pu - estimate.signals.servomotor_position_pu)
                    .powi(2)
            });
            (square.sum::<f64>() / estimates.len() as f64).sqrt()
        };
        let without = residual(vec![]);
        let mut values: Vec<f64> = find(id).unwrap().parameters.iter().map(|p| p.typical).collect();
        values[0] = effects[0].size;
        let with = residual(vec![EffectSetting { id: id.to_owned(), values }]);
        assert!(with < 0.55 * without, "{id}: {with} with, {without} without");
    });
}
