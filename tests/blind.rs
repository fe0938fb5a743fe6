//! `govtwin blind` on units whose reports are there already: the score is the one counted by hand, and nothing is judged anew.
#![cfg(feature = "cli")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use govtwin_bag::{Interpolation, ReadOptions};
use govtwin_diagnosis::result::sealed;
use govtwin_files::digest::sha256;
use govtwin_lab::baselines::BASELINES;
use govtwin_lab::baselines::ground::Ground;
use govtwin_lab::benchmark::isolability;
use govtwin_lab::benchmark::scored::SEEN;
use govtwin_lab::benchmark::validation::laid_along;
use govtwin_model::effects::find;
use govtwin_model::frame::{EsvState, Frame};
use govtwin_model::params;
use govtwin_model::provenance::{FileUsed, Provenance, RecordingGiven, SheetUsed};
use govtwin_model::recording::Recording;
use govtwin_model::twin::Twin;
use serde_json::Value;

fn report(verdict: &str, blamed: &[(&str, f64)]) -> String {
    let effects: Vec<String> = blamed
        .iter()
        .map(|(id, p)| {
            let parameter = find(id).unwrap().parameters[0].name;
            format!(
                r#"{{"id": "{id}", "stage": "servomotor", "probability": {p}, "closure": {{"value": null, "ci90": [null, null]}},
                    "parameters": [{{"name": "{parameter}", "unit": "1", "value": 1.0, "ci90": [0.9, 1.2]}}]}}"#
            )
        })
        .collect();
    let ranking: Vec<String> =
        blamed.iter().map(|(id, p)| format!(r#"{{"id": "{id}", "probability": {p}}}"#)).collect();
    let report = format!(
        r#"{{"schema": "govtwin-diagnosis/1", "verdict": "{verdict}", "location": {{"stage": "servomotor"}},
            "effects": [{}], "ranking": [{}], "seconds": 12.0}}"#,
        effects.join(", "),
        ranking.join(", ")
    );
    sealed(serde_json::from_str(&report).unwrap()).to_string()
}

/// A report that says which recording and sheet it is of: a bag with these bytes, and the shipped sheet.
fn of_recording(report: &str, bytes: &str) -> String {
    let mut report: Value = serde_json::from_str(report).unwrap();
    let files = vec![FileUsed { path: "startup.mcap".into(), bytes: bytes.len() as u64, sha256: sha256(bytes) }];
    let made = Provenance {
        recordings: vec![RecordingGiven { name: "startup".into(), files, ..RecordingGiven::default() }],
        sheet: SheetUsed { sha256: params::unit_digest(&params::reference()), ..SheetUsed::default() },
        ..Provenance::default()
    };
    report["provenance"] = serde_json::to_value(made).unwrap();
    format!("{:#}\n", sealed(report))
}

fn unit(dir: &Path, name: &str, report: &str) {
    let folder = dir.join(name);
    fs::create_dir_all(&folder).unwrap();
    // Named, and read for its digest only: the reports are there.
    fs::write(folder.join("startup.mcap"), "").unwrap();
    let report = of_recording(report, "");
    fs::write(folder.join("report.json"), &report).unwrap();
    for baseline in BASELINES {
        fs::write(folder.join(format!("baseline_{}.json", baseline.id)), &report).unwrap();
    }
}

/// A folder with the report of one unit, and its labels: nothing is in it.
fn one_sound_unit() -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    unit(dir.path(), "case_1", &report("no_gap", &[]));
    let labels = dir.path().join("labels.yaml");
    fs::write(&labels, "case_1: {effects: []}\n").unwrap();
    (dir, labels)
}

/// Runs the command: its exit code and what it says.
fn blind(args: &[&str]) -> (Option<i32>, String) {
    let out = Command::new(env!("CARGO_BIN_EXE_govtwin")).arg("blind").args(args).output().unwrap();
    (out.status.code(), format!("{}{}", String::from_utf8_lossy(&out.stdout), String::from_utf8_lossy(&out.stderr)))
}

#[test]
fn reports_that_are_there_are_scored_and_kept() {
    let dir = tempfile::tempdir().unwrap();
    unit(dir.path(), "case_1", &report("no_gap", &[]));
    unit(dir.path(), "case_2", &report("named", &[("backlash", 0.9)]));
    unit(dir.path(), "case_3", &report("named", &[("load", 0.6)]));
    let labels = dir.path().join("labels.yaml");
    fs::write(
        &labels,
        "case_1: {listed: true, effects: []}\n\
         case_2: {listed: true, effects: [{id: backlash, stage: servomotor, size: 1.0, unit: pu}]}\n\
         case_3: {listed: false, effects: [{id: surge, stage: servomotor, size: 2.0, unit: N}]}\n",
    )
    .unwrap();
    let (code, words) = blind(&[dir.path().to_str().unwrap(), "--baselines", "--labels", labels.to_str().unwrap()]);
    assert!(code == Some(0) && words.contains("surge (not in the catalogue)"), "{words}");
    let score: Value = serde_json::from_str(&fs::read_to_string(dir.path().join("score.json")).unwrap()).unwrap();
    let methods = score["methods"].as_object().unwrap();
    assert!(methods.len() >= BASELINES.len());
    for (name, method) in methods {
        let value = |id: &str| method["measures"][id]["value"].as_f64().unwrap();
        assert_eq!((value("false_alarm"), value("single_first"), value("unknown")), (0.0, 1.0, 0.0), "{name}");
        assert_eq!((value("size_coverage"), value("seconds")), (1.0, 12.0), "{name}");
    }
    let page = || fs::read_to_string(dir.path().join("score.html")).unwrap();
    assert!(page().starts_with("<!DOCTYPE html>"));
    assert!(!page().to_lowercase().contains("synthetic"), "nobody said where the units come from");
    assert_eq!(
        fs::read_to_string(dir.path().join("case_2/report.json")).unwrap(),
        of_recording(&report("named", &[("backlash", 0.9)]), "")
    );
    fs::write(dir.path().join("ORIGIN.txt"), "From the moon.\n").unwrap();
    blind(&[dir.path().to_str().unwrap(), "--labels", labels.to_str().unwrap()]);
    assert!(page().contains("From the moon."));
}

#[test]
fn recordings_tell_of_what_is_large_enough_and_unlike_the_answer() {
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/practice/case_03");
    let recordings = || {
        ["load_rejection", "shutdown"]
            .map(|name| {
                govtwin_bag::read(&dir.join(format!("{name}.mcap")), &ReadOptions::default()).unwrap().recording
            })
            .to_vec()
    };
    let unit = params::reference();
    let of = |size: f64, answer: &[(&str, f64)]| {
        let answer: Vec<_> = answer.iter().map(|(id, size)| (*id, vec![*size])).collect();
        isolability::expected_log_bayes_factor(recordings(), &unit, &[("esv_delay", vec![size])], &answer).unwrap()
    };
    let large = of(0.5, &[]);
    assert!(large > 10.0 * SEEN, "{large}");
    // Too small to be seen; taken up by the answer; hardly touched by an answer of another kind.
    let tiny = of(1e-3, &[]);
    assert!(tiny < SEEN, "{tiny}");
    let same = of(0.5, &[("esv_delay", 0.5)]);
    assert!(same < 1e-3 * large, "{same}");
    let other = of(0.5, &[("backlash", 0.002)]);
    assert!(other > 0.5 * large, "{other}");
    // No equation, no figure.
    assert!(isolability::expected_log_bayes_factor(recordings(), &unit, &[("surge", vec![1.0])], &[]).is_none());
}

/// All bag files below a folder.
fn bag_files(dir: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> =
        entries.flat_map(|path| if path.is_dir() { bag_files(&path) } else { vec![path] }).collect();
    files.retain(|file| file.extension().is_some_and(|suffix| suffix == "mcap"));
    files.sort();
    files
}

#[test]
fn a_battery_is_made_once_and_answered_as_it_was_committed_to() {
    let root = tempfile::tempdir().unwrap();
    let at = |name: &str| root.path().join(name);
    let (dir, out) = (at("battery"), at("out"));
    // Nothing is diagnosed: the only unit's report is there.
    fs::create_dir_all(out.join("case_001")).unwrap();
    fs::write(out.join("case_001/report.json"), report("no_gap", &[])).unwrap();
    let run = |dir: &Path, out: &Path, more: &[&str]| {
        let folders = [dir.to_str().unwrap(), "--out", out.to_str().unwrap()];
        blind(&[&folders[..], &["--generate", "1", "--rate", "100", "--unchecked"], more].concat())
    };
    let (code, words) = run(&dir, &out, &[]);
    assert_eq!(code, Some(0), "{words}");
    let labels = fs::read_to_string(dir.join("answers/labels.yaml")).unwrap();
    assert_eq!(
        fs::read_to_string(dir.join("answers/keys.sha256")).unwrap(),
        format!("{}  labels.yaml\n", sha256(&labels))
    );
    assert!(!labels.contains("strength"), "what is committed to was known before any simulation");
    let score = || -> Value { serde_json::from_str(&fs::read_to_string(out.join("score.json")).unwrap()).unwrap() };
    assert_eq!((score()["units"].as_u64(), score()["scored"].as_u64()), (Some(1), Some(1)));
    assert_eq!(score()["methods"]["govtwin"]["measures"]["single_first"]["value"].as_f64(), Some(0.0));
    assert!(score()["strengths"]["case_001"].as_f64().unwrap() > 0.0);
    let page = fs::read_to_string(out.join("score.html")).unwrap();
    assert!(page.contains("All units are synthetic") && page.contains("1 of 1 units"));
    let bags = bag_files(&dir);
    let words = b"blind --generate";
    assert_eq!(bags.len(), 4);
    assert!(fs::read(&bags[0]).unwrap().windows(words.len()).any(|window| window == words));

    // A second run neither makes bags nor measures strengths.
    fs::write(&bags[0], "kept").unwrap();
    fs::write(dir.join("answers/strengths.yaml"), "case_001: 99.0\n").unwrap();
    assert_eq!(run(&dir, &out, &[]).0, Some(0));
    assert_eq!(score()["strengths"]["case_001"].as_f64(), Some(99.0));
    assert_eq!(fs::read_to_string(&bags[0]).unwrap(), "kept");
    assert_eq!(fs::read_to_string(dir.join("answers/labels.yaml")).unwrap(), labels);

    // Neither bags of another sheet nor reports of another draw are taken for this battery's.
    let sheet = at("unit2.yaml");
    fs::write(&sheet, "name: unit 2\noil:\n  bulk_modulus_pa: 1.1e9\n").unwrap();
    let (code, words) = run(&dir, &out, &["--params", sheet.to_str().unwrap()]);
    assert!(code == Some(1) && words.contains("data sheet") && words.contains("battery"), "{words}");
    let (code, words) = run(&at("other"), &out, &["--seed", "2"]);
    assert!(code == Some(1) && words.contains("out is of a battery of another seed"), "{words}");
    assert!(!at("other").exists(), "nothing is made for a folder of reports that is not its own");
}

/// Units of mismatch 0 are the twin itself, and say so; a second verdict counts as the answer to the proposed test.
#[test]
fn twins_are_told_apart_and_answers_to_tests_are_scored() {
    let root = tempfile::tempdir().unwrap();
    let (dir, out) = (root.path().join("battery"), root.path().join("out"));
    for (folder, said) in [("case_001", report("unknown", &[])), ("case_001/next_test", report("no_gap", &[]))] {
        fs::create_dir_all(out.join(folder)).unwrap();
        fs::write(out.join(folder).join("report.json"), said).unwrap();
    }
    let folders = [dir.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let of_twins = ["--generate", "1", "--rate", "100", "--mismatch", "0", "--next-test", "--unchecked"];
    let (code, words) = blind(&[&folders[..], &of_twins].concat());
    assert!(code == Some(0) && words.contains("Next tests: 1 units were tested"), "{words}");
    let score: Value = serde_json::from_str(&fs::read_to_string(out.join("score.json")).unwrap()).unwrap();
    assert_eq!((score["next_tests"]["units"].as_u64(), score["next_tests"]["open"].as_u64()), (Some(1), Some(1)));
    assert_eq!(score["by_mismatch"]["mismatch 0"]["scored"].as_u64(), Some(1));
    assert!(fs::read_to_string(out.join("score.html")).unwrap().contains("those of mismatch 0 are the twin itself"));
    assert!(fs::read_to_string(dir.join("answers/labels.yaml")).unwrap().contains("mismatch: 0"));
    let (code, words) = blind(&[&folders[..], &["--generate", "1", "--rate", "100", "--unchecked"]].concat());
    assert!(code == Some(1) && words.contains("mismatch"), "{words}");
}

#[test]
fn a_battery_in_parts_is_the_battery_as_a_whole() {
    let root = tempfile::tempdir().unwrap();
    let at = |name: &str| root.path().join(name);
    // Nothing is diagnosed: the reports are there.
    let reports = |dir: &Path| {
        for name in ["case_001", "case_002"] {
            fs::create_dir_all(dir.join(name)).unwrap();
            fs::write(dir.join(name).join("report.json"), report("no_gap", &[])).unwrap();
        }
    };
    let run = |dir: &Path, more: &[&str]| {
        let own = [dir.to_str().unwrap(), "--generate", "2", "--rate", "5", "--unchecked"];
        let (code, words) = blind(&[&own[..], more].concat());
        assert_eq!(code, Some(0), "{words}");
    };
    let (whole, parts) = (at("whole"), at("parts"));
    reports(&whole);
    reports(&parts);
    run(&whole, &[]);
    std::thread::scope(|scope| {
        for shard in ["2/2", "1/2"] {
            let (run, parts) = (&run, &parts);
            scope.spawn(move || run(parts, &["--shard", shard]));
        }
    });
    assert!(
        !parts.join("answers/labels.yaml").exists() && !parts.join("score.json").exists(),
        "a part opens no answers"
    );
    let made = bag_files(&parts);
    let times = |files: &[PathBuf]| {
        files.iter().map(|file| fs::metadata(file).unwrap().modified().unwrap()).collect::<Vec<_>>()
    };
    let before = times(&made);
    run(&parts, &[]);
    assert!(times(&made) == before, "no unit is made anew");
    let bytes = |dir: &Path| bag_files(dir).iter().map(|file| fs::read(file).unwrap()).collect::<Vec<_>>();
    assert!(bytes(&whole) == bytes(&parts) && bytes(&whole).len() == 8);
    for name in ["answers/keys.sha256", "answers/labels.yaml", "answers/strengths.yaml", "answers/drawn.sha256"] {
        assert!(fs::read(whole.join(name)).unwrap() == fs::read(parts.join(name)).unwrap(), "{name}");
    }
    let score = |dir: &Path| {
        let mut score: Value = serde_json::from_str(&fs::read_to_string(dir.join("score.json")).unwrap()).unwrap();
        score["provenance"] = Value::Null;
        score
    };
    assert_eq!(score(&whole), score(&parts));
    let (code, words) = blind(&[parts.to_str().unwrap(), "--shard", "1/2"]);
    assert!(code == Some(2) && words.contains("--generate"), "{words}");
    let (code, words) = blind(&[parts.to_str().unwrap(), "--generate", "2", "--shard", "3/2"]);
    assert!(code == Some(2) && words.contains("such as 1/4"), "{words}");
}

#[test]
fn what_is_not_scored_is_told() {
    let dir = tempfile::tempdir().unwrap();
    unit(dir.path(), "case_1", &report("no_gap", &[]));
    unit(dir.path(), "case_2", &report("no_gap", &[]));
    let labels = dir.path().join("labels.yaml");
    fs::write(&labels, "case_1: {effects: []}\ncase_3: {effects: []}\n").unwrap();
    let (code, words) = blind(&[dir.path().to_str().unwrap(), "--labels", labels.to_str().unwrap()]);
    assert_eq!(code, Some(3), "{words}");
    assert!(words.contains("case_2: no label says what is in it"), "{words}");
    assert!(words.contains("case_3: govtwin said nothing of it"), "{words}");
    let score: Value = serde_json::from_str(&fs::read_to_string(dir.path().join("score.json")).unwrap()).unwrap();
    assert_eq!((score["units"].as_u64(), score["scored"].as_u64()), (Some(2), Some(1)));
    assert_eq!(score["methods"]["govtwin"]["scored"].as_u64(), Some(1));
}

#[test]
fn a_report_counts_only_for_its_own_recordings_and_sheet() {
    let (dir, labels) = one_sound_unit();
    let run =
        |more: &[&str]| blind(&[&[dir.path().to_str().unwrap(), "--labels", labels.to_str().unwrap()], more].concat());
    assert_eq!(run(&[]).0, Some(0));
    let at = dir.path().join("case_1/report.json");
    // Another recording under the same name.
    fs::write(&at, of_recording(&report("no_gap", &[]), "other")).unwrap();
    let (code, words) = run(&[]);
    assert!(code == Some(3) && words.contains("other recordings than those of case_1"), "{words}");
    assert!(words.contains("case_1: govtwin said nothing of it; not counted"), "{words}");
    assert!(run(&["--unchecked"]).1.contains("other recordings"), "what says something else is never taken");
    // No word of it, as of an early program.
    fs::write(&at, report("no_gap", &[])).unwrap();
    let (code, words) = run(&[]);
    assert!(code == Some(3) && words.contains("does not say which recordings"), "{words}");
    assert_eq!(run(&["--unchecked"]).0, Some(0));
    // What it is of, but no digests.
    let mut early: Value = serde_json::from_str(&of_recording(&report("no_gap", &[]), "")).unwrap();
    early.as_object_mut().unwrap().remove("digests");
    fs::write(&at, early.to_string()).unwrap();
    let (code, words) = run(&[]);
    assert!(code == Some(3) && words.contains("holds no digests"), "{code:?} {words}");
    assert_eq!(run(&["--unchecked"]).0, Some(0));
    // Another sheet.
    fs::write(&at, of_recording(&report("no_gap", &[]), "")).unwrap();
    let sheet = dir.path().join("unit2.yaml");
    fs::write(&sheet, "name: unit 2\noil:\n  bulk_modulus_pa: 1.1e9\n").unwrap();
    let (code, words) = run(&["--params", sheet.to_str().unwrap()]);
    assert!(code == Some(3) && words.contains("another data sheet (the shipped one)"), "{words}");
}

#[test]
fn without_a_sheet_only_reports_made_without_one_count() {
    let (dir, labels) = one_sound_unit();
    let run =
        |more: &[&str]| blind(&[&[dir.path().to_str().unwrap(), "--labels", labels.to_str().unwrap()], more].concat());
    let (code, words) = run(&["--no-sheet"]);
    assert!(code == Some(3) && words.contains("was made with a data sheet"), "{words}");
    let at = dir.path().join("case_1/report.json");
    let mut made: Value = serde_json::from_str(&fs::read_to_string(&at).unwrap()).unwrap();
    made["provenance"]["options"]["no-sheet"] = "the whole chain, by a sheet made of the recordings".into();
    made["provenance"]["sheet"]["sha256"] = "of its own".into();
    fs::write(&at, sealed(made).to_string()).unwrap();
    let (code, words) = run(&["--no-sheet"]);
    assert_eq!(code, Some(0), "{words}");
    let score: Value = serde_json::from_str(&fs::read_to_string(dir.path().join("score.json")).unwrap()).unwrap();
    assert_eq!(score["provenance"]["options"]["no-sheet"], "each unit by a sheet made of its recordings");
    let (code, words) = run(&[]);
    assert!(code == Some(3) && words.contains("another data sheet (made of its recordings)"), "{words}");
}

/// What a unit of the sheet does at 5 Hz about a trip, whose stamp is so many rows of 1 ms late; and the row of the trip.
fn trip_stamped_late(late_rows: usize) -> (Recording, usize) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/reference/shutdown_01.mcap");
    let sharp = ReadOptions { interpolation: Interpolation::Sharp { period_ns: 1_000_000 }, ..ReadOptions::default() };
    let mut recording = govtwin_bag::read(&path, &sharp).unwrap().recording;
    let stamped = trip(&recording.frames);
    recording.frames = recording.frames[stamped - 6000..stamped + 8000].to_vec();
    let mut twin = Twin::new(&params::reference());
    for (row, frame) in recording.frames.iter_mut().enumerate() {
        let signals = twin.step(frame).signals;
        if frame.measured.servomotor_position_pu.is_finite() {
            frame.measured.servomotor_position_pu = signals.servomotor_position_pu;
            frame.measured.spool_position_pu = signals.spool_position_pu;
        }
        frame.inputs.esv = if row < 6000 + late_rows { EsvState::Normal } else { EsvState::Shutdown };
    }
    (recording, 6000)
}

fn trip(frames: &[Frame]) -> usize {
    frames.iter().position(|frame| frame.inputs.esv == EsvState::Shutdown).unwrap()
}

#[test]
fn a_trip_that_a_slow_recorder_stamped_late_is_placed_as_in_the_diagnosis() {
    let unit = params::reference();
    let (recording, tripped) = trip_stamped_late(150);
    let fresh = laid_along(vec![recording.clone()], &unit);
    let ground = Ground::new(vec![recording], &unit, &[find("backlash").unwrap()]);
    for (what, bench) in [("validation and isolability", fresh), ("baselines", ground.problem)] {
        let found = trip(&bench.recordings[0].frames);
        assert!(found.abs_diff(tripped) < 120, "{what}: {found}, not {tripped}");
    }
}

#[test]
fn slips_say_the_way_out() {
    let dir = tempfile::tempdir().unwrap();
    let run = |more: &[&str]| blind(&[&[dir.path().to_str().unwrap()], more].concat());
    let (code, words) = run(&[]);
    assert!(code == Some(1) && words.contains("expected folders with .mcap files"), "{words}");
    let (code, words) = run(&["--generate", "0"]);
    assert!(code == Some(2) && words.contains("at least 1 unit"), "{words}");
    // Bags of another draw would be scored by answers that are not theirs.
    std::fs::create_dir(dir.path().join("answers")).unwrap();
    std::fs::write(dir.path().join("answers/drawn.sha256"), "another\n").unwrap();
    let (code, words) = run(&["--generate", "1"]);
    assert!(code == Some(1) && words.contains("of another seed, rate, mismatch or data sheet"), "{words}");
    unit(dir.path(), "case_1", &report("perhaps", &[]));
    let (code, words) = run(&["--baselines"]);
    assert!(code == Some(1) && words.contains("found `perhaps`"), "{words}");
}

#[test]
fn every_method_looks_for_the_streams_where_it_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let bag = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/reference/startup_01.mcap");
    fs::create_dir(dir.path().join("unit")).unwrap();
    fs::copy(bag, dir.path().join("unit/startup.mcap")).unwrap();
    let run = |more: &[&str]| blind(&[&[dir.path().to_str().unwrap()], more].concat());
    for method in [&[][..], &["--baselines-only"]] {
        let (code, words) = run(&[&["--topic", "servo_state=/other/servo_state"], method].concat());
        assert!(code == Some(3) && words.contains("/other/servo_state"), "{words}");
    }
    let (code, words) = run(&["--generate", "1", "--topic", "esv=/esv"]);
    assert!(code == Some(2) && words.contains("--generate"), "{words}");
}
