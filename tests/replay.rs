//! Replay through the library: what is compared, and that nothing but time and inputs decides.
#![cfg(feature = "cli")]

#[path = "support/program.rs"]
mod program;

use std::path::Path;
use std::process::Command;

use govtwin_model::frame::{Estimate, EsvState, Frame, Inputs, Signals};
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::replay::{Replayed, Scores};
use govtwin_model::signal::Signal;
use govtwin_model::twin::Twin;

fn recording(unit: &Unit) -> Recording {
    let frame = |i: i32| Frame {
        time_ns: i64::from(i) * 10_000_000,
        inputs: Inputs {
            opening_command_pu: if i < 20 { 0.3 } else { 0.4 },
            esv: EsvState::Normal,
            tank_pressure_pa: unit.parameters.oil.tank_pressure_pa,
            piston_force_n: 0.0,
        },
        measured: Signals { servomotor_position_pu: if i % 2 == 0 { 0.3 } else { f64::NAN }, ..Signals::NONE },
    };
    Recording::new("steps", (0..100).map(frame).collect())
}

#[test]
fn a_replay_starts_anew_each_time() {
    let unit = govtwin_model::params::reference();
    let mut twin = Twin::new(&unit);
    let first = Replayed::new(&mut twin, recording(&unit));
    let second = Replayed::new(&mut twin, recording(&unit));
    assert_eq!(first.estimates, second.estimates);
}

#[test]
fn a_force_on_the_piston_acts_from_its_row_on_and_a_start_under_it_is_in_balance() {
    let unit = govtwin_model::params::reference();
    let run = |force_n: &dyn Fn(usize) -> f64| {
        let mut recording = recording(&unit);
        for (k, frame) in recording.frames.iter_mut().enumerate() {
            frame.inputs.opening_command_pu = if k < 50 { 0.3 } else { 0.6 };
            frame.inputs.piston_force_n = force_n(k);
        }
        Replayed::new(&mut Twin::new(&unit), recording).estimates
    };
    let servomotor_pu = |estimate: &Estimate| estimate.signals.servomotor_position_pu;
    let (free, late) = (run(&|_| 0.0), run(&|k| if k < 50 { 0.0 } else { 1e5 }));
    assert_eq!(free[..=50], late[..=50]);
    assert!(servomotor_pu(&late[99]) > servomotor_pu(&free[99]) + 1e-3, "an opening force helps");
    for force_n in [-1e5, 1e5] {
        let under = run(&|_| force_n);
        assert!((servomotor_pu(&under[49]) - servomotor_pu(&under[0])).abs() < 1e-6, "{force_n} N at rest");
        // The chambers carry it: both areas over the sum of their pressures' change.
        let carried_n = (free[0].opening_chamber_pressure_pa - under[0].opening_chamber_pressure_pa)
            * unit.parameters.servomotor.opening_area_m2;
        assert!((carried_n - force_n).abs() < 1.0, "{carried_n} N of {force_n}");
    }
    // A row without a force keeps the last one.
    assert_eq!(run(&|_| 1e5), run(&|k| if k % 3 == 0 { 1e5 } else { f64::NAN }));
}

#[test]
fn only_rows_that_were_measured_count() {
    let unit = govtwin_model::params::reference();
    let replayed = Replayed::new(&mut Twin::new(&unit), recording(&unit));
    assert_eq!(replayed.scores.figures(Signal::ServomotorPosition).count, 50);
    assert_eq!(replayed.scores.figures(Signal::SpoolPosition).count, 0);
    let mut twice = replayed.scores;
    twice.merge(&replayed.scores);
    assert_eq!(twice.figures(Signal::ServomotorPosition).count, 100);
    assert_eq!(Scores::of(&replayed.recording, &[]), Scores::default());
}

/// All files below a folder with their content.
fn contents(dir: &Path, found: &mut Vec<(String, Vec<u8>)>) {
    let mut entries: Vec<_> = std::fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            contents(&path, found);
        } else {
            found.push((path.file_name().unwrap().to_string_lossy().into_owned(), std::fs::read(&path).unwrap()));
        }
    }
}

#[test]
fn the_number_of_threads_changes_no_byte() {
    let dir = tempfile::tempdir().unwrap();
    let bags = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/practice/case_01");
    let written = |threads: &str| {
        let out = dir.path().join(threads);
        let output = Command::new(env!("CARGO_BIN_EXE_govtwin"))
            .env("RAYON_NUM_THREADS", threads)
            .env("SOURCE_DATE_EPOCH", "1700000000")
            .args(["replay", bags.to_str().unwrap(), "--out", out.to_str().unwrap()])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let mut found = vec![];
        contents(&out, &mut found);
        found
    };
    let one = written("1");
    assert_eq!(one.len(), 2 + 2 * 4, "page, figures, and four bags of two files");
    assert!(one == written("4"), "files differ between one thread and four");
}

#[test]
fn a_cut_shows_dashes_and_says_why() {
    let bag = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/reference/startup_01.mcap");
    for (cut, word, dashes_first) in
        [("servomotor", "measured servomotor position", true), ("spool", "measured spool position", false)]
    {
        let output = Command::new(env!("CARGO_BIN_EXE_govtwin"))
            .args(["replay", bag.to_str().unwrap(), "--cut", cut])
            .output()
            .unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        assert!(
            output.status.success() && text.contains(word) && text.contains("its error is not evaluated"),
            "{text}"
        );
        let overall = text.lines().find(|line| line.starts_with("overall")).unwrap();
        let figures: Vec<bool> = overall.split_whitespace().skip(3).map(|cell| cell == "–").collect();
        assert_eq!(figures, [[dashes_first; 3], [!dashes_first; 3]].concat(), "{overall}");
    }
}

/// Every key of a JSON value, at any depth.
fn keys(value: &serde_json::Value, found: &mut std::collections::BTreeSet<String>) {
    match value {
        serde_json::Value::Object(fields) => fields.iter().for_each(|(key, value)| {
            found.insert(key.clone());
            keys(value, found);
        }),
        serde_json::Value::Array(values) => values.iter().for_each(|value| keys(value, found)),
        _ => {}
    }
}

#[test]
fn every_key_of_the_figures_is_documented_with_its_schema() {
    let documented: String =
        include_str!("../src/diagnosis/replay_summary.rs").lines().filter(|line| line.starts_with("//!")).collect();
    let dir = tempfile::tempdir().unwrap();
    let params = dir.path().join("unit.yaml");
    std::fs::write(&params, "name: unit 2\noil:\n  bulk_modulus_pa: 1.1e9\n").unwrap();
    let bag = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/reference/startup_01.mcap");
    let output = Command::new(env!("CARGO_BIN_EXE_govtwin"))
        .args(["replay", bag.to_str().unwrap(), "--params", params.to_str().unwrap(), "--out"])
        .arg(dir.path())
        .output()
        .unwrap();
    assert!(output.status.success());
    let text = std::fs::read_to_string(dir.path().join("replay.json")).unwrap();
    let figures: serde_json::Value = serde_json::from_str(&text).unwrap();
    let mut found = std::collections::BTreeSet::new();
    keys(&figures, &mut found);
    assert!(found.len() > 25, "{found:?}");
    for key in found {
        assert!(documented.contains(&format!("\"{key}\"")), "{key} is not documented");
    }
    assert!(documented.contains(figures["schema"].as_str().unwrap()));
    assert_eq!(figures["parameters"]["changed"]["oil.bulk_modulus_pa"], 1.1e9);
    assert!(figures["recordings"][0]["origin"].as_str().unwrap().contains("Synthetic"));
}

/// Replays a shipped recording with these arguments.
fn validated(arguments: &[&str]) -> program::Run {
    let bag = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/reference/load_rejection_01.mcap");
    program::Run::of(Command::new(env!("CARGO_BIN_EXE_govtwin")).arg("replay").arg(bag).args(arguments))
}

#[test]
fn a_broken_limit_has_an_exit_code_of_its_own_and_is_found_in_every_report() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let limits = ["--require", "servomotor.rmse<=50%", "--require", "load_rejection.spool.max<=0.01%"];
    let run = validated(&[&limits[..], &["--out", &at("out"), "--junit", &at("replay.xml")]].concat());
    assert_eq!(run.code, 4, "{}{}", run.stdout, run.stderr);
    let figures = std::fs::read_to_string(dir.path().join("out/replay.json")).unwrap();
    let figures: serde_json::Value = serde_json::from_str(&figures).unwrap();
    let checks = figures["validation"]["checks"].as_array().unwrap();
    let standings: Vec<_> = checks.iter().map(|check| check["standing"].as_str().unwrap()).collect();
    assert_eq!(standings, ["passes", "fails"]);
    let (value, bound) = (checks[1]["value"].as_f64().unwrap(), checks[1]["bound"].as_f64().unwrap());
    assert!(value > bound && (bound - 1e-4).abs() < 1e-15);
    let stretch = &checks[1]["stretch"];
    let length_s = stretch["to_s"].as_f64().unwrap() - stretch["from_s"].as_f64().unwrap();
    assert!((length_s - 2.0).abs() < 1e-9, "{stretch}");
    let xml = std::fs::read_to_string(dir.path().join("replay.xml")).unwrap();
    let report = quick_junit::Report::deserialize_from_str(&xml).unwrap();
    assert_eq!((report.tests, report.failures, report.errors), (2, 1, 0));
    let page = std::fs::read_to_string(dir.path().join("out/replay.html")).unwrap();
    assert!(page.contains("load_rejection.spool.max&lt;=0.01%"), "the limit is on the page");
    // Kept limits end with 0, an error with 1, a slip with 2.
    assert_eq!(validated(&limits[..2]).code, 0);
    assert_eq!(validated(&["--against", &at("none.json")]).code, 1);
    assert_eq!(validated(&["--require", "spool.rmse<0.5%"]).code, 2);
    assert_eq!(validated(&["--junit", &at("alone.xml")]).code, 2);
}

#[test]
fn a_stored_replay_is_the_limit_of_the_next_one() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    // Of two sheets one has a learned residual: what is compared is the twin alone.
    let alone = ["--residual", "none"];
    assert_eq!(validated(&[&alone[..], &["--out", &at("approved")]].concat()).code, 0);
    let baseline = at("approved/replay.json");
    let itself = validated(&[&alone[..], &["--against", &baseline, "--worse-by", "0"]].concat());
    assert_eq!(itself.code, 0, "no worse than itself: {}", itself.stderr);
    std::fs::write(dir.path().join("worse.yaml"), "servomotor:\n  load_closed_n: 4.0e5\n").unwrap();
    let worse = validated(&["--params", &at("worse.yaml"), "--against", &baseline, "--worse-by", "10%", "--json"]);
    assert_eq!(worse.code, 4, "{}{}", worse.stdout, worse.stderr);
    let figures: serde_json::Value = serde_json::from_str(&worse.stdout).unwrap();
    assert_eq!(figures["validation"]["passed"], false);
    assert_eq!(validated(&["--cut", "spool", "--against", &baseline]).code, 1, "made with another cut");
    let limits = "# of the bench\nservomotor.rmse<=50%   # wide\n\n";
    std::fs::write(dir.path().join("limits.txt"), limits).unwrap();
    assert_eq!(validated(&["--require", &format!("@{}", at("limits.txt"))]).code, 0);
}

/// A recorder that writes a row every 0.2 s chose that rate, not the governor; what holds live is no less exact between rows that come as fast.
#[test]
fn between_slow_rows_inputs_run_straight_and_the_trip_comes_when_the_unit_moved() {
    let figures = |more: &[&str]| -> serde_json::Value {
        let bag = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/reference/shutdown_01.mcap");
        let mut command = Command::new(env!("CARGO_BIN_EXE_govtwin"));
        let run = program::Run::of(command.arg("replay").arg(bag).args(["--residual", "none", "--json"]).args(more));
        serde_json::from_str(&run.stdout).unwrap()
    };
    let [held, straight, as_recorded] =
        [&["--rate-of-inputs", "hold"][..], &["--rate-of-inputs", "linear"], &[]].map(figures);
    let rmse = |figures: &serde_json::Value| figures["overall"]["signals"][0]["rmse"].as_f64().unwrap();
    assert!(
        rmse(&as_recorded) < rmse(&straight) && rmse(&straight) < 0.6 * rmse(&held),
        "{held} {straight} {as_recorded}"
    );
    let notes = |figures: &serde_json::Value| figures["recordings"][0]["notes"].to_string();
    assert!(notes(&as_recorded).contains("rows come every 0.20 s") && notes(&as_recorded).contains("a trip was set"));
    assert!(!notes(&held).contains("rows come every"));
    assert_eq!(
        as_recorded["recordings"][0]["rows"], held["recordings"][0]["rows"],
        "added rows are none of the recording's"
    );
}

#[test]
fn the_page_shows_the_learned_residual_with_its_band_beside_the_twin_alone() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let run = validated(&["--out", out.to_str().unwrap()]);
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    let page = std::fs::read_to_string(out.join("replay.html")).unwrap();
    for words in ["twin alone", "with the residual", "90 % band", "with the learned residual"] {
        assert!(page.contains(words), "{words}");
    }
    let figures: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(out.join("replay.json")).unwrap()).unwrap();
    let spool = |group: &serde_json::Value| {
        let signals = group["signals"].as_array().unwrap();
        signals.iter().find(|one| one["name"] == "spool_position_pu").unwrap()["rmse"].as_f64().unwrap()
    };
    assert!(spool(&figures["residual"]["overall"]) < spool(&figures["overall"]), "the residual helps on its unit");
}

#[cfg(feature = "node")]
#[test]
fn the_page_shows_how_late_the_ticks_of_the_node_were() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let mut stats = govtwin_node::stats::Stats::default();
    stats.woke(0, 41_000, 50_000, 1_000_000);
    let figures = serde_json::json!({"loop": stats.summary(0), "inputs": {}});
    std::fs::write(at("run.json"), figures.to_string()).unwrap();
    let run = validated(&["--run", &at("run.json"), "--out", &at("out")]);
    assert_eq!(run.code, 0, "{}{}", run.stdout, run.stderr);
    let page = std::fs::read_to_string(at("out/replay.html")).unwrap();
    assert!(page.contains("Punctuality of the node") && page.contains(">41"), "lateness in µs");
    std::fs::write(at("run.json"), r#"{"units": {}}"#).unwrap();
    let run = validated(&["--run", &at("run.json"), "--out", &at("out")]);
    assert!(run.code == 1 && run.stderr.contains("the figures of one unit"), "{}", run.stderr);
}
