//! The commands: `import`, its suggestion, and `--map` of the commands that read recordings.

use std::path::Path;
use std::process::{Command, Output};

use super::{file, fixture, shipped};

fn govtwin(args: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_govtwin")).args(args).current_dir(folder).output().unwrap()
}

fn said(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

#[test]
fn a_suggestion_leads_to_a_bag_and_replay_reads_the_table_itself() {
    let folder = tempfile::tempdir().unwrap();
    let table = fixture("pandas_iso.csv");
    let table = table.to_str().unwrap();
    let output = govtwin(&["import", "--suggest", table, "--out", "look"], folder.path());
    assert_eq!(output.status.code(), Some(3), "units are guessed: {}", said(&output));
    assert!(said(&output).contains("servomotor_position  servomotor"), "{}", said(&output));
    let page = std::fs::read_to_string(folder.path().join("look/suggestion.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("Servomotor position, pu (servomotor)"));
    let output = govtwin(&["import", table, "--map", "look/map.yaml", "--out", "bag"], folder.path());
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    assert!(folder.path().join("bag/metadata.yaml").is_file());
    // Again into the same place: the import replaces its own bag, and nothing else.
    let output = govtwin(&["import", table, "--map", "look/map.yaml", "--out", "bag", "--json"], folder.path());
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let figures: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(figures["rows"], 300);
    assert_eq!(figures["signals"][3]["signal"], "spool_position");
    std::fs::write(folder.path().join("bag/mine.txt"), "mine").unwrap();
    let output = govtwin(&["import", table, "--map", "look/map.yaml", "--out", "bag"], folder.path());
    assert_eq!(output.status.code(), Some(1));
    assert!(folder.path().join("bag/mine.txt").is_file());

    let direct = govtwin(&["replay", table, "--map", "look/map.yaml", "--out", "direct"], folder.path());
    std::fs::remove_file(folder.path().join("bag/mine.txt")).unwrap();
    let by_bag = govtwin(&["replay", "bag", "--out", "by_bag"], folder.path());
    let figures = |name: &str| -> serde_json::Value {
        serde_json::from_slice(&std::fs::read(folder.path().join(name).join("replay.json")).unwrap()).unwrap()
    };
    assert_eq!(direct.status.code(), by_bag.status.code(), "{}", said(&direct));
    let (direct, by_bag) = (figures("direct"), figures("by_bag"));
    assert_eq!(direct["overall"], by_bag["overall"]);
    assert!(direct["recordings"][0]["path"].as_str().unwrap().ends_with("pandas_iso.csv"), "{direct}");
    assert!(folder.path().join("direct/pandas_iso/metadata.yaml").is_file(), "the simulated bag beside the page");
}

#[test]
fn a_suggestion_prints_what_columns_do_to_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let mut position = 0.0;
    let text = (0..2000).fold(String::new(), |text, k| {
        let valve = [3.0, -1.0, -4.0, 2.0][k / 50 % 4];
        position += 0.01 * valve;
        text + &format!("{valve},{position}\n")
    });
    let (_kept, table) = file("bare.csv", &text);
    let arguments = ["import", "--suggest", table.to_str().unwrap(), "--rate-hz", "50", "--unit", "#2=mm"];
    let output = govtwin(&arguments, folder.path());
    for words in ["By their courses alone", "sums up", "govtwin diagnose"] {
        assert!(said(&output).contains(words), "{words}: {}", said(&output));
    }
    let page = std::fs::read_to_string(folder.path().join("import/suggestion.html")).unwrap();
    assert!(page.contains("sums up") && page.contains("whatever they are called"));
    let map = std::fs::read_to_string(folder.path().join("import/map.yaml")).unwrap();
    assert!(map.contains("rate_hz: 50") && map.contains("mm"), "{map}");
    let output = govtwin(&[&arguments[..], &["--json"]].concat(), folder.path());
    let figures: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&figures["pairs"][0]["position"], &figures["pairs"][0]["other"]), (&"#2".into(), &"#1".into()));
}

#[test]
fn slips_are_told_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let (_kept, table) = file("t.csv", "t,y\n0,1\n1,2\n2,3\n");
    let table = table.to_str().unwrap();
    for (args, code, words) in [
        (vec!["import", table], 2, "--map <MAP>"),
        (vec!["import", table, "--map", "none.yaml", "--out", "bag"], 1, "none.yaml: cannot read the map"),
        (vec!["import", "--suggest", table, table], 2, "--suggest looks at one file, found 2"),
        (vec!["import", "--suggest", "nowhere.csv"], 1, "nowhere.csv"),
        (vec!["import", "--suggest", table, "--unit", "y"], 2, "a column and its unit"),
        (vec!["import", "--suggest", table, "--unit", "z=mm"], 1, "no column `z`"),
        (vec!["import", "--suggest", table, "--rate-hz", "0"], 2, "rows per second"),
        (vec!["import", table, "--rate-hz", "5"], 2, "--suggest"),
        (vec!["replay", table, "--map", "m.yaml", "--topic", "esv=/x"], 2, "cannot be used with"),
    ] {
        let output = govtwin(&args, folder.path());
        assert_eq!(output.status.code(), Some(code), "{args:?}: {}", said(&output));
        assert!(said(&output).contains(words), "{args:?}: {}", said(&output));
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is left behind");
    // A bag is not written over what is read.
    std::fs::write(
        folder.path().join("m.yaml"),
        "signals: {servomotor_position: /plant/servo_state.servomotor_position}\n",
    )
    .unwrap();
    let bag = folder.path().join("bag");
    let shipped = shipped("practice/case_01/shutdown.mcap");
    let first = govtwin(&["import", shipped.to_str().unwrap(), "--map", "m.yaml", "--out", "bag"], folder.path());
    assert!(matches!(first.status.code(), Some(0 | 3)), "{}", said(&first));
    let again = govtwin(&["import", "bag", "--map", "m.yaml", "--out", bag.to_str().unwrap()], folder.path());
    assert!(
        again.status.code() == Some(1) && said(&again).contains("would take the place of what is read"),
        "{}",
        said(&again)
    );
}

#[test]
fn an_error_in_the_middle_leaves_no_bag() {
    let folder = tempfile::tempdir().unwrap();
    let mut text: String = (0..500).map(|k| format!("{},{}\n", k as f64 * 0.01, (k as f64).sin())).collect();
    text.insert_str(0, "t,\"y\"\n");
    text.push_str(&format!("5.0,\"{}\n", "x".repeat(9_000_000)));
    std::fs::write(folder.path().join("t.csv"), text).unwrap();
    std::fs::write(folder.path().join("m.yaml"), "signals: {servomotor_position: y}\n").unwrap();
    let output = govtwin(&["import", "t.csv", "--map", "m.yaml", "--out", "bag"], folder.path());
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(said(&output).contains("never closed"), "{}", said(&output));
    let mut names: Vec<String> = std::fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["m.yaml", "t.csv"]);
}

#[test]
fn the_bag_says_where_it_comes_from() {
    let folder = tempfile::tempdir().unwrap();
    let map = "name: unit\nsource: historian of unit 3\nsignals: {servomotor_position: servomotor}\n";
    std::fs::write(folder.path().join("m.yaml"), map).unwrap();
    let table = fixture("pandas_ns.csv");
    let output = govtwin(&["import", table.to_str().unwrap(), "--map", "m.yaml", "--out", "bag"], folder.path());
    assert_eq!(output.status.code(), Some(0), "{}", said(&output));
    let bytes = std::fs::read(folder.path().join("bag/bag_0.mcap")).unwrap();
    let text = String::from_utf8_lossy(&bytes);
    for words in
        ["imported_from", "pandas_ns.csv", "historian of unit 3", "servomotor_position: {column: \"servomotor\"}"]
    {
        assert!(text.contains(words), "{words}");
    }
    assert!(!text.contains("tests/fixtures"), "names, no places");
    assert!(shipped("ORIGIN.txt").is_file());
}
