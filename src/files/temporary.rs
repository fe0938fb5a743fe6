//! Temporary names: one for each process and file, locked while in use, and removed where a process that is gone left them.

use std::ffi::OsStr;
use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use tempfile::{Builder, NamedTempFile};

use super::fault::step;
use super::folder_of;
use crate::digest::sha256;

const PREFIX: &str = ".govtwin-";
const SUFFIX: &str = ".tmp";
/// What ends the name of the file that is locked for another's name.
const LOCK_SUFFIX: &str = ".lock";
/// A name of up to so many bytes is part of its lock's name unchanged.
const LONGEST_NAME: usize = 200;

/// A file under a temporary name in a folder, held; whoever may read new files of this user may read it.
pub(super) fn temporary_file(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = builder();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    step()?;
    let file = builder.tempfile_in(folder)?;
    hold(file.as_file())?;
    Ok(file)
}

/// A file in the system's folder for temporary files, which goes with this.
#[derive(Debug)]
pub struct Scratch(NamedTempFile);

impl Scratch {
    /// Makes an empty one.
    ///
    /// # Errors
    /// The file system's error.
    pub fn new() -> io::Result<Self> {
        builder().tempfile().map(Self)
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

impl Write for Scratch {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

/// Makes a folder under a temporary name in another. It counts as left over once no file in it is held.
///
/// # Errors
/// The file system's error.
pub fn temporary_folder(parent: &Path) -> io::Result<PathBuf> {
    let mut builder = builder();
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
    step()?;
    Ok(builder.tempdir_in(parent)?.keep())
}

fn builder() -> Builder<'static, 'static> {
    let mut builder = Builder::new();
    builder.prefix(PREFIX).suffix(SUFFIX);
    builder
}

/// Locks a file against whoever asks [`is_held`], until it is closed; a file system without locks does without.
///
/// # Errors
/// If another process holds it, or the file system's error.
pub fn hold(file: &File) -> io::Result<()> {
    step()?;
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(io::Error::new(io::ErrorKind::ResourceBusy, "another process holds it")),
        Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => Ok(()),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// Whether a process holds a file, or any file of a folder. What cannot be asked counts as held.
#[must_use]
pub fn is_held(path: &Path) -> bool {
    let Ok(kind) = fs::symlink_metadata(path) else { return false };
    if kind.is_dir() {
        let Ok(entries) = fs::read_dir(path) else { return true };
        return entries.into_iter().any(|entry| entry.map_or(true, |entry| is_held(&entry.path())));
    }
    // Nothing but a regular file is opened: a pipe would wait.
    kind.is_file() && !File::open(path).is_ok_and(|file| file.try_lock().is_ok())
}

/// The file beside a path that is locked by who writes there.
pub(super) fn name_lock(path: &Path) -> PathBuf {
    let name = match path.file_name() {
        Some(name) if name.len() <= LONGEST_NAME => name.to_string_lossy().into_owned(),
        _ => sha256(path.file_name().unwrap_or(path.as_os_str()).as_encoded_bytes()),
    };
    folder_of(path).join(format!("{PREFIX}{name}{LOCK_SUFFIX}"))
}

/// Whether an open file is the one at a path.
#[cfg(unix)]
pub(super) fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let (Ok(open), Ok(there)) = (file.metadata(), fs::symlink_metadata(path)) else { return false };
    (open.dev(), open.ino()) == (there.dev(), there.ino())
}

/// Elsewhere an open file cannot be removed.
#[cfg(not(unix))]
pub(super) fn is_at(_: &File, _: &Path) -> bool {
    true
}

/// Whether a path ends with a temporary name.
pub(super) fn is_temporary(path: &Path) -> bool {
    path.file_name().is_some_and(is_temporary_name)
}

fn is_temporary_name(name: &OsStr) -> bool {
    let name = name.as_encoded_bytes();
    name.starts_with(PREFIX.as_bytes()) && name.ends_with(SUFFIX.as_bytes())
}

/// The files of another process are locked within moments; an unlocked one older than this is a leftover.
const YOUNG: Duration = Duration::from_secs(60);

/// Removes the temporary files and folders in a folder that no process holds; only for a process that has claimed it, or one above it.
pub fn remove_stale(folder: &Path) {
    remove(folder, |_| true);
}

/// The same for a folder that is not claimed, such as one that many processes write bags into: only what is a minute old.
pub fn remove_abandoned(folder: &Path) {
    let is_old = |entry: &fs::DirEntry| {
        let changed = entry.metadata().and_then(|data| data.modified());
        changed.is_ok_and(|time| time.elapsed().is_ok_and(|age| age > YOUNG))
    };
    remove(folder, is_old);
}

fn remove(folder: &Path, counts: impl Fn(&fs::DirEntry) -> bool) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let ours = is_temporary_name(&entry.file_name());
        let path = entry.path();
        let Ok(kind) = entry.file_type() else { continue };
        if kind.is_file() && is_lock_name(&entry.file_name()) && counts(&entry) {
            remove_lock(&path);
        }
        if !ours || !counts(&entry) || is_held(&path) {
            continue;
        }
        // What cannot be removed only takes room.
        let _ = if kind.is_dir() { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
    }
}

fn is_lock_name(name: &OsStr) -> bool {
    let name = name.as_encoded_bytes();
    name.starts_with(PREFIX.as_bytes()) && name.ends_with(LOCK_SUFFIX.as_bytes())
}

/// Removes a lock that no process holds, and holds it meanwhile: a process that opened it before finds that it is gone.
fn remove_lock(path: &Path) {
    let Ok(file) = File::open(path) else { return };
    if file.try_lock().is_ok() && is_at(&file, path) {
        // What cannot be removed does no harm.
        let _ = fs::remove_file(path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_nobody_holds_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let live = temporary_file(folder.path()).unwrap();
        let (dead, making) = (temporary_folder(folder.path()).unwrap(), temporary_folder(folder.path()).unwrap());
        fs::write(dead.join("a_0.mcap"), "half").unwrap();
        let file = File::create(making.join("b_0.mcap")).unwrap();
        hold(&file).unwrap();
        fs::write(at(".govtwin-dead.tmp"), "half").unwrap();
        fs::write(at("notes.tmp"), "mine").unwrap();
        fs::create_dir(at(".govtwin-mine")).unwrap();
        remove_stale(folder.path());
        assert!(live.path().exists() && making.exists() && at("notes.tmp").exists() && at(".govtwin-mine").exists());
        assert!(!dead.exists() && !at(".govtwin-dead.tmp").exists());
        drop(file);
        remove_abandoned(folder.path());
        assert!(making.exists(), "it may be in the making");
        let long_ago = fs::FileTimes::new().set_modified(std::time::SystemTime::now() - 2 * YOUNG);
        File::open(&making).unwrap().set_times(long_ago).unwrap();
        File::open(live.path()).unwrap().set_times(long_ago).unwrap();
        remove_abandoned(folder.path());
        assert!(!making.exists() && live.path().exists());
    }

    #[cfg(unix)]
    #[test]
    fn new_files_have_the_rights_that_the_umask_leaves() {
        use std::os::unix::fs::PermissionsExt as _;
        let folder = tempfile::tempdir().unwrap();
        // What the standard library makes has them; a process cannot ask for its umask without changing it.
        fs::write(folder.path().join("plain"), "").unwrap();
        fs::create_dir(folder.path().join("folder")).unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        let file = temporary_file(folder.path()).unwrap();
        assert_eq!(mode(file.path()), mode(&folder.path().join("plain")));
        assert_eq!(mode(&temporary_folder(folder.path()).unwrap()), mode(&folder.path().join("folder")));
    }
}
