//! What is in any bag, this project's or not: topics, types, counts, rates, gaps, jitter, stamps, values.

use std::path::Path;

use serde::Serialize;

use super::source::{self, BagSource, Scanned};
use super::tally::Tallies;
use super::topic::shown;
use super::topic_survey::TopicSurvey;
use super::{BagError, FileHealth, Finding, Warning};

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
    /// What is to be known besides.
    pub notes: Vec<Finding>,
}

/// Looks through a whole bag.
///
/// # Errors
/// Where there is no bag at the path. Damage is no error.
pub fn survey(path: &Path) -> Result<Survey, BagError> {
    let source = source::open(path)?;
    let mut tallies = Tallies::default();
    let scanned = source.scan(&mut |message| tallies.take(message))?;
    Ok(of(&source, scanned, tallies))
}

/// The findings once all messages are counted.
pub(super) fn of(source: &BagSource, scanned: Scanned, mut tallies: Tallies) -> Survey {
    let mut warnings = source.all_warnings(&scanned.files);
    let notes = source.notes(&scanned.files);
    for topic in &scanned.topics {
        tallies.of(topic);
    }
    let topics = tallies.finish();
    let counts = source.metadata.iter().flat_map(|metadata| &metadata.counts);
    let read =
        |name: &String| topics.iter().filter(|topic| topic.name == *name).map(|topic| topic.messages).sum::<u64>();
    let other = counts.filter(|(name, count)| read(name) != **count).map(|(name, count)| Warning::Metadata {
        problem: format!("counts {count} messages on {}, the files hold {}", shown(name), read(name)),
    });
    warnings.extend(other);
    let busy = || topics.iter().filter(|topic| topic.messages > 0);
    Survey {
        files: scanned.files,
        messages: topics.iter().map(|topic| topic.messages).sum(),
        first_ns: busy().map(|topic| topic.log.first_ns).min(),
        last_ns: busy().map(|topic| topic.log.last_ns).max(),
        topics,
        warnings,
        notes,
    }
}
