//! What commands leave: nothing half, nothing of others touched, the cause named, and no text that acts on a terminal.
#![cfg(feature = "cli")]

#[path = "cli/bags.rs"]
mod bags;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;

use bags::bag;
use govtwin_bag::msg::EsvState;
use govtwin_bag::{Qos, TopicInfo, Writer, WriterOptions};

fn govtwin(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_govtwin")).args(arguments).output().unwrap()
}

/// Runs the program behind some words of a shell.
#[cfg(unix)]
fn behind(words: &str, arguments: &[&str]) -> Output {
    let script = format!("{words}; exec \"$0\" \"$@\"");
    let mut shell = Command::new("bash");
    shell.args(["-c", &script, env!("CARGO_BIN_EXE_govtwin")]).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Every file below a folder with its bytes.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else {
            found.insert(path.clone(), fs::read(&path).unwrap());
        }
    }
    found
}

#[cfg(unix)]
#[test]
fn a_disk_that_is_full_at_any_write_leaves_what_was_there() {
    let dir = tempfile::tempdir().unwrap();
    let (first, second) = (bag(dir.path(), "run", |_, _| {}), dir.path().join("other"));
    fs::create_dir(&second).unwrap();
    let second = bag(&second, "run", |_, row| row.opening = Some(0.4));
    let out = dir.path().join("out");
    let out_text = out.to_str().unwrap();
    for arguments in [vec!["replay", first.to_str().unwrap()], vec!["fit", first.to_str().unwrap(), "--starts", "1"]] {
        let run = govtwin(&[&arguments[..], &["--out", out_text]].concat());
        assert!(matches!(run.status.code(), Some(0 | 3)), "{}", text(&run.stderr));
    }
    let before = files(&out);
    assert_eq!(before.len(), 6, "{:?}", before.keys());
    let mut refused = 0;
    // No file may be longer than so many blocks of 1 KiB: the writes fail one after the other.
    for most in [0, 1, 2, 4, 8, 12, 16, 24, 32, 64, 100_000] {
        let limit = format!("ulimit -f {most}");
        let run = behind(&limit, &["replay", second.to_str().unwrap(), "--out", out_text]);
        if run.status.success() {
            break;
        }
        refused += 1;
        let words = text(&run.stderr);
        assert!(words.contains("File too large") && words.contains(out_text), "{most}: {words}");
        assert!(files(&out) == before, "{most}: {:?}", files(&out).keys());
    }
    assert!(refused > 4, "{refused}");
    assert!(files(&out) != before && files(&out).len() == before.len());
}

#[test]
fn what_is_in_the_way_is_named_before_any_work() {
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "run", |_, _| {});
    let path = path.to_str().unwrap();
    let at = |name: &str| dir.path().join(name);
    fs::write(at("file"), "mine").unwrap();
    for name in ["report.html", "replay.json", "fit.json", "truth.yaml"] {
        fs::create_dir_all(at("taken").join(name)).unwrap();
        fs::write(at("taken").join(name).join("diary"), "mine").unwrap();
    }
    let before = files(dir.path());
    for command in [&["replay", path][..], &["fit", path], &["diagnose", path], &["generate"]] {
        for (out, words) in [
            (at("file"), "expected a folder, found a file"),
            (at("file/below"), "expected a folder, found a file"),
            (at("taken"), "expected a file or nothing there, found a folder"),
            (PathBuf::from("/proc/self/govtwin"), "/proc/self/govtwin"),
        ] {
            let run = govtwin(&[command, &["--out", out.to_str().unwrap()]].concat());
            let said = text(&run.stderr);
            assert!(run.status.code() == Some(1) && said.contains(words), "{command:?} {}: {said}", out.display());
            assert!(
                run.stdout.is_empty() && files(dir.path()) == before,
                "{command:?}: {:?}",
                files(dir.path()).keys()
            );
        }
    }
}

#[test]
fn a_file_of_others_is_replaced_by_none_and_one_of_ours_is() {
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "run", |_, _| {});
    let path = path.to_str().unwrap();
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let table = format!("{}/tests/fixtures/import/pandas_iso.csv", env!("CARGO_MANIFEST_DIR"));
    let plate = ["tank_pressure=63 bar", "servomotor_stroke=600 mm", "servomotor_volume=120 L"];
    let sheet: Vec<&str> = [&["sheet", "new", "--quick"][..], &plate.map(|one| ["--set", one]).concat()].concat();
    let mut commands = vec![
        (vec!["replay", path], "out", "out/replay.json"),
        (vec!["replay", path], "out", "out/replay.html"),
        (vec!["fit", path], "out", "out/fit.json"),
        (vec!["diagnose", path], "out", "out/report.json"),
        (vec!["accept", path, "--measure-only"], "out", "out/acceptance.csv"),
        (vec!["import", "--suggest", &table], "out", "out/map.yaml"),
        (vec!["man"], "out", "out/govtwin.1"),
        (vec!["watch", path, "--once"], "out", "out/watch.json"),
        (vec!["calibrate", path], "out", "out"),
        (sheet.clone(), "out", "out"),
    ];
    if cfg!(feature = "node") {
        commands.push((vec!["run", "--duration", "0.1", "--priority", "0"], "out", "out"));
    }
    for (command, out, file) in &commands {
        let _ = fs::remove_dir_all(at("out")).or_else(|_| fs::remove_file(at("out")));
        fs::create_dir_all(Path::new(&at(file)).parent().unwrap()).unwrap();
        fs::write(at(file), "a diary").unwrap();
        let run = govtwin(&[&command[..], &["--out", &at(out)]].concat());
        let said = text(&run.stderr);
        assert!(run.status.code() == Some(1) && said.contains(&at(file)), "{command:?}: {said}");
        assert!(run.stdout.is_empty(), "{command:?}");
        assert_eq!(fs::read_to_string(at(file)).unwrap(), "a diary", "{command:?}");
    }
    // What this program made it makes again, but what a person may have worked on.
    let again = |arguments: &[&str]| {
        let runs = [0, 1].map(|_| govtwin(arguments));
        (runs[1].status.code(), text(&runs[1].stderr))
    };
    for command in
        [&["replay", path][..], &["accept", path, "--measure-only"], &["man"], &["import", "--suggest", &table]]
    {
        let (code, said) = again(&[command, &["--out", &at(command[0])]].concat());
        assert!(matches!(code, Some(0 | 3)), "{command:?}: {said}");
    }
    let mended = fs::read_to_string(at("import/map.yaml")).unwrap() + "# settled\n";
    fs::write(at("import/map.yaml"), &mended).unwrap();
    let (code, said) = again(&["import", "--suggest", &table, "--out", &at("import")]);
    assert!(code == Some(1) && said.contains("may have been settled by hand"), "{said}");
    assert_eq!(fs::read_to_string(at("import/map.yaml")).unwrap(), mended);
    let (code, said) = again(&[&sheet[..], &["--out", &at("unit.yaml")]].concat());
    assert!(code == Some(1) && said.contains("may have been mended by hand"), "{said}");
}

#[cfg(unix)]
#[test]
fn files_have_the_rights_that_the_umask_leaves() {
    use std::os::unix::fs::PermissionsExt as _;
    let dir = tempfile::tempdir().unwrap();
    let path = bag(dir.path(), "run", |_, _| {});
    for (umask, file_mode, folder_mode) in [("077", 0o600, 0o700), ("027", 0o640, 0o750), ("002", 0o664, 0o775)] {
        let out = dir.path().join(umask);
        let run =
            behind(&format!("umask {umask}"), &["replay", path.to_str().unwrap(), "--out", out.to_str().unwrap()]);
        assert!(run.status.success(), "{}", text(&run.stderr));
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        for file in files(&out).into_keys() {
            assert_eq!(mode(&file), file_mode, "{umask}: {}", file.display());
        }
        assert_eq!([mode(&out), mode(&out.join("run"))], [folder_mode; 2], "{umask}");
    }
}

#[test]
fn names_from_a_bag_do_not_act_on_the_terminal() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("hostile");
    let hostile = "/x\u{1b}]0;owned\u{7}\u{9b}31m\u{202e}\nwarning: all is well";
    let mut writer = Writer::create(&path, WriterOptions::default()).unwrap();
    let esv = writer.topic::<EsvState>("/governor/esv", Qos::SENSOR).unwrap();
    writer.write(esv, 5, &EsvState::default()).unwrap();
    let topic =
        TopicInfo { name: hostile.into(), type_name: hostile.into(), encoding: "cdr".into(), ..TopicInfo::default() };
    let message = govtwin_bag::RawMessage {
        topic: Arc::new(topic),
        log_time_ns: 7,
        publish_time_ns: 7,
        sequence: 0,
        data: vec![],
    };
    writer.copy(&message).unwrap();
    let path = writer.finish().unwrap();
    let path = path.to_str().unwrap();
    for arguments in
        [&["info", path][..], &["info", "--json", path], &["replay", path], &["fit", path], &["diagnose", path]]
    {
        let run = Command::new(env!("CARGO_BIN_EXE_govtwin")).args(arguments).current_dir(dir.path()).output().unwrap();
        let all = text(&run.stdout) + &text(&run.stderr);
        let acts = |c: char| (c.is_control() && c != '\n') || c == '\u{202e}';
        assert!(!all.contains(acts), "{arguments:?}: {all:?}");
        assert!(all.contains("/x\\u001b]0;owned\\u0007\\u009b31m\\u202e"), "{arguments:?}: {all}");
        assert!(!all.contains("\nwarning: all is well"), "{arguments:?}: a line of its own");
    }
    let json: serde_json::Value = serde_json::from_slice(&govtwin(&["info", "--json", path]).stdout).unwrap();
    assert_eq!(json[0]["topics"][1]["name"], hostile, "JSON holds the name as it is");
}
