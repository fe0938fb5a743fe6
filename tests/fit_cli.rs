//! `govtwin fit` through the binary: files, exit codes, words; and the example of docs/own_effect.md in every command.
#![cfg(feature = "cli")]

#[path = "support/program.rs"]
mod program;

use std::fs;
use std::path::Path;
use std::process::Command;

use program::Run;

fn run(threads: &str, arguments: &[&str]) -> Run {
    let mut command = Command::new(env!("CARGO_BIN_EXE_govtwin"));
    Run::of(command.args(arguments).env("RAYON_NUM_THREADS", threads).env("SOURCE_DATE_EPOCH", "0"))
}

fn done(arguments: &[&str]) -> String {
    let run = run("2", arguments);
    assert!(run.code == 0, "{arguments:?}: {} {}", run.code, run.stderr);
    run.stdout
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// A sheet in which only two parameters have a tolerance, so that fits are quick.
fn small_sheet(dir: &Path) -> String {
    let keys = govtwin_model::parameters::ENTRIES.iter().zip(govtwin_model::params::reference().tolerances);
    let mut sheet = String::new();
    let mut last = "";
    for (entry, tolerance) in keys {
        let (section, name) = entry.key.split_once('.').unwrap();
        if tolerance.is_none() || ["load_closed_n", "rated_flow_m3_s"].contains(&name) {
            continue;
        }
        if section != last {
            sheet += &format!("{section}:\n");
            last = section;
        }
        sheet += &format!("  {name}: {{tol: ~}}\n");
    }
    let path = dir.join("sheet.yaml");
    fs::write(&path, sheet).unwrap();
    text(&path).to_owned()
}

#[test]
fn a_fit_leaves_a_parameter_file_that_other_commands_take_whatever_the_thread_count() {
    let dir = tempfile::tempdir().unwrap();
    let sheet = small_sheet(dir.path());
    let (bags, slow) = (dir.path().join("bags"), dir.path().join("slow"));
    let make = ["generate", "--effect", "backlash=0.004", "--duration", "30", "--spread", "off", "--process"];
    done(&[&make[..], &["load_rejection", "--out", text(&bags)]].concat());
    done(&[&make[..], &["load_increase", "--rate", "5", "--out", text(&slow)]].concat());
    let mut files = vec![];
    for threads in ["1", "2"] {
        let out = dir.path().join(threads);
        let arguments = ["fit", "--params", &sheet, "--effect", "backlash", "--starts", "1", "--out", text(&out)];
        let run = run(threads, &[&arguments[..], &[text(&bags), text(&slow)]].concat());
        assert!(run.code == 0, "{}{}", run.stdout, run.stderr);
        for words in ["backlash.play_pu", "learned", "Well determined", "RMSE", "fitted.yaml"] {
            assert!(run.stdout.contains(words), "{words}: {}", run.stdout);
        }
        let read = |name: &str| fs::read_to_string(out.join(name)).unwrap();
        files.push((read("fit.json"), read("fitted.yaml")));
    }
    assert_eq!(files[0], files[1], "the same bytes for one and two threads");
    let figures: serde_json::Value = serde_json::from_str(&files[0].0).unwrap();
    let play = &figures["parameters"].as_array().unwrap()[2];
    assert_eq!((&play["key"], &play["unit"]), (&"backlash.play_pu".into(), &"pu".into()));
    assert!((play["fitted"].as_f64().unwrap() - 0.004).abs() < 3e-4, "{play}");
    assert_eq!(figures["recordings"].as_array().unwrap().len(), 2);
    assert!(files[0].1.contains("# ci90 ["), "{}", files[0].1);
    let fitted = dir.path().join("1/fitted.yaml");
    assert!(done(&["check", text(&fitted)]).contains("effect backlash: play_pu 0.00"));
    done(&["replay", "--params", text(&fitted), text(&bags)]);
    let left: Vec<String> = fs::read_dir(dir.path().join("1"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    assert_eq!(left.len(), 2, "{left:?}");
}

#[test]
fn the_documented_effect_of_ones_own_works_in_every_command() {
    let dir = tempfile::tempdir().unwrap();
    let page = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/own_effect.md")).unwrap();
    let example = page.split("```yaml\n").nth(1).unwrap().split("```").next().unwrap();
    let sheet = small_sheet(dir.path());
    let (candidate, true_unit) = (dir.path().join("stiction.yaml"), dir.path().join("true.yaml"));
    fs::write(&candidate, example).unwrap();
    fs::write(&true_unit, "base: stiction.yaml\neffects:\n  bush_stiction: {c_n: 4.0e4, v_m_s: 0.05}\n").unwrap();
    let checked = done(&["check", text(&true_unit)]);
    assert!(checked.contains("effect bush_stiction: c_n 40000.0 N, v_m_s 0.05 m/s"), "{checked}");
    assert!(checked.contains("adds to servomotor_force_n: -c_n*tanh("), "{checked}");
    let bags = dir.path().join("bags");
    let make = ["generate", "--process", "load_increase,load_rejection", "--spread", "off", "--duration", "30"];
    done(&[&make[..], &["--params", text(&true_unit), "--out", text(&bags)]].concat());
    // The truth beside the bags carries the definition.
    assert!(fs::read_to_string(bags.join("truth.yaml")).unwrap().contains("bush_stiction:\n    at: "));
    let out = dir.path().join("fit");
    let arguments = ["fit", "--params", &sheet, "--candidate", text(&candidate), "--out", text(&out), text(&bags)];
    let run = run("2", &arguments);
    assert!(run.code == 0 || run.code == 3, "{}", run.stderr);
    let figures: serde_json::Value = serde_json::from_slice(&fs::read(out.join("fit.json")).unwrap()).unwrap();
    let height = &figures["parameters"].as_array().unwrap()[2];
    assert_eq!(height["key"], "bush_stiction.c_n");
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let (fitted, low, high) = (number(&height["fitted"]), number(&height["ci90"][0]), number(&height["ci90"][1]));
    assert!(fitted > 1e4 && (low..=high).contains(&4e4), "{height}");
    let fitted = out.join("fitted.yaml");
    assert!(done(&["check", text(&fitted)]).contains("adds to servomotor_force_n"));
    let replayed = dir.path().join("replay");
    done(&["replay", "--params", text(&fitted), "--out", text(&replayed), text(&bags)]);
    let figures = fs::read_to_string(replayed.join("replay.json")).unwrap();
    assert!(figures.contains("bush_stiction") && figures.contains("v_m_s"));
}

#[test]
fn what_cannot_be_fitted_is_told_in_words() {
    let dir = tempfile::tempdir().unwrap();
    let sheet = small_sheet(dir.path());
    let bags = dir.path().join("bags");
    done(&["generate", "--process", "load_increase", "--duration", "30", "--out", text(&bags)]);
    let bag = bags.join("load_increase");
    let out = dir.path().join("out");
    let plain = dir.path().join("plain.yaml");
    fs::write(&plain, "name: nothing of its own\n").unwrap();
    for (arguments, words) in [
        (&["--effect", "backlsh"][..], "did you mean `backlash`?"),
        (&["--free", "oil.densty_kg_m3"], "did you mean `oil.density_kg_m3`?"),
        (&["--candidate", text(&plain)], "no effect of your own in it"),
        (&["--params", "nowhere.yaml"], "nowhere.yaml"),
    ] {
        // A slip on the command line, or a file that is not right.
        let code = if words.starts_with("did you mean") { 2 } else { 1 };
        let run = run("1", &[&["fit", "--out", text(&out)], arguments, &[text(&bag)]].concat());
        assert_eq!(run.code, code, "{}", run.stderr);
        assert!(run.stderr.contains(words), "{arguments:?}: {}", run.stderr);
    }
    // What says nothing is told apart from what is known: the trip valve in a load change.
    let free =
        ["fit", "--params", &sheet, "--free", "esv.drain_area_m2", "--starts", "1", "--out", text(&out), text(&bag)];
    let run = run("1", &free);
    assert_eq!(run.code, 3, "{}{}", run.stdout, run.stderr);
    assert!(run.stderr.contains("esv.drain_area_m2") && run.stderr.contains("too little excitation"), "{}", run.stderr);
    assert!(out.join("fitted.yaml").is_file());
    let all = run_code(&["fit"]);
    assert_eq!(all, 2);
}

fn run_code(arguments: &[&str]) -> i32 {
    run("1", arguments).code
}
