//! `metadata.yaml` beside a bag's files, as rosbag2 writes it (version 9, Jazzy) and as it reads older ones.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use govtwin_files::check_yaml;

/// Longer profiles of quality of service are not parsed, bytes; a publisher's has some 300.
const LONGEST_PROFILES: usize = 1 << 16;

/// Its name.
pub(super) const FILE_NAME: &str = "metadata.yaml";

/// What the reader needs of any version.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Metadata {
    pub(super) relative_file_paths: Vec<String>,
    pub(super) message_count: Option<u64>,
    pub(super) compression_mode: String,
    pub(super) compression_format: String,
    /// Its statements on topics, by name: qualities of service as YAML, and the hash of the type.
    pub(super) topics: BTreeMap<String, (String, String)>,
    /// How many messages it counts on each topic.
    pub(super) counts: BTreeMap<String, u64>,
    /// What the recording's user said of it.
    pub(super) custom_data: Option<serde_yaml::Value>,
}

impl Metadata {
    /// Reads the parts that matter, whatever the version; the rest may be anything.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        check_yaml(text).map_err(|problem| format!("cannot be read: {problem}"))?;
        let outer: Outer<ReadInformation> =
            serde_yaml::from_str(text).map_err(|error| format!("cannot be read: {error}"))?;
        let information = outer.rosbag2_bagfile_information;
        Ok(Self {
            relative_file_paths: information.relative_file_paths,
            message_count: information.message_count,
            compression_mode: information.compression_mode,
            compression_format: information.compression_format,
            topics: information.topics_with_message_count.iter().filter_map(topic).collect(),
            counts: information.topics_with_message_count.iter().filter_map(count).collect(),
            custom_data: information.custom_data,
        })
    }

    /// The messages are compressed one by one, and not with zstd.
    pub(super) fn is_packed_otherwise(&self) -> bool {
        let zstd = self.compression_format.is_empty() || self.compression_format.eq_ignore_ascii_case("zstd");
        self.compression_mode.eq_ignore_ascii_case("message") && !zstd
    }
}

#[derive(Debug, Serialize, Deserialize)]
struct Outer<T> {
    rosbag2_bagfile_information: T,
}

#[derive(Debug, Deserialize)]
struct ReadInformation {
    #[serde(default)]
    relative_file_paths: Vec<String>,
    message_count: Option<u64>,
    #[serde(default)]
    compression_mode: String,
    #[serde(default)]
    compression_format: String,
    #[serde(default)]
    topics_with_message_count: Vec<serde_yaml::Value>,
    custom_data: Option<serde_yaml::Value>,
}

/// Name of a topic, and how many messages it has.
fn count(entry: &serde_yaml::Value) -> Option<(String, u64)> {
    let name = entry.get("topic_metadata")?.get("name")?.as_str()?;
    Some((name.to_owned(), entry.get("message_count")?.as_u64()?))
}

/// Name, qualities of service and type hash of a topic; up to version 8 the qualities are YAML within a text.
fn topic(entry: &serde_yaml::Value) -> Option<(String, (String, String))> {
    let topic = entry.get("topic_metadata")?;
    let text = |key: &str| topic.get(key).and_then(serde_yaml::Value::as_str).unwrap_or_default().to_owned();
    let profiles =
        topic.get("offered_qos_profiles").filter(|profiles| profiles.as_sequence().is_some_and(|all| !all.is_empty()));
    let profiles = match profiles {
        Some(profiles) => serde_yaml::to_string(profiles).ok()?.trim_end().to_owned(),
        None => text("offered_qos_profiles"),
    };
    Some((text("name"), (profiles, text("type_description_hash"))))
}

/// One topic of a written bag.
#[derive(Clone, Debug)]
pub(super) struct TopicSummary {
    pub(super) name: String,
    pub(super) type_name: String,
    pub(super) encoding: String,
    pub(super) offered_qos_profiles: String,
    pub(super) type_hash: String,
    pub(super) message_count: u64,
}

/// The metadata of a written bag.
#[derive(Clone, Debug)]
pub(super) struct Summary {
    pub(super) file_name: String,
    pub(super) starting_time_ns: i64,
    pub(super) duration_ns: i64,
    pub(super) message_count: u64,
    pub(super) topics: Vec<TopicSummary>,
    pub(super) custom_data: Option<serde_yaml::Value>,
}

impl Summary {
    /// The text of `metadata.yaml`.
    pub(super) fn to_yaml(&self) -> Result<String, String> {
        let starting_time = || Since { nanoseconds_since_epoch: self.starting_time_ns };
        let duration = || Nanoseconds { nanoseconds: self.duration_ns };
        let information = WriteInformation {
            version: 9,
            storage_identifier: "mcap",
            duration: duration(),
            starting_time: starting_time(),
            message_count: self.message_count,
            topics_with_message_count: self.topics.iter().map(WriteTopic::new).collect(),
            compression_format: "",
            compression_mode: "",
            relative_file_paths: [&self.file_name],
            files: [WriteFile {
                path: &self.file_name,
                starting_time: starting_time(),
                duration: duration(),
                message_count: self.message_count,
            }],
            custom_data: self.custom_data.as_ref(),
            ros_distro: "jazzy",
        };
        serde_yaml::to_string(&Outer { rosbag2_bagfile_information: information }).map_err(|error| error.to_string())
    }
}

#[derive(Debug, Serialize)]
struct WriteInformation<'a> {
    version: u32,
    storage_identifier: &'a str,
    duration: Nanoseconds,
    starting_time: Since,
    message_count: u64,
    topics_with_message_count: Vec<WriteTopic<'a>>,
    compression_format: &'a str,
    compression_mode: &'a str,
    relative_file_paths: [&'a str; 1],
    files: [WriteFile<'a>; 1],
    custom_data: Option<&'a serde_yaml::Value>,
    ros_distro: &'a str,
}

#[derive(Debug, Serialize)]
struct Nanoseconds {
    nanoseconds: i64,
}

#[derive(Debug, Serialize)]
struct Since {
    nanoseconds_since_epoch: i64,
}

#[derive(Debug, Serialize)]
struct WriteFile<'a> {
    path: &'a str,
    starting_time: Since,
    duration: Nanoseconds,
    message_count: u64,
}

#[derive(Debug, Serialize)]
struct WriteTopic<'a> {
    topic_metadata: WriteTopicMetadata<'a>,
    message_count: u64,
}

#[derive(Debug, Serialize)]
struct WriteTopicMetadata<'a> {
    name: &'a str,
    #[serde(rename = "type")]
    type_name: &'a str,
    serialization_format: &'a str,
    offered_qos_profiles: serde_yaml::Value,
    type_description_hash: &'a str,
}

impl<'a> WriteTopic<'a> {
    fn new(topic: &'a TopicSummary) -> Self {
        let profiles = if topic.offered_qos_profiles.is_empty() { "[]" } else { &topic.offered_qos_profiles };
        // They come from a bag. What is no YAML of that size stays text, as up to version 8 all of them did.
        let sound = profiles.len() <= LONGEST_PROFILES && check_yaml(profiles).is_ok();
        let parsed = if sound { serde_yaml::from_str(profiles).ok() } else { None };
        let profiles = parsed.unwrap_or_else(|| serde_yaml::Value::String(profiles.to_owned()));
        Self {
            topic_metadata: WriteTopicMetadata {
                name: &topic.name,
                type_name: &topic.type_name,
                serialization_format: &topic.encoding,
                offered_qos_profiles: profiles,
                type_description_hash: &topic.type_hash,
            },
            message_count: topic.message_count,
        }
    }
}
