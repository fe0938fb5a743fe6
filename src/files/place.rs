//! Whether a file can take its place, known before the work that it comes from.

use std::io;
use std::path::Path;

use super::folder_of;
use super::input::read_bytes;
use super::regular::look_at;
use super::temporary::temporary_file;

/// Every file of this program names it.
const MARK: &[u8] = b"govtwin";

/// Larger files are none of this program's reports.
const LARGEST_BYTES: u64 = 1 << 30;

/// What is in the place of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Nothing, or an empty file.
    Free,
    /// A file that this program made.
    Ours,
    /// A file that others made.
    Foreign,
    /// A folder.
    Folder,
}

/// What is in the place of a file, links followed.
///
/// # Errors
/// If the file system refuses to answer, or something else than a file or folder is there.
pub fn place_of(path: &Path) -> io::Result<Place> {
    Ok(match look_at(path)? {
        None => Place::Free,
        Some(kind) if kind.is_dir() => Place::Folder,
        Some(kind) if kind.is_file() && kind.len() == 0 => Place::Free,
        Some(kind) if kind.len() > LARGEST_BYTES => Place::Foreign,
        Some(_) => {
            let bytes = read_bytes(path, LARGEST_BYTES)?;
            let is_ours = bytes.windows(MARK.len()).any(|window| window == MARK);
            if is_ours { Place::Ours } else { Place::Foreign }
        }
    })
}

/// Sees whether a file can be made at a path, by one that goes at once; folders that are missing on the way stay so.
///
/// # Errors
/// The file system's error.
pub fn try_place(path: &Path) -> io::Result<()> {
    for folder in folder_of(path).ancestors().filter(|folder| *folder != Path::new("")).chain([Path::new(".")]) {
        match look_at(folder)? {
            Some(kind) if kind.is_dir() => return temporary_file(folder).map(drop),
            Some(_) => {
                let words = format!("expected a folder, found a file: {}", folder.display());
                return Err(io::Error::new(io::ErrorKind::NotADirectory, words));
            }
            None => {}
        }
    }
    Err(io::ErrorKind::NotFound.into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_in_a_place_is_known() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::write(at("ours"), "# Made by govtwin").unwrap();
        std::fs::write(at("other"), "a diary").unwrap();
        std::fs::write(at("empty"), "").unwrap();
        let places = ["ours", "other", "empty", "none", "other/below", "."].map(|name| place_of(&at(name)).unwrap());
        assert_eq!(places, [Place::Ours, Place::Foreign, Place::Free, Place::Free, Place::Free, Place::Folder]);
    }

    #[test]
    fn a_place_is_tried_and_left_as_it_was() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        std::fs::write(at("file"), "mine").unwrap();
        for good in ["new", "deep/er/new", "file"] {
            try_place(&at(good)).unwrap();
        }
        let error = try_place(&at("file/below")).unwrap_err().to_string();
        assert!(error.contains("expected a folder, found a file"), "{error}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
        #[cfg(target_os = "linux")]
        assert!(try_place(Path::new("/proc/self/new")).is_err());
    }
}
