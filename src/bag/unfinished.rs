//! The folder of a bag that is still being written: under another name until it is whole.

use std::fs;
use std::path::{Path, PathBuf};

use super::{BagError, WriterOptions, metadata, source};

/// A folder beside the bag's place. Dropped, it is removed, unless it is to be kept.
#[derive(Debug)]
pub(super) struct Unfinished {
    path: PathBuf,
    place: PathBuf,
    options: WriterOptions,
    keep: bool,
}

/// Whether a bag's place is free, or holds a bag that may be replaced.
pub(super) fn check(place: &Path, options: WriterOptions) -> Result<(), BagError> {
    // A link that leads nowhere is in the way, too.
    let free = fs::symlink_metadata(place).is_err();
    if free || options.mark.is_some_and(|mark| is_empty(place) || is_marked(place, mark)) {
        return Ok(());
    }
    Err(BagError::InTheWay { path: place.to_owned() })
}

impl Unfinished {
    /// Makes the folder, if the bag's place is free or holds a bag that may be replaced.
    pub(super) fn create(place: &Path, options: WriterOptions) -> Result<Self, BagError> {
        check(place, options)?;
        let path = beside(place, if options.keep_unfinished { "unfinished" } else { "tmp" });
        if path.exists() {
            if options.keep_unfinished {
                return Err(BagError::InTheWay { path });
            }
            fs::remove_dir_all(&path).map_err(BagError::io(&path, "remove"))?;
        }
        fs::create_dir_all(&path).map_err(BagError::io(&path, "create"))?;
        Ok(Self { path, place: place.to_owned(), options, keep: options.keep_unfinished })
    }

    /// Where to write.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The name that the bag will have.
    pub(super) fn name(&self) -> String {
        self.place.file_name().unwrap_or(self.place.as_os_str()).to_string_lossy().into_owned()
    }

    /// Puts the folder in its place; a bag that stood there goes only once this one stands.
    pub(super) fn complete(mut self) -> Result<PathBuf, BagError> {
        // Writing takes its time, and others may have written there.
        check(&self.place, self.options).map_err(|error| match error {
            BagError::InTheWay { path } if self.keep => BagError::PlaceTaken { path, kept: self.path.clone() },
            other => other,
        })?;
        let old = beside(&self.place, "old");
        let replaced = self.place.exists();
        if replaced {
            if old.exists() {
                fs::remove_dir_all(&old).map_err(BagError::io(&old, "remove"))?;
            }
            fs::rename(&self.place, &old).map_err(BagError::io(&self.place, "replace"))?;
        }
        if let Err(error) = fs::rename(&self.path, &self.place) {
            if replaced {
                // The old bag goes back; should even that fail, its folder still stands under its other name.
                let _ = fs::rename(&old, &self.place);
            }
            return Err(BagError::io(&self.place, "create")(error));
        }
        self.keep = true;
        if replaced {
            fs::remove_dir_all(&old).map_err(BagError::io(&old, "remove"))?;
        }
        Ok(self.place.clone())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if !self.keep {
            // Nobody is left to hear of a failure to clean up.
            let _ = fs::remove_dir_all(&self.path);
        }
    }
}

/// `.NAME.suffix` beside `NAME`.
fn beside(place: &Path, suffix: &str) -> PathBuf {
    let name = place.file_name().unwrap_or(place.as_os_str()).to_string_lossy();
    place.with_file_name(format!(".{name}.{suffix}"))
}

fn is_empty(place: &Path) -> bool {
    fs::read_dir(place).is_ok_and(|mut entries| entries.next().is_none())
}

/// A bag folder of which every file has the mark, and which holds nothing else.
fn is_marked(place: &Path, mark: &str) -> bool {
    let Ok(entries) = fs::read_dir(place) else { return false };
    let Ok(source) = source::open(place) else { return false };
    let Ok(scanned) = source.scan(&mut |_| {}) else { return false };
    let marked = scanned.files.iter().all(|file| file.metadata.iter().any(|name| name == mark));
    marked
        && !scanned.files.is_empty()
        && place.join(metadata::FILE_NAME).is_file()
        && entries.count() == source.files.len() + 1
}
