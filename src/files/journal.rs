//! Files and folders of one report take their names together even where the process is killed between two of them: what is to be done
//! is in a journal first, and the next command completes it.

use std::fs::{self, File};
use std::io;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::fault::step;
use super::regular::{bounded_text, look_at_link};
use super::rename::{exchange, move_new};
use super::temporary::is_temporary;
use super::{Claim, ClaimError, Together, folder_of};

/// Its name, in the folder of the report.
const NAME: &str = ".govtwin.journal";

const SCHEMA: &str = "govtwin-journal/1";

/// More than the names of ten thousand files need.
const LARGEST_BYTES: u64 = 1 << 22;

/// How often a journal is looked for again that a living process works off.
const TRIES: usize = 10_000;

/// What is to be done in a folder. The paths lie in it.
#[derive(Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FolderJournal {
    schema: String,
    moves: Vec<Move>,
    /// Files that are outdated by then.
    removes: Vec<PathBuf>,
}

/// What is whole under a temporary name, and its own name.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Move {
    from: PathBuf,
    to: PathBuf,
    /// Number of the file or folder in its file system, by which it is known under either name.
    inode: u64,
}

/// Lets `act` give files and folders their names, each `(temporary, own)`, and remove what is outdated. Where the process is killed
/// meanwhile, the next [`Claim`] of the folder, or the next reader of a file in it, does what is left.
///
/// # Errors
/// Where the journal cannot be written; nothing is done then.
pub fn journalled<R>(
    folder: &Path,
    moves: &[(PathBuf, PathBuf)],
    removes: &[PathBuf],
    act: impl FnOnce() -> R,
) -> io::Result<R> {
    if moves.len() + removes.len() < 2 || cfg!(not(unix)) {
        return Ok(act());
    }
    // Temporary files have absolute names, whatever the folder is called.
    let root = std::path::absolute(folder)?;
    let inside =
        |path: &Path| std::path::absolute(path)?.strip_prefix(&root).map(Path::to_owned).map_err(io::Error::other);
    let mut journal = FolderJournal { schema: SCHEMA.to_owned(), ..FolderJournal::default() };
    for (from, to) in moves {
        let inode = inode(from)?.ok_or(io::ErrorKind::NotFound)?;
        journal.moves.push(Move { from: inside(from)?, to: inside(to)?, inode });
    }
    for path in removes {
        journal.removes.push(inside(path)?);
    }
    let path = folder.join(NAME);
    let mut file = Together::default();
    file.add(&path, &serde_json::to_vec(&journal).map_err(io::Error::other)?)?;
    file.place()?;
    if let Err(error) = sync(folder) {
        // Nothing was done, and no later command may do it.
        fs::remove_file(&path)?;
        return Err(error);
    }
    let done = act();
    step()?;
    fs::remove_file(&path)?;
    Ok(done)
}

/// Completes what a killed process left to do; only for who has claimed the folder.
pub(super) fn complete(folder: &Path) -> io::Result<()> {
    let path = folder.join(NAME);
    if look_at_link(&path)?.is_none() {
        return Ok(());
    }
    let text = bounded_text(&path, LARGEST_BYTES)?;
    let journal: FolderJournal = serde_json::from_str(&text).map_err(|error| foreign(&path, &error.to_string()))?;
    if journal.schema != SCHEMA {
        return Err(foreign(&path, "another schema"));
    }
    let names = journal.moves.iter().flat_map(|one| [&one.from, &one.to]).chain(&journal.removes);
    let strange =
        names.clone().any(|name| !is_inside(name)) || journal.moves.iter().any(|one| !is_temporary(&one.from));
    if strange {
        return Err(foreign(&path, "a name that leads elsewhere"));
    }
    for Move { from, to, inode: number } in &journal.moves {
        let (from, to) = (folder.join(from), folder.join(to));
        if inode(&to)? == Some(*number) || inode(&from)? != Some(*number) {
            continue;
        }
        if look_at_link(&to)?.is_some() {
            // The older one takes the temporary name, and goes with what is stale.
            exchange(&from, &to)?;
        } else {
            move_new(&from, &to)?;
        }
    }
    for path in &journal.removes {
        match fs::remove_file(folder.join(path)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
    }
    fs::remove_file(&path)
}

/// Completes what a killed process left to do in the folder of a file or bag that is about to be read.
///
/// # Errors
/// Where that cannot be done: some files there would be of another report than others.
pub fn settle(read: &Path) -> io::Result<()> {
    let folder = folder_of(read);
    let path = folder.join(NAME);
    for _ in 0..TRIES {
        if look_at_link(&path)?.is_none() {
            return Ok(());
        }
        match Claim::folder(folder) {
            Ok(_claim) => return Ok(()),
            // Its writer is alive and at it.
            Err(ClaimError::Busy { .. }) => std::thread::yield_now(),
            Err(error) => {
                return Err(io::Error::other(format!(
                    "a report in this folder was broken off while its files took their names, and cannot be completed ({error})"
                )));
            }
        }
    }
    Ok(())
}

/// A relative path that stays where it is.
fn is_inside(path: &Path) -> bool {
    let mut parts = path.components();
    path.components().next().is_some() && parts.all(|part| matches!(part, Component::Normal(_)))
}

fn foreign(path: &Path, problem: &str) -> io::Error {
    io::Error::other(format!("{} is no journal of this program ({problem}); move it away", path.display()))
}

#[cfg(unix)]
fn inode(path: &Path) -> io::Result<Option<u64>> {
    use std::os::unix::fs::MetadataExt as _;
    Ok(look_at_link(path)?.map(|kind| kind.ino()))
}

/// Elsewhere files have no number, and there is no journal.
#[cfg(not(unix))]
fn inode(_: &Path) -> io::Result<Option<u64>> {
    Ok(None)
}

/// Puts the names in a folder onto the disk.
fn sync(folder: &Path) -> io::Result<()> {
    step()?;
    match File::open(folder).and_then(|folder| folder.sync_all()) {
        // Some file systems know no such thing.
        Err(error) if matches!(error.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => Ok(()),
        other => other,
    }
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::die_at;
    use crate::{read_text, remove_stale, temporary_folder};

    const NAMES: [&str; 3] = ["report.html", "report.json", "deep/note"];

    /// A report of files and a bag, over an older one.
    fn report(folder: &Path, words: &str) -> io::Result<()> {
        let _claim = Claim::folder(folder).map_err(io::Error::other)?;
        let mut files = Together::default();
        for name in NAMES {
            files.add(&folder.join(name), words.as_bytes())?;
        }
        let (bag, made) = (folder.join("bag"), temporary_folder(folder)?);
        fs::write(made.join("words"), words)?;
        let moves: Vec<_> = files.moves().chain([(made.clone(), bag.clone())]).collect();
        let outdated = folder.join("outdated");
        journalled(folder, &moves, std::slice::from_ref(&outdated), || {
            if bag.exists() {
                exchange(&made, &bag)?
            } else {
                move_new(&made, &bag)?
            }
            files.place()?;
            step()?;
            let _ = fs::remove_file(&outdated);
            Ok(())
        })?
    }

    /// What a reader finds: the words of each file and of the bag, and whether the outdated file is there.
    fn read(folder: &Path) -> (Vec<Option<String>>, bool) {
        let mut names = NAMES.map(|name| folder.join(name)).to_vec();
        names.insert(0, folder.join("bag/words"));
        settle(&folder.join("bag")).unwrap();
        (names.iter().map(|name| read_text(name, 100).ok()).collect(), folder.join("outdated").exists())
    }

    /// The child of the next test: writes a report and dies at a step.
    #[test]
    #[ignore = "dies; run by the next test"]
    fn a_writer_that_dies() {
        let (Ok(folder), Ok(steps)) = (std::env::var("GOVTWIN_FOLDER"), std::env::var("GOVTWIN_STEP")) else { return };
        die_at(steps.parse().unwrap());
        report(Path::new(&folder), "new").unwrap();
    }

    #[test]
    fn killed_at_any_step_all_are_new_or_all_are_old() {
        let mut outcomes = vec![];
        for steps in 0.. {
            let dir = tempfile::tempdir().unwrap();
            report(dir.path(), "old").unwrap();
            fs::write(dir.path().join("outdated"), "").unwrap();
            let child = std::process::Command::new(std::env::current_exe().unwrap())
                .args(["--exact", "journal::tests::a_writer_that_dies", "--ignored"])
                .env("GOVTWIN_FOLDER", dir.path())
                .env("GOVTWIN_STEP", steps.to_string())
                .output()
                .unwrap();
            let (words, outdated) = read(dir.path());
            let new = words[0].as_deref() == Some("new");
            let expected = if new { "new" } else { "old" };
            assert!(words.iter().all(|word| word.as_deref() == Some(expected)), "step {steps}: {words:?}");
            assert_eq!(outdated, !new, "step {steps}");
            outcomes.push(new);
            // What is left over goes with the next writer, and nothing else stays.
            remove_stale(dir.path());
            remove_stale(&dir.path().join("deep"));
            let mut left: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
            left.retain(|name| !Claim::is_lock(name));
            assert_eq!(left.len(), 4 + usize::from(outdated), "step {steps}: {left:?}");
            if child.status.success() {
                assert!(new && outcomes.len() > 15, "{} steps", outcomes.len());
                break;
            }
        }
        let turned = outcomes.iter().position(|new| *new).unwrap();
        assert!(outcomes[turned..].iter().all(|new| *new) && outcomes.len() - turned > 4, "{outcomes:?}");
    }

    #[test]
    fn a_journal_of_others_moves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("out");
        fs::create_dir(&folder).unwrap();
        fs::write(dir.path().join("mine"), "mine").unwrap();
        fs::write(folder.join("plain"), "plain").unwrap();
        let number = |path: &Path| inode(path).unwrap().unwrap();
        let mine = number(&dir.path().join("mine"));
        for journal in [
            format!(
                r#"{{"schema":"{SCHEMA}","moves":[{{"from":"../mine","to":"taken","inode":{mine}}}],"removes":[]}}"#
            ),
            format!(r#"{{"schema":"{SCHEMA}","moves":[],"removes":["../mine"]}}"#),
            format!(r#"{{"schema":"{SCHEMA}","moves":[],"removes":["{}"]}}"#, dir.path().join("mine").display()),
            format!(
                r#"{{"schema":"{SCHEMA}","moves":[{{"from":"plain","to":"b","inode":{}}}],"removes":[]}}"#,
                number(&folder.join("plain"))
            ),
            r#"{"schema":"govtwin-journal/9","moves":[],"removes":[]}"#.to_owned(),
            "words".to_owned(),
        ] {
            fs::write(folder.join(NAME), &journal).unwrap();
            let error = read_text(&folder.join("plain"), 100).unwrap_err().to_string();
            assert!(error.contains("is no journal of this program"), "{journal}: {error}");
            assert!(dir.path().join("mine").exists() && folder.join("plain").exists(), "{journal}");
        }
    }
}
