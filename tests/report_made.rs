//! What a report says it was made from, that it is kept from harm, and that its page can be made again.
#![cfg(feature = "cli")]

#[path = "cli/bags.rs"]
#[expect(dead_code, reason = "several tests share it")]
mod bags;

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use bags::bag;
use govtwin_bag::{ReadOptions, read};
use govtwin_files::digest::sha256;
use govtwin_model::effects::CATALOGUE;
use serde_json::Value;

fn govtwin(dir: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_govtwin"));
    command.args(arguments).current_dir(dir).env("SOURCE_DATE_EPOCH", "1700000000").output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

/// The data of a bag folder.
fn data(folder: &Path) -> Vec<u8> {
    let name = format!("{}_0.mcap", folder.file_name().unwrap().to_str().unwrap());
    fs::read(folder.join(name)).unwrap()
}

#[test]
fn a_replay_names_what_it_was_made_from_and_keeps_the_synthetic_mark() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let made =
        govtwin(dir.path(), &["generate", "--process", "shutdown", "--duration", "30", "--out", "unit 3", "--json"]);
    assert!(made.status.success(), "{}", text(&made.stderr));
    let said: Value = serde_json::from_slice(&made.stdout).unwrap();
    assert!(said["synthetic"] == true && said["bags"][0] == "unit 3/shutdown", "{said}");
    let arguments = ["replay", "unit 3", "--cut", "servo", "--then", "unit 3/truth.yaml", "--out", "out", "--json"];
    let run = govtwin(dir.path(), &arguments);
    assert!(run.status.success(), "{}", text(&run.stderr));
    let figures: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(figures, json(&at("out/replay.json")), "standard output and file hold the same");
    let made = &figures["provenance"];
    assert_eq!(made["date"], "2023-11-14T22:13:20Z");
    assert_eq!((&made["unit"], &made["command"]), (&Value::from("unit 3"), &Value::from("replay")));
    assert_eq!(made["recordings"][0]["files"][0]["sha256"], sha256(data(&at("unit 3/shutdown"))));
    assert_eq!(made["recordings"][0]["synthetic"], true);
    assert_eq!(made["options"]["cut"], "servomotor", "a name that people use stands for the option's own");
    let truth = sha256(fs::read(at("unit 3/truth.yaml")).unwrap());
    assert!(made["options"]["then"].as_str().unwrap().contains(&truth[..12]), "{made}");
    // The page says so, and draws the two units beside each other.
    let page = fs::read_to_string(at("out/replay.html")).unwrap();
    for words in [
        "Synthetic data: the bags say",
        "2023-11-14",
        &sha256(data(&at("unit 3/shutdown")))[..12],
        "\nbefore\n",
        "\nafter: truth.yaml\n",
    ] {
        assert!(page.contains(words), "{words}");
    }
    // What was recorded is no less synthetic in the bag that the replay wrote.
    let health = read(&at("out/shutdown"), &ReadOptions::default()).unwrap().health;
    assert!(health.is_synthetic() && health.about("replay_of") == Some("shutdown"), "{:?}", health.files[0].about);
    let measured = bag(dir.path(), "measured", |_, _| {});
    assert!(govtwin(dir.path(), &["replay", measured.to_str().unwrap(), "--out", "out2"]).status.success());
    assert!(!read(&at("out2/measured"), &ReadOptions::default()).unwrap().health.is_synthetic());
    // The origin that a folder states goes with the bag.
    fs::write(at("ORIGIN.txt"), "Synthetic data: by hand.\n").unwrap();
    assert!(govtwin(dir.path(), &["replay", measured.to_str().unwrap(), "--out", "out3"]).status.success());
    fs::remove_file(at("ORIGIN.txt")).unwrap();
    let health = read(&at("out3/measured"), &ReadOptions::default()).unwrap().health;
    assert!(health.is_synthetic() && health.about("origin") == Some("Synthetic data: by hand."));
    let info = govtwin(dir.path(), &["info", "out3/measured", "--json"]);
    let info: Value = serde_json::from_slice(&info.stdout).unwrap();
    assert_eq!(info[0]["files"][0]["about"]["synthetic"], "true");
}

#[test]
fn a_diagnosis_has_a_folder_for_each_unit_and_spares_those_of_others() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    for (unit, seed) in [("unit_1", "3"), ("unit_2", "4")] {
        let arguments =
            ["generate", "--process", "load_increase", "--effect", "lvdt_bias=0.03", "--seed", seed, "--out", unit];
        assert!(govtwin(dir.path(), &arguments).status.success());
    }
    let without: Vec<&str> = CATALOGUE
        .iter()
        .filter(|spec| !["lvdt_bias", "feedback_lag"].contains(&spec.id))
        .flat_map(|spec| ["--without", spec.id])
        .collect();
    let run = |more: &[&str]| govtwin(dir.path(), &[&["diagnose"], more, &without[..]].concat());
    let first = run(&["unit_1", "--json", "--fail-on", "no_gap,not_excited,named"]);
    // A verdict that fails is reported like any other.
    assert_eq!(first.status.code(), Some(1), "{}", text(&first.stderr));
    assert!(text(&first.stderr).contains("the verdict is named, on which --fail-on"), "{}", text(&first.stderr));
    let report: Value = serde_json::from_slice(&first.stdout).unwrap();
    let folder = at("diagnosis/unit_1");
    assert_eq!(report, json(&folder.join("report.json")));
    let made = &report["provenance"];
    assert_eq!((&made["unit"], &made["seed"]), (&Value::from("unit_1"), &Value::from(1)));
    assert_eq!(made["recordings"][0]["files"][0]["sha256"], sha256(data(&at("unit_1/load_increase"))));
    assert!(made["options"]["without"].as_str().unwrap().contains("backlash"), "{made}");
    assert!(made["warnings"].as_array().unwrap().iter().any(|one| one.as_str().unwrap().contains("One recording")));
    for name in ["refitted.yaml", "fitted.yaml"] {
        let head = fs::read_to_string(folder.join(name)).unwrap();
        for words in
            ["# Made by govtwin ", "diagnose on 2023-11-14", "Unit: unit_1.", "synthetic", "seed 1", "# Warning: "]
        {
            assert!(head.contains(words), "{name}: {words}: {head}");
        }
    }

    // What was changed in the report, or stands beside it and is another's, is refused by name.
    let whole = fs::read(folder.join("report.json")).unwrap();
    let refused = |what: &str, words: &str| {
        for arguments in
            [&["report", "diagnosis/unit_1/report.json"][..], &["accept", "unit_1", "--diagnosis", "diagnosis/unit_1"]]
        {
            let run = govtwin(dir.path(), arguments);
            assert!(run.status.code() == Some(1) && text(&run.stderr).contains(words), "{what}: {}", text(&run.stderr));
        }
    };
    for (one, other, place) in [
        ("/provenance/written/fitted.yaml", "/provenance/written/refitted.yaml", "provenance.written"),
        ("/provenance/sheet/sha256", "/provenance/recordings/0/files/0/sha256", "provenance.recordings"),
        ("/evidence/parameters/0/sheet", "/evidence/parameters/1/sheet", "evidence.parameters"),
        ("/gap/signals/0", "/gap/signals/1", "gap.signals"),
    ] {
        let mut changed = report.clone();
        let [first, second] = [one, other].map(|place| report.pointer(place).unwrap().clone());
        *changed.pointer_mut(one).unwrap() = second;
        *changed.pointer_mut(other).unwrap() = first;
        fs::write(folder.join("report.json"), changed.to_string()).unwrap();
        refused(one, &format!("{place}: expected what was written"));
    }
    let mut changed = report.clone();
    changed.as_object_mut().unwrap().remove("digests").unwrap();
    changed["verdict"] = "no_gap".into();
    fs::write(folder.join("report.json"), changed.to_string()).unwrap();
    refused("no digests", "digests: expected the SHA-256 of each section, found none");
    fs::write(folder.join("report.json"), whole).unwrap();
    for name in ["refitted.yaml", "fitted.yaml"] {
        let own = fs::read(folder.join(name)).unwrap();
        fs::write(folder.join(name), [&own[..], b"# by hand\n"].concat()).unwrap();
        refused(name, &format!("{name} beside it: expected the file that was written with the report"));
        fs::write(folder.join(name), own).unwrap();
    }

    // The page is made again from the report, with the same four answers.
    let page = fs::read_to_string(folder.join("report.html")).unwrap();
    fs::rename(folder.join("report.json"), at("alone.json")).unwrap();
    let again = govtwin(dir.path(), &["report", "alone.json"]);
    assert!(again.status.success(), "{}", text(&again.stderr));
    let answers =
        |page: &str| page.split("<dl class=\"answers\">").nth(1).unwrap().split("</dl>").next().unwrap().to_owned();
    assert_eq!(answers(&fs::read_to_string(at("alone.html")).unwrap()), answers(&page));
    assert!(text(&again.stdout).contains("verdict      named"), "{}", text(&again.stdout));

    // Files without a report belong to nobody knows whom; a report of other recordings to another unit.
    let orphaned = run(&["unit_1"]);
    assert!(
        orphaned.status.code() == Some(1) && text(&orphaned.stderr).contains("nobody can tell whose"),
        "{}",
        text(&orphaned.stderr)
    );
    fs::rename(at("alone.json"), folder.join("report.json")).unwrap();
    let before = fs::read(folder.join("report.json")).unwrap();
    let other = run(&["unit_2", "--out", "diagnosis/unit_1"]);
    let words = text(&other.stderr);
    assert!(
        other.status.code() == Some(1) && words.contains("is the report of `unit_1`, of other recordings"),
        "{words}"
    );
    assert!(words.contains("--overwrite"), "{words}");
    assert_eq!(fs::read(folder.join("report.json")).unwrap(), before);
    let overwritten = run(&["unit_2", "--out", "diagnosis/unit_1", "--overwrite"]);
    assert!(matches!(overwritten.status.code(), Some(0 | 3)), "{}", text(&overwritten.stderr));
    assert_eq!(json(&folder.join("report.json"))["provenance"]["unit"], "unit_2");
}

#[test]
fn what_is_no_report_of_a_diagnosis_is_named_for_what_it_is() {
    let dir = tempfile::tempdir().unwrap();
    for (content, words) in [
        (r#"{"schema": "govtwin-replay/1"}"#, "its pictures come from the bags"),
        (
            r#"{"schema": "govtwin-diagnosis/9"}"#,
            "expected a report of the schema govtwin-diagnosis/1, found `govtwin-diagnosis/9`",
        ),
        (
            r#"{"schema": "govtwin-diagnosis/1", "verdict": "perhaps"}"#,
            "verdict: expected a verdict (named, class, unknown, no_gap, not_excited, no_such_unit), found `perhaps`",
        ),
        (
            r#"{"schema": "govtwin-diagnosis/1", "verdict": "named", "effects": [{"id": "backlash", "stage": "rotor", "probability": 0.9}]}"#,
            "effects[0].stage: expected a stage of the chain (regulator, pilot_valve, esv, spool, servomotor, supply, sensor), found `rotor`",
        ),
        (
            r#"{"schema": "govtwin-diagnosis/1", "verdict": "no_gap", "ranking": [{"id": "none", "probability": "high"}]}"#,
            "ranking[0].probability: invalid type: string \"high\", expected f64",
        ),
        ("[]", "found JSON that states none"),
        ("{", "report.json"),
    ] {
        fs::write(dir.path().join("report.json"), content).unwrap();
        let run = govtwin(dir.path(), &["report", "report.json"]);
        assert!(run.status.code() == Some(1) && text(&run.stderr).contains(words), "{content}: {}", text(&run.stderr));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "nothing is written");
    }
}
