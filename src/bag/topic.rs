//! Topics and messages as they stand in a bag, undecoded.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::msg::definition::DefinitionError;
use crate::msg::{Interface, definition, type_hash};

/// Keys of what rosbag2 keeps beside a channel.
pub(super) const QOS_KEY: &str = "offered_qos_profiles";
pub(super) const HASH_KEY: &str = "topic_type_hash";

/// A topic by a bag's metadata.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TopicInfo {
    /// Name, `/governor/command`.
    pub name: String,
    /// Full type name, `package/msg/Type`; empty if the bag does not state it.
    pub type_name: String,
    /// Encoding of the messages, `cdr`.
    pub encoding: String,
    /// Language of the schema, `ros2msg`.
    pub schema_encoding: String,
    /// The schema, which topics of one type share.
    pub schema: Arc<[u8]>,
    /// Quality of service as YAML, as rosbag2 keeps it; empty if the bag does not state it.
    pub offered_qos_profiles: String,
    /// REP-2016 hash of the type; empty if the bag does not state it.
    pub type_hash: String,
    /// What else the bag keeps beside the channel.
    pub metadata: BTreeMap<String, String>,
}

impl TopicInfo {
    /// A topic of a type whose definition the crate carries.
    ///
    /// # Errors
    /// Where it does not.
    pub fn of<T: Interface>(name: &str, qos: Qos) -> Result<Self, DefinitionError> {
        Ok(Self {
            name: name.to_owned(),
            type_name: T::TYPE_NAME.to_owned(),
            encoding: "cdr".to_owned(),
            schema_encoding: "ros2msg".to_owned(),
            schema: definition::schema_of(T::TYPE_NAME)?.into_bytes().into(),
            offered_qos_profiles: qos.to_yaml(),
            type_hash: type_hash::type_hash(T::TYPE_NAME)?,
            metadata: BTreeMap::new(),
        })
    }

    /// What tells its messages from others of the same name: their type and its definition.
    pub(super) fn definition(&self) -> MessageDefinition {
        let Self { name, type_name, encoding, schema_encoding, schema, .. } = self;
        let texts = [name, type_name, encoding, schema_encoding].map(String::clone);
        MessageDefinition { texts, schema: Arc::clone(schema) }
    }

    /// What rosbag2 keeps beside a channel, and whatever else stood there.
    pub(super) fn channel_metadata(&self) -> BTreeMap<String, String> {
        let mut all = self.metadata.clone();
        all.insert(QOS_KEY.to_owned(), self.offered_qos_profiles.clone());
        all.insert(HASH_KEY.to_owned(), self.type_hash.clone());
        all
    }
}

/// What tells the messages of a topic from others of the same name.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct MessageDefinition {
    /// Name of the topic, type, encoding and language of the schema.
    texts: [String; 4],
    schema: Arc<[u8]>,
}

/// One message of a bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawMessage {
    /// Its topic.
    pub topic: Arc<TopicInfo>,
    /// When it was recorded, ns.
    pub log_time_ns: i64,
    /// When it was published, ns; the log time where the bag does not know.
    pub publish_time_ns: i64,
    /// Running number of the publisher, 0 where the bag does not know.
    pub sequence: u32,
    /// The encoded message.
    pub data: Vec<u8>,
}

/// A name from a bag within a sentence: line breaks in it would pass for the program's own.
pub(super) fn shown(name: &str) -> String {
    name.replace('\n', "\\u000a").replace('\t', "\\u0009")
}

/// A message still in the reader's buffer.
#[derive(Clone, Copy, Debug)]
pub(super) struct RawView<'a> {
    pub(super) topic: &'a Arc<TopicInfo>,
    pub(super) log_time_ns: i64,
    pub(super) publish_time_ns: i64,
    pub(super) sequence: u32,
    pub(super) data: &'a [u8],
}

/// Takes each message as it is read.
pub(super) type OnMessage<'a> = dyn FnMut(RawView<'_>) + 'a;

impl RawView<'_> {
    pub(super) fn to_owned(self) -> RawMessage {
        RawMessage {
            topic: Arc::clone(self.topic),
            log_time_ns: self.log_time_ns,
            publish_time_ns: self.publish_time_ns,
            sequence: self.sequence,
            data: self.data.to_vec(),
        }
    }
}

/// The parts of a ROS 2 quality of service that matter to whom replays a bag.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Qos {
    /// Lost samples are sent again.
    pub reliable: bool,
    /// Late joiners get the last samples.
    pub transient_local: bool,
    /// Samples kept.
    pub depth: u32,
}

impl Qos {
    /// Best effort, last five: `rmw_qos_profile_sensor_data`.
    pub const SENSOR: Self = Self { reliable: false, transient_local: false, depth: 5 };
    /// Reliable, last ten: the default of ROS 2.
    pub const DEFAULT: Self = Self { reliable: true, transient_local: false, depth: 10 };

    /// Senders whose quality of service rosbag2 keeps in a channel's metadata.
    pub(super) fn offered(profiles: &str) -> usize {
        profiles.lines().filter(|line| line.starts_with("- ")).count()
    }

    /// As rosbag2 keeps it in a channel's metadata.
    pub fn to_yaml(self) -> String {
        let reliability = if self.reliable { "reliable" } else { "best_effort" };
        let durability = if self.transient_local { "transient_local" } else { "volatile" };
        let depth = self.depth;
        format!(
            "- history: keep_last\n  depth: {depth}\n  reliability: {reliability}\n  durability: {durability}\n  \
             deadline:\n    sec: 9223372036\n    nsec: 854775807\n  lifespan:\n    sec: 9223372036\n    nsec: \
             854775807\n  liveliness: automatic\n  liveliness_lease_duration:\n    sec: 9223372036\n    nsec: \
             854775807\n  avoid_ros_namespace_conventions: false"
        )
    }
}
