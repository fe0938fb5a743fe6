//! A folder as a store: objects are files, those of a hidden name are not seen.

use std::io::{self, Read as _, Seek as _};
use std::path::{Path, PathBuf};
use std::sync::Once;

use super::{Object, StoreError};
use crate::{check_regular, look_at, remove_abandoned, write_atomically, write_new};

const WHAT: &str = "list the objects";

/// Folders within folders deeper than this are a mistake.
const DEEPEST: usize = 16;

/// A folder.
#[derive(Debug)]
pub(crate) struct Folder {
    top: PathBuf,
    /// What killed writers left beside the first result is removed; a list for each would cost more than the results.
    first: Once,
}

impl Folder {
    /// A folder that need not be there yet.
    pub(crate) fn new(top: PathBuf) -> Self {
        Self { top, first: Once::new() }
    }

    /// Its full path where it is there.
    pub(crate) fn address(&self) -> String {
        self.top.canonicalize().unwrap_or_else(|_| self.top.clone()).display().to_string()
    }

    /// Where an object is.
    pub(crate) fn path(&self, path: &str) -> PathBuf {
        if path.is_empty() { self.top.clone() } else { self.top.join(path) }
    }

    fn refused(&self, path: &str, what: &'static str) -> impl FnOnce(io::Error) -> StoreError {
        let object = self.path(path).display().to_string();
        move |error| match error.kind() {
            io::ErrorKind::NotFound => StoreError::Absent { object },
            _ => StoreError::Refused { object, what, reason: error.to_string() },
        }
    }

    /// The same where something was to be written: what is missing then is a folder.
    fn unwritten(&self, path: &str) -> impl FnOnce(io::Error) -> StoreError {
        let object = self.path(path).display().to_string();
        move |error| StoreError::Refused { object, what: "write", reason: error.to_string() }
    }

    pub(crate) fn list(&self, prefix: &str) -> Result<Vec<Object>, StoreError> {
        let mut all = Vec::new();
        let top = self.path(prefix);
        if look_at(&top).map_err(self.refused(prefix, WHAT))?.is_some_and(|kind| !kind.is_dir()) {
            let reason = "expected a folder, found a file".to_owned();
            return Err(StoreError::Refused { object: top.display().to_string(), what: WHAT, reason });
        }
        match self.walk(prefix, &mut vec![], &mut all) {
            Err(StoreError::Absent { .. }) => Ok(vec![]),
            other => other.map(|()| all),
        }
    }

    /// `above` are the real paths of the folders on the way.
    fn walk(&self, folder: &str, above: &mut Vec<PathBuf>, all: &mut Vec<Object>) -> Result<(), StoreError> {
        let real = self.path(folder).canonicalize().map_err(self.refused(folder, WHAT))?;
        if above.contains(&real) {
            // A link that leads back: everything below it is met without it.
            return Ok(());
        }
        if above.len() > DEEPEST {
            let reason = format!("folders go deeper than {DEEPEST} levels; name one that is nearer to its recordings");
            return Err(StoreError::Refused { object: self.path(folder).display().to_string(), what: WHAT, reason });
        }
        above.push(real);
        for entry in self.path(folder).read_dir().map_err(self.refused(folder, WHAT))? {
            let entry = entry.map_err(self.refused(folder, WHAT))?;
            let name = entry.file_name().to_string_lossy().into_owned();
            if name.starts_with('.') {
                continue;
            }
            let path = if folder.is_empty() { name } else { format!("{folder}/{name}") };
            match std::fs::metadata(entry.path()) {
                Ok(kind) if kind.is_dir() => self.walk(&path, above, all)?,
                Ok(kind) => all.push(Object { path, bytes: kind.len() }),
                // A link to nowhere, or a file that went away meanwhile; its reader gets an error.
                Err(error) if error.kind() == io::ErrorKind::NotFound => all.push(Object { path, bytes: 0 }),
                Err(error) => return Err(self.refused(&path, WHAT)(error)),
            }
        }
        above.pop();
        Ok(())
    }

    pub(crate) fn has(&self, path: &str) -> Result<bool, StoreError> {
        self.path(path).try_exists().map_err(self.refused(path, "look"))
    }

    pub(crate) fn get(&self, path: &str) -> Result<Vec<u8>, StoreError> {
        let file = self.path(path);
        check_regular(&file).and_then(|_| std::fs::read(&file)).map_err(self.refused(path, "read"))
    }

    pub(crate) fn part(&self, path: &str, at: u64, len: u64) -> Result<(Vec<u8>, u64), StoreError> {
        let file = self.path(path);
        let read = || -> io::Result<_> {
            let whole = check_regular(&file)?.len();
            let mut opened = std::fs::File::open(&file)?;
            opened.seek(io::SeekFrom::Start(at))?;
            let mut bytes = Vec::new();
            opened.take(len).read_to_end(&mut bytes)?;
            Ok((bytes, whole))
        };
        read().map_err(self.refused(path, "read"))
    }

    pub(crate) fn fetch(&self, path: &str, to: &Path) -> Result<(), StoreError> {
        let file = self.path(path);
        check_regular(&file).and_then(|_| std::fs::copy(&file, to)).map(drop).map_err(self.refused(path, "copy"))
    }

    pub(crate) fn put(&self, path: &str, bytes: &[u8]) -> Result<(), StoreError> {
        write_atomically(&self.path(path), bytes).map_err(self.unwritten(path))
    }

    pub(crate) fn create(&self, path: &str, bytes: &[u8]) -> Result<bool, StoreError> {
        let path_there = self.path(path);
        self.first.call_once(|| remove_abandoned(path_there.parent().unwrap_or(&self.top)));
        write_new(&path_there, bytes).map_err(self.unwritten(path))
    }

    pub(crate) fn remove(&self, path: &str) -> Result<(), StoreError> {
        match std::fs::remove_file(self.path(path)) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            other => other.map_err(self.refused(path, "remove")),
        }
    }
}

/// Removes what killed writers left under temporary names in the folders below one, once it is old: workers may be at work there. Links are not followed.
pub(crate) fn tidy_below(folder: &Path, deepest: usize) {
    let Some(deepest) = deepest.checked_sub(1) else { return };
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            remove_abandoned(&entry.path());
            tidy_below(&entry.path(), deepest);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::store::{Store, StoreError};

    #[test]
    fn a_folder_keeps_objects() {
        let dir = tempfile::tempdir().unwrap();
        let store = Store::open(dir.path().join("store").to_str().unwrap()).unwrap();
        assert_eq!(store.list("").unwrap(), []);
        assert!(store.create("results/a.json", b"first").unwrap());
        assert!(!store.create("results/a.json", b"second").unwrap());
        store.put("results/b.json", b"one").unwrap();
        store.put("results/b.json", b"two").unwrap();
        std::fs::write(dir.path().join("store/results/.hidden"), "").unwrap();
        assert_eq!(store.get("results/a.json").unwrap(), b"first");
        assert_eq!(store.get("results/b.json").unwrap(), b"two");
        let listed: Vec<_> = store.list("results").unwrap().into_iter().map(|one| (one.path, one.bytes)).collect();
        assert_eq!(listed, [("results/a.json".to_owned(), 5), ("results/b.json".to_owned(), 3)]);
        assert!(store.has("results/a.json").unwrap() && !store.has("results/c.json").unwrap());
        assert_eq!(store.part("results/a.json", 2, 2).unwrap(), (b"rs".to_vec(), 5));
        assert_eq!(store.part("results/a.json", 4, 9).unwrap(), (b"t".to_vec(), 5));
        assert_eq!(store.part("results/a.json", 5, 9).unwrap(), (vec![], 5));
        assert!(matches!(store.part("results/c.json", 0, 1), Err(StoreError::Absent { .. })));
        assert!(matches!(store.get("results/c.json"), Err(StoreError::Absent { .. })));
        store.remove("results/a.json").unwrap();
        store.remove("results/a.json").unwrap();
        assert!(store.list("results/b.json").unwrap_err().to_string().contains("found a file"));
    }

    #[test]
    fn what_killed_writers_left_is_removed_below_a_prefix_once_it_is_old() {
        let dir = tempfile::tempdir().unwrap();
        let attempt = dir.path().join("reports/KEY/drawn");
        std::fs::create_dir_all(&attempt).unwrap();
        let [old, young, report] =
            [".govtwin-old.tmp", ".govtwin-young.tmp", "report.json"].map(|name| attempt.join(name));
        for path in [&old, &young, &report] {
            std::fs::write(path, b"x").unwrap();
        }
        let an_hour_ago = std::time::SystemTime::now() - std::time::Duration::from_secs(3600);
        for path in [&old, &report] {
            std::fs::File::options().write(true).open(path).unwrap().set_modified(an_hour_ago).unwrap();
        }
        Store::open(dir.path().to_str().unwrap()).unwrap().tidy("reports");
        assert_eq!([&old, &young, &report].map(|path| path.exists()), [false, true, true]);
    }
}
