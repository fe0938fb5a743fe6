//! A bag that grows: each look reads what came since the last one, and hands on the rows that are complete by it.
//!
//! The rows are those of [`read()`](super::read()), to the last bit, however often it was looked, but that below a grid no sample plays a part in
//! a row that is older by more than a minute: a stream that is silent for so long holds its value, and is not waited for any longer. What
//! needs all samples at once (a clock that jumps, stamps of 0), another storage than MCAP, and compressed files are left to
//! [`read()`](super::read()).

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;

use super::grid::Irregular;
use super::live::Live;
use super::look::Rows;
use super::mcap_file::GrowingFile;
use super::source::{self, BagFile, BagSource, Storage};
use super::streams::Value as _;
use super::topic::RawView;
use super::{BagError, ReadOptions, Stream, unpack};
use govtwin_model::frame::Frame;
use govtwin_model::units::NANOS_PER_SECOND;

/// A stream without a message for so long since the first one counts as absent.
const SILENT_NS: i64 = 30 * NANOS_PER_SECOND;

/// Bytes before the place where a file was left, by which it is known again.
const KNOWN_BY_BYTES: usize = 1 << 12;

/// What a look gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grown {
    /// The rows that were complete were handed on.
    Rows,
    /// The bag has to be read as a whole.
    NeedsAll,
}

/// A bag that grows.
#[derive(Debug)]
pub struct Growing {
    files: Vec<Followed>,
    rows: RowsSoFar,
    /// It was read to its end, where what was not whole counted as well.
    ended: bool,
    read_bytes: u64,
}

/// A file, and how it is known again.
#[derive(Debug)]
struct Followed {
    file: GrowingFile,
    number: (u64, u64),
    before: Vec<u8>,
}

impl Growing {
    /// Nothing was read yet.
    pub fn new(options: ReadOptions) -> Self {
        Self { files: vec![], rows: RowsSoFar::new(options, BTreeSet::new()), ended: false, read_bytes: 0 }
    }

    /// Bytes read so far.
    pub fn read_bytes(&self) -> u64 {
        self.read_bytes
    }

    /// Whether some row holds a measurement: a bag without any is no recording of a servo system.
    pub fn is_measured(&self) -> bool {
        self.rows.measured
    }

    /// What the bag states so far under a key of its metadata; the first of its files that has the key counts.
    pub fn about(&self, key: &str) -> Option<&str> {
        self.files.iter().find_map(|known| known.file.about(key))
    }

    /// Whether the bag at a path is the one that was read, be it under another name.
    pub fn is_at(&self, path: &Path) -> bool {
        !self.files.is_empty() && source::open(path).is_ok_and(|source| self.goes_on(&source).is_ok_and(|same| same))
    }

    /// Reads on. Where the bag is another than before, has lost bytes, or was read to its end already, it is read anew, and `rows` is notified.
    ///
    /// # Errors
    /// Where there is no bag, or the operating system refuses.
    pub fn more(&mut self, path: &Path, ended: bool, rows: &mut dyn Rows) -> Result<Grown, BagError> {
        let source = source::open(path)?;
        if !source.files.iter().all(can_grow) {
            return Ok(Grown::NeedsAll);
        }
        if self.files.is_empty() || self.ended || !self.goes_on(&source).map_err(BagError::io(path, "read"))? {
            let options = &self.rows.options;
            let absent = source.topics().map(|known| {
                Stream::ALL.into_iter().filter(|stream| !known.contains(options.topics.of(*stream))).collect()
            });
            self.begin(absent.unwrap_or_default(), rows);
        }
        self.read_bytes += self.files.iter().map(|known| known.before.len() as u64).sum::<u64>();
        loop {
            if self.read(&source, ended, rows)?.is_err() {
                return Ok(Grown::NeedsAll);
            }
            let silent = self.rows.silent(ended);
            if silent.is_empty() {
                break;
            }
            // A silent stream delays all rows. Once: the next time these are known.
            self.begin(silent, rows);
        }
        self.ended = ended;
        let complete = if ended { self.rows.finish(rows) } else { Ok(()) };
        let nothing = ended && !self.rows.measured;
        Ok(if complete.is_err() || nothing { Grown::NeedsAll } else { Grown::Rows })
    }

    fn begin(&mut self, absent: BTreeSet<Stream>, rows: &mut dyn Rows) {
        self.files.clear();
        self.rows = RowsSoFar::new(self.rows.options.clone(), absent);
        rows.restart();
    }

    /// Whether the files are those that were read, as far as they were read.
    fn goes_on(&self, source: &BagSource) -> io::Result<bool> {
        if source.files.len() < self.files.len() {
            return Ok(false);
        }
        for (known, file) in self.files.iter().zip(&source.files) {
            let path = file.readable();
            if number(path)? != known.number || before(path, known.file.at())? != known.before {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn read(
        &mut self,
        source: &BagSource,
        ended: bool,
        rows: &mut dyn Rows,
    ) -> Result<Result<(), Irregular>, BagError> {
        let last = source.files.len().saturating_sub(1);
        for (place, file) in source.files.iter().enumerate() {
            let path = file.readable();
            let refused = || BagError::io(&file.path, "read");
            if self.files.len() == place {
                let number = number(path).map_err(refused())?;
                self.files.push(Followed { file: GrowingFile::new(path), number, before: vec![] });
            }
            let Some(followed) = self.files.get_mut(place) else { continue };
            let mut messages = unpack::Messages::new(path.metadata().map_err(refused())?.len());
            let (mut taken, so_far) = (Ok(()), &mut self.rows);
            let mut on_message = |message: RawView<'_>| {
                if taken.is_ok() {
                    taken = so_far.take(messages.unpack(message), rows);
                }
            };
            // Of several files the one that is written is the last.
            self.read_bytes += followed.file.more(path, ended || place < last, &mut on_message)?;
            followed.before = before(path, followed.file.at()).map_err(refused())?;
            self.read_bytes += followed.before.len() as u64;
            let foreign = followed.file.topics().any(|topic| so_far.is_foreign(topic));
            if taken.is_err() || foreign {
                return Ok(Err(Irregular));
            }
        }
        Ok(Ok(()))
    }
}

fn can_grow(file: &BagFile) -> bool {
    file.storage == Storage::Mcap && file.readable() == file.path
}

/// Device and number of a file: another one under the same name has another.
#[cfg(unix)]
fn number(path: &Path) -> io::Result<(u64, u64)> {
    use std::os::unix::fs::MetadataExt as _;
    let data = path.metadata()?;
    Ok((data.dev(), data.ino()))
}

/// Elsewhere files have no number, and are known by their bytes alone.
#[cfg(not(unix))]
fn number(_: &Path) -> io::Result<(u64, u64)> {
    Ok((0, 0))
}

/// The last bytes before a place, fewer where the file is shorter.
fn before(path: &Path, at: u64) -> io::Result<Vec<u8>> {
    let from = at.saturating_sub(KNOWN_BY_BYTES as u64);
    let mut file = File::open(path)?;
    file.seek(SeekFrom::Start(from))?;
    let mut bytes = vec![];
    file.take(at - from).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Messages into rows.
struct RowsSoFar {
    options: ReadOptions,
    absent: BTreeSet<Stream>,
    live: Live,
    /// Log times of the first and the newest message.
    log_ns: Option<(i64, i64)>,
    measured: bool,
}

impl std::fmt::Debug for RowsSoFar {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RowsSoFar").field("log_ns", &self.log_ns).finish_non_exhaustive()
    }
}

impl RowsSoFar {
    fn new(options: ReadOptions, absent: BTreeSet<Stream>) -> Self {
        let there = Stream::ALL.into_iter().filter(|stream| !absent.contains(stream));
        let topics = there.map(|stream| options.topics.of(stream).to_owned()).collect();
        let live = Live::following(&options, &topics);
        Self { options, absent, live, log_ns: None, measured: false }
    }

    fn is_foreign(&self, topic: &super::TopicInfo) -> bool {
        let is_one = |stream: Stream| self.options.topics.of(stream) == topic.name;
        self.live.collected.all().iter().any(|one| is_one(one.stream()) && one.foreign_type(topic).is_some())
    }

    /// Absent streams and those to be taken for absent, where there are any new ones.
    fn silent(&self, ended: bool) -> BTreeSet<Stream> {
        let heard_ns = self.log_ns.map_or(0, |(first, newest)| newest.saturating_sub(first));
        let wanted = |stream: &Stream| self.options.required.contains(stream);
        let mut silent: BTreeSet<Stream> = self.live.unheard().filter(|stream| !wanted(stream)).collect();
        if silent.is_empty() || !(ended || heard_ns > SILENT_NS) {
            return BTreeSet::new();
        }
        silent.extend(&self.absent);
        silent
    }

    fn take(&mut self, message: RawView<'_>, rows: &mut dyn Rows) -> Result<(), Irregular> {
        let now_ns = message.log_time_ns;
        self.log_ns = Some(self.log_ns.map_or((now_ns, now_ns), |(first, newest)| (first, newest.max(now_ns))));
        let Self { live, measured, .. } = self;
        live.take(message, &mut |frame| hand_on(frame, measured, rows))
    }

    fn finish(&mut self, rows: &mut dyn Rows) -> Result<(), Irregular> {
        let Self { live, measured, .. } = self;
        live.finish(&mut |frame| hand_on(frame, measured, rows))
    }
}

fn hand_on(frame: &Frame, measured: &mut bool, rows: &mut dyn Rows) {
    *measured |= frame.measured.number().is_finite();
    rows.row(frame);
}
