//! Slips at the command line: what is answered, and with which exit code.
#![cfg(feature = "cli")]

#[path = "cli/bags.rs"]
#[expect(dead_code, reason = "several tests share it")]
mod bags;
#[cfg(target_os = "linux")]
#[path = "slips/table.rs"]
mod table;

use std::path::Path;
use std::process::{Command, Output};

use bags::bag;

fn govtwin(dir: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_govtwin")).args(arguments).current_dir(dir).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

#[test]
fn a_wrong_word_on_the_command_line_is_wrong_usage_and_told_with_the_way_out() {
    let dir = tempfile::tempdir().unwrap();
    bag(dir.path(), "run", |_, _| {});
    for (arguments, words) in [
        (&["replay"][..], "required arguments"),
        (&["replay", "run", "--cut", "esv"], "[possible values: none, servomotor, spool]"),
        (&["replay", "run", "--parms", "x"], "'--params'"),
        (
            &["replay", "run", "--topic", "/governor/command"],
            "STREAM=NAME with one of command, esv, tank_pressure, servo_state",
        ),
        (&["replay", "-"], "cannot be read from a pipe"),
        (&["diagnose", "run", "--without", "backlsh"], "did you mean `backlash`?"),
        (&["diagnose", "run", "--without", "xyzzy"], "`govtwin effects` lists them"),
        (
            &["diagnose", "run", "--fail-on", "bad"],
            "[possible values: named, class, unknown, no_gap, not_excited, no_such_unit]",
        ),
        (&["diagnose", "run", "--no-sheet", "--params", "x"], "cannot be used with"),
        (&["diagnose", "run", "--no-sheet", "--stage-alone"], "cannot be used with"),
        (&["blind", "b", "--no-sheet", "--baselines"], "cannot be used with"),
        (&["fit", "run", "--free", "oil.densty_kg_m3"], "did you mean `oil.density_kg_m3`?"),
        (&["fit", "run", "--effect", "backlsh"], "did you mean `backlash`?"),
        (&["effects", "backlsh"], "did you mean `backlash`?"),
        (&["generate", "--out", "g", "--rate", "5000"], "--rate: expected 1 to 1000 Hz, found 5000"),
        (&["generate", "--out", "g", "--effect", "backlash=9"], "outside the physical range"),
        (&["generate", "--out", "g", "--effect", "backlash"], "expected ID=VALUE"),
        (&["blind", "b", "--generate", "0"], "at least 1 unit"),
        (&["completions", "tcsh"], "[possible values: bash, elvish, fish, powershell, zsh]"),
        (&["diagnos", "run"], "'diagnose'"),
    ] {
        let run = govtwin(dir.path(), arguments);
        let said = text(&run.stderr);
        assert!(run.status.code() == Some(2) && said.contains(words), "{arguments:?}: {:?} {said}", run.status.code());
        assert!(run.stdout.is_empty(), "{arguments:?}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "{arguments:?}: nothing is left behind");
    }
}

#[cfg(feature = "node")]
#[test]
fn the_node_and_its_tools_hold_their_options_against_their_ranges() {
    let dir = tempfile::tempdir().unwrap();
    bag(dir.path(), "run", |_, _| {});
    for (arguments, words) in [
        (&["run", "--rate", "0"][..], "--rate is 0: expected 1 to 10000 Hz"),
        (&["run", "--hold=-1"], "--hold is -1"),
        (&["play", "run", "--speed", "0"], "--speed is 0: expected 0.001 to 1000"),
        // The name of earlier versions, and of `ros2 bag play`.
        (&["play", "run", "--rate", "0"], "--speed is 0: expected 0.001 to 1000"),
        (&["record", "--out", "o", "--lease", "0"], "--lease is 0: expected 1 to 3600 s"),
    ] {
        let run = govtwin(dir.path(), arguments);
        let said = text(&run.stderr);
        assert!(run.status.code() == Some(2) && said.contains(words), "{arguments:?}: {:?} {said}", run.status.code());
    }
}

#[cfg(not(feature = "residual"))]
#[test]
fn a_command_of_another_build_says_which_build_has_it() {
    let run = govtwin(Path::new("."), &["train", "x", "--out", "y"]);
    let said = text(&run.stderr);
    assert!(run.status.code() == Some(1) && said.contains("without the cargo feature `residual`"), "{said}");
}

#[test]
fn a_bag_is_checked_where_a_parameter_file_was_expected() {
    let dir = tempfile::tempdir().unwrap();
    bag(dir.path(), "run", |_, _| {});
    let run = govtwin(dir.path(), &["check", "run"]);
    assert!(run.status.success() && text(&run.stdout).contains("load increase"), "{}", text(&run.stderr));
    assert!(text(&run.stderr).contains("run is a bag and no parameter file"), "{}", text(&run.stderr));
    let run = govtwin(dir.path(), &["check", "--json", "run"]);
    let said: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(said[0]["recording"]["process"], "load_increase");
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    let dir = tempfile::tempdir().unwrap();
    let help = text(&govtwin(dir.path(), &["--help"]).stdout);
    let commands = help.split("Commands:\n").nth(1).unwrap().split("\n\n").next().unwrap();
    let commands: Vec<&str> = commands.lines().filter_map(|line| line.strip_prefix("  ")?.split(' ').next()).collect();
    let commands: Vec<&str> = commands.into_iter().filter(|name| !name.is_empty() && *name != "help").collect();
    assert!(commands.len() > 14, "{commands:?}");
    for shell in ["bash", "zsh", "fish"] {
        let script = text(&govtwin(dir.path(), &["completions", shell]).stdout);
        assert!(commands.iter().all(|name| script.contains(name)) && script.contains("fail-on"), "{shell}");
    }
    let page = text(&govtwin(dir.path(), &["man"]).stdout);
    assert!(page.contains(".TH govtwin 1") && commands.iter().all(|name| page.contains(&name.replace('-', "\\-"))));
    assert!(govtwin(dir.path(), &["man", "--out", "man1"]).status.success());
    for name in &commands {
        let page = std::fs::read_to_string(dir.path().join(format!("man1/govtwin-{name}.1"))).unwrap();
        assert!(
            page.contains(".SH SYNOPSIS") && page.contains("Exit codes")
                || ["run", "play", "record", "sheet"].contains(name)
                || page.len() > 500,
            "{name}"
        );
    }
    // Every page that a page leads to is there.
    for entry in std::fs::read_dir(dir.path().join("man1")).unwrap() {
        let page = std::fs::read_to_string(entry.unwrap().path()).unwrap();
        for named in page.lines().filter_map(|line| line.strip_suffix("(1)")).filter(|named| !named.contains(' ')) {
            let named = named.replace("\\-", "-");
            assert!(dir.path().join(format!("man1/{named}.1")).is_file(), "{named}");
        }
    }
    assert!(dir.path().join("man1/govtwin-fleet-plan.1").is_file());
    let page = std::fs::read_to_string(dir.path().join("man1/govtwin-diagnose.1")).unwrap();
    assert!(page.contains("not_excited") && page.contains("Exit codes: 0 ok"), "what --help teaches is in the manual");
}
