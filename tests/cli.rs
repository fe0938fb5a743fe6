//! Bad inputs through the binary: a clear error or a stated recovery, the right exit code, nothing half-written.
#![cfg(feature = "cli")]

#[path = "cli/bags.rs"]
mod bags;
#[path = "support/program.rs"]
mod program;

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use bags::{BEGIN_NS, ROWS, bag, file_of, in_namespace, with_wrong_type};
use govtwin_bag::msg::EsvState;
use program::Run;

fn govtwin(arguments: &[&str]) -> Run {
    Run::of(Command::new(env!("CARGO_BIN_EXE_govtwin")).args(arguments))
}

fn replay(path: &Path, more: &[&str]) -> Run {
    govtwin(&[&["replay", path.to_str().unwrap()], more].concat())
}

/// Fails with exit code 1 and these words, and leaves no output.
#[track_caller]
fn refused(dir: &Path, path: &Path, words: &[&str]) {
    let out = dir.join("out");
    let run = replay(path, &["--out", out.to_str().unwrap()]);
    assert_eq!(run.code, 1, "{}{}", run.stdout, run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "expected `{word}` in: {}", run.stderr);
    }
    assert!(run.stdout.is_empty(), "figures of a failed run: {}", run.stdout);
    assert!(!out.exists(), "output of a failed run");
}

/// Finishes with warnings, exit code 3, these words, and whole output; gives the figures.
#[track_caller]
fn recovered(dir: &Path, path: &Path, words: &[&str]) -> serde_json::Value {
    let (run, figures) = replayed(dir, path);
    assert_eq!(run.code, 3, "{}{}", run.stdout, run.stderr);
    for word in words {
        assert!(run.stderr.contains(word), "expected `{word}` in: {}", run.stderr);
    }
    assert!(!figures["recordings"][0]["warnings"].as_array().unwrap().is_empty());
    figures
}

#[track_caller]
fn replayed(dir: &Path, path: &Path) -> (Run, serde_json::Value) {
    let out = dir.join("out");
    let run = replay(path, &["--out", out.to_str().unwrap()]);
    assert!(run.code == 0 || run.code == 3, "{}", run.stderr);
    assert!(leftovers(dir).is_empty(), "{:?}", leftovers(dir));
    let json = fs::read_to_string(out.join("replay.json")).unwrap();
    assert!(fs::read_to_string(out.join("replay.html")).unwrap().ends_with("</html>"));
    (run, serde_json::from_str(&json).unwrap())
}

/// Temporary files anywhere below a folder.
fn leftovers(dir: &Path) -> Vec<String> {
    let mut found = vec![];
    for entry in fs::read_dir(dir).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if name.starts_with('.') || name.ends_with(".tmp") || name.ends_with(".unfinished") {
            found.push(name);
        }
        if path.is_dir() {
            found.extend(leftovers(&path));
        }
    }
    found
}

fn servomotor(figures: &serde_json::Value) -> &serde_json::Value {
    &figures["overall"]["signals"][0]
}

#[test]
fn a_sound_bag_leaves_figures_page_and_bag() {
    let dir = tempfile::tempdir().unwrap();
    let (run, figures) = replayed(dir.path(), &bag(dir.path(), "sound", |_, _| {}));
    assert_eq!((run.code, run.stderr.as_str()), (0, ""));
    assert!(run.stdout.contains("load increase") && run.stdout.contains("overall"));
    assert_eq!(servomotor(&figures)["rows"], ROWS);
    assert!(servomotor(&figures)["mae"].as_f64().unwrap() < 0.01);
    // What was written is a bag again, and the simulated state in it does not disturb.
    let (again, second) = replayed(dir.path().join("out").as_path(), &dir.path().join("out/sound"));
    assert_eq!(again.code, 0, "{}", again.stderr);
    assert_eq!(second["overall"], figures["overall"]);
}

#[test]
fn without_out_nothing_is_written_and_the_way_to_it_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let run = replay(&bag(dir.path(), "sound", |_, _| {}), &[]);
    assert_eq!(run.code, 0);
    assert!(run.stdout.contains("--out"));
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
}

#[test]
fn a_missing_topic_is_named_with_its_type() {
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "no_pressure", |_, row| row.pressure_pa = None);
    refused(dir.path(), &path, &["no_pressure", "/governor/tank_pressure", "sensor_msgs/msg/FluidPressure"]);
}

#[test]
fn a_recording_in_a_namespace_is_read_by_the_names_that_the_error_gives() {
    let dir = tempfile::tempdir().unwrap();
    let plain = bag(dir.path(), "plain", |_, _| {});
    let path = in_namespace(dir.path(), "named", "/unit2", &plain);
    let run = replay(&path, &[]);
    assert_eq!(run.code, 1, "{}", run.stderr);
    let mut named: Vec<&str> = run.stderr.split('`').filter(|part| part.starts_with("--topic ")).collect();
    assert_eq!(named.len(), 3, "{}", run.stderr);
    named.push("--topic servo_state=/unit2/plant/servo_state");
    let named: Vec<&str> = named.iter().flat_map(|option| option.split(' ')).collect();
    let out = dir.path().join("named_out");
    let run = replay(&path, &[&named[..], &["--out", out.to_str().unwrap()]].concat());
    assert_eq!((run.code, run.stderr.as_str()), (0, ""));
    let (_, expected) = replayed(dir.path(), &plain);
    let figures: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(out.join("replay.json")).unwrap()).unwrap();
    assert_eq!(figures["overall"], expected["overall"]);
    let simulated = replay(&out.join("named"), &[&named[..7], &["servo_state=/sim/servo_state"]].concat());
    assert_eq!(simulated.code, 0, "{}", simulated.stderr);
    let info = govtwin(&[&["info", path.to_str().unwrap()], &named[..]].concat());
    assert!(info.code == 0 && info.stdout.contains("load increase"), "{}{}", info.stdout, info.stderr);
    for command in ["replay", "info", "diagnose", "fit"] {
        let wrong = govtwin(&[command, path.to_str().unwrap(), "--topic", "valve=/x"]);
        assert!(
            wrong.code == 2 && wrong.stderr.contains("one of command, esv, tank_pressure, servo_state"),
            "{}",
            wrong.stderr
        );
    }
}

#[test]
fn without_measured_positions_there_is_nothing_to_judge() {
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "inputs_only", |_, row| row.servo = None);
    let (run, figures) = replayed(dir.path(), &path);
    assert_eq!(run.code, 3, "{}", run.stderr);
    assert_eq!(servomotor(&figures)["rows"], 0);
    assert!(servomotor(&figures)["r2"].is_null());
    let cut = replay(&path, &["--cut", "spool"]);
    assert_eq!(cut.code, 1);
    assert!(cut.stderr.contains("/plant/servo_state"), "{}", cut.stderr);
}

#[test]
fn a_wrong_type_is_told_with_expected_and_found() {
    let dir = tempfile::tempdir().unwrap();
    let words = ["/governor/command", "governor_msgs/msg/GovernorCommand", "sensor_msgs/msg/FluidPressure"];
    refused(dir.path(), &with_wrong_type(dir.path()), &words);
}

#[test]
fn values_that_are_no_numbers_are_dropped_and_counted() {
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "not_finite", |i, row| match i {
        10 => row.opening = Some(f64::NAN),
        20 => row.pressure_pa = Some(f64::INFINITY),
        // In a measured state NaN is the word for "not available"; infinity is a fault.
        30..40 => row.servo.as_mut().unwrap().servomotor_position = f64::NAN,
        40 => row.servo.as_mut().unwrap().servomotor_position = f64::INFINITY,
        _ => {}
    });
    let figures = recovered(dir.path(), &path, &["/governor/command", "/governor/tank_pressure", "/plant/servo_state"]);
    assert_eq!(servomotor(&figures)["rows"], ROWS - 11);
    assert!(servomotor(&figures)["rmse"].as_f64().unwrap().is_finite());
}

#[test]
fn a_topic_without_one_usable_value_is_an_error() {
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "all_nan", |_, row| row.opening = Some(f64::NAN));
    refused(dir.path(), &path, &["/governor/command", "none of its 100 messages is usable"]);
}

#[test]
fn a_pressure_in_another_unit_is_told() {
    let dir = tempfile::tempdir().unwrap();
    for (pressure, words) in [
        (63.0, "reaches 63 Pa, expected 5.0e5 to 5.0e7 Pa of a governor's oil supply; was it sent in bar?"),
        (6.1, "was it sent in MPa?"),
        (6300.0, "was it sent in kPa?"),
        (1e6, "the median is 1.0e+6 Pa, the sheet says 6.3e+6 Pa"),
        (-500.0, "reaches -500 Pa"),
        (9.9e7, "reaches 9.900e7 Pa"),
    ] {
        let path = bag(dir.path(), &format!("p{pressure}"), |_, row| row.pressure_pa = Some(pressure));
        let run = replay(&path, &[]);
        assert!(run.code == 3 && run.stderr.contains(words), "{}", run.stderr);
        let info = govtwin(&["info", path.to_str().unwrap()]);
        assert_eq!(info.code == 3 && info.stdout.contains(words), !words.contains("sheet"), "{}", info.stdout);
    }
    let path = bag(dir.path(), "low", |_, row| row.pressure_pa = Some(5.8e6));
    assert_eq!(replay(&path, &[]).stderr, "");
}

#[test]
fn late_messages_find_their_place() {
    let dir = tempfile::tempdir().unwrap();
    let sound = replayed(dir.path(), &bag(dir.path(), "in_order", |_, _| {})).1;
    let path = bag(dir.path(), "swapped", |i, row| {
        // Rows 40 and 41 arrive the wrong way round.
        let other = if i == 40 {
            1
        } else if i == 41 {
            -1
        } else {
            0
        };
        row.stamp_ns += other * 100_000_000;
    });
    let swapped = replayed(dir.path(), &path).1;
    assert_eq!(swapped["overall"], sound["overall"]);
}

#[test]
fn without_any_clock_the_times_of_recording_count_also_in_what_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "no_clock", |_, row| row.stamp_ns = 0);
    let figures = recovered(dir.path(), &path, &["/governor/command: 100 of 100 samples have stamp 0"]);
    assert_eq!(servomotor(&figures)["rows"], ROWS);
    let last_ns = govtwin_bag::survey(&dir.path().join("out/no_clock")).unwrap().last_ns;
    assert_eq!(last_ns, Some(BEGIN_NS + (ROWS - 1) * 100_000_000));
}

#[test]
fn a_clock_that_restarts_is_told_and_the_longer_run_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "restarted", |i, row| {
        if i >= 60 {
            row.stamp_ns = BEGIN_NS + (i - 60) * 100_000_000 - 3_600_000_000_000;
        }
    });
    let figures = recovered(dir.path(), &path, &["backwards", "restarted"]);
    assert_eq!(servomotor(&figures)["rows"], 60);
}

#[test]
fn one_stamp_with_two_values_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "doubled", |i, row| {
        if i == 51 {
            row.stamp_ns -= 100_000_000;
            row.opening = Some(0.9);
        }
    });
    recovered(dir.path(), &path, &["/governor/command", "dropped from 1 of 100"]);
}

#[test]
fn a_truncated_bag_gives_what_is_whole() {
    let dir = tempfile::tempdir().unwrap();
    let whole = fs::read(file_of(&bag(dir.path(), "whole", |_, _| {}))).unwrap();
    let path = dir.path().join("cut.mcap");
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let run = replay(&path, &[]);
    assert!(run.code == 3 || run.code == 1, "{}", run.stderr);
    assert!(run.stderr.contains("lost") || run.stderr.contains("no message"), "{}", run.stderr);
    // However it is cut, it is a stated recovery or a clear error.
    for share in 1..40 {
        fs::write(&path, &whole[..whole.len() * share / 40]).unwrap();
        let run = replay(&path, &[]);
        assert!(matches!(run.code, 0 | 1 | 3), "{share}: {}", run.stderr);
        assert!(run.code == 0 || run.stderr.contains("cut"), "the file is named: {}", run.stderr);
    }
}

#[test]
fn a_shipped_recording_cut_in_half_keeps_its_first_rows() {
    let dir = tempfile::tempdir().unwrap();
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/practice/case_01/startup.mcap");
    let whole = fs::read(shipped).unwrap();
    let path = dir.path().join("half.mcap");
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    let figures = recovered(dir.path(), &path, &["half.mcap", "lost"]);
    let rows = servomotor(&figures)["rows"].as_i64().unwrap();
    assert!(rows > 500 && rows < 3500, "{rows}");
}

#[test]
fn what_is_no_bag_is_named_for_what_it_is() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("notes.mcap");
    fs::write(&path, "these are notes\n").unwrap();
    refused(dir.path(), &path, &["notes.mcap", "not a bag"]);
    fs::write(&path, "").unwrap();
    refused(dir.path(), &path, &["notes.mcap"]);
    let folder = dir.path().join("folder");
    fs::create_dir(&folder).unwrap();
    refused(dir.path(), &folder, &["folder", "no bag in this folder"]);
    refused(dir.path(), &dir.path().join("nowhere.mcap"), &["nowhere.mcap", "No such file"]);
    for arguments in
        [&["replay", "nowhere.mcap"][..], &["replay", "--params", "nowhere.yaml", "x"], &["check", "nowhere.yaml"]]
    {
        let run = govtwin(arguments);
        assert_eq!(run.stderr.matches("No such file").count(), 1, "{}", run.stderr);
    }
    let empty = bag(dir.path(), "empty", |_, row| {
        (row.opening, row.esv, row.pressure_pa, row.servo) = (None, None, None, None);
    });
    refused(dir.path(), &empty, &["empty", "no message"]);
}

#[test]
fn one_bad_bag_among_good_ones_stops_all_before_anything_is_written() {
    let dir = tempfile::tempdir().unwrap();
    let bags = dir.path().join("bags");
    fs::create_dir(&bags).unwrap();
    bag(&bags, "good", |_, _| {});
    bag(&bags, "no_esv", |_, row| row.esv = None);
    fs::write(bags.join("notes.mcap"), "notes").unwrap();
    refused(dir.path(), &bags, &["2 of 3 bags", "no_esv", "notes.mcap"]);
}

#[test]
fn parameter_files_with_mistakes_are_refused_line_by_line() {
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "sound", |_, _| {});
    let params = dir.path().join("unit.yaml");
    let out = dir.path().join("out");
    for (text, words) in [
        ("oil:\n  densty_kg_m3: 870.0\n", ["unit.yaml:2", "density_kg_m3"]),
        ("oil:\n  density_kg_m3: heavy\n", ["unit.yaml:2", "heavy"]),
        ("servomotor:\n  opening_area_m2: -0.07\n", ["unit.yaml:2", "-0.07"]),
        ("oil: [\n", ["unit.yaml", "YAML"]),
    ] {
        fs::write(&params, text).unwrap();
        let run = replay(&path, &["--params", params.to_str().unwrap(), "--out", out.to_str().unwrap()]);
        assert_eq!(run.code, 1, "{text}{}", run.stderr);
        assert!(words.iter().all(|word| run.stderr.contains(word)), "{text}{}", run.stderr);
        assert!(!out.exists());
    }
    let run = replay(&path, &["--params", path.to_str().unwrap()]);
    assert_eq!(run.code, 1, "a folder for parameters");
}

#[test]
fn what_is_read_is_never_overwritten() {
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "precious", |_, _| {});
    let before = fs::read(file_of(&path)).unwrap();
    let run = replay(&path, &["--out", dir.path().to_str().unwrap()]);
    assert_eq!(run.code, 1);
    assert!(run.stderr.contains("choose another folder"), "{}", run.stderr);
    assert_eq!(fs::read(file_of(&path)).unwrap(), before);
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    // A file in the place of the folder, and a folder that is no bag in the place of a bag.
    let file = dir.path().join("file");
    fs::write(&file, "mine").unwrap();
    assert_eq!(replay(&path, &["--out", file.to_str().unwrap()]).code, 1);
    assert_eq!(fs::read(&file).unwrap(), b"mine");
    let taken = dir.path().join("taken");
    fs::create_dir_all(taken.join("precious")).unwrap();
    fs::write(taken.join("precious/diary"), "mine").unwrap();
    assert_eq!(replay(&path, &["--out", taken.to_str().unwrap()]).code, 1);
    assert_eq!(fs::read_dir(&taken).unwrap().count(), 1);
}

#[test]
fn a_replay_replaces_its_own_bags_and_no_others() {
    let dir = tempfile::tempdir().unwrap();
    let sound = bag(dir.path(), "sound", |_, _| {});
    replayed(dir.path(), &sound);
    assert_eq!(replayed(dir.path(), &sound).0.code, 0, "its own bag of the same name");
    // Another unit's recording of the same name.
    let measured = dir.path().join("measured");
    fs::create_dir(&measured).unwrap();
    let before = fs::read(file_of(&bag(&measured, "sound", |_, row| row.esv = Some(EsvState::SHUTDOWN)))).unwrap();
    let run = replay(&sound, &["--out", measured.to_str().unwrap()]);
    assert_eq!(run.code, 1, "{}", run.stderr);
    assert!(run.stderr.contains("measured/sound: is there already; name another folder"), "{}", run.stderr);
    assert_eq!(fs::read(file_of(&measured.join("sound"))).unwrap(), before);
    assert_eq!(fs::read_dir(&measured).unwrap().count(), 1);
}

#[test]
fn simulated_bags_that_would_lie_in_one_another_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let names = ["one/a", "two/a_b", "three/a/b", "four/b"];
    let paths = names.map(|name| {
        let path = dir.path().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        bag(path.parent().unwrap(), path.file_name().unwrap().to_str().unwrap(), |_, _| {})
    });
    let out = dir.path().join("out");
    let mut arguments = vec!["replay", "--out", out.to_str().unwrap()];
    arguments.extend(paths.iter().map(|path| path.to_str().unwrap()));
    let run = govtwin(&arguments);
    assert_eq!(run.code, 1, "{}", run.stderr);
    assert!(run.stderr.contains("bag a/b of") && run.stderr.contains("inside a of"), "{}", run.stderr);
    assert!(!out.exists());
}

#[test]
fn wrong_usage_has_its_own_exit_code() {
    for arguments in
        [&["replay"][..], &["replay", "--cut", "esv", "x"], &["replay", "--speed", "2", "x"], &["simulate"]]
    {
        let run = govtwin(arguments);
        assert_eq!(run.code, 2, "{arguments:?}");
        assert!(run.stderr.contains("--help"), "{}", run.stderr);
    }
}

#[test]
fn a_reader_that_leaves_is_no_failure() {
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "sound", |_, row| row.esv = Some(EsvState::NORMAL));
    let mut child = Command::new(env!("CARGO_BIN_EXE_govtwin"))
        .args(["replay", path.to_str().unwrap()])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
}
