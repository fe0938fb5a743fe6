//! Bags: recordings in and out of files as rosbag2 writes them.
//!
//! [`read()`] turns a bag into a [`Recording`]: decoded, checked, aligned. [`messages`] gives what is in
//! it as it is, in log-time order. [`survey()`] reports what is in any bag. [`Writer`] makes one that rosbag2,
//! Foxglove and PlotJuggler open. What was damaged, dropped or moved is counted and placed in [`Health`].
//!
//! # From streams to rows
//! Streams have their own rates and jitter. The rule that makes rows of them:
//!
//! 1. A value's time is its `header.stamp`. Log time only orders arrival. A stamp of 0 is a sender without a
//!    clock, which log time replaces, unless other stamps of the bag are near 0, too.
//! 2. Late samples go to their place. Of samples with one stamp the last logged stays. Values that are
//!    not finite or physically impossible, and stamps far from their neighbours, are dropped. Where the
//!    clock of the stamps jumps, or nothing is recorded for more than 600 s, the run with most samples is
//!    read. All of it is counted.
//! 3. There is one row for each distinct stamp of any stream, and one for each point of the grid where
//!    linear interpolation is asked for; rows rise strictly in time.
//! 4. An input is the newest value at or before the row; a force on the piston is 0 before its first one. Under linear interpolation, command and
//!    pressure run straight between their samples instead; the ESV always holds. Sharp interpolation puts
//!    a bend of the command that lies between two samples where the lines of both sides meet.
//! 5. `measured` is there only in rows whose time is the stamp of a servo state; it is never interpolated.
//! 6. Rows begin when every input has a value, and end at the last command or servo state.

pub mod cdr;
pub mod import;
pub mod msg;

mod align;
mod batch;
mod chain;
mod channel;
mod channels;
mod chunk;
mod clock;
mod collect;
mod correlation;
#[cfg(feature = "sqlite")]
mod db3;
mod distribution;
mod edges;
mod error;
mod evidence;
mod extras;
mod field;
mod finding;
mod findings;
mod grid;
mod growing;
mod health;
mod layout;
mod live;
mod look;
mod mcap_file;
mod memory;
mod merge;
mod metadata;
mod newest;
mod order;
mod pace;
mod qualification;
mod read;
mod record;
mod record_file;
mod recover;
mod reserve;
mod segment;
mod source;
mod streams;
mod structure;
mod survey;
mod tally;
mod topic;
mod topic_survey;
mod translation;
mod unfinished;
mod unpack;
mod writer;

use std::fmt;

use govtwin_model::parameters::ChannelReadings;
use govtwin_model::recording::Recording;
use govtwin_model::units::{TICK_NS, nanos_from_seconds, seconds_from_nanos};

pub use align::FARTHEST_NS;
pub use chain::Followed;
pub use error::BagError;
pub use field::{FieldPath, FieldReader, FieldValue};
pub use finding::{Finding, Kind, Severity};
pub use growing::{Growing, Grown};
pub use health::{Damage, FileHealth, Health, StreamHealth, Warning};
pub use look::{NeedsAll, Overview, Rows, RowsOfMessages, look, read_rows};
pub use memory::InMemory;
pub use merge::{MergedMessages, messages};
pub use newest::Newest;
pub use qualification::{TANK_PA, unit_of_pressure};
pub use read::read;
pub use recover::{Recovered, broken_off, intended_place, recover};
pub use survey::{Survey, survey};
pub use topic::{Qos, RawMessage, TopicInfo};
pub use topic_survey::{FieldSurvey, PaceSurvey, Spread, TopicSurvey};
pub use writer::{Sealed, Topic, Writer, WriterOptions};

/// Name of the metadata record in which the program describes what it wrote.
pub const GOVTWIN: &str = "govtwin";
/// Key there of what was simulated.
pub const SIMULATOR: &str = "simulator";
/// Its text where that was the twin itself.
pub const TWIN: &str = "twin";
/// Key there that is `true` where the data was simulated and not measured.
pub const SYNTHETIC: &str = "synthetic";
/// Key there of how far the command may have been from that of its messages, pu: between the few points of a historian.
pub const COMMAND_DEVIATION: &str = "command_deviation_pu";
/// Key there for where the data comes from, in words.
pub const ORIGIN: &str = "origin";

/// A recording with the findings on its bag.
#[derive(Clone, Debug, PartialEq)]
pub struct Loaded {
    /// The rows.
    pub recording: Recording,
    /// What was damaged, dropped, late or doubled.
    pub health: Health,
}

/// The streams that a recording is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stream {
    /// `governor_msgs/msg/GovernorCommand`.
    Command,
    /// `governor_msgs/msg/EsvState`.
    Esv,
    /// `sensor_msgs/msg/FluidPressure`.
    TankPressure,
    /// `governor_msgs/msg/ServoState`.
    ServoState,
    /// `sensor_msgs/msg/JointState`: the force on the piston that the node takes as a joint command. Few recordings have it.
    Load,
}

impl Stream {
    /// The four that recordings of a servo system have, in the order of health reports.
    pub const ALL: [Self; 4] = [Self::Command, Self::Esv, Self::TankPressure, Self::ServoState];

    /// All that are read.
    pub const READ: [Self; 5] = [Self::Command, Self::Esv, Self::TankPressure, Self::ServoState, Self::Load];

    /// The three that act on the servo system.
    pub const INPUTS: [Self; 3] = [Self::Command, Self::Esv, Self::TankPressure];
}

impl fmt::Display for Stream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Command => "command",
            Self::Esv => "esv",
            Self::TankPressure => "tank_pressure",
            Self::ServoState => "servo_state",
            Self::Load => "load",
        })
    }
}

/// Topic names of the streams.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topics {
    /// Topic of [`Stream::Command`].
    pub command: String,
    /// Topic of [`Stream::Esv`].
    pub esv: String,
    /// Topic of [`Stream::TankPressure`].
    pub tank_pressure: String,
    /// Topic of [`Stream::ServoState`].
    pub servo_state: String,
    /// Topic of [`Stream::Load`].
    pub load: String,
    /// Stamps are of clocks that differ: each stream is moved onto the recorder's clock, by the least delay of a message.
    pub by_log: bool,
}

impl Default for Topics {
    fn default() -> Self {
        Self {
            command: "/governor/command".into(),
            esv: "/governor/esv".into(),
            tank_pressure: "/governor/tank_pressure".into(),
            servo_state: "/plant/servo_state".into(),
            load: "/sim/joint_commands".into(),
            by_log: false,
        }
    }
}

impl Topics {
    /// The topic of a stream.
    pub fn of(&self, stream: Stream) -> &str {
        match stream {
            Stream::Command => &self.command,
            Stream::Esv => &self.esv,
            Stream::TankPressure => &self.tank_pressure,
            Stream::ServoState => &self.servo_state,
            Stream::Load => &self.load,
        }
    }

    /// Names another topic for a stream.
    pub fn set(&mut self, stream: Stream, name: &str) {
        let topic = match stream {
            Stream::Command => &mut self.command,
            Stream::Esv => &mut self.esv,
            Stream::TankPressure => &mut self.tank_pressure,
            Stream::ServoState => &mut self.servo_state,
            Stream::Load => &mut self.load,
        };
        name.clone_into(topic);
    }
}

/// What the inputs do between their samples. The ESV always holds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// Command and tank pressure hold until the next sample.
    #[default]
    Hold,
    /// Command and tank pressure run straight from sample to sample. Rows are added on a grid that
    /// starts at the first row, so that the twin sees the slope. It looks ahead: not for live use.
    Linear {
        /// Time between added rows, ns; at least 1.
        period_ns: i64,
    },
    /// The same, but where the command bends sharply between two samples it runs along the straight lines of both sides up to where
    /// they meet: a ramp that begins or ends between two slow samples then does so in time. Without a command no rows are added.
    Sharp {
        /// Time between added rows, ns; at least 1.
        period_ns: i64,
    },
}

impl Interpolation {
    /// Time between added rows, ns; none where none are added.
    pub fn period_ns(self) -> Option<i64> {
        match self {
            Self::Hold => None,
            Self::Linear { period_ns } | Self::Sharp { period_ns } => Some(period_ns.max(1)),
        }
    }
}

/// What the numbers of recorded positions mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Positions {
    /// Pu, as the messages define; impossible values are dropped.
    #[default]
    Pu,
    /// Spool and servomotor in units of their own, which are read as pu.
    Recorded(ChannelReadings),
    /// Anything that rises and falls with the position, taken as it is.
    AnyUnit,
}

impl Positions {
    /// As a unit's file defines.
    pub fn of(channels: ChannelReadings) -> Self {
        if channels == ChannelReadings::default() { Self::Pu } else { Self::Recorded(channels) }
    }

    /// A twin's tick by the clock of the recording, ns; none where the clock of a stage is found from what it does.
    fn tick_ns(self) -> Option<i64> {
        match self {
            Self::Pu => Some(TICK_NS),
            Self::Recorded(channels) => {
                Some(nanos_from_seconds(seconds_from_nanos(TICK_NS) / channels.clock_ratio).max(1))
            }
            Self::AnyUnit => None,
        }
    }
}

/// How a bag is to be read.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// Where the streams are.
    pub topics: Topics,
    /// What the inputs do between samples.
    pub interpolation: Interpolation,
    /// Streams without which the bag is refused; the three inputs by default.
    ///
    /// Others that are absent are replaced by a constant, which the health lists: command NaN, ESV
    /// normal, tank pressure NaN, measured signals NaN.
    pub required: Vec<Stream>,
    /// What the numbers of positions mean.
    pub positions: Positions,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            topics: Topics::default(),
            interpolation: Interpolation::default(),
            required: Stream::INPUTS.to_vec(),
            positions: Positions::default(),
        }
    }
}
