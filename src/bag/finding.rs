//! Findings: data that can be read and looks plausible, but may be wrong.

use std::fmt;

use serde::Serialize;

/// What follows from a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// The data can be right; a reader of results should know it.
    Note,
    /// Results may be wrong: the command ends with warnings.
    Warning,
    /// Results would be wrong: the values are left out, and where nothing is left, the bag is refused.
    Disqualified,
}

/// What was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// More than one sender on a topic.
    SeveralSenders,
    /// Stamps later than the time of recording.
    StampsAhead,
    /// A clock that runs faster or slower than another.
    ClockDrift,
    /// Stamps that run at another rate than the time of recording, as when a bag was played.
    Played,
    /// Numbers missing in a sender's count of its messages.
    Lost,
    /// Single samples far from both neighbours.
    Outliers,
    /// A signal that stays the same to the last bit while others move.
    Frozen,
    /// A signal that is cut off at a value.
    Saturated,
    /// A signal that never changes.
    Constant,
    /// No number in any measured signal.
    NothingMeasured,
    /// No number in one measured signal.
    NotMeasured,
    /// Commands outside the stroke.
    BeyondStroke,
    /// Data whose bytes no checksum protects.
    NoChecksum,
    /// Nothing states how many messages there should be.
    NoCount,
    /// Messages of another definition of their type.
    OtherDefinition,
    /// Stamps of another clock than those of the other streams.
    OtherClock,
    /// A pressure that no governor's oil supply has.
    OtherUnit,
    /// A command of which a historian kept few points.
    Compressed,
    /// Signals that cannot be of one machine, or not of its time.
    Impossible,
}

/// One finding.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was found.
    pub what: Kind,
    /// What follows from it.
    pub severity: Severity,
    /// The topic, or the file.
    pub subject: String,
    /// The signal, where the finding is on one of several in a message.
    pub signal: Option<&'static str>,
    /// The finding in words, with figures and units.
    pub words: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.signal {
            Some(signal) => write!(f, "{}: {signal} {}", self.subject, self.words),
            None => write!(f, "{}: {}", self.subject, self.words),
        }
    }
}
