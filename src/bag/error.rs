//! What can be wrong with a bag: each error has the path, what was expected, what was found, and a suggested fix.

use std::path::{Path, PathBuf};

use super::Stream;
use crate::msg::definition::DefinitionError;

/// Why a bag cannot be read or written.
#[derive(Debug, thiserror::Error)]
pub enum BagError {
    /// The operating system refused.
    #[error("{path}: cannot {action}: {reason}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What was tried, as a verb.
        action: &'static str,
        /// The system's own words.
        reason: std::io::Error,
    },
    /// The path holds something else.
    #[error("{path}: not a bag: expected {expected}, found {found}")]
    NotABag {
        /// The file or folder.
        path: PathBuf,
        /// What a bag would have here.
        expected: &'static str,
        /// What was found.
        found: String,
    },
    /// Messages compressed one by one by a plugin of rosbag2 that is not zstd.
    #[error(
        "{path}: the messages are compressed one by one (compression_mode: message) with `{format}`, expected `zstd`; convert \
         the bag once: `ros2 bag convert -i BAG -o OUT.yaml` with `storage_id: mcap`"
    )]
    Compressed {
        /// The folder.
        path: PathBuf,
        /// The format.
        format: String,
    },
    /// A bag in sqlite3 storage, which this build cannot read.
    #[error(
        "{path}: a sqlite3 bag, which this build cannot read; build with `--features sqlite`, or convert it once: \
         `ros2 bag convert -i BAG -o OUT.yaml` with `storage_id: mcap`"
    )]
    Sqlite {
        /// The file.
        path: PathBuf,
    },
    /// The database is not one of rosbag2.
    #[error("{path}: cannot be read as a sqlite3 bag: {problem}")]
    Database {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
    /// No message was found.
    #[error("{path}: the bag holds no message{lost}")]
    Empty {
        /// The bag.
        path: PathBuf,
        /// What was damaged, where something was.
        lost: String,
    },
    /// Needed streams are missing.
    #[error("{path}: {}; topics present: {present}", missing.join("; "))]
    Missing {
        /// The bag.
        path: PathBuf,
        /// Each missing stream with topic, type and, where there is one, the nearest topic.
        missing: Vec<String>,
        /// The topics of the bag with their types.
        present: String,
    },
    /// A topic carries another type.
    #[error(
        "{path}: topic `{topic}`: expected type `{expected}`, found {found}; name another with `--topic {stream}=NAME`, or read this type by a map (`govtwin import --suggest {path}`)"
    )]
    Type {
        /// The bag.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// The stream that it should carry.
        stream: Stream,
        /// The type that the stream has.
        expected: &'static str,
        /// What the topic has.
        found: String,
    },
    /// Not one message of a needed topic is usable.
    #[error("{path}: topic `{topic}`: none of its {messages} messages is usable: {first}")]
    Unusable {
        /// The bag.
        path: PathBuf,
        /// The topic.
        topic: String,
        /// How many there are.
        messages: u64,
        /// What is wrong with the first.
        first: String,
    },
    /// None of the streams is there, and none was required.
    #[error("{path}: none of the four streams has a sample; topics present: {present}")]
    NoRows {
        /// The bag.
        path: PathBuf,
        /// The topics of the bag with their types.
        present: String,
    },
    /// Resampling would make too many rows.
    #[error(
        "{path}: a row every {period_ns} ns over {duration_s} s makes {rows} rows, expected at most {limit}; cut the \
         recording into shorter ones"
    )]
    TooManyRows {
        /// The bag.
        path: PathBuf,
        /// The period asked for, ns.
        period_ns: i64,
        /// How long the recording is, s.
        duration_s: f64,
        /// How many rows that would be.
        rows: i64,
        /// The most rows that are made.
        limit: i64,
    },
    /// The streams have clocks that differ so far that nothing can be simulated between them.
    #[error(
        "{path}: the stamps of the streams lie {gap_s} s apart, from {from_ns} ns to {to_ns} ns; record with one clock \
         for all senders, or with stamps of 0, for which the time of recording stands in"
    )]
    TwoClocks {
        /// The bag.
        path: PathBuf,
        /// The last stamp before the gap, ns.
        from_ns: i64,
        /// The first stamp after it, ns.
        to_ns: i64,
        /// The gap, s.
        gap_s: f64,
    },
    /// Streams of the bag are stamped by clocks that differ.
    #[error("{path}: {problem}")]
    Clocks {
        /// The bag.
        path: PathBuf,
        /// Which, by how much, and the way out.
        problem: String,
    },
    /// The output is there already.
    #[error("{path}: is there already; name another folder, or move it away")]
    InTheWay {
        /// The folder.
        path: PathBuf,
    },
    /// A recording of that name was broken off.
    #[error(
        "{path}: a recording of that name was broken off, and what it holds is kept in {kept}; save it with `govtwin recover \
         {path}`, or name another folder"
    )]
    Unfinished {
        /// The folder that the bag would become.
        path: PathBuf,
        /// Where it is.
        kept: PathBuf,
    },
    /// Somebody else is writing the output.
    #[error("{path}: another process is writing it and holds {held}; wait until it ends, or name another folder")]
    Busy {
        /// The folder that the bag will become.
        path: PathBuf,
        /// What is held.
        held: PathBuf,
    },
    /// Something came into the place of the output while it was written.
    #[error(
        "{path}: appeared while the bag was written, which is kept in {kept}; move one of the two to a place of its own"
    )]
    PlaceTaken {
        /// The folder that the bag should have become.
        path: PathBuf,
        /// Where it is, whole.
        kept: PathBuf,
    },
    /// The MCAP library refused.
    #[error("{path}: cannot write MCAP: {reason}")]
    Mcap {
        /// The file.
        path: PathBuf,
        /// The library's own words.
        reason: mcap::McapError,
    },
    /// A message, or the metadata, cannot be encoded.
    #[error("cannot encode {what}: {problem}")]
    Encode {
        /// The type of the message, or the file.
        what: String,
        /// What is wrong.
        problem: String,
    },
    /// A type without definition.
    #[error(transparent)]
    Definition(#[from] DefinitionError),
}

impl BagError {
    /// For `map_err` on what the operating system does.
    pub(super) fn io(path: &Path, action: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        move |reason| Self::Io { path: path.to_owned(), action, reason }
    }

    /// The same for another file: the one that was unpacked to be read.
    pub(super) fn of(self, path: &Path) -> Self {
        let path = path.to_owned();
        match self {
            Self::Io { action, reason, .. } => Self::Io { path, action, reason },
            Self::Database { problem, .. } => Self::Database { path, problem },
            other => other,
        }
    }

    /// For `map_err` on what the MCAP library writes.
    pub(super) fn mcap(path: &Path) -> impl FnOnce(mcap::McapError) -> Self {
        move |reason| match reason {
            // The library's own words would leave out the system's.
            mcap::McapError::Io(reason) => Self::Io { path: path.to_owned(), action: "write", reason },
            mcap::McapError::Parse(reason) => Self::Io {
                path: path.to_owned(),
                action: "write",
                reason: std::io::Error::other(reason.root_cause().to_string()),
            },
            reason => Self::Mcap { path: path.to_owned(), reason },
        }
    }
}
