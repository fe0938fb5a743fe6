//! Several files that appear together: all of them stand whole under temporary names before the first gets its own.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempPath};

use super::create::make_folder;
use super::fault::step;
use super::folder_of;
use super::regular::{describe, look_at, look_at_link};
use super::rename::{exchange, move_new};
use super::temporary::temporary_file;

/// Files on their way. Dropped before [`Together::place`], they are gone.
#[derive(Debug, Default)]
pub struct Together {
    files: Vec<(NamedTempFile, PathBuf)>,
}

impl Together {
    /// Writes a file under a temporary name beside its own; missing folders on the way are made.
    ///
    /// # Errors
    /// The file system's error, and names that no file can have.
    pub fn add(&mut self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let folder = folder_of(path);
        step()?;
        make_folder(folder)?;
        // A device or a pipe would be replaced by the file where the folder may be written to.
        if let Some(found) = look_at(path)?.and_then(|kind| describe(&kind)) {
            let words = format!("expected a file or nothing there, found {found}");
            return Err(io::Error::new(io::ErrorKind::InvalidInput, words));
        }
        let mut file = temporary_file(folder)?;
        step()?;
        file.write_all(bytes)?;
        step()?;
        file.as_file().sync_all()?;
        self.files.push((file, path.to_owned()));
        Ok(())
    }

    /// The files with their temporary names and their own.
    pub fn moves(&self) -> impl Iterator<Item = (PathBuf, PathBuf)> {
        self.files.iter().map(|(file, path)| (file.path().to_owned(), path.clone()))
    }

    /// Gives all files their names, in the order in which they were added. Where one cannot have its own, those before it are taken
    /// back, and the older files are restored.
    ///
    /// # Errors
    /// The file system's error.
    pub fn place(self) -> io::Result<()> {
        let mut placed: Vec<(TempPath, PathBuf, bool)> = Vec::new();
        // The files stay open, and so held, until all have their names.
        let (open, names): (Vec<_>, Vec<_>) =
            self.files.into_iter().map(|(file, path)| (file.into_parts(), path)).unzip();
        let (_held, temporary): (Vec<_>, Vec<TempPath>) = open.into_iter().unzip();
        for (from, path) in temporary.into_iter().zip(names) {
            // An older file takes the temporary name, and goes with it.
            let result = look_at_link(&path).and_then(|older| {
                let there = older.is_some();
                if there { exchange(&from, &path) } else { move_new(&from, &path) }.map(|()| there)
            });
            match result {
                Ok(there) => placed.push((from, path, there)),
                Err(error) => {
                    for (from, path, there) in placed.iter().rev() {
                        // Nothing better can be done where even the way back is closed.
                        let _ = if *there { exchange(from, path) } else { std::fs::rename(path, from) };
                    }
                    return Err(error);
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::refuse_each;

    #[test]
    fn whatever_step_is_refused_all_are_new_or_all_are_old() {
        let dir = tempfile::tempdir().unwrap();
        let names = ["a", "b", "deep/c"];
        let read = || names.map(|name| std::fs::read_to_string(dir.path().join(name)).ok());
        let write = |words: &str| -> io::Result<()> {
            let mut files = Together::default();
            for name in names {
                files.add(&dir.path().join(name), words.as_bytes())?;
            }
            files.place()
        };
        // First where one of them is there already, then where all are.
        std::fs::write(dir.path().join("b"), "old").unwrap();
        for new in ["first", "second"] {
            let before = read();
            let refused = refuse_each(
                || write(new).is_ok(),
                |went_well| {
                    let expected = if went_well { names.map(|_| Some(new.to_owned())) } else { before.clone() };
                    assert_eq!(read(), expected);
                    assert_eq!(
                        std::fs::read_dir(dir.path().join("deep")).map_or(0, Iterator::count),
                        usize::from(expected[2].is_some())
                    );
                },
            );
            assert_eq!(refused, 3 * 5 + 3, "folder, file, lock, write and sync of each, and its name");
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 3);
    }

    #[test]
    fn all_appear_or_none() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::write(at("b"), "old").unwrap();
        let mut files = Together::default();
        for name in ["a", "b", "c"] {
            files.add(&at(name), name.as_bytes()).unwrap();
        }
        assert!(!at("a").exists() && std::fs::read(at("b")).unwrap() == b"old");
        files.place().unwrap();
        assert_eq!(["a", "b", "c"].map(|name| std::fs::read(at(name)).unwrap()), [b"a", b"b", b"c"]);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 3);

        let mut files = Together::default();
        for name in ["new", "b", "gone/c"] {
            files.add(&at(name), b"second").unwrap();
        }
        std::fs::remove_dir_all(at("gone")).unwrap();
        assert!(files.place().is_err());
        assert!(!at("new").exists(), "what was new goes again");
        assert_eq!(std::fs::read(at("b")).unwrap(), b"b", "what was there is there again");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 3);
        assert!(Together::default().add(dir.path(), b"x").is_err(), "a folder is in the way");
    }
}
