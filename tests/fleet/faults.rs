//! What goes wrong on the way: killed workers, full disks, changed recordings, damaged results, entries that are none.

use std::fs;
use std::process::{Command, Stdio};
use std::time::Duration;

use serde_json::Value;

use super::{Fleet, names, text};

#[test]
fn a_recording_that_changed_gives_no_result_and_is_told_with_its_unit() {
    let fleet = Fleet::new();
    let entry = fleet.entries().into_iter().position(|entry| entry["unit"] == "short").unwrap().to_string();
    let path = fleet.path("source/short/still/still_0.mcap");
    let before = fs::read(&path).unwrap();
    let mut bytes = before.clone();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&path, &bytes).unwrap();
    let run = fleet.run(&["run", "plan", "--index", &entry, "--out", "store"]);
    let said = text(&run.stderr);
    assert!(
        run.status.code() == Some(1) && said.contains("short, 2023-11: no result") && said.contains("still_0.mcap"),
        "{said}"
    );
    assert_eq!(names(&fleet.dir.path().join("store")), ["notes"]);
    let (code, table) = fleet.gather("store");
    assert_eq!(code, Some(3));
    assert!(
        table.contains("short,2023-11,missing") && table.contains("it changed since, or was not read whole"),
        "{table}"
    );
    assert!(table.contains("sound,2024-03,missing") && table.contains("no result yet"), "{table}");
    // With the bytes of the plan it goes well.
    fs::write(&path, &before).unwrap();
    assert!(fleet.run(&["run", "plan", "--index", &entry, "--out", "store"]).status.success());
    assert!(fleet.gather("store").1.contains("short,2023-11,failed"));
    // A failure is done again only where that is asked for.
    let line = |more: &[&str]| {
        let run = fleet.run(&[&["run", "plan", "--index", &entry, "--out", "store", "--json"], more].concat());
        serde_json::from_slice::<Value>(&run.stdout).unwrap()["result"].clone()
    };
    assert_eq!((line(&[]), line(&["--retry-failed"])), ("there".into(), "written".into()));
}

#[cfg(unix)]
#[test]
fn a_full_disk_and_a_killed_worker_leave_no_result_and_the_next_try_does() {
    let fleet = Fleet::new();
    let entry = fleet.entries().into_iter().position(|entry| entry["unit"] == "sound").unwrap().to_string();
    let arguments = ["fleet", "run", "plan", "--index", &entry, "--out", "store"];
    // No file may be longer than so many blocks of 1 KiB.
    let script = "trap '' XFSZ; ulimit -f 8; exec \"$0\" \"$@\"";
    let mut shell = Command::new("bash");
    let run = shell
        .current_dir(fleet.dir.path())
        .args(["-c", script, env!("CARGO_BIN_EXE_govtwin")])
        .args(arguments)
        .output()
        .unwrap();
    assert!(
        run.status.code() == Some(1) && text(&run.stderr).contains("sound, 2024-03: no result"),
        "{}",
        text(&run.stderr)
    );
    assert!(!fleet.dir.path().join("store/results").exists());
    // Killed in the middle of its work.
    let mut command = Command::new(env!("CARGO_BIN_EXE_govtwin"));
    let mut worker = command
        .current_dir(fleet.dir.path())
        .args(arguments)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(200));
    worker.kill().unwrap();
    worker.wait().unwrap();
    let count =
        |folder: &str| names(&fleet.dir.path().join(folder)).iter().filter(|name| name.ends_with(".json")).count();
    assert_eq!(count("store/results"), 0, "it takes longer than that");
    assert!(fleet.run(&arguments[1..]).status.success());
    assert_eq!(count("store/results"), 1);
    // A clock that runs wrong changes nothing but dates.
    let run = fleet.run_with(&[("SOURCE_DATE_EPOCH", "1")], &["run", "plan", "--index", &entry, "--out", "skewed"]);
    assert!(run.status.success());
    assert!(fleet.gather("store").1 == fleet.gather("skewed").1);
}

#[test]
fn a_damaged_result_is_named_and_an_entry_that_is_none_is_refused() {
    let fleet = Fleet::new();
    let entry = fleet.entries().into_iter().position(|entry| entry["unit"] == "short").unwrap().to_string();
    assert!(fleet.run(&["run", "plan", "--index", &entry, "--out", "store"]).status.success());
    let result = fleet.path(&format!("store/results/{}", names(&fleet.dir.path().join("store/results"))[0]));
    let whole = fs::read(&result).unwrap();
    fs::write(&result, &whole[..whole.len() / 2]).unwrap();
    fs::write(fleet.path("store/results/notes.txt"), "mine").unwrap();
    let run = fleet.run(&["gather", "store", "--plan", "plan"]);
    let said = text(&run.stderr);
    assert!(
        run.status.code() == Some(3)
            && said.contains("notes.txt: expected a result")
            && said.contains("remove it, so that its entry"),
        "{said}"
    );
    assert!(fleet.gather("store").1.contains("short,2023-11,missing"));
    let alone = fleet.run(&["gather", "store"]);
    let said = text(&alone.stderr);
    assert!(alone.status.code() == Some(1) && said.contains("no result can be read"), "{said}");

    let refused = |variables: &[(&str, &str)], arguments: &[&str], words: &str, code: i32| {
        let run = fleet.run_with(variables, &[&["run", "plan", "--out", "none"], arguments].concat());
        let said = text(&run.stderr);
        assert!(run.status.code() == Some(code) && said.contains(words), "{said}");
        assert!(!fleet.dir.path().join("none/results").exists());
    };
    refused(&[], &["--index", "3"], "has 3 entries; expected 0 to 2", 2);
    refused(&[("SLURM_ARRAY_TASK_ID", "x")], &[], "the variable SLURM_ARRAY_TASK_ID: expected the index", 2);
    refused(&[("HQ_ENTRY", "{}")], &[], "the variable HQ_ENTRY: expected an entry", 1);
    let line = fs::read_to_string(fleet.path("plan/entries.jsonl")).unwrap().lines().next().unwrap().to_owned();
    refused(&[("HQ_ENTRY", &line.replace("\"seed\":1", "\"seed\":2"))], &[], "was the plan changed", 1);
    let gone = fleet.run(&["run", "nowhere", "--out", "none"]);
    assert!(text(&gone.stderr).contains("`govtwin fleet plan` makes one"), "{}", text(&gone.stderr));
    fs::create_dir(fleet.path("void")).unwrap();
    let empty = fleet.run(&["gather", "void"]);
    assert!(
        empty.status.code() == Some(1) && text(&empty.stderr).contains("expected results, found none"),
        "{}",
        text(&empty.stderr)
    );
}
