//! The schemas and channels of a file, and the messages that refer to them.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::record::Record;
use super::topic::{HASH_KEY, QOS_KEY, RawView, TopicInfo};

/// Schemas and channels met so far.
#[derive(Debug, Default)]
pub(super) struct Channels {
    schemas: BTreeMap<u16, Schema>,
    topics: BTreeMap<u16, Arc<TopicInfo>>,
}

/// A schema; the text is in memory once, however many channels have it.
#[derive(Clone, Debug, Default)]
struct Schema {
    name: String,
    encoding: String,
    data: Arc<[u8]>,
}

impl Channels {
    /// Channels that are known beforehand.
    #[cfg(feature = "sqlite")]
    pub(super) fn of(topics: BTreeMap<u16, Arc<TopicInfo>>) -> Self {
        Self { schemas: BTreeMap::new(), topics }
    }

    /// The topics in the order of their channel numbers.
    pub(super) fn topics(&self) -> impl Iterator<Item = (u16, &Arc<TopicInfo>)> {
        self.topics.iter().map(|(id, topic)| (*id, topic))
    }

    /// Adds what topics do not state themselves: qualities of service and type hash by name.
    pub(super) fn complete(&mut self, known: &BTreeMap<String, (String, String)>) {
        for topic in self.topics.values_mut() {
            complete(topic, known);
        }
    }

    /// Takes in a schema or channel record; others pass by.
    pub(super) fn take_in(&mut self, record: &Record<'_>) {
        match record {
            Record::Schema { id, name, encoding, data } => {
                let same = |known: &Schema| known.name == *name && known.encoding == *encoding && *known.data == **data;
                if !self.schemas.get(id).is_some_and(same) {
                    let (name, encoding) = ((*name).to_owned(), (*encoding).to_owned());
                    self.schemas.insert(*id, Schema { name, encoding, data: (*data).into() });
                }
            }
            Record::Channel { id, schema_id, topic, encoding, metadata } => {
                let Schema { name: type_name, encoding: schema_encoding, data: schema } =
                    self.schemas.get(schema_id).cloned().unwrap_or_default();
                let mut metadata: BTreeMap<String, String> =
                    metadata.iter().map(|(key, text)| ((*key).to_owned(), (*text).to_owned())).collect();
                let mut text = |key: &str| metadata.remove(key).unwrap_or_default();
                let info = TopicInfo {
                    name: (*topic).to_owned(),
                    type_name,
                    encoding: (*encoding).to_owned(),
                    schema_encoding,
                    schema,
                    offered_qos_profiles: text(QOS_KEY),
                    type_hash: text(HASH_KEY),
                    metadata,
                };
                // Summary and data both hold the channel; the same `Arc` stays so that comparing is cheap.
                if !self.topics.get(id).is_some_and(|known| is_same(known, &info)) {
                    self.topics.insert(*id, Arc::new(info));
                }
            }
            _ => {}
        }
    }

    /// One message on a known channel.
    pub(super) fn view<'a>(&'a self, record: &Record<'a>) -> Option<RawView<'a>> {
        let Record::Message { channel_id, sequence, log_time_ns, publish_time_ns, data } = *record else { return None };
        Some(RawView {
            topic: self.topics.get(&channel_id)?,
            log_time_ns: i64::try_from(log_time_ns).unwrap_or(i64::MAX),
            publish_time_ns: i64::try_from(publish_time_ns).unwrap_or(i64::MAX),
            sequence,
            data,
        })
    }
}

/// Adds what a topic does not state itself.
pub(super) fn complete(topic: &mut Arc<TopicInfo>, known: &BTreeMap<String, (String, String)>) {
    let Some((profiles, type_hash)) = known.get(&topic.name) else { return };
    let (no_profiles, no_hash) = (topic.offered_qos_profiles.is_empty(), topic.type_hash.is_empty());
    if (no_profiles && !profiles.is_empty()) || (no_hash && !type_hash.is_empty()) {
        let topic = Arc::make_mut(topic);
        if no_profiles {
            topic.offered_qos_profiles.clone_from(profiles);
        }
        if no_hash {
            topic.type_hash.clone_from(type_hash);
        }
    }
}

/// Whether a channel is announced again as it was; of schemas it is enough to ask whether they are one.
fn is_same(known: &TopicInfo, other: &TopicInfo) -> bool {
    let schema = Arc::ptr_eq(&known.schema, &other.schema) || (known.schema.is_empty() && other.schema.is_empty());
    schema
        && known.name == other.name
        && known.type_name == other.type_name
        && known.encoding == other.encoding
        && known.schema_encoding == other.schema_encoding
        && known.offered_qos_profiles == other.offered_qos_profiles
        && known.type_hash == other.type_hash
        && known.metadata == other.metadata
}
