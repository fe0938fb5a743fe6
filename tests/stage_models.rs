//! Plain models beside the twin of a servomotor stage: on the same held-out pieces, in any unit, sign and clock, and what a verdict makes of them.
#![cfg(feature = "cli")]

#[path = "support/plain_stage.rs"]
mod plain_stage;
#[path = "support/position_loop.rs"]
mod position_loop;
#[path = "support/stage.rs"]
mod stage;

use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::result::{ComparedModel, Diagnosis, Verdict};
use govtwin_model::provenance::Provenance;
use govtwin_model::recording::Recording;
use govtwin_pages::diagnosis as report;
use plain_stage::{PlainStage, govtwin, in_units, near};
use position_loop::Loop;
use stage::{Spool, freely};
use std::path::Path;

/// The plain models, in the order of reports.
const PLAIN: [&str; 6] = [
    "integrator",
    "integrator with two gains",
    "integrator with two gains and dead zone",
    "plain law",
    "first-order lag",
    "set point with lag",
];

/// What the play of a loop is called.
const PLAY: &str = "backlash or dead band, full width";

fn models(said: &Diagnosis) -> &[ComparedModel] {
    &said.part.as_ref().unwrap().models
}

fn model<'a>(said: &'a Diagnosis, name: &str) -> &'a ComparedModel {
    models(said).iter().find(|one| one.model == name).unwrap_or_else(|| panic!("{name}: {:?}", models(said)))
}

fn parameter(model: &ComparedModel, name: &str) -> Option<f64> {
    model.parameters.iter().find(|one| one.name == name).map(|one| one.value)
}

/// The parameter of the model of this name.
fn told(said: &Diagnosis, of: &str, name: &str) -> f64 {
    parameter(model(said, of), name).unwrap_or_else(|| panic!("{of}, {name}: {:?}", model(said, of)))
}

fn shown(said: &Diagnosis) -> String {
    let all = models(said).iter().map(|one| format!("{} {:?} {:?}", one.model, one.halves, one.parameters));
    let blamed: Vec<&str> = said.blamed.iter().map(|one| one.id.as_str()).collect();
    let won = said.part.as_ref().and_then(|part| part.plain_wins.clone());
    format!("{:?} {blamed:?} {won:?}\n{}\n{:?}", said.verdict, all.collect::<Vec<_>>().join("\n"), said.notes)
}

#[test]
fn stage_models_stand_beside_the_twin_in_the_file_the_text_and_the_page() {
    let recording = PlainStage::USUAL.record(&Spool::usual(41), 20.0, 2000);
    let said = freely(vec![in_units(&recording, [0.5, 0.5], [1.0, 0.0])]);
    println!("{}", shown(&said));
    let plain: Vec<&str> = models(&said).iter().filter(|one| one.is_plain).map(|one| one.model.as_str()).collect();
    assert_eq!(plain, PLAIN, "{}", shown(&said));
    assert!(models(&said)[0].model.is_empty() && !models(&said)[0].is_plain, "the recalibrated twin comes first");
    // The law by which the recording was made has its own numbers, and none is better.
    let of = |name| told(&said, "integrator with two gains and dead zone", name);
    assert!(near(of("gain above zero"), 0.24, 0.03) && near(of("gain below zero"), 0.16, 0.03), "{}", shown(&said));
    assert!((of("zero") - 0.5).abs() < 0.003 && near(of("dead band, full width"), 0.07, 0.05), "{}", shown(&said));
    let right = model(&said, "integrator with two gains and dead zone").held_out;
    let transducers = said.part.as_ref().unwrap().transducers_pu;
    assert!(right < 2.0 * transducers, "{right} of {transducers}: {}", shown(&said));
    for (worse, times) in [("integrator", 5.0), ("integrator with two gains", 1.5), ("first-order lag", 5.0)] {
        assert!(model(&said, worse).held_out > times * right, "{worse}: {}", shown(&said));
    }
    let json = DiagnosisReport::of(&said, 0.0).json();
    let rows = json["evidence"]["servomotor_stage_only"]["models"].as_array().unwrap();
    assert_eq!(rows.len(), models(&said).len());
    assert!(rows.iter().all(|row| row["piece_rmse_pu"].as_array().is_some_and(|pieces| pieces.len() >= 4)));
    let page = report::page(&said, &Provenance::default()).to_html();
    let text = report::summary(&said, 120);
    for name in PLAIN {
        assert!(text.contains(&format!("{name}: RMS error")) && page.contains(name), "{name}: {text}");
    }
    assert!(page.contains("dead band, full width 0.0"), "the table gives parameters");
}

#[test]
fn stage_loops_are_told_as_set_points_with_delay_lag_and_limits_at_any_speed() {
    for (slower, seed) in [(1.0, 51), (0.1, 52), (10.0, 53)] {
        let said = freely(vec![Loop { slower, ..Loop::USUAL }.record(seed, 2400)]);
        println!("{slower}: {}", shown(&said));
        let of = |name| told(&said, "set point with lag", name);
        assert!(near(of("gain"), 1.0, 0.01) && of("level").abs() < 0.01, "{}", shown(&said));
        assert!(near(of("delay"), 0.15 * slower, 0.2) && near(of("lag"), 0.3 * slower, 0.15), "{}", shown(&said));
        assert!(near(of("rate limit, rising"), 0.30 / slower, 0.06), "{}", shown(&said));
        assert!(near(of("rate limit, falling"), 0.22 / slower, 0.06), "{}", shown(&said));
        assert!(parameter(model(&said, "set point with lag"), PLAY).is_none(), "{}", shown(&said));
        // Nothing of a servomotor is named where a set point says it all.
        assert_eq!(said.part.as_ref().unwrap().plain_wins.as_deref(), Some("set point with lag"), "{}", shown(&said));
        assert!(said.blamed.is_empty(), "{}", shown(&said));
        assert_ne!(said.verdict, Verdict::NoSuchUnit, "{}", shown(&said));
        let text = report::summary(&said, 120).replace('\n', " ");
        assert!(
            text.starts_with("A plain model predicts better than the twin. A position loop: the position"),
            "{text}"
        );
        for words in ["× command", "with a delay of", "a lag of", "rises by at most", "falls by at most"] {
            assert!(text.contains(words), "{words}: {text}");
        }
        assert!(said.part.as_ref().unwrap().figures.is_empty(), "a law that was refused has no figures");
        // The deviation is from where the loop goes, not from a line over what it is still on its way from.
        let note = said.notes.iter().find(|note| note.contains("the deviation")).unwrap();
        assert!(note.contains("0.99") || note.contains("1.00"), "{note}");
    }
}

#[test]
fn stage_loops_with_backlash_are_told_its_width_with_an_interval() {
    let said = freely(vec![Loop { half_play: 0.02, ..Loop::USUAL }.record(55, 2000)]);
    println!("{}", shown(&said));
    let model = model(&said, "set point with lag");
    let play = model.parameters.iter().find(|one| one.name == PLAY).unwrap_or_else(|| panic!("{}", shown(&said)));
    assert!(near(play.value, 0.04, 0.15), "{play:?}");
    assert!(play.ends.0 < play.value && play.value < play.ends.1 && play.ends.1 - play.ends.0 < 0.03, "{play:?}");
    assert_eq!(said.part.as_ref().unwrap().plain_wins.as_deref(), Some("set point with lag"), "{}", shown(&said));
    assert!(said.blamed.is_empty(), "{}", shown(&said));
    let text = report::summary(&said, 120).replace('\n', " ");
    assert!(text.contains("short of that from either side, by backlash or a dead band of 0.0"), "{text}");
    let json = DiagnosisReport::of(&said, 0.0).json();
    let part = &json["evidence"]["servomotor_stage_only"];
    assert!(part.get("free_runs").is_none(), "the models say it");
    let rows = part["models"].as_array().unwrap();
    let told = rows.iter().find(|row| row["model"] == "set point with lag").unwrap();
    assert!(told["parameters"].as_array().unwrap().iter().all(|one| one["ci90"].is_array()), "{told}");
}

/// The same recording whose clock runs so many times as slow, in other units; a command goes with the spool.
fn other(recording: &Recording, slower: f64, spool: [f64; 2], servomotor: [f64; 2]) -> Recording {
    let mut other = in_units(recording, spool, servomotor);
    let begin_ns = recording.frames[0].time_ns;
    for frame in &mut other.frames {
        frame.time_ns = begin_ns + ((frame.time_ns - begin_ns) as f64 * slower).round() as i64;
        frame.inputs.opening_command_pu = frame.inputs.opening_command_pu * spool[0] + spool[1];
    }
    other
}

/// The measured crane, where it is at hand.
fn crane() -> Option<Recording> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/bags/real/crane.mcap");
    if !path.exists() {
        println!("skipped for the crane: {} is not there", path.display());
        return None;
    }
    let required = vec![govtwin_bag::Stream::ServoState];
    let options = govtwin_bag::ReadOptions { required, ..govtwin_bag::ReadOptions::default() };
    Some(govtwin_bag::read(&path, &options).unwrap().recording)
}

#[test]
fn stage_models_are_the_same_in_any_unit_sign_and_clock() {
    let mut recordings = vec![
        ("stage", PlainStage::USUAL.record(&Spool::usual(42), 20.0, 1200)),
        ("loop", Loop::USUAL.record(54, 2400)),
    ];
    recordings.extend(crane().map(|crane| ("crane", crane)));
    for (name, recording) in recordings {
        let plain = freely(vec![recording.clone()]);
        println!("{name}: {}", shown(&plain));
        let variants = [(10.0, [-1000.0, 40.0], [1000.0, -300.0]), (0.1, [0.02, -1.0], [-0.3, 0.5])];
        for (slower, spool, servomotor) in variants {
            let said = freely(vec![other(&recording, slower, spool, servomotor)]);
            let how = format!("{name}, {slower} {spool:?} {servomotor:?}: {}\nbefore: {}", shown(&said), shown(&plain));
            let part = |said: &Diagnosis| said.part.clone().unwrap();
            assert!(near(part(&said).free_run_s, slower * part(&plain).free_run_s, 1e-3), "{how}");
            assert_eq!(part(&said).plain_wins, part(&plain).plain_wins, "{how}");
            // What misses most of the movement, as a sum does in a loop, has numbers that nothing determines, and so has a lag longer than a run.
            let is_told = |one: &&ComparedModel| {
                let in_time = parameter(one, "lag").is_none_or(|lag_s| lag_s < part(&plain).free_run_s);
                one.is_plain && one.held_out < 0.2 && in_time
            };
            for wanted in models(&plain).iter().filter(is_told) {
                let found = model(&said, &wanted.model);
                assert_eq!(found.pieces.len(), wanted.pieces.len(), "{how}");
                assert!(near(found.held_out, wanted.held_out, 0.03), "{}: {how}", wanted.model);
                if let (Some(found), Some(wanted)) = (parameter(found, "lag"), parameter(wanted, "lag"))
                    && wanted > 0.0
                {
                    assert!(near(found, slower * wanted, 0.1), "lag: {how}");
                }
            }
            let gain = |said: &Diagnosis| told(said, "integrator", "gain");
            let wanted = gain(&plain) * servomotor[0] / spool[0] / slower;
            assert!(near(gain(&said), wanted, 0.01), "{} for {wanted}: {how}", gain(&said));
        }
    }
}

/// Writes a recording as a table of a command and a position with a map that takes its numbers as they are; the two paths.
fn table(dir: &Path, recording: &Recording) -> [String; 2] {
    let mut text = "t,u,y\n".to_owned();
    for frame in &recording.frames {
        let (u, y) = (frame.inputs.opening_command_pu, frame.measured.servomotor_position_pu);
        text += &format!("{},{u:.6},{y:.6}\n", frame.time_ns as f64 * 1e-9);
    }
    let map = "time: {column: t, format: seconds}\nsignals:\n  opening_command: {column: u, unit: pu}\n  servomotor_position: {column: y, unit: pu}\n";
    let paths = ["rig.csv", "map.yaml"].map(|name| dir.join(name));
    std::fs::write(&paths[0], text).unwrap();
    std::fs::write(&paths[1], map).unwrap();
    paths.map(|path| path.display().to_string())
}

/// A command in the numbers of the plant drives the stage as it is, and a long recording is not cut.
#[test]
fn stage_commands_in_any_unit_are_taken_whole() {
    let dir = tempfile::tempdir().unwrap();
    let recordings = [Some(PlainStage::USUAL.record(&Spool::usual(43), 2.0, 1500)), crane()];
    for (number, mut recording) in recordings.into_iter().flatten().enumerate() {
        for frame in &mut recording.frames {
            frame.inputs.opening_command_pu = frame.measured.spool_position_pu;
        }
        let dir = dir.path().join(number.to_string());
        std::fs::create_dir(&dir).unwrap();
        let rows = recording.frames.len();
        let [csv, map] = table(&dir, &other(&recording, 1.0, [1000.0, 4000.0], [1000.0, -300.0]));
        let out = dir.join("report");
        let text = govtwin(&["diagnose", &csv, "--map", &map, "--stage-alone", "--out", &out.display().to_string()]);
        assert!(!text.contains("dropped") && !text.contains("cut out"), "{text}");
        assert!(text.contains("the command stands in for it"), "{text}");
        let json: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(out.join("report.json")).unwrap()).unwrap();
        let part = &json["evidence"]["servomotor_stage_only"];
        let recorded_s = part["pieces"].as_f64().unwrap() * part["piece_s"].as_f64().unwrap();
        let whole_s = recording.duration_s();
        assert!(near(recorded_s, whole_s, 0.05), "{recorded_s} of {whole_s} s");
        assert!(json["evidence"]["values"].as_u64().unwrap() >= rows as u64 - 10, "{}", json["evidence"]["values"]);
    }
}
