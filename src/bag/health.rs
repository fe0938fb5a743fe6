//! The health of a bag: what is damaged, dropped, late or doubled, counted and placed.

use std::collections::BTreeMap;
use std::fmt;
use std::path::PathBuf;

use serde::Serialize;

use super::topic_survey::PaceSurvey;
use super::{COMMAND_DEVIATION, Finding, Kind, SYNTHETIC, Severity};
use govtwin_model::units::seconds_from_nanos;

/// Everything worth knowing about a bag besides its values.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Health {
    /// The files, in order.
    pub files: Vec<FileHealth>,
    /// The streams that were read, in the order command, ESV, tank pressure, servo state.
    pub streams: Vec<StreamHealth>,
    /// What a user should read, most serious first.
    pub warnings: Vec<Warning>,
    /// What a reader of results should know besides; none of it speaks against them.
    pub notes: Vec<Finding>,
}

impl Health {
    /// Nothing to warn of.
    pub fn is_clean(&self) -> bool {
        self.warnings.is_empty()
    }

    /// Why nothing may be concluded from the recording, where its signals cannot be of one machine.
    pub fn disqualified(&self) -> Option<String> {
        let found = self.warnings.iter().filter_map(|warning| match warning {
            Warning::Doubtful(finding) if finding.severity == Severity::Disqualified => Some(finding.to_string()),
            _ => None,
        });
        let found: Vec<String> = found.collect();
        (!found.is_empty()).then(|| found.join("; "))
    }

    /// Why no measure may be taken of the recording: whatever makes its figures those of something else than the unit.
    pub fn untrusted(&self) -> Option<String> {
        let doubts = [Kind::Impossible, Kind::SeveralSenders, Kind::OtherClock, Kind::Frozen, Kind::Compressed];
        let found = self.warnings.iter().filter_map(|warning| match warning {
            Warning::Doubtful(finding) if doubts.contains(&finding.what) => Some(finding.to_string()),
            _ => None,
        });
        let found: Vec<String> = found.collect();
        (!found.is_empty()).then(|| found.join("; "))
    }

    /// What the bag states under a key of its metadata; the first of its files that has the key counts.
    pub fn about(&self, key: &str) -> Option<&str> {
        self.files.iter().find_map(|file| file.about.get(key)).map(String::as_str)
    }

    /// How far the command may have been from that of its messages, pu, between the few points of a historian: infinite where nobody says it; 0 where
    /// it was not compressed.
    pub fn command_deviation_pu(&self) -> f64 {
        let stated =
            |file: &FileHealth| file.about.get(COMMAND_DEVIATION)?.parse().ok().filter(|pu: &f64| !pu.is_nan());
        self.files.iter().filter_map(stated).fold(0.0, f64::max)
    }

    /// The bag states that its data was simulated and not measured.
    pub fn is_synthetic(&self) -> bool {
        self.about(SYNTHETIC) == Some("true")
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
    /// What rosbag2 compressed with zstd besides: `file`, `message`, or nothing.
    pub packed: &'static str,
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
    /// Messages whose bytes no checksum protects.
    pub unchecked_messages: u64,
    /// Messages that the file's own summary counts; `None` without one.
    pub stated_messages: Option<u64>,
    /// Names of metadata records.
    pub metadata: Vec<String>,
    /// Says that the program's own twin was simulated, and nothing measured ([`SIMULATOR`](crate::SIMULATOR)).
    pub from_the_twin: bool,
    /// What the program wrote of the bag ([`GOVTWIN`](crate::GOVTWIN)), by key; long texts are cut.
    pub about: BTreeMap<String, String>,
    /// What could not be read.
    pub damage: Vec<Damage>,
    /// Where indices, times and counts are not those of the messages.
    pub structure: Vec<String>,
}

impl FileHealth {
    /// What a user should read about the file.
    pub fn warnings(&self) -> impl Iterator<Item = Warning> {
        let damage = self.damage.iter();
        let damage = damage.map(|damage| Warning::Damaged { path: self.path.clone(), damage: damage.clone() });
        let stated = self.stated_messages.filter(|stated| *stated != self.messages);
        let structure = self.structure.iter();
        let structure =
            structure.map(|problem| Warning::Structure { path: self.path.clone(), problem: problem.clone() });
        damage
            .chain(stated.map(|stated| Warning::Count { path: self.path.clone(), stated, read: self.messages }))
            .chain(structure)
    }
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
    /// How often, from here on.
    pub places: u64,
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
    /// Samples dropped because their stamp is no time, or is far from its neighbours' stamps.
    pub bad_stamps: u64,
    /// Samples with a stamp of 0, which get the time of recording.
    pub unstamped: u64,
    /// Values dropped because they are not finite or physically impossible.
    pub bad_values: u64,
    /// Messages from which such values were dropped.
    pub bad_messages: u64,
    /// Samples left out because the clock jumped and the run with more samples was read.
    pub other_run: u64,
    /// The first of the dropped, with place, unit and limits.
    pub first_fault: Option<String>,
    /// How evenly the stamps of the samples in use follow each other.
    pub pace: PaceSurvey,
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
    /// A file's own count and the messages read differ.
    Count {
        /// The file.
        path: PathBuf,
        /// The count of the file's summary.
        stated: u64,
        /// What was read.
        read: u64,
    },
    /// Indices, times or counts of a file are not those of its messages; other readers may miss some.
    Structure {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        problem: String,
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
        /// Messages that were dropped, whole or in part.
        count: u64,
        /// Messages of the topic.
        of: u64,
        /// The first of them.
        first: String,
    },
    /// Samples arrived after later ones.
    Late {
        /// The topic.
        topic: String,
        /// How many.
        count: u64,
        /// Messages of the topic.
        of: u64,
    },
    /// Samples come from a sender without a clock.
    Unstamped {
        /// The topic.
        topic: String,
        /// How many.
        count: u64,
        /// Messages of the topic.
        of: u64,
    },
    /// The clock of the stamps was set back or forward.
    ClockJump {
        /// The topic on which it shows first.
        topic: String,
        /// From this stamp, ns.
        from_ns: i64,
        /// To this stamp, ns.
        to_ns: i64,
        /// How often it jumped.
        jumps: u64,
        /// Samples left out, over all streams.
        left_out: u64,
    },
    /// A stream is absent, and a constant replaces it.
    Filled {
        /// The topic.
        topic: String,
        /// The constant.
        with: &'static str,
    },
    /// An input begins after the recording, and rows begin when every input has a value.
    BeginsLate {
        /// The topic.
        topic: String,
        /// How long after the first stamp of all streams, s.
        late_s: f64,
        /// Rows before it.
        rows: u64,
    },
    /// An input ends before the recording.
    EndsEarly {
        /// The topic.
        topic: String,
        /// How long before the last stamp of all streams, s.
        early_s: f64,
    },
    /// An input goes on after the last command and measurement.
    GoesOn {
        /// The topic.
        topic: String,
        /// How long after them, s.
        more_s: f64,
    },
    /// Nothing was recorded for so long that the run with most samples is read.
    Pause {
        /// The topic on which it shows first.
        topic: String,
        /// From this stamp, ns.
        from_ns: i64,
        /// To this stamp, ns.
        to_ns: i64,
        /// How many pauses and jumps there are.
        pauses: u64,
        /// Samples left out, over all streams.
        left_out: u64,
    },
    /// Data that can be read and looks plausible, and may be wrong.
    Doubtful(Finding),
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
                let Damage { at_byte, lost_bytes, problem, places, recovered_messages, last_good_ns } = damage;
                write!(f, "{}: {problem} at byte {at_byte}: {lost_bytes} bytes lost", path.display())?;
                if *places > 1 {
                    write!(f, " in {places} places from there on")?;
                }
                if *recovered_messages > 0 {
                    write!(f, ", {recovered_messages} messages of the damaged part recovered")?;
                }
                match last_good_ns {
                    Some(time_ns) => write!(f, "; last message before it logged at {time_ns} ns"),
                    None => write!(f, "; no message before it"),
                }
            }
            Self::Count { path, stated, read } => {
                write!(f, "{}: its summary counts {stated} messages, {read} could be read", path.display())
            }
            Self::Structure { path, problem } => {
                write!(f, "{}: {problem}; read here all the same, other readers may miss messages", path.display())
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
            Self::Late { topic, count, of } => {
                write!(f, "{topic}: {count} of {of} samples arrived after later ones; put in the order of their stamps")
            }
            Self::Unstamped { topic, count, of } => {
                write!(f, "{topic}: {count} of {of} samples have stamp 0; the time of recording stands in for it")
            }
            Self::ClockJump { topic, from_ns, to_ns, jumps, left_out } => {
                let way = if to_ns < from_ns { "backwards" } else { "forwards" };
                let by_s = seconds_from_nanos(to_ns.saturating_sub(*from_ns).saturating_abs());
                write!(
                    f,
                    "{topic}: time jumps {way} by {by_s:.1} s, from {from_ns} ns to {to_ns} ns (jumps in all: {jumps}); the \
                     run with most samples is read, {left_out} samples of the others are left out"
                )
            }
            Self::Pause { topic, from_ns, to_ns, pauses, left_out } => {
                let for_s = seconds_from_nanos(to_ns.saturating_sub(*from_ns));
                write!(
                    f,
                    "{topic}: nothing is recorded for {for_s:.1} s, from {from_ns} ns to {to_ns} ns, by stamps and log times alike \
                     (pauses in all: {pauses}); the run with most samples is read, {left_out} samples of the others are left out; \
                     split the bag to read them"
                )
            }
            Self::Doubtful(finding) => write!(f, "{finding}"),
            Self::Filled { topic, with } => write!(f, "{topic}: not in the bag; {with} stands in for it"),
            Self::BeginsLate { topic, late_s, rows } => {
                write!(f, "{topic}: begins {late_s:.1} s after the recording: {rows} rows left out")
            }
            Self::EndsEarly { topic, early_s } => {
                write!(f, "{topic}: ends {early_s:.1} s before the recording: its last value holds")
            }
            Self::GoesOn { topic, more_s } => {
                write!(f, "{topic}: goes on {more_s:.1} s after the last command and measurement: left out")
            }
            Self::Gap { topic, longest_s, count } => {
                write!(f, "{topic}: {count} gaps, the longest {longest_s:.3} s; values hold across them")
            }
        }
    }
}
