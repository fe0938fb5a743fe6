//! `govtwin fleet`: nothing that lies in a source is lost, nothing is done twice, and what comes out does not depend on who did it.
#![cfg(feature = "cli")]

#[path = "cli/bags.rs"]
mod bags;
#[path = "fleet/faults.rs"]
mod faults;
#[path = "fleet/plans.rs"]
mod plans;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use govtwin_diagnosis::fleet::result::EntryResult;
use govtwin_model::effects::CATALOGUE;
use serde_json::Value;

use bags::bag;

/// Runs the program, told nothing by any engine.
fn govtwin(arguments: &[&str]) -> Output {
    with(&[], arguments)
}

/// The same with variables of the environment.
fn with(variables: &[(&str, &str)], arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_govtwin"));
    for name in ["HQ_ENTRY", "SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"] {
        command.env_remove(name);
    }
    command.envs(variables.iter().copied()).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// All but two effects: a diagnosis takes a second or two then.
fn without() -> String {
    let all = CATALOGUE.iter().map(|spec| spec.id).filter(|id| !["backlash", "feedback_bias"].contains(id));
    all.collect::<Vec<_>>().join(" ")
}

/// A source of three units and a stray file, a table of two of them, and its plan.
struct Fleet {
    dir: tempfile::TempDir,
}

impl Fleet {
    /// Unit `sound` can be diagnosed in two months, `short` holds nothing that can.
    fn new() -> Self {
        let fleet = Self { dir: tempfile::tempdir().unwrap() };
        for (month, effect) in [("03", "0.002"), ("04", "0.03")] {
            let run = govtwin(&[
                "generate",
                "--process",
                "startup",
                "--rate",
                "20",
                "--duration",
                "30",
                "--spread",
                "off",
                "--effect",
                &format!("backlash={effect}"),
                "--start",
                &format!("2024-{month}-09T06:00:00Z"),
                "--out",
                &fleet.path(&format!("source/sound/{month}")),
            ]);
            assert!(run.status.success(), "{}", text(&run.stderr));
        }
        // Half a second at standstill.
        bag(&fleet.dir.path().join("source/short"), "still", |i, row| {
            row.opening = Some(0.3);
            if i > 5 {
                row.servo = None;
            }
        });
        fs::write(fleet.dir.path().join("units.csv"), format!("unit,without\nsound,{}\nshort,\n", without())).unwrap();
        let plan = fleet.run(&["plan", "source", "--units", "units.csv", "--out", "plan"]);
        assert!(plan.status.success(), "{}", text(&plan.stderr));
        assert_eq!(fleet.entries().len(), 3);
        fleet
    }

    fn path(&self, name: &str) -> String {
        self.dir.path().join(name).display().to_string()
    }

    /// A command of the fleet, in its folder, with a fixed date.
    fn run(&self, arguments: &[&str]) -> Output {
        self.run_with(&[], arguments)
    }

    fn run_with(&self, variables: &[(&str, &str)], arguments: &[&str]) -> Output {
        let mut command = Command::new(env!("CARGO_BIN_EXE_govtwin"));
        for name in ["HQ_ENTRY", "SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"] {
            command.env_remove(name);
        }
        command.current_dir(self.dir.path()).env("SOURCE_DATE_EPOCH", "1700000000").envs(variables.iter().copied());
        command.arg("fleet").args(arguments).output().unwrap()
    }

    fn entries(&self) -> Vec<Value> {
        let text = fs::read_to_string(self.path("plan/entries.jsonl")).unwrap();
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    }

    /// Gathers a store; its exit code and table.
    fn gather(&self, store: &str) -> (Option<i32>, String) {
        let run = self.run(&["gather", store, "--plan", "plan"]);
        let table =
            fs::read_to_string(self.path(&format!("{store}/fleet/fleet.csv"))).unwrap_or_else(|_| text(&run.stderr));
        (run.status.code(), table)
    }
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

#[test]
fn whoever_does_the_entries_the_tables_are_the_same() {
    let fleet = Fleet::new();
    // One process, all entries.
    let whole = fleet.run(&["run", "plan", "--out", "whole"]);
    assert!(whole.status.success(), "{}", text(&whole.stderr));
    assert!(
        text(&whole.stderr).contains("short, 2023-11: cannot be diagnosed, which is its result"),
        "{}",
        text(&whole.stderr)
    );
    // A process each, the last entry first, told by three engines; the first two at once and twice.
    let line = fs::read_to_string(fleet.path("plan/entries.jsonl")).unwrap().lines().nth(1).unwrap().to_owned();
    let parts = [("JOB_COMPLETION_INDEX", "2"), ("HQ_ENTRY", line.as_str()), ("SLURM_ARRAY_TASK_ID", "0")];
    std::thread::scope(|scope| {
        for variable in [parts[0], parts[0], parts[1], parts[2]] {
            let fleet = &fleet;
            scope.spawn(move || {
                let run = fleet.run_with(&[variable], &["run", "plan", "--out", "parts"]);
                assert!(run.status.success(), "{}", text(&run.stderr));
            });
        }
    });
    assert_eq!(names(&fleet.dir.path().join("parts/results")), names(&fleet.dir.path().join("whole/results")));
    let (code, table) = fleet.gather("whole");
    assert_eq!(code, Some(3), "a failed entry is a warning");
    let (_, other) = fleet.gather("parts");
    assert!(table == other && table.lines().count() > 50, "{table}\n{other}");
    assert!(
        table.contains("short,2023-11,failed")
            && table.contains("sound,2024-03,done")
            && table.contains("sound,2024-04,done")
    );
    // The page has every unit, and leads to reports that are there.
    let page = fs::read_to_string(fleet.path("whole/fleet/fleet.html")).unwrap();
    let links: Vec<&str> =
        page.split("<a href=\"../reports/").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    assert!(
        !links.is_empty() && links.iter().all(|link| Path::new(&fleet.path("whole/reports")).join(link).is_file()),
        "{links:?}"
    );
    assert!(page.contains("cannot be diagnosed") && page.to_lowercase().contains("synthetic"));
    // What is there is not done again.
    let again = fleet.run(&["run", "plan", "--out", "whole", "--json"]);
    let lines: Vec<Value> = text(&again.stdout).lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines.len() == 3 && lines.iter().all(|line| line["result"] == "there"), "{lines:?}");
    // A second gather finds no change.
    let json = text(&fleet.run(&["gather", "whole", "--plan", "plan", "--json"]).stdout);
    let json: Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&json["changes"], &json["done"], &json["failed"]), (&Value::Array(vec![]), &2.into(), &1.into()));
    assert!(json["work"]["peak_memory_bytes"].as_u64() > Some(1_000_000) || cfg!(not(target_os = "linux")));
    changes_are_refused(&fleet);
}

/// A result is as it was written, and so are its report's files.
fn changes_are_refused(fleet: &Fleet) {
    let result = names(&fleet.dir.path().join("whole/results"))
        .into_iter()
        .map(|name| fleet.path(&format!("whole/results/{name}")));
    let result = result.into_iter().find(|path| fs::read_to_string(path).unwrap().contains("sound")).unwrap();
    let own: Value = serde_json::from_str(&fs::read_to_string(&result).unwrap()).unwrap();
    let folder = fleet.path(&format!("whole/{}", own["report"].as_str().unwrap()));
    let gathered = |words: &str| {
        let run = fleet.run(&["gather", "whole", "--plan", "plan"]);
        assert!(run.status.code() == Some(3) && text(&run.stderr).contains(words), "{words}: {}", text(&run.stderr));
    };
    for (place, value) in [
        ("/unit", Value::from("other")),
        ("/origins", Value::Array(vec![])),
        ("/found/entropy_bits", Value::from(0.25)),
        ("/found/parameters/0/value", Value::Null),
        ("/report", Value::from("reports/other/1")),
        ("/found/parameters/0/unit", Value::from("bar")),
        ("/found/verdict", Value::from("no_such_unit")),
        ("/digest", Value::from("")),
    ] {
        let mut changed = own.clone();
        *changed.pointer_mut(place).unwrap() = value;
        fs::write(&result, changed.to_string()).unwrap();
        gathered("digest: expected ");
    }
    // Whoever writes results may not lead elsewhere in the store.
    let mut elsewhere: EntryResult = serde_json::from_value(own.clone()).unwrap();
    elsewhere.report = Some("reports/other/1".to_owned());
    fs::write(&result, elsewhere.sealed().json()).unwrap();
    gathered("report: expected a folder of reports/");
    fs::write(&result, own.to_string()).unwrap();
    let refitted = format!("{folder}/refitted.yaml");
    let sound = fs::read(&refitted).unwrap();
    fs::write(&refitted, "oil:\n").unwrap();
    gathered("refitted.yaml: expected the file that was written with the result");
    fs::write(&refitted, sound).unwrap();
}

/// The path of a file as text.
fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// A copy of a file under another name.
fn copy(from: &Path, to: &Path) -> PathBuf {
    fs::create_dir_all(to.parent().unwrap()).unwrap();
    fs::copy(from, to).unwrap();
    to.to_owned()
}
