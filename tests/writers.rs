//! Two writers, and writers that are killed: what has its final name is whole, and nobody's work is lost by another's.
#![cfg(feature = "cli")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::{Duration, Instant};

use govtwin_bag::msg::EsvState;
use govtwin_bag::{Qos, Writer, WriterOptions};
use govtwin_files::Claim;

/// Draws of the moments at which processes are killed.
const KILLS: u64 = 14;

fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_govtwin"));
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn govtwin(arguments: &[&str]) -> Output {
    command(arguments).output().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn shipped(name: &str) -> String {
    format!("{}/bags/reference/{name}.mcap", env!("CARGO_MANIFEST_DIR"))
}

/// Every file and folder below a folder, by its path in it.
fn tree(folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        found.push(path.clone());
        if path.is_dir() {
            found.extend(tree(&path));
        }
    }
    found.sort();
    found
}

fn hidden(folder: &Path) -> Vec<PathBuf> {
    let is_hidden = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().starts_with('.');
    tree(folder).into_iter().filter(is_hidden).collect()
}

/// Fails where anything under a final name of a replay is not whole; gives how many of its files and bags are there.
#[track_caller]
fn whole(out: &Path, bags: &[&str]) -> usize {
    let mut there = 0;
    if let Ok(page) = fs::read_to_string(out.join("replay.html")) {
        assert!(page.ends_with("</html>"), "half a page");
        there += 1;
    }
    if let Ok(figures) = fs::read_to_string(out.join("replay.json")) {
        serde_json::from_str::<serde_json::Value>(&figures).expect("whole figures");
        there += 1;
    }
    for name in bags {
        let path = out.join(name);
        if path.exists() {
            let survey = govtwin_bag::survey(&path).unwrap();
            assert!(survey.warnings.is_empty() && survey.messages > 1000, "{name}: {:?}", survey.warnings);
            assert!(survey.topics.iter().any(|topic| topic.name == "/sim/servo_state"), "{name}");
            there += 1;
        }
    }
    there
}

/// Waits until a path is there, as long as the process runs.
fn await_path(path: &Path, child: &mut Child) {
    while !path.exists() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
}

#[test]
fn of_two_replays_at_once_one_is_refused_and_the_other_whole() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let arguments = ["replay", &shipped("shutdown_01"), &shipped("startup_01"), "--out", out.to_str().unwrap()];
    let mut first = command(&arguments).spawn().unwrap();
    await_path(&out.join(".govtwin.lock"), &mut first);
    let second = govtwin(&arguments);
    assert_eq!(second.status.code(), Some(1), "{}", stderr(&second));
    for words in [out.to_str().unwrap(), "another process is writing there", "name another folder"] {
        assert!(stderr(&second).contains(words), "{}", stderr(&second));
    }
    assert!(second.stdout.is_empty(), "refused before any work");
    let first = first.wait_with_output().unwrap();
    assert_eq!(first.status.code(), Some(0), "{}", stderr(&first));
    assert_eq!(whole(&out, &["shutdown_01", "startup_01"]), 4);
    assert_eq!(hidden(&out), Vec::<PathBuf>::new());
}

#[test]
fn a_replay_that_is_killed_destroys_nothing_and_the_next_one_cleans_up() {
    let dir = tempfile::tempdir().unwrap();
    let (out, bags) = (dir.path().join("out"), ["shutdown_01", "startup_01"]);
    let arguments = ["replay", &shipped(bags[0]), &shipped(bags[1]), "--out", out.to_str().unwrap()];
    let start = Instant::now();
    assert_eq!(govtwin(&arguments).status.code(), Some(0));
    let run_ms = start.elapsed().as_millis() as u64 + 1;
    assert_eq!(whole(&out, &bags), 4);
    for kill in 0..KILLS {
        let mut child = command(&arguments).spawn().unwrap();
        // Most of them late, where names change.
        std::thread::sleep(Duration::from_millis(run_ms * (kill + 3) / (KILLS + 3)));
        child.kill().unwrap();
        child.wait().unwrap();
        assert_eq!(whole(&out, &bags), 4, "killed at {kill} of {KILLS}: everything of the first run, or of the second");
    }
    // What they left is known by nobody holding it.
    assert_eq!(govtwin(&arguments).status.code(), Some(0));
    assert_eq!(whole(&out, &bags), 4);
    assert_eq!(hidden(&out), Vec::<PathBuf>::new());
}

#[test]
fn while_one_replay_works_others_are_killed_and_do_not_disturb_it() {
    let dir = tempfile::tempdir().unwrap();
    let (out, bags) = (dir.path().join("out"), ["load_increase_01", "startup_01"]);
    let arguments = ["replay", &shipped(bags[0]), &shipped(bags[1]), "--out", out.to_str().unwrap()];
    let lock = out.join(".govtwin.lock");
    for round in 0..3 {
        // A killed one may have left its own, which would be taken for that of the first.
        let _ = fs::remove_file(&lock);
        let mut first = command(&arguments).spawn().unwrap();
        await_path(&lock, &mut first);
        for kill in 0..KILLS {
            let mut other = command(&arguments).spawn().unwrap();
            std::thread::sleep(Duration::from_millis(kill * 3 + round));
            other.kill().unwrap();
            other.wait().unwrap();
        }
        let first = first.wait_with_output().unwrap();
        // Where it was done before the last of the others, that one may have been at work.
        assert!(matches!(first.status.code(), Some(0)), "{}", stderr(&first));
        assert_eq!(whole(&out, &bags), 4, "round {round}");
    }
}

#[test]
fn recordings_that_are_killed_in_the_making_leave_no_bag() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let arguments = ["generate", "--duration", "30", "--out", out.to_str().unwrap()];
    let start = Instant::now();
    assert_eq!(govtwin(&arguments).status.code(), Some(0));
    let run_ms = start.elapsed().as_millis() as u64 + 1;
    fs::remove_dir_all(&out).unwrap();
    for kill in 0..KILLS {
        let mut child = command(&arguments).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(run_ms * kill / KILLS));
        child.kill().unwrap();
        child.wait().unwrap();
        let named = tree(&out).into_iter().filter(|path| path.parent() == Some(&out));
        for path in named.filter(|path| !path.file_name().unwrap().to_string_lossy().starts_with('.')) {
            if path.is_dir() {
                let survey = govtwin_bag::survey(&path).unwrap();
                assert!(survey.warnings.is_empty() && survey.messages > 1000, "{survey:?}");
            }
        }
        if out.join("truth.yaml").exists() {
            fs::remove_dir_all(&out).unwrap();
        }
    }
    let mut last = govtwin(&arguments);
    if stderr(&last).contains("not empty") {
        // Killed with all files whole and not all of them named, perhaps none: this run named them, and refuses the folder as it would another's.
        assert!(out.join("truth.yaml").exists());
        fs::remove_dir_all(&out).unwrap();
        last = govtwin(&arguments);
    }
    assert_eq!(last.status.code(), Some(0), "{}", stderr(&last));
    assert_eq!(hidden(&out), Vec::<PathBuf>::new());
}

/// A table, a map of it, and what is typed to import it into `bag`.
fn import_of(folder: &Path, rows: usize) -> Vec<String> {
    let mut table = "Zeit [s],Y [%],S [%]\n".to_owned();
    (0..rows).for_each(|row| table += &format!("{}.{:02},{},{}\n", row / 100, row % 100, row % 90, row % 80));
    fs::write(folder.join("table.csv"), table).unwrap();
    let map = "time: {column: Zeit, format: seconds, start: 2024-05-02T10:00:00}\nsignals:\n  \
               opening_command: {column: Y, unit: \"%\"}\n  servomotor_position: {column: S, unit: \"%\"}\n";
    fs::write(folder.join("map.yaml"), map).unwrap();
    let at = |name: &str| folder.join(name).display().to_string();
    vec!["import".into(), at("table.csv"), "--map".into(), at("map.yaml"), "--out".into(), at("bag")]
}

#[test]
fn of_two_imports_into_one_bag_one_is_refused_and_a_killed_one_blocks_nobody() {
    let dir = tempfile::tempdir().unwrap();
    let (rows, bag, lock) = (400_000, dir.path().join("bag"), dir.path().join(".govtwin-bag.lock"));
    let arguments = import_of(dir.path(), rows);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let messages = || govtwin_bag::survey(&bag).map_or(0, |survey| survey.messages);
    let mut first = command(&arguments).spawn().unwrap();
    await_path(&lock, &mut first);
    let second = govtwin(&arguments);
    assert_eq!(second.status.code(), Some(1), "{}", stderr(&second));
    let words = "bag: another process is writing it and holds";
    assert!(stderr(&second).contains(words) && stderr(&second).contains("choose another name"), "{}", stderr(&second));
    assert!(second.stdout.is_empty() && first.try_wait().unwrap().is_none(), "refused before any work");
    // Another bag beside it is nobody's business.
    let table = dir.path().join("small");
    fs::create_dir(&table).unwrap();
    let mut beside = import_of(&table, 500);
    *beside.last_mut().unwrap() = dir.path().join("beside").display().to_string();
    let beside = govtwin(&beside.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(matches!(beside.status.code(), Some(0 | 3)), "{}", stderr(&beside));
    let first = first.wait_with_output().unwrap();
    assert!(matches!(first.status.code(), Some(0 | 3)), "{}", stderr(&first));
    let whole = messages();
    assert!(whole >= rows as u64, "{whole}");
    assert_eq!(hidden(dir.path()), Vec::<PathBuf>::new());
    // Killed while it replaces the older one: that one stands, and the next goes ahead at once.
    for kill in 0..KILLS {
        let mut other = command(&arguments).spawn().unwrap();
        await_path(&lock, &mut other);
        std::thread::sleep(Duration::from_millis(kill * 20));
        other.kill().unwrap();
        other.wait().unwrap();
        assert_eq!(messages(), whole, "killed at {kill} of {KILLS}");
    }
    // What is young may be another's: it goes once it is a minute old.
    let then = fs::FileTimes::new().set_modified(std::time::SystemTime::now() - Duration::from_secs(120));
    hidden(dir.path()).iter().for_each(|path| fs::File::open(path).unwrap().set_times(then).unwrap());
    let next = govtwin(&arguments);
    assert!(matches!(next.status.code(), Some(0 | 3)), "{}", stderr(&next));
    assert_eq!((messages(), hidden(dir.path())), (whole, vec![]));
}

#[test]
fn single_files_and_bags_have_one_writer_at_a_time() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).display().to_string();
    let place = at("out.yaml");
    let claim = Claim::name(Path::new(&place)).unwrap();
    let broken = at("broken.mcap");
    let bytes = fs::read(shipped("startup_01")).unwrap();
    fs::write(&broken, &bytes[..bytes.len() / 2]).unwrap();
    fs::create_dir(at("empty")).unwrap();
    fs::write(at("report.json"), "{\"schema\": \"govtwin-diagnosis/1\"}").unwrap();
    let table = import_of(dir.path(), 500);
    let mut commands = vec![
        vec!["recover", &broken, "--out", &place],
        vec!["calibrate", dir.path().to_str().unwrap(), "--out", &place],
        vec!["sheet", "new", "--set", "tank_pressure=63 bar", "--quick", "--out", &place],
        vec![&table[0], &table[1], &table[2], &table[3], &table[4], &place],
    ];
    let (empty, report) = (at("empty/out.html"), at("report.json"));
    let page = Claim::name(Path::new(&empty)).unwrap();
    commands.push(vec!["report", &report, "--out", &empty]);
    if cfg!(feature = "node") {
        commands.push(vec!["run", "--out", &place, "--duration", "1"]);
        commands.push(vec!["record", "--out", &place, "--duration", "1"]);
    }
    for arguments in commands {
        let run = govtwin(&arguments);
        assert_eq!(run.status.code(), Some(1), "{arguments:?}: {}", stderr(&run));
        let words = stderr(&run);
        assert!(words.contains("another process is writing it and holds"), "{arguments:?}: {words}");
        assert!(run.stdout.is_empty(), "{arguments:?}");
    }
    assert!(!Path::new(&place).exists() && !Path::new(&empty).exists());
    drop((claim, page));
    // A page beside its report is the business of who has the folder.
    let _claim = Claim::folder(dir.path()).unwrap();
    let run = govtwin(&["report", &report]);
    assert!(stderr(&run).contains("another process is writing there"), "{}", stderr(&run));
}

#[test]
fn every_command_with_an_output_is_refused_before_its_work_where_another_writes() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let _claim = Claim::folder(&out).unwrap();
    let out_text = out.to_str().unwrap();
    let bag = shipped("startup_01");
    let units = dir.path().join("units");
    fs::create_dir_all(units.join("one")).unwrap();
    fs::copy(&bag, units.join("one/startup.mcap")).unwrap();
    let table = format!("{}/tests/fixtures/import/pandas_iso.csv", env!("CARGO_MANIFEST_DIR"));
    let battery = dir.path().join("battery");
    let mut commands = vec![
        vec!["accept", bag.as_str(), "--measure-only", "--out", out_text],
        vec!["watch", units.to_str().unwrap(), "--once", "--out", out_text],
        vec!["import", "--suggest", table.as_str(), "--out", out_text],
        vec!["man", "--out", out_text],
        vec!["blind", battery.to_str().unwrap(), "--generate", "1", "--out", out_text],
        vec!["replay", bag.as_str(), "--out", out_text],
        vec!["fit", bag.as_str(), "--out", out_text],
        vec!["diagnose", bag.as_str(), "--out", out_text],
        vec!["generate", "--out", out_text],
        vec!["blind", units.to_str().unwrap(), "--out", out_text],
    ];
    if cfg!(feature = "residual") {
        commands.push(vec!["train", bag.as_str(), "--out", out_text]);
        commands.push(vec!["compare", bag.as_str(), "--out", out_text]);
    }
    for arguments in commands {
        let run = govtwin(&arguments);
        assert_eq!(run.status.code(), Some(1), "{arguments:?}: {}", stderr(&run));
        let words = stderr(&run);
        assert!(words.contains(out_text) && words.contains("another process is writing there"), "{words}");
        assert!(run.stdout.is_empty(), "{arguments:?}");
    }
    assert_eq!(tree(&out), [out.join(".govtwin.lock")]);
    assert!(!battery.exists(), "nothing is made for reports that cannot be written");
}

/// Processes whose command line holds this text.
#[cfg(target_os = "linux")]
fn processes(text: &str) -> usize {
    let lines =
        fs::read_dir("/proc").unwrap().flatten().filter_map(|entry| fs::read(entry.path().join("cmdline")).ok());
    lines.filter(|line| String::from_utf8_lossy(line).contains(text)).count()
}

#[cfg(target_os = "linux")]
#[test]
fn a_diagnosis_ends_with_the_benchmark_that_started_it() {
    let dir = tempfile::tempdir().unwrap();
    let (units, out) = (dir.path().join("units"), dir.path().join("out"));
    fs::create_dir_all(units.join("one")).unwrap();
    fs::copy(shipped("startup_01"), units.join("one/startup.mcap")).unwrap();
    let mut blind = command(&["blind", units.to_str().unwrap(), "--out", out.to_str().unwrap()]).spawn().unwrap();
    let of_unit = out.join("one");
    let of_unit = of_unit.to_str().unwrap();
    let start = Instant::now();
    let wait = |wanted: usize| {
        while processes(of_unit) != wanted && start.elapsed() < Duration::from_secs(60) {
            std::thread::sleep(Duration::from_millis(10));
        }
        processes(of_unit)
    };
    assert_eq!(wait(1), 1, "the diagnosis has begun");
    blind.kill().unwrap();
    blind.wait().unwrap();
    assert_eq!(wait(0), 0, "and has ended");
    // Nobody is told to wait for it. An ending process loses its command line before its locks, hence more than one try.
    let mut claim = Claim::folder(Path::new(of_unit));
    while claim.is_err() && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(10));
        claim = Claim::folder(Path::new(of_unit));
    }
    drop(claim.unwrap());
}

#[test]
fn of_two_recorders_one_is_refused_and_a_broken_recording_is_kept() {
    let dir = tempfile::tempdir().unwrap();
    let place = dir.path().join("run");
    let options = WriterOptions { keep_unfinished: true, ..WriterOptions::default() };
    let mut writer = Writer::create(&place, options).unwrap();
    let topic = writer.topic::<EsvState>("/governor/esv", Qos::SENSOR).unwrap();
    writer.write(topic, 1, &EsvState::default()).unwrap();
    let words = Writer::create(&place, options).unwrap_err().to_string();
    assert!(words.contains("run: another process is writing it and holds"), "{words}");
    if cfg!(feature = "node") {
        let run = govtwin(&["record", "--out", place.to_str().unwrap()]);
        assert_eq!(run.status.code(), Some(1));
        assert!(stderr(&run).contains("another process is writing it"), "{}", stderr(&run));
    }
    // Killed: it stays, and the next recorder is told of it, not of a process.
    drop(writer);
    let words = Writer::create(&place, options).unwrap_err().to_string();
    assert!(words.contains("kept in") && words.contains(".run.unfinished; save it with `govtwin recover"), "{words}");
    assert!(!place.exists());
}
