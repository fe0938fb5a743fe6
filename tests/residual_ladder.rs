//! The ladder on a generated unit with a planted effect: on a process left out of training the effect carries over, the residual does not.
#![cfg(all(feature = "cli", feature = "residual"))]

use std::path::Path;
use std::process::Command;

const BIN: &str = env!("CARGO_BIN_EXE_govtwin");

fn run(args: &[&str]) -> String {
    let output = Command::new(BIN).args(args).env("RAYON_NUM_THREADS", "1").output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn on_a_process_left_out_the_named_effect_carries_over_and_the_residual_does_not() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let effect = "port_overlap=0.002";
    let visit = |seed: &str| {
        let out = at(&format!("unit/visit_{seed}"));
        let flags = ["--rate", "5", "--duration", "120", "--spread", "off", "--seed", seed];
        run(&[&["generate", "--out", &out, "--effect", effect], &flags[..]].concat());
    };
    ["1", "2", "3"].into_iter().for_each(visit);
    std::fs::write(at("effect.yaml"), "effects:\n  port_overlap:\n    extra_overlap_m: 0.002\n").unwrap();
    let unit = at("unit");
    let trained = at("model");
    run(&["train", &unit, "--manual", "--leave-out", "load_rejection", "--out", &trained]);
    let model = format!("{trained}/model.residual");
    let out = at("ladder");
    let text = run(&["replay", &unit, "--then", &at("effect.yaml"), "--residual", &model, "--out", &out]);
    println!("{text}");

    let text = std::fs::read_to_string(Path::new(&out).join("replay.json")).unwrap();
    let figures: serde_json::Value = serde_json::from_str(&text).unwrap();
    let rungs = figures["ladder"]["rungs"].as_array().unwrap();
    let mae = |rung: usize, process: &str| {
        let groups = rungs[rung]["processes"].as_array().unwrap();
        let group = groups.iter().find(|group| group["process"] == process).unwrap();
        let signals = group["signals"].as_array().unwrap();
        signals.iter().find(|one| one["name"] == "spool_position_pu").unwrap()["mae"].as_f64().unwrap()
    };
    assert_eq!(rungs.len(), 3);
    assert_eq!(rungs[2]["unseen"], serde_json::json!(["load_rejection"]));
    // Where it has been, the black box looks as if it knew; where it has not, the law does.
    let [shipped, effect, boxed] = [0, 1, 2].map(|rung| mae(rung, "load_rejection"));
    assert!(effect < 0.5 * shipped, "effect {effect} against {shipped}");
    assert!(boxed > 1.5 * effect, "residual {boxed} against effect {effect}");
    assert!(mae(2, "load_increase") < 0.8 * mae(0, "load_increase"));
    let finding = figures["ladder"]["findings"][0].as_str().unwrap();
    assert!(finding.starts_with("Load rejection was left out of training."), "{finding}");
    let page = std::fs::read_to_string(Path::new(&out).join("replay.html")).unwrap();
    assert!(
        page.contains("Mean absolute error with each unit and each learned residual."),
        "the ladder is on the page"
    );
}
