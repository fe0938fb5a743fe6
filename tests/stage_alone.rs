//! A servomotor stage alone, without a sheet: recordings of stages that are not the twin's, in units of their own, and measured ones.
#![cfg(feature = "cli")]

#[path = "support/plain_stage.rs"]
mod plain_stage;
#[path = "support/stage.rs"]
mod stage;

use govtwin_bag::import::{Import, ImportError, ImportedRow, Map, Target};
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::result::{Diagnosis, Verdict};
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::params::reference;
use govtwin_model::provenance::Provenance;
use govtwin_model::recording::Recording;
use govtwin_pages::diagnosis as report;
use plain_stage::{PlainStage, govtwin, in_units, near};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use stage::{Spool, freely, record, symmetric, with};
use std::path::{Path, PathBuf};

fn ids(said: &Diagnosis) -> Vec<&str> {
    let mut ids: Vec<&str> = said.blamed.iter().map(|blame| blame.id.as_str()).collect();
    ids.sort_unstable();
    ids
}

fn shown(said: &Diagnosis) -> String {
    let gap: Vec<[f64; 3]> = said.gap.iter().map(|gap| [gap.noise_floor, gap.refitted, gap.with_effects]).collect();
    let tried: Vec<_> = said.tried.iter().take(4).map(|one| (&one.ids, one.gain)).collect();
    format!(
        "{:?} {:?} gap {gap:?} tried {tried:?} part {:?} {:?} {:?}",
        said.verdict,
        ids(said),
        said.part,
        &said.ranking[..4],
        said.notes
    )
}

/// The told figure with this id.
fn told(said: &Diagnosis, id: &str) -> f64 {
    said.part.as_ref().unwrap().figures.iter().find(|one| one.id == id).unwrap().value.value
}

#[test]
fn zero_dead_band_and_speeds_are_told_in_the_numbers_of_a_signal_about_a_half() {
    let plain = PlainStage::USUAL.record(&Spool::usual(1), 20.0, 2000);
    let said = freely(vec![in_units(&plain, [0.5, 0.5], [1.0, 0.0])]);
    assert!(matches!(said.verdict, Verdict::Class | Verdict::Named), "{}", shown(&said));
    assert!(ids(&said).contains(&"port_asymmetry"), "{}", shown(&said));
    assert!((told(&said, "spool_zero") - 0.5).abs() < 0.004, "{}", shown(&said));
    assert!(near(told(&said, "dead_band"), 0.07, 0.12), "{}", shown(&said));
    let farthest = |sign: f64| {
        let spools = plain.frames.iter().map(|frame| sign * frame.measured.spool_position_pu);
        spools.fold(0.0, f64::max) - PlainStage::USUAL.dead_pu
    };
    assert!(near(told(&said, "rising_speed"), 0.12 * farthest(1.0), 0.03), "{}", shown(&said));
    assert!(near(told(&said, "falling_speed"), -0.08 * farthest(-1.0), 0.03), "{}", shown(&said));
    // The same stands in the text, on the page and in the file.
    let text = report::summary(&said, 120);
    let page = report::page(&said, &Provenance::default()).to_html();
    for words in ["dead band, full width", "rising speed at the farthest spool position", "lag behind the spool"] {
        assert!(text.contains(words) && page.contains(words), "{words}: {text}");
    }
    let json = DiagnosisReport::of(&said, 0.0).json();
    let figures = json["fitted_stage"].as_array().unwrap();
    assert!(figures.iter().any(|one| one["id"] == "dead_band" && one["ci90"].is_array()), "{figures:?}");
}

#[test]
fn verdicts_do_not_depend_on_units_signs_or_zeros() {
    let mut random = ChaCha8Rng::seed_from_u64(28);
    let mut channel = |turns: bool| {
        let size = 10.0_f64.powf(random.random_range(-3.0..3.0));
        let sign = if turns && random.random_bool(0.5) { -1.0 } else { 1.0 };
        [sign * size, size * random.random_range(-3.0..3.0)]
    };
    let leaking = with(symmetric(&reference()), "servo_leak", &[4.0e-9]);
    let stages = [
        PlainStage::USUAL.record(&Spool::usual(3), 20.0, 1200),
        record(&with(symmetric(&reference()), "port_asymmetry", &[0.3]), &Spool::usual(4), 10.0, 900),
        record(&leaking, &Spool::usual(5), 10.0, 900),
    ];
    for recording in stages.into_iter().chain(crane()) {
        let plain = freely(vec![recording.clone()]);
        for _ in 0..2 {
            let (spool, servomotor) = (channel(true), channel(true));
            let other = freely(vec![in_units(&recording, spool, servomotor)]);
            let how = format!("{spool:?} {servomotor:?}: {}\nbefore: {}", shown(&other), shown(&plain));
            assert_eq!(other.verdict, plain.verdict, "{how}");
            assert_eq!(ids(&other), ids(&plain), "{how}");
        }
    }
}

#[test]
fn verdicts_hold_at_other_rates_and_at_different_rates_of_the_channels() {
    let fine = PlainStage::USUAL.record(&Spool::usual(6), 50.0, 3000);
    let plain = freely(vec![fine.clone()]);
    let thinned = |spool: usize, servomotor: usize| {
        let mut other = fine.clone();
        for (row, frame) in other.frames.iter_mut().enumerate() {
            if row % spool != 0 {
                frame.measured.spool_position_pu = f64::NAN;
            }
            if row % servomotor != 0 {
                frame.measured.servomotor_position_pu = f64::NAN;
            }
        }
        other
    };
    for (spool, servomotor) in [(4, 4), (5, 1), (1, 5), (3, 2)] {
        let other = freely(vec![thinned(spool, servomotor)]);
        let how = format!("every {spool}, {servomotor}: {}\nbefore: {}", shown(&other), shown(&plain));
        // What stands beside it may change with what is known of the spool between its samples.
        assert!(matches!(other.verdict, Verdict::Class | Verdict::Named), "{how}");
        assert!(ids(&other).contains(&"port_asymmetry") && ids(&plain).contains(&"port_asymmetry"), "{how}");
        assert!(near(told(&other, "dead_band"), 0.14, 0.15), "{how}");
        let [one, same] = [&other, &plain].map(|said| said.part.as_ref().unwrap().free_run_s);
        assert!((one - same).abs() < 0.5, "free runs last {one} s and {same} s");
    }
}

#[test]
fn lag_and_saturation_are_found_where_a_plain_stage_has_them() {
    let alike = PlainStage { dead_pu: 0.02, gains_pu_s: [0.1, 0.1], ..PlainStage::USUAL };
    let late = freely(vec![PlainStage { lag_s: 0.5, ..alike }.record(&Spool::usual(7), 20.0, 2000)]);
    assert!(matches!(late.verdict, Verdict::Named | Verdict::Class), "{}", shown(&late));
    assert!(ids(&late).contains(&"valve_lag") || ids(&late).contains(&"feedback_lag"), "{}", shown(&late));
    assert!(near(told(&late, "lag_s"), 0.5, 0.2), "{}", shown(&late));
    let full = freely(vec![PlainStage { most_pu_s: 0.04, ..alike }.record(&Spool::usual(8), 20.0, 2000)]);
    assert!(matches!(full.verdict, Verdict::Named | Verdict::Class), "{}", shown(&full));
    assert!(ids(&full).contains(&"flow_saturation"), "{}", shown(&full));
    assert!(near(told(&full, "rising_speed"), 0.04, 0.05), "{}", shown(&full));
}

#[test]
fn a_follower_and_a_stranger_are_of_no_such_unit() {
    let stage = PlainStage::USUAL.record(&Spool::usual(9), 20.0, 1500);
    let mut follower = stage.clone();
    let mut at = 0.5;
    for frame in &mut follower.frames {
        at += (0.5 + 0.3 * frame.measured.spool_position_pu - at) * 0.05;
        frame.measured.servomotor_position_pu = at + 1e-4 * (frame.time_ns as f64 * 1e-7).sin();
    }
    let said = freely(vec![follower]);
    assert_eq!(said.verdict, Verdict::NoSuchUnit, "{}", shown(&said));
    assert!(report::summary(&said, 120).contains("settles within"), "{}", report::summary(&said, 120));
    let mut stranger = stage.clone();
    let other = PlainStage::USUAL.record(&Spool::usual(10), 20.0, 1500);
    for (frame, other) in stranger.frames.iter_mut().zip(&other.frames) {
        frame.measured.spool_position_pu = other.measured.spool_position_pu;
    }
    let said = freely(vec![stranger]);
    assert_eq!(said.verdict, Verdict::NoSuchUnit, "{}", shown(&said));
    assert_eq!(DiagnosisReport::of(&said, 0.0).json()["verdict"], "no_such_unit");
    assert!(said.stage.is_none() && said.blamed.is_empty());
}

#[test]
fn without_a_spool_the_command_stands_in_as_a_valve_or_by_its_deviation() {
    let stage = PlainStage::USUAL.record(&Spool::usual(11), 20.0, 2000);
    let mut valve = stage.clone();
    for frame in &mut valve.frames {
        frame.inputs.opening_command_pu = frame.measured.spool_position_pu;
        frame.measured.spool_position_pu = f64::NAN;
    }
    let said = freely(vec![valve]);
    assert!(ids(&said).contains(&"port_asymmetry"), "{}", shown(&said));
    assert!(said.notes.iter().any(|note| note.contains("the command stands in for it")), "{:?}", said.notes);
    // A proportional loop about the same valve.
    let mut loop_ = stage;
    let (mut at, mut asked) = (0.4, 0.4);
    let mut random = ChaCha8Rng::seed_from_u64(12);
    for (row, frame) in loop_.frames.iter_mut().enumerate() {
        if row % 100 == 0 {
            asked = random.random_range(0.1..0.9);
        }
        frame.inputs.opening_command_pu = asked;
        frame.measured =
            Signals { servomotor_position_pu: at + 1e-4 * random.random_range(-1.0..1.0), ..Signals::NONE };
        for _ in 0..20 {
            at += 0.0025 * 1.5 * (asked - at);
        }
    }
    let said = freely(vec![loop_]);
    assert!(said.notes.iter().any(|note| note.contains("the deviation")), "{}", shown(&said));
    assert_ne!(said.verdict, Verdict::NoSuchUnit, "{}", shown(&said));
}

/// A quarter of the measured fatigue rig, whose displacement is no servomotor's to its transducer's noise.
#[test]
fn the_measured_rig_is_never_called_without_a_gap() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/real/faster");
    let map = Map::load(&folder.join("map.yaml")).unwrap();
    let mut frames = vec![];
    let import = Import::open(&[folder.join("faster.csv")], &map).unwrap();
    let take = &mut |row: &ImportedRow| {
        let measured = Signals {
            spool_position_pu: row.value(Target::SpoolPosition).unwrap(),
            servomotor_position_pu: row.value(Target::ServomotorPosition).unwrap(),
            ..Signals::NONE
        };
        let inputs = Inputs {
            opening_command_pu: f64::NAN,
            esv: EsvState::Normal,
            tank_pressure_pa: f64::NAN,
            piston_force_n: 0.0,
        };
        frames.push(Frame { time_ns: row.time_ns, inputs, measured });
        Ok::<(), ImportError>(())
    };
    import.run(take, &mut |_| ()).unwrap();
    frames.truncate(frames.len() / 4);
    let said = freely(vec![Recording::new("rig", frames)]);
    assert!(!matches!(said.verdict, Verdict::NoGap | Verdict::NotExcited | Verdict::NoSuchUnit), "{}", shown(&said));
    let gap = &said.gap[0];
    assert!(gap.refitted > 4.0 * gap.noise_floor, "{}", shown(&said));
}

/// The crane's recording, where it is at hand.
fn crane() -> Option<Recording> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/bags/real/crane.mcap");
    if !path.exists() {
        println!("skipped for the crane: {} is not there", path.display());
        return None;
    }
    let options = govtwin_bag::ReadOptions {
        required: vec![govtwin_bag::Stream::ServoState],
        ..govtwin_bag::ReadOptions::default()
    };
    Some(govtwin_bag::read(&path, &options).unwrap().recording)
}

/// Writes a recording as a table with a map that takes its numbers as they are; the two paths.
fn table(dir: &Path, recording: &Recording) -> [PathBuf; 2] {
    let mut text = "t,u,y\n".to_owned();
    for frame in &recording.frames {
        let Signals { spool_position_pu, servomotor_position_pu, .. } = frame.measured;
        text += &format!("{},{spool_position_pu:.6},{servomotor_position_pu:.6}\n", frame.time_ns as f64 * 1e-9);
    }
    let map = "time: {column: t, format: seconds}\nsignals:\n  spool_position: {column: u, unit: pu}\n  servomotor_position: {column: y, unit: pu}\n";
    let paths = ["rig.csv", "map.yaml"].map(|name| dir.join(name));
    std::fs::write(&paths[0], text).unwrap();
    std::fs::write(&paths[1], map).unwrap();
    paths
}

fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn a_table_in_percent_is_diagnosed_fitted_and_replayed_by_its_map() {
    let dir = tempfile::tempdir().unwrap();
    let plain = PlainStage::USUAL.record(&Spool::usual(13), 20.0, 1500);
    let [csv, map] = table(dir.path(), &in_units(&plain, [-100.0, 50.0], [100.0, 0.0]));
    let at = |name: &str| dir.path().join(name).display().to_string();
    let (csv, map) = (csv.display().to_string(), map.display().to_string());
    let said = govtwin(&["diagnose", &csv, "--map", &map, "--out", &at("report")]);
    assert!(said.contains("port_asymmetry") && !said.contains("dropped"), "{said}");
    // What the report recommends: the improved twin on the recording, which it reads in its own units.
    let fitted = at("report/fitted.yaml");
    govtwin(&["replay", &csv, "--map", &map, "--cut", "spool", "--params", &fitted, "--out", &at("replay")]);
    let figures = json(&dir.path().join("replay/replay.json"));
    let text = figures.to_string();
    let r2 = text.split("\"r2\":").nth(1).and_then(|rest| rest.split([',', '}']).next()).unwrap().parse::<f64>();
    assert!(r2.unwrap() > 0.99, "{text}");
    // A fit without a sheet is one of a stage of unknown size, and says so; with the reference unit's it says what it moved.
    let free = govtwin(&["fit", &csv, "--map", &map, "--out", &at("free")]);
    assert!(free.contains("No data sheet") && free.contains("dead band, full width"), "{free}");
    let [csv, map] = table(dir.path(), &plain).map(|path| path.display().to_string());
    let sheet = Path::new(env!("CARGO_MANIFEST_DIR")).join("params/reference_unit.yaml").display().to_string();
    govtwin(&["fit", &csv, "--map", &map, "--params", &sheet, "--out", &at("sheet")]);
    let fit = json(&dir.path().join("sheet/fit.json"));
    let sentences = fit["identifiability"].as_array().unwrap();
    let left = sentences.iter().filter_map(|one| one.as_str()).find(|one| one.contains("so left")).unwrap_or_default();
    let mut moved = 0;
    for parameter in fit["parameters"].as_array().unwrap() {
        let key = format!("`{}`", parameter["key"].as_str().unwrap());
        let off = parameter["sd_from_sheet"].as_f64().is_some_and(|off| off.abs() > 3.0);
        assert!(!(off && left.contains(&key)), "{key} was moved: {left}");
        moved += usize::from(off);
    }
    assert!(moved > 0, "a stage of another size strains the sheet");
}
