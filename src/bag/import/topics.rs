//! Rows of a bag with any types: each signal is a field of the messages of some topic.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::ImportError;
use super::map::Map;
use super::messages::{MappedTopic, topics_of};
use super::row::ImportedRow;
use super::source::channel::SourceChannel;
use super::source::{Source, SourceNotes};
use crate::{MergedMessages, TopicInfo, messages};
use govtwin_model::params::nearest;

/// A bag as a source of rows.
pub(super) struct BagRows {
    path: PathBuf,
    messages: MergedMessages,
    topics: Vec<(Arc<TopicInfo>, MappedTopic)>,
    total: u64,
    passed: u64,
    notes: Vec<String>,
}

impl BagRows {
    /// Opens a bag by a map.
    pub(super) fn open(path: &Path, map: &Map) -> Result<Self, ImportError> {
        let messages = messages(path)?;
        let wrong = |problem: String| ImportError::file(path, problem);
        let fields = map.fields().map_err(wrong)?;
        let mut topics = vec![];
        for name in topics_of(&fields) {
            let Some(topic) = messages.topics().iter().find(|topic| topic.name == name) else { continue };
            topics.push((Arc::clone(topic), MappedTopic::new(&name, topic, &fields, map).map_err(wrong)?));
        }
        let note = |topic: &TopicInfo| format!("topic {} of type {}", topic.name, topic.type_name);
        let notes = topics.iter().map(|(topic, _)| note(topic)).collect();
        let total = messages.files().iter().map(|file| file.messages).sum();
        Ok(Self { path: path.to_owned(), messages, topics, total, passed: 0, notes })
    }

    /// All channels in the order of the map, each with how many messages did not hold its field.
    fn channels(&self) -> Vec<(&SourceChannel, u64)> {
        let mut channels: Vec<_> = self.topics.iter().flat_map(|(_, topic)| topic.channels()).collect();
        channels.sort_by_key(|(channel, _)| channel.signal);
        channels
    }
}

/// What to say of a topic that is not in a bag.
pub(super) fn absent(path: &Path, field: &str) -> Result<String, ImportError> {
    const MOST: usize = 30;
    let messages = messages(path)?;
    let topic = field.split('.').next().unwrap_or(field);
    let names = || messages.topics().iter().map(|topic| topic.name.as_str());
    let hint = nearest(topic, names()).map_or(String::new(), |near| format!(" did you mean `{near}`?"));
    let mut list: Vec<String> =
        messages.topics().iter().take(MOST).map(|topic| format!("{} ({})", topic.name, topic.type_name)).collect();
    if messages.topics().len() > MOST {
        list.push(format!("and {} more", messages.topics().len() - MOST));
    }
    Ok(format!("there is no topic `{topic}`;{hint} topics: {}", list.join(", ")))
}

impl Source for BagRows {
    fn next(&mut self) -> Result<Option<ImportedRow>, ImportError> {
        for message in self.messages.by_ref() {
            let message = message?;
            self.passed += 1;
            let known = self.topics.iter_mut().find(|(topic, _)| topic.name == message.topic.name);
            let Some((announced, topic)) = known else { continue };
            if !Arc::ptr_eq(announced, &message.topic) {
                let wrong = |problem: String| ImportError::file(&self.path, problem);
                topic.by_definition(&message.topic).map_err(wrong)?;
                *announced = Arc::clone(&message.topic);
            }
            let row = topic.take(&message.data, message.log_time_ns, self.passed);
            if !row.is_empty() {
                return Ok(Some(row));
            }
        }
        Ok(None)
    }

    fn share(&self) -> f64 {
        self.passed as f64 / self.total.max(1) as f64
    }

    fn holds(&self) -> Vec<usize> {
        self.channels().iter().map(|(channel, _)| channel.signal).collect()
    }

    fn said(&self) -> SourceNotes {
        let path = self.path.display();
        let mut said =
            SourceNotes { notes: self.notes.iter().map(|note| format!("{path}: {note}")).collect(), warnings: vec![] };
        said.warnings.extend(self.messages.warnings().iter().map(|warning| format!("{path}: {warning}")));
        let undated: u64 = self.topics.iter().map(|(_, topic)| topic.undated()).sum();
        if undated > 0 {
            said.notes.push(format!(
                "{path}: {undated} messages have no stamp of their own; the time of recording stands in"
            ));
        }
        said.warnings
            .extend(self.topics.iter().flat_map(|(_, topic)| topic.doubtful()).map(|words| format!("{path}: {words}")));
        for (channel, absent) in self.channels() {
            let (id, place) = (channel.map.target.id(), channel.map.place().unwrap_or_default());
            if absent > 0 {
                said.warnings.push(format!("{path}: {id} (`{place}`): {absent} messages do not hold it"));
            }
            if let Some((message, text)) = &channel.bad.first {
                let count = channel.bad.count;
                said.warnings.push(format!(
                    "{path}: {id} (`{place}`): {count} values are no numbers, the first `{text}` in message {message}"
                ));
            }
        }
        said
    }
}
