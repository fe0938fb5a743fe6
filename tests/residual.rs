//! A residual model outside of its own module: in a replay, refused where it does not fit, and in the node's step.
#![cfg(feature = "cli")]

#[path = "support/residual.rs"]
mod residual;

use std::path::Path;
use std::process::{Command, Output};

use govtwin_correction::model::Model;
use govtwin_correction::row::RateOfInputs;
use govtwin_model::params;

fn replay(model: &Path, more: &[&str]) -> Output {
    replay_with(&[&["--residual", model.to_str().unwrap()], more].concat())
}

fn replay_with(arguments: &[&str]) -> Output {
    let bag = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/reference/startup_01.mcap");
    Command::new(env!("CARGO_BIN_EXE_govtwin")).arg("replay").arg(bag).args(arguments).output().unwrap()
}

/// The figures of a replay of the start-up, and what it prints.
fn figures(arguments: &[&str]) -> (serde_json::Value, String) {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let output = replay_with(&[arguments, &["--out", out.to_str().unwrap()]].concat());
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(out.join("replay.json")).unwrap();
    let page = std::fs::read_to_string(out.join("replay.html")).unwrap();
    assert_eq!(page.contains("reference_unit.residual (shipped)"), text.contains("reference_unit.residual (shipped)"));
    (serde_json::from_str(&text).unwrap(), String::from_utf8_lossy(&output.stdout).into_owned())
}

#[test]
fn the_shipped_residual_corrects_the_reference_unit_unless_it_is_left_out() {
    const NAME: &str = "reference_unit.residual (shipped)";
    let (by_default, text) = figures(&[]);
    assert!(text.contains(NAME) && text.contains("`--residual none` leaves it out"), "{text}");
    assert_eq!(by_default["residual"]["model"], NAME);
    assert!(by_default["provenance"]["options"]["residual"].as_str().unwrap().starts_with(NAME));
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/params/reference_unit.residual");
    let (given, _) = figures(&["--residual", file]);
    for part in ["overall", "inputs_between_samples"] {
        assert_eq!(by_default[part], given[part]);
    }
    assert_eq!(by_default["residual"]["overall"], given["residual"]["overall"]);
    let (without, text) = figures(&["--residual", "none"]);
    assert!(without["residual"].is_null() && !text.contains(".residual"), "{text}");
    assert_eq!(without["inputs_between_samples"], "as_recorded");
}

#[test]
fn a_shipped_residual_that_cannot_be_used_is_named_with_the_reason_on_its_own_sheet_only() {
    for (arguments, reason) in [
        (["--rate-of-inputs", "hold"], "trained with --rate-of-inputs linear"),
        (["--cut", "spool"], "nothing to correct"),
    ] {
        let (figures, text) = figures(&arguments);
        assert!(text.contains("is not used: ") && text.contains(reason), "{text}");
        assert!(figures["residual"].is_null());
        assert!(figures["provenance"]["options"]["residual"].as_str().unwrap().contains(reason));
    }
    let dir = tempfile::tempdir().unwrap();
    let sheet = dir.path().join("other.yaml");
    std::fs::write(&sheet, "oil: {bulk_modulus_pa: 1.1e9}\n").unwrap();
    let (figures, text) = figures(&["--params", sheet.to_str().unwrap()]);
    assert!(figures["residual"].is_null() && !text.contains(".residual"), "{text}");
    assert_eq!(replay_with(&["--residual", "none", "--adapt"]).status.code(), Some(2));
}

#[test]
fn a_replay_shows_both_stages_and_what_the_guard_did() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("model.residual");
    std::fs::write(&path, residual::model(&params::reference()).to_text().unwrap()).unwrap();
    let out = dir.path().join("out");
    let output = replay(&path, &["--out", out.to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("With the residual of "));
    let text = std::fs::read_to_string(out.join("replay.json")).unwrap();
    let figures: serde_json::Value = serde_json::from_str(&text).unwrap();
    let spool = |group: &serde_json::Value| {
        let signals = group["signals"].as_array().unwrap();
        signals.iter().find(|one| one["name"] == "spool_position_pu").unwrap().clone()
    };
    let (plain, corrected) = (spool(&figures["overall"]), spool(&figures["residual"]["overall"]));
    let moved = (corrected["bias"].as_f64().unwrap() - plain["bias"].as_f64().unwrap()).abs();
    assert!(moved > 1e-3 && moved < 0.011, "{moved}");
    assert_eq!(figures["residual"]["guard"]["rows"], figures["recordings"][0]["rows"]);
    let documented = include_str!("../src/diagnosis/replay_summary.rs");
    for key in figures["residual"].as_object().unwrap().keys() {
        assert!(documented.contains(&format!("\"{key}\"")), "{key} is not documented");
    }
}

#[test]
fn a_replay_that_adapts_says_what_it_saw() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("model.residual");
    let mut model = residual::model(&params::reference());
    std::fs::write(&path, model.to_text().unwrap()).unwrap();
    let out = dir.path().join("out");
    let output = replay(&path, &["--adapt", "--out", out.to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("Adaptation: "));
    let text = std::fs::read_to_string(out.join("replay.json")).unwrap();
    let figures: serde_json::Value = serde_json::from_str(&text).unwrap();
    let adaptation = figures["residual"]["adaptation"].as_object().unwrap();
    assert!(adaptation["samples"].as_u64().unwrap() > 1000);
    let documented = include_str!("../src/diagnosis/replay_summary.rs");
    for key in adaptation.keys() {
        assert!(documented.contains(&format!("\"{key}\"")), "{key} is not documented");
    }
    model.band = None;
    std::fs::write(&path, model.to_text().unwrap()).unwrap();
    let output = replay(&path, &["--adapt"]);
    assert!(String::from_utf8_lossy(&output.stderr).contains("band, against which drift is judged"));
}

#[test]
fn a_model_that_does_not_fit_or_is_damaged_is_refused_with_its_reason() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("model.residual");
    let mut unit = params::reference();
    let text = residual::model(&unit).to_text().unwrap();
    let refused = |text: &str, more: &[&str], words: &str| {
        std::fs::write(&path, text).unwrap();
        let output = replay(&path, more);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains(words) && said.contains("model.residual") || said.contains("does not fit"), "{said}");
    };
    refused(&text[..text.len() / 2], &[], "checksum");
    refused("", &[], "an empty file");
    refused(&text, &["--cut", "servomotor"], "guide-vane opening");
    unit.parameters.oil.bulk_modulus_pa *= 1.01;
    refused(&residual::model(&unit).to_text().unwrap(), &[], "its twin");
}

#[test]
fn a_model_of_faster_rows_is_refused_or_says_what_it_assumes() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("model.residual");
    let keep = |period_ns: i64, rate_of_inputs: RateOfInputs| {
        let model = Model { period_ns, rate_of_inputs, ..residual::model(&params::reference()) };
        std::fs::write(&path, model.to_text().unwrap()).unwrap();
    };
    let said = |output: &Output| {
        [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat()
    };
    // Of the same rate: said, and nothing to warn of.
    keep(200_000_000, RateOfInputs::Hold);
    let output = replay(&path, &[]);
    assert_eq!(output.status.code(), Some(0));
    assert!(said(&output).contains("trained on rows every 0.2 s with the opening simulated"), "{}", said(&output));
    // Rows every 0.2 s hold no past on a grid of 0.01 s.
    keep(10_000_000, RateOfInputs::Hold);
    let output = replay(&path, &[]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("its training period is 0.01 s"), "{}", said(&output));
    // Driven on a fine grid they do, and what lies between is an assumption.
    keep(10_000_000, RateOfInputs::Linear);
    let output = replay(&path, &[]);
    assert!(output.status.code() != Some(1), "{}", said(&output));
    assert!(
        said(&output).contains("recorded every 0.2 s, while the residual was trained every 0.01 s"),
        "{}",
        said(&output)
    );
}

#[cfg(feature = "residual")]
#[test]
fn every_objective_trains_by_command_and_the_model_says_which() {
    let dir = tempfile::tempdir().unwrap();
    let bag = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/reference/load_rejection_01.mcap");
    let trees = ["l1", "huber", "l2", "quantile"].map(|objective| {
        let out = dir.path().join(objective);
        let output = Command::new(env!("CARGO_BIN_EXE_govtwin"))
            .args(["train", "--manual", "--objective", objective, "--out"])
            .args([&out, &bag])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let model = Model::from_text(&std::fs::read_to_string(out.join("model.residual")).unwrap()).unwrap();
        (model.training["objective"].clone(), model.trees.len())
    });
    assert_eq!(trees.each_ref().map(|(name, _)| &**name), ["regression_l1", "huber", "regression", "quantile"]);
    assert_eq!(trees.map(|(_, count)| count), [200, 200, 200, 600]);
}

#[cfg(feature = "node")]
#[test]
fn the_node_corrects_in_the_same_step_as_a_replay_would() {
    use govtwin_correction::corrector::Corrector;
    use govtwin_model::frame::EsvState;
    use govtwin_model::twin::Twin;
    use govtwin_node::core::{Core, InputEvent, Notices, OnStale, Policy};
    use govtwin_node::refit::Refit;

    const MS: i64 = 1_000_000;
    let unit = params::reference();
    let model = residual::model(&unit);
    let policy = Policy { stale_after_ns: 1000 * MS, hold_ns: 1000 * MS, on_stale: OnStale::Trip };
    let corrector = Corrector::new(&model).unwrap();
    let mut core = Core::new(Twin::new(&unit), policy, 6.3e6).with_corrector(Some(corrector.clone()));
    let (mut twin, mut offline) = (Twin::new(&unit), corrector);
    for step in 0..800 {
        let now_ns = step * MS;
        core.hear(InputEvent::Command(if step < 300 { 0.35 } else { 0.45 }), now_ns);
        core.hear(InputEvent::Esv(EsvState::Normal), now_ns);
        core.hear(InputEvent::TankPressure(6.2e6), now_ns);
        let tick = core.tick(now_ns, now_ns);
        let (estimate, correction) = (tick.estimate.unwrap(), tick.correction.unwrap());
        let by = if step < 300 { -0.01 } else { 0.01 };
        assert_eq!(correction.uncorrected, estimate.signals.spool_position_pu);
        assert_eq!(correction.corrected, correction.uncorrected + by);
        assert_eq!(correction.half_width, 0.02);
        assert_eq!(correction, offline.step(&tick.frame, &twin.step(&tick.frame)));
    }
    // It is of the unit as it was, and ends with it.
    let mut changed = unit;
    changed.parameters.servomotor.load_closed_n += 1e5;
    core.refit(&mut Refit::new(&changed));
    let tick = core.tick(800 * MS, 800 * MS);
    assert!(tick.estimate.is_some() && tick.correction.is_none() && tick.notices.has(Notices::UNCORRECTED));
}

#[test]
fn a_recording_as_fast_as_live_is_driven_as_live_with_the_shipped_residual() {
    let dir = tempfile::tempdir().unwrap();
    let made = dir.path().join("made");
    let govtwin = |arguments: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_govtwin")).args(arguments).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output.stdout
    };
    govtwin(&["generate", "--process", "load_rejection", "--duration", "30", "--out", made.to_str().unwrap()]);
    let figures = |more: &[&str]| -> serde_json::Value {
        let arguments = [&["replay", made.to_str().unwrap(), "--json"], more].concat();
        serde_json::from_slice(&govtwin(&arguments)).unwrap()
    };
    let (corrected, plain) = (figures(&[]), figures(&["--residual", "none"]));
    assert_eq!(corrected["residual"]["model"], "reference_unit.residual (shipped)");
    assert_eq!(corrected["inputs_between_samples"], "hold");
    assert_eq!(corrected["overall"], plain["overall"]);
}
