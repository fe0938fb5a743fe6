//! A bag that grows: each look reads what came since the last one, and hands on the rows that are complete by it.
//!
//! The rows are those of [`read()`](super::read()), to the last bit, however often it was looked, but that no sample plays a part in a row that
//! is older by more than a minute: a stream that is silent for so long holds its value, and nobody waits for it any longer. What
//! needs all samples at once (a clock that jumps, stamps of 0), another storage than MCAP, and compressed files are left to
//! [`read()`](super::read()).

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::path::Path;

use super::align::{self, Streams, Window, align_window};
use super::grid::Irregular;
use super::live::Live;
use super::look::Rows;
use super::mcap_file::GrowingFile;
use super::source::{self, BagFile, BagSource, Storage};
use super::streams::{Command, Pressure, Sample, Value as _};
use super::topic::RawView;
use super::{BagError, ReadOptions, Stream, unpack};
use crate::frame::EsvState;
use crate::units::NANOS_PER_SECOND;

/// So much later a sample still plays a part in a row.
const AHEAD_NS: i64 = 60 * NANOS_PER_SECOND;

/// A stream that was not heard for so long since the first message is taken for absent.
const SILENT_NS: i64 = 30 * NANOS_PER_SECOND;

/// Rows are made of so much time at once while a long file is read.
const TOGETHER_NS: i64 = 15 * NANOS_PER_SECOND;

/// Messages between two looks at whether rows can be made.
const MESSAGES: u32 = 1024;

/// Samples on either side of a row that a bend of the command is told by.
const BEND_SAMPLES: usize = 3;

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
    #[must_use]
    pub fn new(options: ReadOptions) -> Self {
        Self { files: vec![], rows: RowsSoFar::new(options, BTreeSet::new()), ended: false, read_bytes: 0 }
    }

    /// Bytes read so far.
    #[must_use]
    pub fn read_bytes(&self) -> u64 {
        self.read_bytes
    }

    /// Whether some row holds a measurement: a bag without any is no recording of a servo system.
    #[must_use]
    pub fn is_measured(&self) -> bool {
        self.rows.measured
    }

    /// Whether the bag at a path is the one that was read, be it under another name.
    #[must_use]
    pub fn is_at(&self, path: &Path) -> bool {
        !self.files.is_empty() && source::open(path).is_ok_and(|source| self.goes_on(&source).is_ok_and(|same| same))
    }

    /// Reads on. Where the bag is another than before, has lost bytes, or was read to its end already, it is read anew, and `rows` is told so.
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
            // Who says nothing holds up all rows. Once: the next time these are known.
            self.begin(silent, rows);
        }
        self.ended = ended;
        let complete = if ended { self.rows.finish(rows) } else { self.rows.make(Until::Complete, rows) };
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

/// Up to where rows are to be made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Until {
    /// As far as no later sample plays a part, where that is much.
    Much,
    /// As far as no later sample plays a part.
    Complete,
    /// All of them.
    End,
}

/// Messages into rows.
struct RowsSoFar {
    options: ReadOptions,
    absent: BTreeSet<Stream>,
    live: Live,
    /// The samples that rows still need, in order.
    streams: Streams,
    /// Where the grid of rows begins.
    origin_ns: Option<i64>,
    /// Rows up to here were handed on.
    done_ns: i64,
    /// Log times of the first and the newest message.
    log_ns: Option<(i64, i64)>,
    untried: u32,
    measured: bool,
}

impl std::fmt::Debug for RowsSoFar {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("RowsSoFar").field("done_ns", &self.done_ns).finish_non_exhaustive()
    }
}

impl RowsSoFar {
    fn new(options: ReadOptions, absent: BTreeSet<Stream>) -> Self {
        let there = Stream::ALL.into_iter().filter(|stream| !absent.contains(stream));
        let topics = there.map(|stream| options.topics.of(stream).to_owned()).collect();
        let live = Live::keeping(&options, Some(&topics));
        let mut streams = Streams::default();
        if absent.contains(&Stream::Command) {
            streams.command = align::constant(Command(f64::NAN));
        }
        if absent.contains(&Stream::Esv) {
            streams.esv = align::constant(EsvState::Normal);
        }
        if absent.contains(&Stream::TankPressure) {
            streams.tank_pressure = align::constant(Pressure(f64::NAN));
        }
        let (origin_ns, done_ns, log_ns) = (None, i64::MIN, None);
        Self { options, absent, live, streams, origin_ns, done_ns, log_ns, untried: 0, measured: false }
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
        self.live.take(message, &mut |_| {})?;
        self.untried += 1;
        if self.untried < MESSAGES {
            return Ok(());
        }
        self.untried = 0;
        self.make(Until::Much, rows)
    }

    fn finish(&mut self, rows: &mut dyn Rows) -> Result<(), Irregular> {
        self.live.finish(&mut |_| {})?;
        self.make(Until::End, rows)
    }

    /// Hands on rows, and drops the samples that no later row needs.
    fn make(&mut self, until: Until, rows: &mut dyn Rows) -> Result<(), Irregular> {
        let complete_ns = self.live.passed(&mut self.streams);
        let upto_ns = match until {
            Until::End => i64::MAX,
            Until::Much | Until::Complete => self.complete(complete_ns),
        };
        let least_ns = if until == Until::Much { self.done_ns.saturating_add(TOGETHER_NS) } else { self.done_ns };
        if upto_ns <= least_ns {
            return Ok(());
        }
        let window = Window { origin_ns: self.origin_ns, ahead_ns: AHEAD_NS };
        let frames = align_window(&self.streams, self.options.interpolation, window, Path::new(""));
        // Whatever is wrong with so short a window is told by who reads all.
        let frames = frames.map_err(|_| Irregular)?;
        self.origin_ns = self.origin_ns.or(frames.first().map(|first| first.time_ns));
        for frame in frames.iter().filter(|frame| frame.time_ns > self.done_ns && frame.time_ns <= upto_ns) {
            self.measured |= frame.measured.number().is_finite();
            rows.row(frame);
        }
        self.done_ns = upto_ns;
        drop_before(&mut self.streams.command, upto_ns, BEND_SAMPLES);
        drop_before(&mut self.streams.esv, upto_ns, 1);
        drop_before(&mut self.streams.tank_pressure, upto_ns, 1);
        drop_before(&mut self.streams.servo_state, upto_ns, 1);
        Ok(())
    }

    /// Up to where no sample that is still to come plays a part, of streams that are complete up to a time.
    fn complete(&self, complete_ns: i64) -> i64 {
        let Streams { command, tank_pressure, servo_state, .. } = &self.streams;
        // As many samples behind the row as it takes.
        let before = |stamps: Option<i64>| stamps.map_or(i64::MIN, |stamp_ns| stamp_ns.saturating_sub(1));
        let behind = |stream: Stream, stamp_ns: Option<i64>| {
            if self.absent.contains(&stream) { i64::MAX } else { before(stamp_ns) }
        };
        let command_ns = command.len().checked_sub(BEND_SAMPLES).and_then(|place| command.get(place));
        let with_all_ns = behind(Stream::Command, command_ns.map(|sample| sample.stamp_ns))
            .min(behind(Stream::TankPressure, tank_pressure.last().map(|sample| sample.stamp_ns)));
        // Rows end at a command or a servo state.
        let ends = align::stamps(command).last().max(align::stamps(servo_state).last());
        complete_ns.min(with_all_ns.max(complete_ns.saturating_sub(AHEAD_NS))).min(ends.unwrap_or(i64::MIN))
    }
}

/// Drops samples up to a time but so many of the last of them.
fn drop_before<V>(samples: &mut Vec<Sample<V>>, time_ns: i64, keep: usize) {
    let passed = samples.partition_point(|sample| sample.stamp_ns <= time_ns);
    samples.drain(..passed.saturating_sub(keep));
}
