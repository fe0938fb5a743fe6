//! Rows of a bag with any types: each signal is a field of the messages of some topic.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::ImportError;
use super::map::{Map, SignalPlace};
use super::row::ImportedRow;
use super::source::channel::{ChannelValue, SourceChannel};
use super::source::{Source, SourceNotes};
use crate::bag::{FieldPath, FieldReader, FieldValue, MergedMessages, TopicInfo, messages};
use crate::params::nearest;

/// A signal, its field, and the reader of its topic.
struct MappedSignal {
    path: FieldPath,
    reader: usize,
    channel: SourceChannel,
    /// Messages that do not hold the field.
    absent: u64,
}

/// A bag as a source of rows.
pub(super) struct BagRows {
    path: PathBuf,
    messages: MergedMessages,
    readers: Vec<(Arc<TopicInfo>, FieldReader)>,
    wanted: Vec<MappedSignal>,
    by_log: bool,
    total: u64,
    passed: u64,
    undated: u64,
    notes: Vec<String>,
}

impl BagRows {
    /// Opens a bag by a map.
    pub(super) fn open(path: &Path, map: &Map) -> Result<Self, ImportError> {
        let messages = messages(path)?;
        let wrong = |problem: String| ImportError::file(path, problem);
        let mut readers: Vec<(Arc<TopicInfo>, FieldReader)> = vec![];
        let mut wanted = vec![];
        for (signal, one) in map.signals.iter().enumerate() {
            let SignalPlace::Field(field) = &one.from else { continue };
            let id = one.target.id();
            let field = FieldPath::parse(field).map_err(|problem| wrong(format!("{id}: {problem}")))?;
            let Some(topic) = messages.topics().iter().find(|topic| topic.name == field.topic) else { continue };
            let known = readers.iter().position(|(known, _)| known.name == topic.name);
            let reader = if let Some(known) = known {
                known
            } else {
                let reader =
                    FieldReader::new(topic).map_err(|problem| wrong(format!("topic `{}`: {problem}", topic.name)))?;
                readers.push((Arc::clone(topic), reader));
                readers.len() - 1
            };
            readers[reader].1.check(&field).map_err(|problem| wrong(format!("{id}: {problem}")))?;
            wanted.push(MappedSignal { path: field, reader, channel: SourceChannel::new(signal, one), absent: 0 });
        }
        let notes =
            readers.iter().map(|(topic, _)| format!("topic {} of type {}", topic.name, topic.type_name)).collect();
        let total = messages.files().iter().map(|file| file.messages).sum();
        let path = path.to_owned();
        let by_log = map.time.by_log;
        Ok(Self { path, messages, readers, wanted, by_log, total, passed: 0, undated: 0, notes })
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
            let Some(reader) = self.readers.iter().position(|(topic, _)| topic.name == message.topic.name) else {
                continue;
            };
            let stamp_ns = self.readers[reader].1.stamp_ns(&message.data).filter(|_| !self.by_log);
            self.undated += u64::from(stamp_ns.is_none() && !self.by_log);
            let mut row = ImportedRow::at(stamp_ns.unwrap_or(message.log_time_ns));
            for wanted in self.wanted.iter_mut().filter(|wanted| wanted.reader == reader) {
                match self.readers[reader].1.value(&wanted.path, &message.data) {
                    Some(FieldValue::Number(number)) => {
                        wanted.channel.take(ChannelValue::Number(number), self.passed, &mut row);
                    }
                    Some(FieldValue::Text(text)) => {
                        wanted.channel.take(ChannelValue::Text(&text), self.passed, &mut row);
                    }
                    None => wanted.absent += 1,
                }
            }
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
        self.wanted.iter().map(|wanted| wanted.channel.signal).collect()
    }

    fn said(&self) -> SourceNotes {
        let path = self.path.display();
        let mut said =
            SourceNotes { notes: self.notes.iter().map(|note| format!("{path}: {note}")).collect(), warnings: vec![] };
        said.warnings.extend(self.messages.warnings().iter().map(|warning| format!("{path}: {warning}")));
        if self.undated > 0 {
            let count = self.undated;
            said.notes
                .push(format!("{path}: {count} messages have no stamp of their own; the time of recording stands in"));
        }
        for wanted in &self.wanted {
            let (id, place) = (wanted.channel.map.target.id(), wanted.channel.map.place().unwrap_or_default());
            if wanted.absent > 0 {
                said.warnings.push(format!("{path}: {id} (`{place}`): {} messages do not hold it", wanted.absent));
            }
            if let Some((message, text)) = &wanted.channel.bad.first {
                let count = wanted.channel.bad.count;
                said.warnings.push(format!(
                    "{path}: {id} (`{place}`): {count} values are no numbers, the first `{text}` in message {message}"
                ));
            }
        }
        said
    }
}
