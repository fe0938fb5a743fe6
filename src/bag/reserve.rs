//! Room that a recording keeps on the disk for its own end: where the disk is full, it is given back, and the bag is completed in it.

use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use govtwin_files::fault::step;

/// Name of the file that takes the room.
pub(super) const FILE_NAME: &str = ".room";

/// How much: the open chunk of less than 1 MB, and 200 bytes of index for each chunk before, one a second for some ten hours.
const BYTES: usize = 1 << 23;

/// A file, and the room for its end.
#[derive(Debug)]
pub(super) struct Reserved {
    file: File,
    room: Option<PathBuf>,
    full: Arc<AtomicBool>,
}

impl Reserved {
    /// A file without such room.
    pub(super) fn without(file: File) -> Self {
        Self { file, room: None, full: Arc::default() }
    }

    /// Takes the room in a folder.
    ///
    /// # Errors
    /// Where there is none.
    #[expect(clippy::disallowed_methods, reason = "inside a folder that takes its name only when it is whole")]
    pub(super) fn with_room(file: File, folder: &Path) -> io::Result<Self> {
        let path = folder.join(FILE_NAME);
        let zeros = vec![0; BYTES];
        let room = step().and_then(|()| File::create(&path)).and_then(|mut room| room.write_all(&zeros));
        if let Err(error) = room {
            let _ = fs::remove_file(&path);
            return Err(error);
        }
        Ok(Self { file, room: Some(path), full: Arc::default() })
    }

    /// Becomes true once the disk was full.
    pub(super) fn is_full(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.full)
    }

    /// The file, its room given back.
    pub(super) fn into_file(mut self) -> File {
        self.give_back();
        self.file
    }

    /// Whether there was room to give back.
    fn give_back(&mut self) -> bool {
        self.room.take().is_some_and(|path| fs::remove_file(path).is_ok())
    }
}

impl Write for Reserved {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match step().and_then(|()| self.file.write(bytes)) {
            Err(error) if is_full(&error) => {
                self.full.store(true, Ordering::Relaxed);
                if self.give_back() { self.file.write(bytes) } else { Err(error) }
            }
            other => other,
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for Reserved {
    fn seek(&mut self, place: SeekFrom) -> io::Result<u64> {
        self.file.seek(place)
    }
}

/// Whether a full disk, a quota or a file size limit is the cause.
pub(super) fn is_full(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded | io::ErrorKind::FileTooLarge)
}
