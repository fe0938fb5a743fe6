//! What other nodes offer on the bus: topics with types, type hashes and qualities of service, and who describes types.

use ros2_client::Gid;
use rustdds::discovery::{DiscoveredReaderData, DiscoveredWriterData};
use rustdds::policy::{Durability, Liveliness, Reliability};
use rustdds::{Duration, QosPolicies};

use super::arguments::hint;
use super::transport::{Participant, participant_of};

/// A publisher of another node.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Offer {
    /// Its id.
    pub(super) sender: Gid,
    /// The part of the id that its whole process shares.
    pub(super) process: Participant,
    /// Full name of the topic.
    pub(super) topic: String,
    /// `package/msg/Type`.
    pub(super) type_name: String,
    /// The type's hash as the publisher announces it, `RIHS01_` and 64 digits; empty before Iron.
    pub(super) type_hash: String,
    /// Its quality of service, one entry of YAML as rosbag2 keeps it.
    pub(super) profile: String,
    /// It keeps samples for those who come later.
    pub(super) is_latched: bool,
}

impl Offer {
    /// What a publisher announces, where its topic and type are those of ROS 2.
    pub(super) fn of(writer: &DiscoveredWriterData) -> Option<Self> {
        let data = &writer.publication_topic_data;
        let qos = data.qos();
        Some(Self {
            sender: Gid::from(data.key),
            process: participant_of(data.key),
            topic: data.topic_name.strip_prefix("rt")?.to_owned(),
            type_name: ros_type(&data.type_name),
            type_hash: type_hash(&writer.user_data).unwrap_or_default(),
            is_latched: is_latched(&qos),
            profile: profile(&qos),
        })
    }

    /// Whether it is of a type by its name and, where both are known, the hash of its definition.
    pub(super) fn is_of(&self, type_name: &str, hash: &str) -> bool {
        let same_hash = hash.is_empty() || self.type_hash.is_empty() || hash == self.type_hash;
        self.type_name == type_name && same_hash
    }

    /// Its type in words, where it is not of the expected one: that, or another definition of it.
    pub(super) fn otherwise(&self, expected: &str) -> String {
        let other = if self.type_name == expected { "another definition of " } else { "" };
        format!("{other}`{}`", self.type_name)
    }
}

/// A service that describes types, and the process that has it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Describer {
    /// Full name of the service.
    pub(super) service: String,
    /// The part of an id that its whole process shares; the first two bytes name the maker of its DDS.
    pub(super) process: Participant,
}

impl Describer {
    /// The service behind a reader of requests, where it is one of these.
    pub(super) fn of(reader: &DiscoveredReaderData) -> Option<Self> {
        let data = &reader.subscription_topic_data;
        let service = data.topic_name().strip_prefix("rq")?.strip_suffix("Request")?;
        service
            .ends_with("/get_type_description")
            .then(|| Self { service: service.to_owned(), process: participant_of(data.key()) })
    }
}

/// The DDS name of a type as ROS 2 writes it: `pkg::msg::dds_::Type_` is `pkg/msg/Type`.
pub(super) fn ros_type(dds_name: &str) -> String {
    let plain = dds_name.replace("::dds_::", "::").replace("::", "/");
    plain.strip_suffix('_').unwrap_or(&plain).to_owned()
}

/// The reverse of [`ros_type`]: `pkg/msg/Type` is `pkg::msg::dds_::Type_`, and so are `pkg/srv/Type_Event` and their like. Topics
/// whose types are named otherwise keep that name.
pub(super) fn dds_type(ros_name: &str) -> String {
    match ros_name.split('/').collect::<Vec<_>>()[..] {
        [package, kind, name] => format!("{package}::{kind}::dds_::{name}_"),
        _ => ros_name.to_owned(),
    }
}

/// What is said of a topic that nobody publishes.
pub(super) fn silence(topic: &str, offers: &[Offer]) -> String {
    format!("{topic}: nobody publishes it so far{}", hint(topic, offers.iter().map(|offer| &offer.topic)))
}

fn is_latched(qos: &QosPolicies) -> bool {
    qos.durability().is_some_and(|durability| durability >= Durability::TransientLocal)
}

/// The hash in what a publisher says of itself, `typehash=RIHS01_…;` among other things.
fn type_hash(user_data: &[u8]) -> Option<String> {
    const KEY: &[u8] = b"typehash=";
    let begin = user_data.windows(KEY.len()).position(|window| window == KEY)? + KEY.len();
    let hash: Vec<u8> = user_data.get(begin..)?.iter().copied().take_while(|letter| *letter != b';').collect();
    let hash = String::from_utf8(hash).ok()?;
    is_hash(&hash).then_some(hash)
}

/// Whether a text is the hash of a type.
pub(super) fn is_hash(text: &str) -> bool {
    let digits = text.strip_prefix("RIHS01_");
    digits.is_some_and(|digits| digits.len() == 64 && digits.bytes().all(|digit| digit.is_ascii_hexdigit()))
}

/// As rosbag2 keeps it; what is not announced (history and depth) is unknown.
fn profile(qos: &QosPolicies) -> String {
    // A publisher that does not say is reliable: that is the default of DDS for it.
    let reliability = match qos.reliability() {
        Some(Reliability::BestEffort) => "best_effort",
        _ => "reliable",
    };
    let durability = if is_latched(qos) { "transient_local" } else { "volatile" };
    let (kind, lease) = match qos.liveliness() {
        Some(Liveliness::ManualByTopic { lease_duration }) => ("manual_by_topic", Some(lease_duration)),
        Some(Liveliness::Automatic { lease_duration } | Liveliness::ManualByParticipant { lease_duration }) => {
            ("automatic", Some(lease_duration))
        }
        None => ("automatic", None),
    };
    let span = |duration: Option<Duration>| {
        // The longest of ROS 2 stands for none. DDS counts in parts of 2^-32 s, which may lack a nanosecond.
        let nanos =
            duration.filter(|duration| *duration < Duration::INFINITE).map(|duration| duration.to_nanoseconds());
        let nanos = nanos.map_or(i64::MAX, |nanos| nanos + i64::from(nanos % 10 == 9));
        format!("    sec: {}\n    nsec: {}", nanos / 1_000_000_000, nanos % 1_000_000_000)
    };
    format!(
        "- history: unknown\n  depth: 0\n  reliability: {reliability}\n  durability: {durability}\n  deadline:\n{}\n  \
         lifespan:\n{}\n  liveliness: {kind}\n  liveliness_lease_duration:\n{}\n  avoid_ros_namespace_conventions: false",
        span(qos.deadline().map(|deadline| deadline.0)),
        span(qos.lifespan().map(|lifespan| lifespan.duration)),
        span(lease),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hash_is_found_among_what_a_publisher_says_of_itself() {
        let hash = format!("RIHS01_{}", "0a".repeat(32));
        let said = [&[80, 0, 0, 0][..], b"enclave=/;typehash=", hash.as_bytes(), b";\0\0"].concat();
        assert_eq!(type_hash(&said), Some(hash));
        for none in [&b"typehash=RIHS01_12;"[..], b"typehash=", b"enclave=/;", b""] {
            assert_eq!(type_hash(none), None);
        }
    }

    #[test]
    fn type_names_are_those_of_ros() {
        assert_eq!(ros_type("sensor_msgs::msg::dds_::JointState_"), "sensor_msgs/msg/JointState");
        assert_eq!(ros_type("Other"), "Other");
        for name in ["sensor_msgs/msg/JointState", "std_srvs/srv/Trigger_Event", "Other"] {
            assert_eq!(ros_type(&dds_type(name)), name);
        }
    }

    #[test]
    fn a_quality_of_service_is_told_as_rosbag2_keeps_it() {
        let qos = rustdds::QosPolicyBuilder::new()
            .durability(Durability::TransientLocal)
            .reliability(Reliability::Reliable { max_blocking_time: Duration::from_millis(100) })
            .deadline(rustdds::policy::Deadline(Duration::from_millis(20)))
            .build();
        let profile = profile(&qos);
        for part in
            ["reliability: reliable", "durability: transient_local", "  deadline:\n    sec: 0\n    nsec: 20000000\n"]
        {
            assert!(profile.contains(part), "{profile}");
        }
        let silent = super::profile(&rustdds::QosPolicyBuilder::new().build());
        assert!(silent.contains("reliability: reliable") && silent.contains("durability: volatile"), "{silent}");
        assert!(profile.contains("lifespan:\n    sec: 9223372036\n    nsec: 854775807"), "{profile}");
    }
}
