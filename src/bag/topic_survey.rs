//! What is on a topic: counts, pace, delays, and the range of each field.

use serde::Serialize;

/// What is on a topic.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TopicSurvey {
    /// Name.
    pub name: String,
    /// Type, `package/msg/Type`.
    pub type_name: String,
    /// Encoding of the messages.
    pub encoding: String,
    /// REP-2016 hash that the bag states; empty where it does not.
    pub type_hash: String,
    /// Whether the stated hash is that of the schema beside it; `None` where one of them is missing.
    pub type_hash_fits: Option<bool>,
    /// Messages.
    pub messages: u64,
    /// Size of the messages, bytes.
    pub bytes: u64,
    /// Pace by log time.
    pub log: PaceSurvey,
    /// Pace by stamp; `None` where the messages carry none.
    pub stamps: Option<PaceSurvey>,
    /// How much later than their stamp messages were recorded, s; `None` without stamps.
    pub delay_s: Option<Spread>,
    /// Messages that their schema does not fit.
    pub undecodable: u64,
    /// Whether the messages could be looked into at all.
    pub readable: bool,
    /// Floating-point numbers that are NaN.
    pub nan: u64,
    /// Floating-point numbers that are infinite.
    pub infinite: u64,
    /// Each floating-point field.
    pub fields: Vec<FieldSurvey>,
}

/// How evenly messages follow each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PaceSurvey {
    /// The earliest time, ns.
    pub first_ns: i64,
    /// The latest time, ns.
    pub last_ns: i64,
    /// Messages per second, from the median interval; 0 below two messages.
    pub rate_hz: f64,
    /// The 99th percentile of how far intervals are from the median, s.
    pub jitter_s: f64,
    /// Intervals longer than five times the median.
    pub gaps: u64,
    /// The longest interval, s.
    pub longest_gap_s: f64,
    /// Where the longest interval begins, ns.
    pub longest_gap_at_ns: i64,
    /// Times earlier than a time before them.
    pub backwards: u64,
    /// Times that repeat.
    pub repeated: u64,
}

/// Least, middle and most of some quantity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// The least, in the quantity's unit.
    pub least: f64,
    /// The median, in the quantity's unit.
    pub median: f64,
    /// The most, in the quantity's unit.
    pub most: f64,
}

/// One floating-point field of a type; elements of an array count as one field.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FieldSurvey {
    /// Path, `pose.position.x`.
    pub name: String,
    /// Values that are finite.
    pub finite: u64,
    /// Values that are NaN.
    pub nan: u64,
    /// Values that are infinite.
    pub infinite: u64,
    /// The least finite value, `None` where there is none, in the field's unit.
    pub least: Option<f64>,
    /// The greatest finite value, `None` where there is none, in the field's unit.
    pub most: Option<f64>,
}
