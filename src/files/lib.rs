//! Files and folders that come out whole: written under temporary names, held against a second writer, placed together.
//!
//! Every final name has complete contents. What is in the making has a name of its own for each process,
//! `.govtwin-*.tmp`, and is locked; so leftovers of a killed process are recognised by their free lock, and are removed by the next
//! [`Claim`] of the folder. The files of one report take their names together even where the process is killed between two of them: by
//! a journal, [`journalled`].

mod bounds;
mod claim;
mod create;
pub mod digest;
pub mod fault;
mod input;
mod journal;
mod place;
mod regular;
mod rename;
pub mod store;
mod temporary;
mod together;

use std::io;
use std::path::Path;

pub use bounds::{YamlBoundError, check_yaml};
pub use claim::{Claim, ClaimError};
pub use create::{make_folder, write_new};
pub use input::{read_bytes, read_text};
pub use journal::{journalled, settle};
pub use place::{Place, place_of, try_place};
pub use regular::{check_regular, look_at, look_at_link};
pub use rename::{exchange, move_new};
pub use temporary::{Scratch, hold, is_held, remove_abandoned, remove_stale, temporary_folder};
pub use together::Together;

/// Writes a file, whole or not at all; missing folders on the way are made.
///
/// # Errors
/// The file system's error; an older file of that name is then untouched.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> io::Result<()> {
    remove_abandoned(folder_of(path));
    let mut files = Together::default();
    files.add(path, bytes)?;
    files.place()
}

/// Whether two names lead to one file or folder.
#[must_use]
pub fn is_same(one: &Path, other: &Path) -> bool {
    one == other || one.canonicalize().is_ok_and(|one| other.canonicalize().is_ok_and(|other| one == other))
}

/// The folder that a path lies in.
#[must_use]
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::write_atomically;

    #[test]
    fn replaces_whole_files_and_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/result.txt");
        write_atomically(&path, b"first").unwrap();
        write_atomically(&path, b"second").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"second");
        assert_eq!(std::fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);

        // A folder in the way cannot be replaced: an error, and no temporary file stays.
        let taken = folder.path().join("taken");
        std::fs::create_dir_all(taken.join("inside")).unwrap();
        assert!(write_atomically(&taken, b"x").is_err());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_not_replaced_by_one() {
        use std::os::unix::fs::FileTypeExt as _;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("socket");
        let _open = std::os::unix::net::UnixListener::bind(&path).unwrap();
        let error = write_atomically(&path, b"x").unwrap_err().to_string();
        assert!(error.contains("expected a file or nothing there, found a socket"), "{error}");
        assert!(std::fs::metadata(&path).unwrap().file_type().is_socket());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
