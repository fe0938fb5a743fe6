//! A file that appears whole or not at all, and only if none exists: of two writers at once, one does.

use std::io::{self, Write as _};
use std::path::Path;

use super::regular::look_at;

use super::fault::step;
use super::folder_of;
use super::rename::move_new;
use super::temporary::temporary_file;

/// Makes a folder and those above it, where they are missing.
///
/// # Errors
/// The file system's error; the standard library reports that a folder exists that cannot be read.
pub fn make_folder(folder: &Path) -> io::Result<()> {
    if look_at(folder)?.is_some_and(|kind| kind.is_dir()) {
        return Ok(());
    }
    std::fs::create_dir_all(folder)
}

/// Writes a file if none has its name; missing folders on the way are made. Returns whether it was written: false if
/// something has the name, which stays as it is.
///
/// # Errors
/// The file system's error.
pub fn write_new(path: &Path, bytes: &[u8]) -> io::Result<bool> {
    let folder = folder_of(path);
    step()?;
    make_folder(folder)?;
    let mut file = temporary_file(folder)?;
    step()?;
    file.write_all(bytes)?;
    step()?;
    file.as_file().sync_all()?;
    // The file stays open, and so held, until it has its name.
    let (_held, from) = file.into_parts();
    match move_new(&from, path) {
        Ok(()) => Ok(true),
        Err(error) if matches!(error.kind(), io::ErrorKind::AlreadyExists | io::ErrorKind::DirectoryNotEmpty) => {
            Ok(false)
        }
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::refuse_each;

    #[test]
    fn of_many_who_write_at_once_one_does() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("deep/result");
        let wrote: Vec<bool> = std::thread::scope(|scope| {
            let path = &path;
            let all: Vec<_> =
                (0..8).map(|k| scope.spawn(move || write_new(path, format!("{k}").as_bytes()).unwrap())).collect();
            all.into_iter().map(|one| one.join().unwrap()).collect()
        });
        let winner = wrote.iter().position(|wrote| *wrote).unwrap();
        assert_eq!(wrote.iter().filter(|wrote| **wrote).count(), 1);
        assert_eq!(std::fs::read_to_string(&path).unwrap(), winner.to_string());
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1, "no temporary file stays");
    }

    #[test]
    fn whatever_step_is_refused_nothing_stands_there() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("result");
        let count = || std::fs::read_dir(dir.path()).unwrap().count();
        let refused =
            refuse_each(|| write_new(&path, b"x").is_ok(), |went_well| assert_eq!(count(), usize::from(went_well)));
        assert!(refused >= 4, "{refused}");
        assert_eq!(count(), 1);
    }
}
