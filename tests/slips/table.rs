//! Mistyped command lines: each is run by a shell, and its answer held by the snapshot tests/snapshots/slips.txt.

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use super::{bag, text};

const TOP: &str = env!("CARGO_MANIFEST_DIR");

/// Longer answers are cut, characters.
const LONGEST: usize = 150;

/// What one line of the table says.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    typed: String,
    code: String,
    answered: String,
    left: String,
}

impl Row {
    fn parse(line: &str) -> Option<Self> {
        let line = line.strip_prefix("| `")?.replace("\\|", "\u{1}");
        let mut cells = line.split('|').map(|cell| cell.trim().replace('\u{1}', "|"));
        let typed = cells.next()?.strip_suffix('`')?.to_owned();
        let (code, answered, left) = (cells.next()?, cells.next()?, cells.next()?);
        Some(Self { typed, code, answered, left })
    }

    fn to_line(&self) -> String {
        let [typed, answered, left] = [&self.typed, &self.answered, &self.left].map(|cell| cell.replace('|', "\\|"));
        format!("| `{typed}` | {} | {answered} | {left} |", self.code)
    }
}

/// All files below a folder, and folders without any.
fn files(dir: &Path) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    let mut folders = vec![dir.to_owned()];
    while let Some(folder) = folders.pop() {
        let entries: Vec<PathBuf> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        if entries.is_empty() {
            found.insert(folder.clone());
        }
        for entry in entries {
            if entry.is_dir() && !entry.is_symlink() {
                folders.push(entry);
            } else {
                found.insert(entry);
            }
        }
    }
    found
}

/// The line of an answer that names the slip.
fn first_line(answer: &str) -> String {
    let mut lines = answer.lines().map(str::trim).filter(|line| !line.is_empty());
    let mut line = lines.next().unwrap_or_default().to_owned();
    if (line.ends_with(':')
        || line.contains(" in the parameter file ")
        || line.contains(" in the limits file ")
        || line.contains(" in the map "))
        && let Some(next) = lines.next()
    {
        line = format!("{line} {next}");
    }
    let line: String = line.chars().take(LONGEST).collect();
    if line.is_empty() { line } else { format!("`` {line} ``") }
}

/// A text without the drawn part of a temporary name.
fn lasting(text: &str) -> String {
    match text.split_once(".govtwin-") {
        Some((before, rest)) => format!("{before}.govtwin-*{}", rest.get(6..).unwrap_or_default()),
        None => text.to_owned(),
    }
}

/// Types a line in a copy of a folder.
fn typed(fixture: &Path, line: &str) -> Row {
    let dir = tempfile::tempdir().unwrap();
    let copied = Command::new("cp").arg("-a").arg(fixture.join(".")).arg(dir.path()).status();
    assert!(copied.unwrap().success());
    let before = files(dir.path());
    let program = Path::new(env!("CARGO_BIN_EXE_govtwin")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let output = Command::new("timeout")
        .args(["-s", "KILL", "30", "sh", "-c", line])
        .env("PATH", path)
        .env_remove("SOURCE_DATE_EPOCH")
        .current_dir(dir.path())
        .stdin(Stdio::null())
        .process_group(0)
        .output()
        .unwrap();
    let after = files(dir.path());
    assert!(before.is_subset(&after), "{line}: files are gone: {:?}", before.difference(&after));
    let left: BTreeSet<String> = after
        .difference(&before)
        .map(|path| {
            let name = path.strip_prefix(dir.path()).unwrap().display().to_string();
            format!("`{}`", lasting(&name))
        })
        .collect();
    let here = format!("{}/", dir.path().canonicalize().unwrap().display());
    let [out, err] = [text(&output.stdout), text(&output.stderr)].map(|said| lasting(&said.replace(&here, "")));
    assert!(!err.contains("panicked"), "{line}: {err}");
    Row {
        typed: line.to_owned(),
        code: output.status.code().map_or_else(|| "killed".to_owned(), |code| code.to_string()),
        answered: first_line(if err.trim().is_empty() { &out } else { &err }),
        left: Vec::from_iter(left).join(", "),
    }
}

/// As the table says; of an interrupted command no more may be left behind than that.
fn agree(said: &Row, found: &Row) -> bool {
    if !said.typed.starts_with("timeout") {
        return said == found;
    }
    let subset =
        found.left.is_empty() || found.left.split(", ").all(|file| said.left.split(", ").any(|one| one == file));
    subset && (&said.code, &said.answered) == (&found.code, &found.answered)
}

#[test]
fn every_slip_of_the_table_is_answered_as_it_says() {
    let fixture = tempfile::tempdir().unwrap();
    bag(fixture.path(), "run", |_, _| {});
    let setup = Command::new("sh").arg(format!("{TOP}/tests/slips/setup.sh")).current_dir(fixture.path()).status();
    assert!(setup.unwrap().success());
    let path = format!("{TOP}/tests/snapshots/slips.txt");
    let text = fs::read_to_string(&path).unwrap();
    let rows: Vec<Row> = text.lines().filter_map(Row::parse).collect();
    assert!(rows.len() >= 200, "{}", rows.len());
    let next = std::sync::atomic::AtomicUsize::new(0);
    let found = std::sync::Mutex::new(vec![None; rows.len()]);
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                while let Some(row) = rows.get(next.fetch_add(1, std::sync::atomic::Ordering::Relaxed)) {
                    let index = rows.iter().position(|other| std::ptr::eq(other, row)).unwrap();
                    let one = typed(fixture.path(), &row.typed);
                    found.lock().unwrap()[index] = Some(one);
                }
            });
        }
    });
    let found: Vec<Row> = found.into_inner().unwrap().into_iter().flatten().collect();
    assert_eq!(found.len(), rows.len());
    if std::env::var_os("GOVTWIN_WRITE_REFERENCE").is_some() {
        let mut left = found.iter();
        let line = |line: &str| Row::parse(line).map_or_else(|| line.to_owned(), |_| left.next().unwrap().to_line());
        let lines: Vec<String> = text.lines().map(line).collect();
        fs::write(&path, lines.join("\n") + "\n").unwrap();
        return;
    }
    let differ: Vec<String> = rows
        .iter()
        .zip(&found)
        .filter(|(said, found)| !agree(said, found))
        .map(|(said, found)| format!("table {}\nfound {}", said.to_line(), found.to_line()))
        .collect();
    assert!(
        differ.is_empty(),
        "{} lines of tests/snapshots/slips.txt are not so:\n{}",
        differ.len(),
        differ.join("\n")
    );
    let hung = found.iter().find(|row| row.code == "killed");
    assert!(hung.is_none(), "{hung:?}");
    assert!(found.iter().all(|row| row.code != "101"), "a panic");
}
