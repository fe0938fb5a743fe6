//! What is in any bag, this project's or not: topics, types, counts, rates, gaps, jitter, stamps, values.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use serde::Serialize;

use super::layout::Layout;
use super::pace::Pace;
use super::topic::{RawView, TopicInfo};
use super::{BagError, FileHealth, Warning, source};

/// What is in a bag.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Survey {
    /// The files, in order.
    pub files: Vec<FileHealth>,
    /// The topics by name.
    pub topics: Vec<TopicSurvey>,
    /// Messages in all.
    pub messages: u64,
    /// Log time of the first message, ns; `None` in an empty bag.
    pub first_ns: Option<i64>,
    /// Log time of the last message, ns; `None` in an empty bag.
    pub last_ns: Option<i64>,
    /// What is wrong with the files.
    pub warnings: Vec<Warning>,
}

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

/// Looks through a whole bag.
///
/// # Errors
/// Where there is no bag at the path. Damage is no error.
pub fn survey(path: &Path) -> Result<Survey, BagError> {
    let source = source::open(path)?;
    let mut tallies: BTreeMap<(String, String), Tally> = BTreeMap::new();
    let mut known: Option<(Arc<TopicInfo>, (String, String))> = None;
    let scanned = source.scan(&mut |message| {
        // Messages of a topic mostly share one `Arc`; looking by name is for when they do not.
        let key = match &known {
            Some((topic, key)) if Arc::ptr_eq(topic, message.topic) => key,
            _ => &known.insert((Arc::clone(message.topic), key_of(message.topic))).1,
        };
        match tallies.get_mut(key) {
            Some(tally) => tally.take(message),
            None => tallies.entry(key.clone()).or_insert_with(|| Tally::new(message.topic)).take(message),
        }
    })?;
    let warnings = source.all_warnings(&scanned.files);
    for topic in &scanned.topics {
        tallies.entry(key_of(topic)).or_insert_with(|| Tally::new(topic));
    }
    let topics: Vec<TopicSurvey> = tallies.into_values().map(Tally::finish).collect();
    let busy = || topics.iter().filter(|topic| topic.messages > 0);
    Ok(Survey {
        files: scanned.files,
        messages: topics.iter().map(|topic| topic.messages).sum(),
        first_ns: busy().map(|topic| topic.log.first_ns).min(),
        last_ns: busy().map(|topic| topic.log.last_ns).max(),
        topics,
        warnings,
    })
}

fn key_of(topic: &TopicInfo) -> (String, String) {
    (topic.name.clone(), topic.type_name.clone())
}

/// A topic while its messages come in.
struct Tally {
    topic: Arc<TopicInfo>,
    layout: Option<Layout>,
    messages: u64,
    bytes: u64,
    log: Pace,
    stamps: Pace,
    delays_ns: Vec<i64>,
    undecodable: u64,
    fields: Vec<FieldSurvey>,
}

impl Tally {
    fn new(topic: &Arc<TopicInfo>) -> Self {
        let layout = Layout::of(topic);
        let field =
            |name: &String| FieldSurvey { name: name.clone(), finite: 0, nan: 0, infinite: 0, least: None, most: None };
        Self {
            topic: Arc::clone(topic),
            fields: layout.iter().flat_map(|layout| layout.names().iter().map(field)).collect(),
            layout,
            messages: 0,
            bytes: 0,
            log: Pace::default(),
            stamps: Pace::default(),
            delays_ns: vec![],
            undecodable: 0,
        }
    }

    fn take(&mut self, message: RawView<'_>) {
        self.messages += 1;
        self.bytes += message.data.len() as u64;
        self.log.push(message.log_time_ns);
        let Some(layout) = &self.layout else { return };
        let fields = &mut self.fields;
        let walked = layout.walk(message.data, &mut |name, value| {
            if let Some(field) = fields.get_mut(name) {
                field.take(value);
            }
        });
        let Some(stamp) = walked else {
            self.undecodable += 1;
            return;
        };
        if let Some(stamp_ns) = stamp.and_then(crate::msg::Time::nanos) {
            self.stamps.push(stamp_ns);
            self.delays_ns.push(message.log_time_ns.saturating_sub(stamp_ns));
        }
    }

    fn finish(mut self) -> TopicSurvey {
        self.delays_ns.sort_unstable();
        let delay_s = |share: usize| {
            let last = self.delays_ns.len().saturating_sub(1);
            self.delays_ns.get(last * share / 100).map_or(f64::NAN, |ns| crate::units::seconds_from_nanos(*ns))
        };
        let stamped = self.layout.as_ref().is_some_and(Layout::is_stamped) && !self.delays_ns.is_empty();
        let schema_hash = self.layout.as_ref().map(|layout| layout.type_hash.as_str());
        let stated_hash = Some(self.topic.type_hash.as_str()).filter(|hash| !hash.is_empty());
        TopicSurvey {
            name: self.topic.name.clone(),
            type_name: self.topic.type_name.clone(),
            encoding: self.topic.encoding.clone(),
            type_hash: self.topic.type_hash.clone(),
            type_hash_fits: stated_hash.zip(schema_hash).map(|(stated, schema)| stated == schema),
            messages: self.messages,
            bytes: self.bytes,
            log: self.log.finish(),
            delay_s: stamped.then(|| Spread { least: delay_s(0), median: delay_s(50), most: delay_s(100) }),
            stamps: stamped.then(|| self.stamps.finish()),
            undecodable: self.undecodable,
            readable: self.layout.is_some(),
            nan: self.fields.iter().map(|field| field.nan).sum(),
            infinite: self.fields.iter().map(|field| field.infinite).sum(),
            fields: self.fields,
        }
    }
}

impl FieldSurvey {
    fn take(&mut self, value: f64) {
        if value.is_finite() {
            self.finite += 1;
            self.least = Some(self.least.map_or(value, |least| least.min(value)));
            self.most = Some(self.most.map_or(value, |most| most.max(value)));
        } else if value.is_nan() {
            self.nan += 1;
        } else {
            self.infinite += 1;
        }
    }
}
