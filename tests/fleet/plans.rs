//! Planning: every object of a source is in an entry or left out with its reason; what is wrong with a table is named with its line.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Output;

use govtwin_bag::{Writer, WriterOptions};
use serde_json::Value;

use super::bags::{bag, file_of};
use super::{copy, govtwin, shown, text};

/// Plans a source by units.csv of a folder into a place, and whatever more is said.
fn plan(folder: &Path, source: &str, out: &Path, more: &[&str]) -> Output {
    let units = shown(&folder.join("units.csv"));
    govtwin(&[&["fleet", "plan", source, "--units", &units, "--out", &shown(out)], more].concat())
}

/// A bag that states the unit that it is of.
fn stating(from: &Path, to: &Path, unit: &str) {
    let mut writer = Writer::create(to, WriterOptions::default()).unwrap();
    writer.describe("govtwin", BTreeMap::from([("unit".to_owned(), unit.to_owned())])).unwrap();
    for message in govtwin_bag::messages(from).unwrap() {
        writer.copy(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn every_object_is_in_an_entry_or_left_out_with_its_reason() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let later = |months: i64| {
        move |_: i64, row: &mut super::bags::Row| {
            row.log_ns += months * 31 * 86_400_000_000_000;
            row.stamp_ns += months * 31 * 86_400_000_000_000;
        }
    };
    let first = bag(&at("source/a"), "run", |_, _| {});
    let second = bag(&at("source/a"), "later", later(2));
    let of_b = bag(&at("source/b/deep"), "run", later(1));
    let both = bag(&at("other"), "both", later(3));
    // A recording under a name that says nothing, one that is there twice, one of two units, one of another than it states.
    copy(&file_of(&bag(&at("other"), "odd", later(4))), &at("source/a/archive.dat"));
    copy(&file_of(&second), &at("source/a/copy of later.mcap"));
    copy(&file_of(&both), &at("source/a/both.mcap"));
    copy(&file_of(&both), &at("source/b/both.mcap"));
    stating(&of_b, &at("source/b/stray"), "a");
    stating(&first, &at("source/b/own"), "b");
    // Neither whole nor a recording at all.
    fs::write(at("source/a/torn.mcap"), "half").unwrap();
    fs::write(at("source/a/README.txt"), "notes").unwrap();
    fs::write(at("source/b/no_servo.mcap"), fs::read(file_of(&first)).unwrap().split_at(60).0).unwrap();
    copy(&file_of(&first), &at("source/nobody/run.mcap"));
    fs::write(at("units.csv"), "unit\na\nb\nc\n").unwrap();
    let run = plan(dir.path(), &shown(&at("source")), &at("plan"), &[]);
    assert_eq!(run.status.code(), Some(3), "{}", text(&run.stderr));
    let entries: Vec<Value> = fs::read_to_string(at("plan/entries.jsonl"))
        .unwrap()
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let bags = |entry: &Value| {
        entry["bags"]
            .as_array()
            .unwrap()
            .iter()
            .map(|bag| bag["path"].as_str().unwrap().to_owned())
            .collect::<Vec<_>>()
            .join(" ")
    };
    let got: Vec<String> = entries
        .iter()
        .map(|entry| {
            format!("{} {} {}", entry["unit"].as_str().unwrap(), entry["period"].as_str().unwrap(), bags(entry))
        })
        .collect();
    assert_eq!(
        got,
        [
            "a 2023-11 a/run",
            "a 2024-01 a/copy of later.mcap",
            "a 2024-03 a/archive.dat",
            "b 2023-11 b/own",
            "b 2023-12 b/deep/run"
        ]
    );
    let table = fs::read_to_string(at("plan/left_out.csv")).unwrap();
    let left: Vec<String> =
        table.lines().skip(1).map(|line| line.split(',').take(3).collect::<Vec<_>>().join(",")).collect();
    assert_eq!(
        left,
        [
            "a/README.txt,a,no_recording",
            "a/both.mcap,a,two_units",
            "a/later,a,duplicate",
            "a/torn.mcap,a,unreadable",
            "b/both.mcap,b,two_units",
            "b/no_servo.mcap,b,unreadable",
            "b/stray,b,other_unit",
            "nobody/run.mcap,,unknown_unit",
        ]
    );
    let said = text(&run.stderr);
    for words in [
        "unit `c`: no recording can be used",
        "nobody/run.mcap: lies in the folder of no unit",
        "states that it is of the unit `a`",
    ] {
        assert!(said.contains(words), "{said}");
    }
    // Longer periods hold more; the same source gives the same plan.
    let of = |out: &Path| {
        let run = plan(dir.path(), &shown(&at("source")), out, &["--period", "all", "--json"]);
        (serde_json::from_slice::<Value>(&run.stdout).unwrap(), fs::read(out.join("entries.jsonl")).unwrap())
    };
    let (json, lines) = of(&at("all"));
    assert_eq!(
        (&json["entries"], &json["recordings"], &json["left_out"]["duplicate"]),
        (&2.into(), &5.into(), &1.into())
    );
    assert!(of(&at("again")).1 == lines);
}

#[test]
fn what_is_wrong_with_a_table_or_source_is_named_with_row_and_object() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    bag(&at("source/a"), "run", |_, _| {});
    fs::create_dir(at("empty")).unwrap();
    fs::write(at("wrong.yaml"), "oil: {bulk_modulus_pa: -1}\n").unwrap();
    let planned = |source: &str, table: &str| {
        fs::write(at("units.csv"), table).unwrap();
        let run = plan(dir.path(), &shown(&at(source)), &at("plan"), &[]);
        assert!(!at("plan").exists(), "nothing is written");
        (run.status.code(), text(&run.stderr))
    };
    for (source, table, words) in [
        (
            "source",
            "unit,foldr\na,a\n",
            "line 1: unknown column `foldr`; expected unit, folder, sheet, map, without; did you mean `folder`?",
        ),
        ("source", "unit\na\nb\na\n", "line 4: the unit `a` stands there already, on line 2"),
        ("source", "unit,sheet\na,none.yaml\n", "line 2: unit `a`"),
        ("source", "unit,sheet\na,wrong.yaml\n", "bulk_modulus_pa"),
        ("source", "unit,map\na,none.yaml\n", "none.yaml"),
        ("source", "unit,without\na,baklash\n", "line 2: unit `a`: there is no effect `baklash`"),
        ("source", "unit,folder\na,a\nb,a/b\n", "line 3: the folder `a/b` lies in `a`, that of the unit `a` on line 2"),
        ("source", "unit,folder\na,a\nb,a\n", "recordings in it would be of two units"),
        ("source", "", "expected a column `unit`"),
        ("empty", "unit\na\n", "expected recordings, found nothing there"),
        ("nowhere", "unit\na\n", "expected recordings, found nothing there"),
        ("units.csv", "unit\na\n", "expected a folder, found a file"),
    ] {
        let (code, said) = planned(source, table);
        assert!(code == Some(1) && said.contains(words), "{table}: {said}");
    }
    let run = govtwin(&["fleet", "plan", "source", "--units", &shown(&at("none.csv")), "--out", &shown(&at("plan"))]);
    assert!(run.status.code() == Some(1) && text(&run.stderr).contains("none.csv"));
    let run = plan(dir.path(), "s3://key:hidden@bucket", &at("plan"), &[]);
    assert!(run.status.code() == Some(1) && !text(&run.stderr).contains("hidden"), "{}", text(&run.stderr));
}

#[cfg(target_os = "linux")]
#[test]
fn where_nobody_may_write_or_read_the_place_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    bag(&at("source/a"), "run", |_, _| {});
    fs::write(at("units.csv"), "unit\na\n").unwrap();
    // Nobody may make folders there, not even who may all else.
    let out = "/proc/self/govtwin";
    let run = plan(dir.path(), &shown(&at("source")), Path::new(out), &[]);
    assert!(run.status.code() == Some(1) && text(&run.stderr).contains(out), "{}", text(&run.stderr));
    let run = govtwin(&["fleet", "gather", out]);
    assert!(run.status.code() == Some(1) && text(&run.stderr).contains(out), "{}", text(&run.stderr));
    // Who may read everything reads this as well.
    use std::os::unix::fs::PermissionsExt as _;
    fs::set_permissions(at("source/a"), fs::Permissions::from_mode(0o0)).unwrap();
    if fs::read_dir(at("source/a")).is_err() {
        let run = plan(dir.path(), &shown(&at("source")), &at("plan"), &[]);
        let said = text(&run.stderr);
        assert!(
            run.status.code() == Some(1) && said.contains("source/a") && said.contains("ermission denied"),
            "{said}"
        );
    }
    fs::set_permissions(at("source/a"), fs::Permissions::from_mode(0o755)).unwrap();
}
