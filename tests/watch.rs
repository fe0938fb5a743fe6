//! `govtwin watch` through the binary: processes entered once whatever happens to bags, histories that survive, slips.
#![cfg(feature = "cli")]

#[cfg(feature = "node")]
#[path = "watch/bus.rs"]
mod bus;
#[path = "support/program.rs"]
mod program;
#[path = "support/tight_sheet.rs"]
mod tight_sheet;

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use program::Run;

fn govtwin(folder: &Path, arguments: &[&str]) -> Run {
    Run::of(Command::new(env!("CARGO_BIN_EXE_govtwin")).current_dir(folder).args(arguments))
}

fn generate(folder: &Path, out: &str, seed: &str) {
    let arguments = [
        "generate",
        "--out",
        out,
        "--process",
        "load_rejection",
        "--rate",
        "20",
        "--spread",
        "off",
        "--effect",
        "port_overlap=3e-4",
    ];
    let run = govtwin(folder, &[&arguments[..], &["--seed", seed, "--duration", "40"]].concat());
    assert_eq!(run.code, 0, "{}", run.stderr);
}

fn watch(folder: &Path, more: &[&str]) -> Run {
    let fixed = ["watch", "unit", "--once", "--params", "sheet.yaml", "--only", "port_overlap", "--out", "seen"];
    govtwin(folder, &[&fixed[..], more].concat())
}

fn lines(folder: &Path) -> Vec<serde_json::Value> {
    let text = fs::read_to_string(folder.join("seen/history.jsonl")).unwrap();
    text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn a_process_is_entered_once_whatever_happens_to_its_bag() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    tight_sheet::write(folder);
    fs::create_dir(folder.join("unit")).unwrap();
    let empty = watch(folder, &[]);
    assert_eq!(empty.code, 0, "a folder without bags may get some: {}", empty.stderr);
    generate(folder, "unit/monday", "1");
    let first = watch(folder, &[]);
    assert!(first.stdout.contains("load_rejection in load_rejection:"), "{} {}", first.stdout, first.stderr);
    let entered = lines(folder);
    assert_eq!(entered.len(), 1, "{}", first.stdout);
    assert_eq!((&entered[0]["schema"], &entered[0]["process"]), (&"govtwin-watch/1".into(), &"load_rejection".into()));
    let size = &entered[0]["sizes"][0];
    let (low, high) = (size["ci90"][0].as_f64().unwrap(), size["ci90"][1].as_f64().unwrap());
    assert!(size["effect"] == "port_overlap" && low < 3e-4 && 3e-4 < high, "{size}");

    // Read again, and a copy under another name: nothing new.
    let again = watch(folder, &["--json"]);
    assert_eq!((again.stdout.as_str(), lines(folder)), ("", entered.clone()));
    fs::create_dir(folder.join("unit/copies")).unwrap();
    let source = folder.join("unit/monday/load_rejection");
    let bag = fs::read_dir(&source).unwrap().map(|entry| entry.unwrap().path());
    let bag = bag.into_iter().find(|path| path.extension().is_some_and(|suffix| suffix == "mcap")).unwrap();
    fs::copy(&bag, folder.join("unit/copies/renamed.mcap")).unwrap();
    watch(folder, &[]);
    assert_eq!(lines(folder), entered);

    // Killed while a line was being written by some other tool: the process is diagnosed anew, with a warning.
    let history = folder.join("seen/history.jsonl");
    let text = fs::read_to_string(&history).unwrap();
    fs::write(&history, &text[..text.len() - 30]).unwrap();
    let torn = watch(folder, &[]);
    assert!(torn.code == 3 && torn.stderr.contains("the last line was broken off"), "{}", torn.stderr);
    let anew = lines(folder);
    assert_eq!((anew.len(), &anew[0]["digest"], &anew[0]["sizes"]), (1, &entered[0]["digest"], &entered[0]["sizes"]));
    let page = fs::read_to_string(folder.join("seen/watch.html")).unwrap();
    assert!(page.contains("Cumulative sums") && page.contains("load rejection"));
    assert!(page.contains("Synthetic data: the bags say") && anew[0]["synthetic"] == true, "{}", anew[0]);
    assert!(torn.stdout.contains("Synthetic data: the bags say"), "{}", torn.stdout);
    let state: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(folder.join("seen/watch.json")).unwrap()).unwrap();
    assert_eq!((&state["processes"], &state["warnings"]), (&1.into(), &serde_json::json!([])));
    assert_eq!(state["sizes"][0]["moved"], false);
}

/// A watch of `unit` that goes on until it is killed.
fn goes_on(folder: &Path, more: &[&str]) -> Child {
    let arguments = "watch unit --params sheet.yaml --only port_overlap --out seen --every 1".split(' ');
    Command::new(env!("CARGO_BIN_EXE_govtwin"))
        .current_dir(folder)
        .args(arguments)
        .args(more)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}

/// Waits until something stands in the history, two minutes at most.
fn await_history(folder: &Path) {
    let begun = Instant::now();
    while !folder.join("seen/history.jsonl").is_file() && begun.elapsed() < Duration::from_secs(120) {
        std::thread::sleep(Duration::from_millis(200));
    }
}

#[test]
fn a_watch_that_goes_on_sees_a_bag_that_comes_and_loses_nothing_when_killed() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    tight_sheet::write(folder);
    fs::create_dir(folder.join("unit")).unwrap();
    let mut watching = goes_on(folder, &["--json"]);
    generate(folder, "unit/monday", "2");
    await_history(folder);
    let second = watch(folder, &[]);
    assert!(second.code == 1 && second.stderr.contains("another process is writing there"), "{}", second.stderr);
    watching.kill().unwrap();
    watching.wait().unwrap();
    assert_eq!(lines(folder).len(), 1);
    let after = watch(folder, &[]);
    assert_eq!((after.code, lines(folder).len()), (0, 1), "{}", after.stderr);
}

#[test]
fn a_bag_that_grows_gives_each_process_as_it_ends_and_none_twice() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    tight_sheet::write(folder);
    let arguments = ["generate", "--out", "made", "--process", "load_rejection", "--rate", "20", "--spread", "off"];
    let made = govtwin(folder, &[&arguments[..], &["--effect", "port_overlap=3e-4", "--duration", "120"]].concat());
    assert_eq!(made.code, 0, "{}", made.stderr);
    let bag = fs::read_dir(folder.join("made/load_rejection")).unwrap().map(|entry| entry.unwrap().path());
    let bag = bag.into_iter().find(|path| path.extension().is_some_and(|suffix| suffix == "mcap")).unwrap();
    let bytes = fs::read(&bag).unwrap();
    // As `govtwin record` leaves it until it is whole: hidden, without metadata, cut off anywhere.
    let growing = folder.join("unit/.today.unfinished");
    fs::create_dir_all(&growing).unwrap();
    fs::write(growing.join("today_0.mcap"), &bytes[..bytes.len() * 4 / 5]).unwrap();
    let mut watching = goes_on(folder, &["--settled", "900"]);
    await_history(folder);
    watching.kill().unwrap();
    watching.wait().unwrap();
    let early = lines(folder);
    assert_eq!((early.len(), &early[0]["bag"]), (1, &"today".into()), "the process ended while the bag grew");
    assert_eq!(early[0]["synthetic"], true, "a bag that grows says so as well: {}", early[0]);
    fs::write(growing.join("today_0.mcap"), &bytes).unwrap();
    fs::rename(&growing, folder.join("unit/today")).unwrap();
    let after = watch(folder, &[]);
    assert_eq!(lines(folder)[..1], early, "{}", after.stderr);
    let digests = |entries: &[serde_json::Value]| entries.iter().map(|one| one["digest"].clone()).collect::<Vec<_>>();
    let grown = digests(&lines(folder));
    fs::remove_dir_all(folder.join("seen")).unwrap();
    watch(folder, &[]);
    assert_eq!(digests(&lines(folder)), grown, "read at once it is the same");
}

#[test]
fn slips_have_their_exit_codes_and_ways_out() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    fs::create_dir_all(folder.join("unit")).unwrap();
    fs::create_dir_all(folder.join("broken")).unwrap();
    fs::write(folder.join("broken/history.jsonl"), "{}\n").unwrap();
    fs::write(folder.join("unit/none.mcap"), "this is no bag").unwrap();
    for (arguments, code, words) in [
        (&["watch"][..], 2, "required"),
        (&["watch", "nowhere"], 1, "found nothing there"),
        (&["watch", "unit", "--only", "port_overlp"], 2, "did you mean `port_overlap`?"),
        (&["watch", "unit", "--between-false-alarms", "0"], 2, "expected 10 to 1000000 processes"),
        (&["watch", "unit", "--once", "--out", "broken"], 1, "line 1: missing field"),
        (&["watch", "unit", "--once", "--out", "seen"], 3, "none.mcap"),
    ] {
        let run = govtwin(folder, arguments);
        assert_eq!(run.code, code, "{arguments:?}: {}", run.stderr);
        assert!(run.stderr.contains(words), "{arguments:?}: {}", run.stderr);
    }
}

#[cfg(feature = "node")]
#[test]
fn what_listens_follows_no_bags_and_what_does_nothing_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path();
    fs::create_dir_all(folder.join("unit")).unwrap();
    for (arguments, words) in [
        (&["watch", "unit", "--bus"][..], "cannot be used with"),
        (&["watch", "--bus", "--once"], "cannot be used with"),
        (&["watch", "--bus", "--every", "3"], "cannot be used with"),
        (&["watch", "--bus", "--publish"], "cannot be used with"),
        (&["watch", "unit", "--publish", "--once"], "cannot be used with"),
        (&["watch", "unit", "--keep", "3"], "--bus"),
        (&["watch", "unit", "--once", "--ros-args", "-r", "__ns:=/unit3"], "--publish"),
        (&["watch", "--bus", "--lease", "0"], "expected 1 to 3600 s"),
    ] {
        let run = govtwin(folder, arguments);
        assert_eq!(run.code, 2, "{arguments:?}: {}", run.stderr);
        assert!(run.stderr.contains(words), "{arguments:?}: {}", run.stderr);
    }
    assert!(!folder.join("watch/unit/history.jsonl").exists());
}
