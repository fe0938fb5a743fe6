//! The folder of a bag that is still being written: under another name until it is whole.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::{BagError, WriterOptions, metadata, reserve, source};
use govtwin_files::fault::step;
use govtwin_files::{
    Claim, ClaimError, exchange, is_held, look_at, look_at_link, make_folder, move_new, remove_abandoned,
    temporary_folder,
};

/// A folder beside the bag's place. Dropped, it is removed, unless it is to be kept.
#[derive(Debug)]
pub(super) struct Unfinished {
    path: PathBuf,
    place: PathBuf,
    options: WriterOptions,
    keep: bool,
    /// Once it is in its place: whether it replaced another.
    replaced: Option<bool>,
    /// Of a recording: its name, until the folder has it. Dropped last.
    _claim: Option<Claim>,
}

/// Whether a bag may be written at a place: it is free or holds a bag that may be replaced, and no recording is left in the making.
pub(super) fn check(place: &Path, options: WriterOptions) -> Result<(), BagError> {
    check_place(place, options)?;
    let path = kept(place);
    if options.keep_unfinished && look_at_link(&path).map_err(BagError::io(&path, "look at"))?.is_some() {
        return match left_or_busy(place, path) {
            BagError::Unfinished { kept, .. } if holds_nothing(&kept) => Ok(()),
            error => Err(error),
        };
    }
    Ok(())
}

fn check_place(place: &Path, options: WriterOptions) -> Result<(), BagError> {
    // A link that leads nowhere is in the way, too.
    let looking = || BagError::io(place, "look at");
    if look_at_link(place).map_err(looking())?.is_none() {
        return Ok(());
    }
    let ours = match options.mark {
        Some(mark) => is_empty(place).map_err(looking())? || is_marked(place, mark)?,
        None => false,
    };
    if ours { Ok(()) } else { Err(BagError::InTheWay { path: place.to_owned() }) }
}

/// The state of an unfinished recording: being written, or broken off.
fn left_or_busy(place: &Path, path: PathBuf) -> BagError {
    let place = place.to_owned();
    if is_held(&path) {
        BagError::Busy { path: place, held: path }
    } else {
        BagError::Unfinished { path: place, kept: path }
    }
}

/// Why the name of a recording cannot be had.
fn unclaimed(place: &Path, error: ClaimError) -> BagError {
    match error {
        ClaimError::NameBusy { path, lock } => BagError::Busy { path, held: lock },
        ClaimError::Refused { reason, .. } => BagError::io(place, "write")(reason),
        other => BagError::io(place, "write")(io::Error::other(other)),
    }
}

/// Whether a recording was broken off before its first message, so that nothing is lost with it.
fn holds_nothing(path: &Path) -> bool {
    let Ok(entries) = fs::read_dir(path) else { return false };
    entries.flatten().all(|entry| {
        let holds_none = |survey: super::Survey| survey.messages == 0 && survey.warnings.len() <= 1;
        let is_empty = || entry.metadata().is_ok_and(|data| data.is_file() && data.len() == 0);
        entry.file_name() == reserve::FILE_NAME || is_empty() || super::survey(&entry.path()).is_ok_and(holds_none)
    })
}

impl Unfinished {
    /// Makes the folder, if the bag's place is free or holds a bag that may be replaced.
    pub(super) fn create(place: &Path, options: WriterOptions) -> Result<Self, BagError> {
        check_place(place, options)?;
        let parent = match place.parent() {
            Some(parent) if parent != Path::new("") => parent,
            _ => Path::new("."),
        };
        make_folder(parent).map_err(BagError::io(parent, "create"))?;
        let mut claim = None;
        let path = if options.keep_unfinished {
            // Of two that begin at once, neither takes the folder of the other for one that was left.
            claim = Some(Claim::name(place).map_err(|error| unclaimed(place, error))?);
            let path = kept(place);
            check(place, options)?;
            if fs::symlink_metadata(&path).is_ok() {
                fs::remove_dir_all(&path).map_err(BagError::io(&path, "remove what was left without a message in"))?;
            }
            // Of two recorders one makes it.
            match step().and_then(|()| fs::create_dir(&path)) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => return Err(left_or_busy(place, path)),
                other => other.map_err(BagError::io(&path, "create"))?,
            }
            path
        } else {
            remove_abandoned(parent);
            temporary_folder(parent).map_err(BagError::io(parent, "write in"))?
        };
        Ok(Self { path, place: place.to_owned(), options, keep: false, replaced: None, _claim: claim })
    }

    /// There is something to be kept now, where it should be.
    pub(super) fn has_messages(&mut self) {
        self.keep = self.options.keep_unfinished;
    }

    /// Where to write.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Where it will be.
    pub(super) fn place(&self) -> &Path {
        &self.place
    }

    /// The name that the bag will have.
    pub(super) fn name(&self) -> String {
        self.place.file_name().unwrap_or(self.place.as_os_str()).to_string_lossy().into_owned()
    }

    /// Puts the folder in its place; an older bag there is removed only when this one is in place.
    pub(super) fn complete(mut self) -> Result<PathBuf, BagError> {
        self.put()?;
        Ok(self.place.clone())
    }

    /// Puts the folder in its place. An older bag there keeps the temporary name as long as this is not dropped.
    pub(super) fn put(&mut self) -> Result<(), BagError> {
        // Writing takes its time, and others may have written there.
        check_place(&self.place, self.options).map_err(|error| self.taken(error))?;
        let older = look_at_link(&self.place).map_err(BagError::io(&self.place, "look at"))?;
        if older.is_some() {
            exchange(&self.path, &self.place).map_err(BagError::io(&self.place, "replace"))?;
            // The extracted bag is checked again: only now it cannot change any more.
            if let Err(error) = check_place(&self.path, self.options) {
                exchange(&self.path, &self.place).map_err(BagError::io(&self.place, "put back"))?;
                return Err(match error {
                    BagError::InTheWay { .. } => self.taken(BagError::InTheWay { path: self.place.clone() }),
                    other => other,
                });
            }
            // The old bag now has the temporary name, and goes with it.
            self.keep = false;
        } else {
            move_new(&self.path, &self.place).map_err(|error| match error.kind() {
                io::ErrorKind::AlreadyExists | io::ErrorKind::DirectoryNotEmpty => {
                    self.taken(BagError::InTheWay { path: self.place.clone() })
                }
                _ => BagError::io(&self.place, "create")(error),
            })?;
            self.keep = true;
        }
        self.replaced = Some(older.is_some());
        Ok(())
    }

    /// Takes the folder out of its place again and restores the older one.
    pub(super) fn take_back(&mut self) {
        // Nothing better can be done where even the way back is closed: both stay.
        self.keep = match self.replaced.take() {
            Some(true) => exchange(&self.path, &self.place).is_err(),
            Some(false) => fs::rename(&self.place, &self.path).is_err(),
            None => self.keep,
        };
    }

    /// The same error, with where the bag is kept.
    fn taken(&self, error: BagError) -> BagError {
        match error {
            BagError::InTheWay { path } if self.keep => BagError::PlaceTaken { path, kept: self.path.clone() },
            other => other,
        }
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        if !self.keep {
            // A failure to clean up cannot be reported any more.
            let _ = fs::remove_dir_all(&self.path);
        }
    }
}

/// `.NAME.unfinished` beside `NAME`: where a recording is kept that was broken off.
pub(super) fn kept(place: &Path) -> PathBuf {
    let name = place.file_name().unwrap_or(place.as_os_str()).to_string_lossy();
    place.with_file_name(format!(".{name}.unfinished"))
}

fn is_empty(place: &Path) -> io::Result<bool> {
    match fs::read_dir(place) {
        Ok(mut entries) => entries.next().transpose().map(|first| first.is_none()),
        Err(error) if error.kind() == io::ErrorKind::NotADirectory => Ok(false),
        Err(error) => Err(error),
    }
}

/// A bag folder of which every file has the mark, and which holds nothing else. What cannot be read is an error, not another's.
fn is_marked(place: &Path, mark: &str) -> Result<bool, BagError> {
    let reading = || BagError::io(place, "read");
    let scanned = match source::open_as_it_is(place).and_then(|source| source.scan(&mut |_| {})) {
        Err(error @ BagError::Io { .. }) => return Err(error),
        Err(_) => return Ok(false),
        Ok(scanned) => scanned,
    };
    let described = look_at(&place.join(metadata::FILE_NAME)).map_err(reading())?;
    let entries = fs::read_dir(place).and_then(Iterator::collect::<io::Result<Vec<_>>>).map_err(reading())?;
    let marked = scanned.files.iter().all(|file| file.metadata.iter().any(|name| name == mark));
    Ok(marked
        && !scanned.files.is_empty()
        && described.is_some_and(|kind| kind.is_file())
        && entries.len() == scanned.files.len() + 1)
}
