//! All messages of a bag in log-time order, loading only the pieces that overlap.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::channels::{self, Channels};
use super::mcap_file;
use super::segment::Segment;
use super::source::{BagFile, Storage};
use super::topic::{OnMessage, RawMessage, RawView, TopicInfo};
use super::{BagError, FileHealth, Warning, source, unpack};

/// The messages of a bag in log-time order; messages of one time stay in file order.
#[derive(Debug)]
pub struct MergedMessages {
    files: Vec<FileHealth>,
    topics: Vec<Arc<TopicInfo>>,
    span_ns: Option<(i64, i64)>,
    warnings: Vec<Warning>,
    /// What `metadata.yaml` holds of the recording's user.
    pub(super) custom_data: Option<serde_yaml::Value>,
    loaders: Vec<PieceLoader>,
    /// Segments not loaded yet with the number of their file, by the time of their first message.
    waiting: VecDeque<(usize, Segment)>,
    loaded: BinaryHeap<QueuedMessage>,
}

/// Loads pieces of one file, which stays unpacked as long as this is there.
#[derive(Debug)]
struct PieceLoader {
    file: BagFile,
    stored: Stored,
    unpack: unpack::Messages,
}

/// By its storage.
#[derive(Debug)]
enum Stored {
    Mcap(mcap_file::Loader),
    #[cfg(feature = "sqlite")]
    Sqlite(super::db3::Db3Loader),
}

impl PieceLoader {
    fn open(file: BagFile, channels: Channels) -> Result<Self, BagError> {
        let path = file.readable();
        let bytes = std::fs::metadata(path).map_err(BagError::io(path, "read"))?.len();
        let stored = match file.storage {
            Storage::Mcap => mcap_file::Loader::open(path, channels).map(Stored::Mcap),
            #[cfg(feature = "sqlite")]
            Storage::Sqlite => super::db3::Db3Loader::open(path).map(Stored::Sqlite),
            #[cfg(not(feature = "sqlite"))]
            Storage::Sqlite => Err(BagError::Sqlite { path: path.to_owned() }),
        }?;
        Ok(Self { file, stored, unpack: unpack::Messages::new(bytes) })
    }

    fn load(&mut self, segment: &Segment, on_message: &mut OnMessage<'_>) -> Result<(), BagError> {
        let Self { file, stored, unpack } = self;
        let on_message = &mut |message: RawView<'_>| on_message(unpack.unpack(message));
        let loaded = match stored {
            Stored::Mcap(loader) => loader.load(segment, on_message),
            #[cfg(feature = "sqlite")]
            Stored::Sqlite(loader) => loader.load(segment, on_message),
        };
        loaded.map_err(|error| error.of(&file.path))
    }
}

/// A loaded message with its place in the order, earliest greatest.
#[derive(Debug)]
struct QueuedMessage {
    /// File, place of the segment in it, number in the segment.
    place: (usize, u64, usize),
    message: RawMessage,
}

impl QueuedMessage {
    fn key(&self) -> (i64, (usize, u64, usize)) {
        (self.message.log_time_ns, self.place)
    }
}

impl Ord for QueuedMessage {
    fn cmp(&self, other: &Self) -> Ordering {
        other.key().cmp(&self.key())
    }
}

impl PartialOrd for QueuedMessage {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for QueuedMessage {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for QueuedMessage {}

impl MergedMessages {
    /// How the files are.
    pub fn files(&self) -> &[FileHealth] {
        &self.files
    }

    /// The topics by name.
    pub fn topics(&self) -> &[Arc<TopicInfo>] {
        &self.topics
    }

    /// Log times of the first and the last message, ns; `None` without messages.
    pub fn span_ns(&self) -> Option<(i64, i64)> {
        self.span_ns
    }

    /// The MCAP files, where they can be read.
    pub(super) fn readable(&self) -> Vec<PathBuf> {
        let mcap = self.loaders.iter().filter(|loader| loader.file.storage == Storage::Mcap);
        mcap.map(|loader| loader.file.readable().to_owned()).collect()
    }

    /// What a user should read before the messages.
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }

    /// Loads every segment that may hold a message before the earliest one loaded.
    fn fill(&mut self) -> Result<(), BagError> {
        while let Some((_, next)) = self.waiting.front() {
            if self.loaded.peek().is_some_and(|earliest| earliest.message.log_time_ns < next.first_ns) {
                break;
            }
            let Some((file, segment)) = self.waiting.pop_front() else { break };
            let Some(loader) = self.loaders.get_mut(file) else { continue };
            let loaded = &mut self.loaded;
            let mut number = 0;
            loader.load(&segment, &mut |message| {
                loaded.push(QueuedMessage { place: (file, segment.at, number), message: message.to_owned() });
                number += 1;
            })?;
        }
        Ok(())
    }
}

impl Iterator for MergedMessages {
    type Item = Result<RawMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        if let Err(error) = self.fill() {
            // Said once; then the end.
            self.waiting.clear();
            self.loaded.clear();
            return Some(Err(error));
        }
        self.loaded.pop().map(|entry| Ok(entry.message))
    }
}

/// Gives all messages of a bag, of any type, in log-time order.
///
/// The bag is read twice: once to find what is where and what is damaged, once for the messages. Only
/// pieces that overlap in time are in memory at once.
///
/// # Errors
/// Where there is no bag at the path. Damage is no error. An item is an error where the operating
/// system refuses later on.
pub fn messages(path: &Path) -> Result<MergedMessages, BagError> {
    let source = source::open(path)?;
    let mut span_ns = None;
    let scanned = source.scan(&mut |message| {
        let time_ns = message.log_time_ns;
        span_ns = Some(span_ns.map_or((time_ns, time_ns), |(first, last)| (time_ns.min(first), time_ns.max(last))));
    })?;
    let warnings = source.all_warnings(&scanned.files);
    let (known, custom_data) =
        source.metadata.map_or_else(Default::default, |metadata| (metadata.topics, metadata.custom_data));
    let mut topics = scanned.topics;
    for topic in &mut topics {
        channels::complete(topic, &known);
    }
    let mut loaders = vec![];
    let mut waiting = vec![];
    for (number, (file, (mut channels, segments))) in source.files.into_iter().zip(scanned.parts).enumerate() {
        channels.complete(&known);
        loaders.push(PieceLoader::open(file, channels)?);
        waiting.extend(segments.into_iter().map(|segment| (number, segment)));
    }
    waiting.sort_by_key(|(number, segment)| (segment.first_ns, *number, segment.at));
    let (files, waiting) = (scanned.files, waiting.into());
    Ok(MergedMessages { files, topics, span_ns, warnings, custom_data, loaders, waiting, loaded: BinaryHeap::new() })
}
