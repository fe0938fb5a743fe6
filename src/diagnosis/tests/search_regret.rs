//! The search finds what the true values reach: each kind of miss that was met is held here, on recordings of the twin itself.

use govtwin_diagnosis::decision::hyperparameters::Hyperparameters;
use govtwin_diagnosis::generate::{Scenario, recording, spread};
use govtwin_diagnosis::hypotheses::table::EvidenceRow;
use govtwin_diagnosis::identification::calibration::calibrate;
use govtwin_diagnosis::identification::free_parameter::FreeParameter;
use govtwin_diagnosis::likelihood::noise::expected;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_diagnosis::result::Diagnosis;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::{DiagnosisSettings, diagnose};
use govtwin_model::effects::find;
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::params::reference;
use govtwin_model::recording::{Process, Recording};

/// Most regret of a search that found the optimum, as a share of χ².
const SMALL_REGRET: f64 = 0.01;

/// A unit within its tolerances with one effect of this size.
fn unit(id: &str, size: f64) -> Unit {
    let mut unit = spread(&reference(), 5);
    unit.effects.push(EffectSetting { id: id.to_owned(), values: find(id).unwrap().completed(&[size]) });
    unit
}

fn recordings(unit: &Unit, processes: &[Process]) -> Vec<Recording> {
    let scenario =
        |process| Scenario { unit: unit.clone(), process, rate_hz: 100.0, duration_s: 40.0, rich: false, seed: 5 };
    processes.iter().map(|&process| recording(&scenario(process))).collect()
}

fn diagnosed(unit: &Unit, processes: &[Process], tried: &[&str], true_values: Option<Unit>) -> Diagnosis {
    let catalogue = tried.iter().filter_map(|id| find(id)).collect();
    let settings = DiagnosisSettings { catalogue, true_values, ..DiagnosisSettings::default() };
    diagnose(recordings(unit, processes), &reference(), &settings, &|_, _| ()).unwrap()
}

/// The size fitted to an effect alone, in its unit.
fn size(said: &Diagnosis, id: &str) -> f64 {
    let row = said.table.rows.iter().find(|row| row.effects == [id]).unwrap();
    let parameter = find(id).unwrap().parameters[0];
    parameter.neutral + row.sizes[0] * (parameter.typical - parameter.neutral)
}

/// A leak of seven typical sizes: a null shift of the pilot valve and a stretched sheet make up for most of it.
#[test]
fn a_large_chamber_leak_is_found_behind_a_stretched_sheet() {
    let leak_m3_s_pa = 3.76e-11;
    let unit = unit("chamber_leak", leak_m3_s_pa);
    let tried = ["chamber_leak", "pv_null_shift", "lvdt_bias", "pilot_filter"];
    let said = diagnosed(&unit, &Process::ALL, &tried, Some(unit.clone()));
    let regret = said.regret.as_ref().unwrap();
    assert!(regret.share() < SMALL_REGRET, "{regret:?}");
    let found = size(&said, "chamber_leak");
    assert!((found / leak_m3_s_pa - 1.0).abs() < 0.15, "{found}");
}

/// A loop swings just so in a narrow band of sizes, which lies between those of a grid.
#[test]
fn the_size_that_makes_a_loop_swing_is_found() {
    let frequency_ratio = 0.1;
    let unit = unit("pv_bandwidth", frequency_ratio);
    let tried = ["pv_bandwidth", "pv_hysteresis", "lvdt_bias"];
    let said = diagnosed(&unit, &[Process::LoadIncrease, Process::Shutdown], &tried, Some(unit.clone()));
    // Where a loop swings χ² is rough, and a fit ends in one of many hollows near the best.
    let regret = said.regret.as_ref().unwrap();
    assert!(regret.share() < 0.5, "{regret:?}");
    let found = size(&said, "pv_bandwidth");
    assert!((found / frequency_ratio - 1.0).abs() < 0.1, "{found}");
}

/// A clock that is 80 ms off, for which two delays together would stand.
#[test]
fn a_large_clock_offset_is_one_effect_and_not_two_delays() {
    let offset_s = -0.08;
    let unit = unit("clock_offset", offset_s);
    let tried = ["clock_offset", "command_delay", "esv_delay", "esv_slow"];
    let processes = [Process::LoadIncrease, Process::Shutdown, Process::LoadRejection];
    let said = diagnosed(&unit, &processes, &tried, Some(unit.clone()));
    let regret = said.regret.as_ref().unwrap();
    assert!(regret.share() < SMALL_REGRET, "{regret:?}");
    let found = size(&said, "clock_offset");
    assert!((found - offset_s).abs() < 2.0e-3, "{found}");
    let ids: Vec<&str> = said.blamed.iter().map(|one| one.id.as_str()).collect();
    assert_eq!(ids, ["clock_offset"], "{:?}", said.ranking);
    // What leads the search leads the posterior.
    let table = &said.table;
    let none = table.rows.iter().find(|row| row.effects.is_empty()).unwrap().cost;
    let score = |row: &EvidenceRow| Hyperparameters::shipped().score(table.samples, none, row.cost, row.effects.len());
    assert!(table.rows.len() > 4 && table.rows.is_sorted_by(|a, b| score(a) >= score(b)), "{:?}", table.rows);
}

/// The same of a fit whose effect is chosen.
#[test]
fn a_fit_finds_a_large_chamber_leak_from_its_profile() {
    let leak_m3_s_pa = 3.76e-11;
    let prepared = recordings(&unit("chamber_leak", leak_m3_s_pa), &Process::ALL);
    let prepared = prepared.into_iter().map(PreparedRecording::new).collect();
    let mut base = reference();
    let spec = find("chamber_leak").unwrap();
    base.effects.push(EffectSetting { id: spec.id.to_owned(), values: vec![spec.parameters[0].neutral] });
    let mut free_parameters = FreeParameter::nuisances(&base);
    free_parameters.push(FreeParameter::Effect { effect: 0, parameter: 0, spec: &spec.parameters[0] });
    let (_, fitted) = calibrate(prepared, &base, free_parameters, &expected(&base.sensors), 1, &|| ());
    let found = fitted.unit.effects[0].values[0];
    assert!((found / leak_m3_s_pa - 1.0).abs() < 0.15, "{found}");
}

/// True values are for the regret alone.
#[test]
fn true_values_change_nothing_but_the_regret() {
    let unit = unit("lvdt_bias", 0.03);
    let processes = [Process::Startup, Process::LoadRejection];
    let of = |true_values| diagnosed(&unit, &processes, &["lvdt_bias", "feedback_lag"], true_values);
    let (blind, mut told) = (of(None), of(Some(unit.clone())));
    assert!(blind.regret.is_none() && told.regret.take().is_some_and(|regret| regret.share() < SMALL_REGRET));
    let json = |said: &Diagnosis| DiagnosisReport::of(said, 1.0).json();
    assert_eq!(json(&told), json(&blind));
}
