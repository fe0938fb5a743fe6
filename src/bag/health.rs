//! The health of a bag: what is damaged, dropped, late or doubled, counted and placed.

use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

/// Everything worth knowing about a bag besides its values.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Health {
    /// The files, in order.
    pub files: Vec<FileHealth>,
    /// The streams that were read, in the order command, ESV, tank pressure, servo state.
    pub streams: Vec<StreamHealth>,
    /// What a user should read, most serious first.
    pub warnings: Vec<Warning>,
}

impl Health {
    /// Nothing to warn of.
    #[must_use]
    pub fn is_clean(&self) -> bool {
        self.warnings.is_empty()
    }
}

/// One file of a bag.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct FileHealth {
    /// Where it is.
    pub path: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// `mcap` or `sqlite3`.
    pub storage: &'static str,
    /// Profile that the file states.
    pub profile: String,
    /// Program that wrote it.
    pub library: String,
    /// Chunks read.
    pub chunks: u64,
    /// Compressions of the chunks, sorted; empty text for none.
    pub compressions: Vec<String>,
    /// Size of the chunks after decompression, bytes.
    pub uncompressed_bytes: u64,
    /// The file has an index of its chunks.
    pub indexed: bool,
    /// The file ends as a finished file does.
    pub finished: bool,
    /// Messages read.
    pub messages: u64,
    /// Names of metadata records.
    pub metadata: Vec<String>,
    /// What could not be read.
    pub damage: Vec<Damage>,
}

/// A part of a file that could not be read.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Damage {
    /// Where it begins, bytes from the start of the file.
    pub at_byte: u64,
    /// How much was lost there, bytes of the file.
    pub lost_bytes: u64,
    /// What was found.
    pub problem: String,
    /// Messages read from the damaged part all the same.
    pub recovered_messages: u64,
    /// Log time of the last message before it that was read, ns.
    pub last_good_ns: Option<i64>,
}

/// What was done with the messages of one stream.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct StreamHealth {
    /// The topic.
    pub topic: String,
    /// Messages in the bag.
    pub messages: u64,
    /// Samples in use.
    pub kept: u64,
    /// Samples that arrived after a later one, put in their place.
    pub late: u64,
    /// Repeated samples dropped: same stamp, same values.
    pub duplicates: u64,
    /// Samples dropped because a later message gave the same stamp other values.
    pub conflicts: u64,
    /// Messages dropped because their bytes do not decode.
    pub undecodable: u64,
    /// Samples dropped because their stamp is no time, or stands alone far from its neighbours.
    pub bad_stamps: u64,
    /// Values dropped because they are not finite or physically impossible.
    pub bad_values: u64,
    /// Samples left out because the clock restarted and the longer part was read.
    pub other_run: u64,
    /// The first of the dropped, with place, unit and limits.
    pub first_fault: Option<String>,
    /// Samples per second, from the median interval.
    pub rate_hz: f64,
    /// Intervals longer than five times the median.
    pub gaps: u64,
    /// The longest interval, s.
    pub longest_gap_s: f64,
}

/// Something that a user should read.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Warning {
    /// A part of a file could not be read.
    Damaged {
        /// The file.
        path: PathBuf,
        /// What and where.
        #[serde(flatten)]
        damage: Damage,
    },
    /// A file that `metadata.yaml` names is not there.
    FileMissing {
        /// The file.
        path: PathBuf,
    },
    /// `metadata.yaml` and the files disagree, or it cannot be read.
    Metadata {
        /// What is wrong.
        problem: String,
    },
    /// Samples were dropped.
    Dropped {
        /// The topic.
        topic: String,
        /// How many, and of how many.
        count: u64,
        /// Messages of the topic.
        of: u64,
        /// The first of them.
        first: String,
    },
    /// The clock of the stamps was set back.
    ClockRestart {
        /// The topic on which it shows first.
        topic: String,
        /// From this stamp, ns.
        from_ns: i64,
        /// To this stamp, ns.
        to_ns: i64,
        /// Samples left out, over all streams.
        left_out: u64,
    },
    /// A stream is absent, and a constant stands in for it.
    Filled {
        /// The topic.
        topic: String,
        /// What stands in.
        with: &'static str,
    },
    /// A stream pauses.
    Gap {
        /// The topic.
        topic: String,
        /// The longest pause, s.
        longest_s: f64,
        /// How many pauses.
        count: u64,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Damaged { path, damage } => {
                let Damage { at_byte, lost_bytes, problem, recovered_messages, last_good_ns } = damage;
                write!(f, "{}: {problem} at byte {at_byte}: {lost_bytes} bytes lost", path.display())?;
                if *recovered_messages > 0 {
                    write!(f, ", {recovered_messages} messages of the damaged part recovered")?;
                }
                match last_good_ns {
                    Some(time_ns) => write!(f, "; last message before it logged at {time_ns} ns"),
                    None => write!(f, "; no message before it"),
                }
            }
            Self::FileMissing { path } => {
                write!(
                    f,
                    "{}: named in metadata.yaml and not there; its part of the recording is missing",
                    path.display()
                )
            }
            Self::Metadata { problem } => write!(f, "metadata.yaml: {problem}"),
            Self::Dropped { topic, count, of, first } => {
                write!(f, "{topic}: dropped from {count} of {of} messages; first: {first}")
            }
            Self::ClockRestart { topic, from_ns, to_ns, left_out } => write!(
                f,
                "{topic}: time runs backwards from {from_ns} ns to {to_ns} ns: the clock restarted; the longer run is \
                 read, {left_out} samples of the others are left out"
            ),
            Self::Filled { topic, with } => write!(f, "{topic}: not in the bag; {with} stands in for it"),
            Self::Gap { topic, longest_s, count } => {
                write!(f, "{topic}: {count} gaps, the longest {longest_s:.3} s; values hold across them")
            }
        }
    }
}
