//! A unit of which nobody has a sheet: what its recordings say of it, what they must hold, and a diagnosis by it. Synthetic recordings.
#![cfg(feature = "cli")]

#[path = "support/program.rs"]
mod program;

use std::fs;
use std::path::Path;
use std::process::Command;

use govtwin_diagnosis::generate::{self, Scenario};
use govtwin_diagnosis::sheet::plate_file;
use govtwin_diagnosis::sheet::recorded::{Filled, NotEnough, fill};
use govtwin_diagnosis::sheet::{Plate, derive};
use govtwin_model::frame::Frame;
use govtwin_model::parameters::{ENTRIES, Unit};
use govtwin_model::params;
use govtwin_model::recording::{Process, Recording};
use program::Run;
use serde_json::Value;

fn recordings(unit: &Unit, seed: u64, rate_hz: f64) -> Vec<Recording> {
    let of = |process| Scenario { unit: unit.clone(), process, rate_hz, duration_s: 60.0, rich: false, seed };
    Process::ALL.into_iter().map(|process| generate::recording(&of(process))).collect()
}

fn value(unit: &Unit, key: &str) -> f64 {
    let entry = ENTRIES.iter().find(|entry| entry.key == key).unwrap();
    (entry.get)(&unit.parameters)
}

/// A unit unlike the reference unit in what the recordings can say.
fn other(seed: u64) -> Unit {
    let mut unit = generate::spread(&params::reference(), seed);
    unit.parameters.regulator.position_gain = 18.0;
    unit.parameters.main_ports.width_m *= 0.6;
    unit.parameters.distributing_valve.stroke_min_m = -0.011;
    unit.parameters.oil.tank_pressure_pa = 5.0e6;
    unit.sensors.spool_position_pu.noise *= 3.0;
    unit
}

fn made_of(recordings: &[Recording]) -> (Unit, Plate, Filled) {
    let reference = params::reference();
    let mut plate = Plate::default();
    let recorded = fill(&mut plate, recordings, &reference).unwrap();
    let derived = derive(&plate, &reference).unwrap_or_else(|problems| panic!("{problems:?}"));
    (derived.unit, plate, recorded)
}

#[test]
fn pressure_stops_speed_and_gain_are_read_off_the_recordings() {
    for (seed, rate_hz) in [(1, 100.0), (2, 100.0), (3, 5.0), (4, 5.0)] {
        let unit = other(seed);
        let (made, plate, recorded) = made_of(&recordings(&unit, seed, rate_hz));
        let near = |key: &str, share: f64| {
            let [found, truly] = [&made, &unit].map(|unit| value(unit, key));
            assert!((found / truly).ln().abs() < share, "{key} at {rate_hz} Hz, seed {seed}: {found} for {truly}");
        };
        near("oil.tank_pressure_pa", 0.03);
        near("regulator.position_gain", 0.3);
        near("distributing_valve.stroke_min_m", 0.08); // stops yield
        near("main_ports.width_m", 0.25);
        // Positions do not say how large it is: the reference unit's size, in a sentence.
        assert_eq!(plate.get("servomotor_volume"), Some(0.12));
        assert!(recorded.assumed[0].contains("servomotor's size"), "{:?}", recorded.assumed);
        let [found, truly] = [recorded.sensors, unit.sensors].map(|sensors| sensors.spool_position_pu.noise);
        assert!((0.5..4.0).contains(&(found / truly)), "noise {found} for {truly}");
    }
}

#[test]
fn what_the_plate_says_is_kept() {
    let recordings = recordings(&other(5), 5, 100.0);
    let mut plate = Plate::default();
    for text in ["position_gain=25", "spool_stroke=20 mm", "servomotor_volume=60 L", "servomotor_stroke=400 mm"] {
        let (key, given) = plate_file::plate_value(text).unwrap();
        plate.values.insert(key, given);
    }
    let recorded = fill(&mut plate, &recordings, &params::reference()).unwrap();
    assert_eq!(plate.get("position_gain"), Some(25.0));
    assert_eq!(plate.get("servomotor_volume"), Some(0.06));
    // Stops are shares of the spool's stroke.
    let stop_m = plate.get("spool_closing_stop").unwrap();
    assert!((stop_m / (0.02 * 11.0 / 15.0) - 1.0).abs() < 0.08, "{stop_m}");
    assert!(recorded.assumed.is_empty(), "{:?}", recorded.assumed);
}

#[test]
fn a_stop_on_the_plate_says_how_long_the_spools_stroke_is() {
    let recordings = recordings(&other(5), 5, 100.0);
    let mut plate = Plate::default();
    let (key, given) = plate_file::plate_value("spool_closing_stop=20 mm").unwrap();
    plate.values.insert(key, given);
    fill(&mut plate, &recordings, &params::reference()).unwrap();
    let (_, without, _) = made_of(&recordings);
    let shown = without.get("spool_opening_stop").unwrap() / 0.015;
    let stop_m = plate.get("spool_opening_stop").unwrap();
    assert!((stop_m / 0.02 - shown).abs() < 1e-9, "{stop_m} m for {shown} of the stroke");
}

#[test]
fn a_spool_that_stands_with_its_deviation_is_at_no_stop() {
    // A slow ramp: the spool stands at what the ramp takes, far from its stops.
    let mut recording = recordings(&params::reference(), 6, 100.0).remove(1);
    for (k, frame) in recording.frames.iter_mut().enumerate() {
        let time_s = k as f64 * 0.01;
        frame.measured.spool_position_pu = 0.2;
        frame.measured.servomotor_position_pu = 0.1 + 0.01 * time_s;
        frame.inputs.opening_command_pu = 0.1 + 0.01 * time_s + 0.007;
    }
    let mut plate = Plate::default();
    fill(&mut plate, &[recording], &params::reference()).unwrap();
    let opening = &plate.values["spool_opening_stop"];
    assert!((opening.value - 1.25 * 0.2 * 0.015).abs() < 1e-9, "{opening:?}");
    assert!(opening.text.contains("nothing shows the stop") && opening.tolerance_share > Some(0.1), "{opening:?}");
    assert!(!plate.values.contains_key("spool_closing_stop"));
}

#[test]
fn what_cannot_make_a_unit_is_refused_by_its_reason() {
    let recordings = recordings(&params::reference(), 4, 100.0);
    let refused = |change: &dyn Fn(&mut Frame)| {
        let mut changed = recordings.clone();
        changed.iter_mut().flat_map(|recording| &mut recording.frames).for_each(change);
        fill(&mut Plate::default(), &changed, &params::reference()).unwrap_err()
    };
    assert_eq!(refused(&|frame| frame.inputs.tank_pressure_pa = f64::NAN), NotEnough::TankPressure);
    assert_eq!(refused(&|frame| frame.inputs.opening_command_pu = f64::NAN), NotEnough::Command);
    assert_eq!(refused(&|frame| frame.measured.spool_position_pu = f64::NAN), NotEnough::Positions);
    assert_eq!(refused(&|frame| frame.measured.spool_position_pu *= -1.0), NotEnough::Turned);
    assert_eq!(refused(&|frame| frame.measured.spool_position_pu = 0.0), NotEnough::Speed);
}

fn govtwin(args: &[&str]) -> Run {
    Run::of(Command::new(env!("CARGO_BIN_EXE_govtwin")).args(args))
}

fn case(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/practice").join(name).display().to_string()
}

#[test]
fn a_unit_without_a_sheet_is_diagnosed_whole_and_its_sheet_lies_beside_the_report() {
    let dir = tempfile::tempdir().unwrap();
    let (out, again) = (dir.path().join("alone"), dir.path().join("again"));
    let text = |path: &Path| path.display().to_string();
    let run = govtwin(&["diagnose", "--no-sheet", &case("case_03"), "--out", &text(&out)]);
    // An assumed sheet is something to look into.
    assert_eq!(run.code, 3, "{}", run.stderr);
    assert!(run.stdout.contains("unit: made of the recordings"), "{}", run.stdout);
    assert!(run.stderr.contains("No data sheet: the unit was made of the recordings"), "{}", run.stderr);
    let report: Value = serde_json::from_str(&fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
    assert_eq!(report["provenance"]["sheet"]["name"], "made of the recordings");
    assert_eq!(report["provenance"]["options"]["no-sheet"], "the whole chain, by a sheet made of the recordings");
    assert!(report["fitted_stage"].is_null(), "the whole chain is judged");
    // The sheet reads back as the unit that the recordings were judged by: the same evidence, to the last digit.
    let assumed = out.join("assumed.yaml");
    let sheet = params::load(&assumed).unwrap();
    assert_eq!(report["provenance"]["sheet"]["sha256"], params::unit_digest(&sheet));
    // A report by a sheet takes the place of the assumed one.
    let by_sheet = govtwin(&["diagnose", "--params", &text(&assumed), &case("case_03"), "--out", &text(&again)]);
    assert!(matches!(by_sheet.code, 0 | 3), "{}", by_sheet.stderr);
    let second: Value = serde_json::from_str(&fs::read_to_string(again.join("report.json")).unwrap()).unwrap();
    let rows = |report: &Value| report["evidence"]["table"]["rows"].clone();
    assert_eq!(rows(&report), rows(&second));
    // Who hands it in answers for it: it counts as a data sheet then.
    assert_eq!(report["evidence"]["table"]["assumed_sheet"], true);
    assert!(second["evidence"]["table"]["assumed_sheet"].is_null());
    let backlash = |report: &Value| {
        let ranking = report["ranking"].as_array().unwrap();
        let rank = ranking.iter().find(|rank| rank["id"] == "backlash").unwrap();
        rank["probability"].as_f64().unwrap()
    };
    assert!(backlash(&report) > 0.4 && backlash(&report) <= backlash(&second), "{report:#}");
    assert!(!again.join("assumed.yaml").exists());
}

#[test]
fn a_sheet_takes_from_recordings_what_its_plate_does_not_say() {
    let dir = tempfile::tempdir().unwrap();
    let sheet = dir.path().join("unit.yaml");
    let path = sheet.display().to_string();
    let args = ["sheet", "new", "--quick", "--set", "position_gain=30", "--from", &case("case_03"), "--out", &path];
    let run = govtwin(&args);
    assert_eq!(run.code, 3, "{}", run.stderr);
    let unit = params::load(&sheet).unwrap();
    assert_eq!(unit.parameters.regulator.position_gain, 30.0);
    assert!(
        (unit.parameters.oil.tank_pressure_pa / 6.3e6 - 1.0).abs() < 0.05,
        "{}",
        unit.parameters.oil.tank_pressure_pa
    );
    let text = fs::read_to_string(&sheet).unwrap();
    assert!(text.contains("recordings: tank_pressure") && text.contains("sensors:"), "{text}");
    assert!(run.stderr.contains("no recording shows the servomotor's size"), "{}", run.stderr);
    // Of what cannot make a sheet it says so, and leaves nothing.
    let stage = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/real");
    let none = dir.path().join("none.yaml");
    let refused =
        govtwin(&["sheet", "new", "--from", &stage.display().to_string(), "--out", &none.display().to_string()]);
    assert_eq!(refused.code, 1, "{}", refused.stderr);
    assert!(!none.exists());
}

#[test]
fn recordings_that_make_no_sheet_are_judged_by_their_stage_and_the_reason_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let bag = format!("{}/load_rejection.mcap", case("case_03"));
    let out = dir.path().display().to_string();
    let run =
        govtwin(&["diagnose", "--no-sheet", &bag, "--topic", "tank_pressure=/nowhere", "--out", &out, "--overwrite"]);
    assert_eq!(run.code, 3, "{}", run.stderr);
    let reason = "The whole chain is not judged without a data sheet: no tank pressure was recorded";
    assert!(run.stderr.contains(reason), "{}", run.stderr);
    assert!(run.stdout.contains("unit: none; the servomotor stage was fitted freely"), "{}", run.stdout);
    let report: Value = serde_json::from_str(&fs::read_to_string(dir.path().join("report.json")).unwrap()).unwrap();
    assert_eq!(report["provenance"]["options"]["no-sheet"], "the servomotor stage alone");
    assert!(report["fitted_stage"].is_array() && !dir.path().join("assumed.yaml").exists());
}
