//! One writer for a folder, or for one file or bag: a lock that ends with its process, taken before any work.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use super::create::make_folder;
use super::fault::step;
use super::temporary::{hold, is_at, name_lock, remove_stale};
use super::{folder_of, journal};

/// The file that is locked. It stays where its process is killed, and counts for nothing then.
const LOCK: &str = ".govtwin.lock";

/// How often a folder is made again that the last writer removes on leaving.
const TRIES: usize = 100;

/// Why a folder cannot be written to.
#[derive(Debug, thiserror::Error)]
pub enum ClaimError {
    /// Somebody else does.
    #[error("{folder}: another process is writing there and holds {lock}; wait until it ends, or name another folder")]
    Busy {
        /// The folder.
        folder: PathBuf,
        /// The file that is locked.
        lock: PathBuf,
    },
    /// Somebody else writes the file or bag of that name.
    #[error("{path}: another process is writing it and holds {lock}; wait until it ends, or choose another name")]
    NameBusy {
        /// The file or bag.
        path: PathBuf,
        /// The file that is locked.
        lock: PathBuf,
    },
    /// Something else is in its place.
    #[error("{folder}: expected a folder, found {found}; name another folder, or move it away")]
    NotAFolder {
        /// What should be a folder.
        folder: PathBuf,
        /// What it is.
        found: &'static str,
    },
    /// The operating system refuses.
    #[error("{folder}: cannot write there: {reason}")]
    Refused {
        /// The folder.
        folder: PathBuf,
        /// The system's own words.
        reason: io::Error,
    },
}

/// A folder in which, or a name under which, no other process writes as long as this exists. If nothing was written, what it made is removed.
#[derive(Debug)]
pub struct Claim {
    /// Open, and so locked.
    _lock: File,
    path: PathBuf,
    /// Folders that were not there before, the deepest first.
    made: Vec<PathBuf>,
}

impl Claim {
    /// Claims a folder, makes it where it is missing, and removes what killed writers left in it.
    ///
    /// # Errors
    /// Where another process has claimed it, or nobody can write there.
    pub fn folder(folder: &Path) -> Result<Self, ClaimError> {
        let refused = |reason| ClaimError::Refused { folder: folder.to_owned(), reason };
        let busy = |lock| ClaimError::Busy { folder: folder.to_owned(), lock };
        let claim = Self::take(folder, folder.join(LOCK), busy)?;
        journal::complete(folder).map_err(refused)?;
        remove_stale(folder);
        Ok(claim)
    }

    /// Claims the name of a single file or bag, which may stand there already; missing folders on the way are made. Others may write beside it.
    ///
    /// # Errors
    /// Where another process has claimed it, or nobody can write there.
    pub fn name(path: &Path) -> Result<Self, ClaimError> {
        let busy = |lock| ClaimError::NameBusy { path: path.to_owned(), lock };
        Self::take(folder_of(path), name_lock(path), busy)
    }

    /// Locks a file in a folder, which is made where it is missing.
    fn take(folder: &Path, path: PathBuf, busy: impl Fn(PathBuf) -> ClaimError) -> Result<Self, ClaimError> {
        let refused = |reason| ClaimError::Refused { folder: folder.to_owned(), reason };
        for _ in 0..TRIES {
            let made = step()
                .and_then(|()| make(folder))
                .map_err(|reason| not_a_folder(folder).unwrap_or_else(|| refused(reason)))?;
            if fs::symlink_metadata(&path).is_ok_and(|kind| !kind.is_file()) {
                let name = path.file_name().unwrap_or_default().display();
                return Err(refused(io::Error::other(format!("{name} in it is no regular file; move it away"))));
            }
            let options = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path);
            let lock = match options {
                Ok(lock) => lock,
                // The last writer removed the folder on leaving.
                Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                Err(error) => {
                    remove_empty(&made);
                    return Err(refused(error));
                }
            };
            match hold(&lock) {
                // Between opening and locking its last holder may have removed it.
                Ok(()) if !is_at(&lock, &path) => {}
                Ok(()) => return Ok(Self { _lock: lock, path, made }),
                Err(error) if error.kind() == io::ErrorKind::ResourceBusy => return Err(busy(path)),
                Err(error) => {
                    // No other process can hold it: it was made here, or is a leftover.
                    let _ = made.first().map(|_| fs::remove_file(&path));
                    remove_empty(&made);
                    return Err(refused(error));
                }
            }
        }
        Err(busy(path))
    }

    /// Whether a name in a claimed folder is that of the claim itself.
    #[must_use]
    pub fn is_lock(name: &std::ffi::OsStr) -> bool {
        name == LOCK
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        // Still locked, so that no process has it; a failure to clean up cannot be reported any more.
        let _ = fs::remove_file(&self.path);
        remove_empty(&self.made);
    }
}

/// Makes a folder and those above it; gives those that were missing, the deepest first.
fn make(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let missing = folder.ancestors().filter(|folder| *folder != Path::new(""));
    let made: Vec<PathBuf> = missing.take_while(|folder| !folder.exists()).map(Path::to_owned).collect();
    make_folder(folder).inspect_err(|_| remove_empty(&made))?;
    Ok(made)
}

fn remove_empty(made: &[PathBuf]) {
    for folder in made {
        // Whoever put something there keeps it.
        let _ = fs::remove_dir(folder);
    }
}

/// What is in the place of a folder, or of one above it.
fn not_a_folder(folder: &Path) -> Option<ClaimError> {
    let place = folder.ancestors().find(|place| fs::symlink_metadata(place).is_ok())?;
    let found = match fs::metadata(place) {
        Ok(kind) if kind.is_dir() => return None,
        Ok(kind) if kind.is_file() => "a file",
        Ok(_) => "something else",
        Err(_) => "a link that leads nowhere",
    };
    Some(ClaimError::NotAFolder { folder: place.to_owned(), found })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_one_writer_and_what_was_made_for_nothing_goes() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("deep/out");
        let claim = Claim::folder(&out).unwrap();
        let error = Claim::folder(&out).unwrap_err();
        assert!(matches!(error, ClaimError::Busy { .. }) && error.to_string().contains("deep/out"), "{error}");
        drop(claim);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);

        let claim = Claim::folder(&out).unwrap();
        fs::write(out.join("report.json"), "{}").unwrap();
        fs::write(out.join(".govtwin-gone.tmp"), "half").unwrap();
        drop(claim);
        assert!(out.join("report.json").exists());
        // Leftovers of a killed process, its lock included, block no other process.
        fs::write(out.join(LOCK), "").unwrap();
        drop(Claim::folder(&out).unwrap());
        assert_eq!(fs::read_dir(&out).unwrap().count(), 1, "only the report");
    }

    #[test]
    fn a_name_has_one_writer_and_others_write_beside_it() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join("deep").join(name);
        let claim = Claim::name(&at("run")).unwrap();
        let error = Claim::name(&at("run")).unwrap_err().to_string();
        assert!(error.contains("deep/run: another process is writing it and holds"), "{error}");
        drop(Claim::name(&at("other")).unwrap());
        drop(Claim::name(&at(&"long".repeat(60))).unwrap());
        fs::write(at("run"), "whole").unwrap();
        drop(claim);
        assert_eq!(fs::read_dir(at("")).unwrap().count(), 1, "only what was written");
        // Leftovers of a killed process block no other process, and are removed with the next, of this name or of another in the folder.
        fs::write(at(".govtwin-run.lock"), "").unwrap();
        drop(Claim::name(&at("run")).unwrap());
        assert_eq!(fs::read_dir(at("")).unwrap().count(), 1);
        fs::write(at(".govtwin-gone.lock"), "").unwrap();
        let claim = Claim::name(&at("run")).unwrap();
        drop(Claim::folder(&at("")).unwrap());
        assert!(at(".govtwin-run.lock").exists() && !at(".govtwin-gone.lock").exists());
        drop(claim);
        assert_eq!(fs::read_dir(at("")).unwrap().count(), 1);
    }

    #[test]
    fn whatever_step_is_refused_nothing_stays() {
        let dir = tempfile::tempdir().unwrap();
        let refused = crate::fault::refuse_each(
            || Claim::folder(&dir.path().join("deep/out")).is_ok(),
            |_| assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0),
        );
        assert_eq!(refused, 2, "folder and lock");
    }

    #[test]
    fn many_at_once_are_never_two_and_all_get_their_turn() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        let inside = std::sync::atomic::AtomicUsize::new(0);
        std::thread::scope(|scope| {
            for _ in 0..8 {
                scope.spawn(|| {
                    let mut turns = 0;
                    while turns < 50 {
                        match Claim::folder(&out) {
                            Ok(_claim) => {
                                assert_eq!(inside.fetch_add(1, std::sync::atomic::Ordering::SeqCst), 0);
                                turns += 1;
                                inside.fetch_sub(1, std::sync::atomic::Ordering::SeqCst);
                            }
                            Err(ClaimError::Busy { .. }) => std::thread::yield_now(),
                            Err(error) => panic!("{error}"),
                        }
                    }
                });
            }
        });
        // Who came between another's leaving and its clearing up found the folder there, and leaves it, empty.
        assert!(fs::read_dir(&out).map_or(0, Iterator::count) == 0);
    }

    #[test]
    fn what_is_in_the_way_is_named() {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("file"), "mine").unwrap();
        for below in ["file", "file/deep"] {
            let error = Claim::folder(&dir.path().join(below)).unwrap_err().to_string();
            assert!(error.contains("file: expected a folder, found a file"), "{error}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("elsewhere", dir.path().join(LOCK)).unwrap();
            let error = Claim::folder(dir.path()).unwrap_err().to_string();
            assert!(error.contains("no regular file") && !dir.path().join("elsewhere").exists(), "{error}");
        }
    }
}
