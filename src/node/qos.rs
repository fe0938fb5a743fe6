//! Qualities of service: what the node asks for, and `qos_overrides` parameters that change it.

use std::time::Duration;

use ros2_client::QosProfile;
use ros2_client::qos::{Durability, History, Liveliness, Reliability, WhenFull};

use super::arguments::{ParameterOverride, hint};

/// Prefix of the parameters that change a quality of service.
pub(crate) const PREFIX: &str = "qos_overrides.";

/// Samples of a played topic that may wait for readers.
const BURST_DEPTH: usize = 100;

/// Samples that are kept for late comers of a played topic; `/rosout` keeps 1000.
const LATCHED_DEPTH: usize = 1000;

/// Best effort, the newest ten: what inputs are read with. It matches every writer.
pub(crate) fn best_effort() -> QosProfile {
    QosProfile { history: History::KeepLast { depth: 10 }, ..QosProfile::subscription_default() }
}

/// Best effort, the newest thousand: what the ticks of `/clock` are read with. Where the node falls behind, each is followed all the same.
pub(crate) fn followed() -> QosProfile {
    QosProfile { history: History::KeepLast { depth: 1000 }, ..best_effort() }
}

/// The same, reliable: what inputs are read with that a step waits for, or a node that follows `/clock`.
pub(crate) fn awaited() -> QosProfile {
    QosProfile { reliability: Reliability::Reliable { when_full: WhenFull::Fail }, ..followed() }
}

/// Best effort like [`best_effort`], but the newest 8192: what is recorded is read with. At 1 kHz they outlast a disk that
/// keeps the recorder waiting for 8 s. To keep all would keep 64 with RustDDS.
pub(crate) fn recorded() -> QosProfile {
    QosProfile { history: History::KeepLast { depth: 8192 }, ..best_effort() }
}

/// The same, reliable and with what publishers keep for those who come later. It matches only publishers that keep it.
pub(crate) fn latched() -> QosProfile {
    QosProfile {
        reliability: Reliability::Reliable { when_full: WhenFull::Fail },
        durability: Durability::TransientLocal,
        ..recorded()
    }
}

/// The same, the newest ten: what a map names is read with where its publishers keep it.
pub(crate) fn newest_latched() -> QosProfile {
    QosProfile { history: best_effort().history, ..latched() }
}

/// Reliable, so that every reader matches, but never waiting: where the window is full the sample is dropped.
pub(crate) fn reliable() -> QosProfile {
    QosProfile {
        reliability: Reliability::Reliable { when_full: WhenFull::Fail },
        durability: Durability::Volatile,
        history: History::KeepLast { depth: 10 },
        ..QosProfile::publisher_default()
    }
}

/// Reliable like [`reliable`], and the newest is kept for those who subscribe later: verdicts, and the statuses of an action's goals.
pub(crate) fn kept() -> QosProfile {
    QosProfile { durability: Durability::TransientLocal, history: History::KeepLast { depth: 1 }, ..reliable() }
}

/// What a recorded topic is played with: reliable without waiting, and otherwise as its publishers offered it. `profiles` is what
/// rosbag2 keeps of them, YAML with words or, before Iron, with numbers. What they do not agree on is not offered.
pub(crate) fn played(profiles: &str) -> QosProfile {
    let all = |key: &str| {
        let values = profiles.lines().filter_map(|line| line.trim_start_matches(['-', ' ']).strip_prefix(key));
        values.map(|value| value.trim_start_matches(':').trim()).collect::<Vec<_>>()
    };
    let durabilities = all("durability:");
    let is_latched =
        !durabilities.is_empty() && durabilities.iter().all(|word| ["transient_local", "1"].contains(word));
    let depth = all("depth:").iter().filter_map(|depth| depth.parse::<usize>().ok()).sum();
    // A burst of samples must fit, and what others kept for late comers must be kept again; a bag may not know how much that was.
    let least = if is_latched { LATCHED_DEPTH } else { BURST_DEPTH };
    QosProfile {
        durability: if is_latched { Durability::TransientLocal } else { Durability::Volatile },
        history: History::KeepLast { depth: least.max(depth).min(10_000) },
        deadline: common_span(profiles, "deadline"),
        lifespan: common_span(profiles, "lifespan"),
        ..reliable()
    }
}

/// A span of time that all publishers offer alike; none where it is the longest one of ROS 2, or 0, which stands for it as well.
fn common_span(profiles: &str, policy: &str) -> Option<Duration> {
    let lines: Vec<&str> = profiles.lines().map(str::trim).collect();
    let number = |line: &str, key: &str| line.strip_prefix(key)?.trim().parse::<u64>().ok();
    let spans = lines.windows(3).filter(|lines| lines[0].trim_end_matches(':') == policy);
    let mut spans = spans.map(|lines| Some((number(lines[1], "sec:")?, number(lines[2], "nsec:")?)));
    let first = spans.next()??;
    let (seconds, nanos) = first;
    let is_one = !matches!(first, (0, 0) | (9_223_372_036.., _)) && spans.all(|span| span == Some(first));
    is_one.then(|| Duration::from_secs(seconds) + Duration::from_nanos(nanos))
}

/// Applies `qos_overrides.TOPIC.ROLE.POLICY` parameters to a topic's quality of service; the later one wins.
///
/// # Errors
/// In words, on a policy or a value that is none.
pub(crate) fn overridden(
    parameters: &[(String, ParameterOverride)],
    topic: &str,
    role: &str,
    mut qos: QosProfile,
) -> Result<QosProfile, String> {
    let prefix = format!("{PREFIX}{topic}.{role}.");
    for (name, given) in parameters {
        let Some(policy) = name.strip_prefix(&prefix) else { continue };
        match (policy, given) {
            // What stands for the node's own choice.
            ("reliability" | "durability" | "history" | "liveliness", ParameterOverride::Text(text))
                if text == "system_default" => {}
            ("history", ParameterOverride::Text(text)) if text == "keep_all" => {
                return Err(format!(
                    "{name} is keep_all, which the transport does not have: it would keep 64; give a depth of 1 to 10000 instead"
                ));
            }
            ("liveliness", ParameterOverride::Text(text)) if text == "manual_by_topic" => {
                qos.liveliness = Liveliness::ManualByTopic;
            }
            ("avoid_ros_namespace_conventions", ParameterOverride::Bool(false)) => {}
            ("avoid_ros_namespace_conventions", ParameterOverride::Bool(true)) => {
                return Err(format!("{name} is true: this node's topics keep the names of ROS 2 on DDS, `rt/…`"));
            }
            ("reliability", ParameterOverride::Text(text)) if text == "reliable" => {
                qos.reliability = Reliability::Reliable { when_full: WhenFull::Fail };
            }
            ("reliability", ParameterOverride::Text(text)) if text == "best_effort" => {
                qos.reliability = Reliability::BestEffort;
            }
            ("durability", ParameterOverride::Text(text)) if text == "volatile" => {
                qos.durability = Durability::Volatile;
            }
            ("durability", ParameterOverride::Text(text)) if text == "transient_local" => {
                qos.durability = Durability::TransientLocal;
            }
            ("history", ParameterOverride::Text(text)) if text == "keep_last" => {}
            ("liveliness", ParameterOverride::Text(text)) if text == "automatic" => {
                qos.liveliness = Liveliness::Automatic;
            }
            ("deadline", ParameterOverride::Number(span_ns)) if is_span(*span_ns) => qos.deadline = span(*span_ns),
            ("lifespan", ParameterOverride::Number(span_ns)) if is_span(*span_ns) => qos.lifespan = span(*span_ns),
            ("liveliness_lease_duration", ParameterOverride::Number(span_ns)) if is_span(*span_ns) => {
                qos.liveliness_lease = span(*span_ns);
            }
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole and in range")]
            ("depth", ParameterOverride::Number(depth)) if (1.0..=10_000.0).contains(depth) && depth.fract() == 0.0 => {
                qos.history = History::KeepLast { depth: *depth as usize };
            }
            _ => {
                return Err(format!(
                    "{name} is {given}: expected reliability (reliable, best_effort), durability (volatile, \
                     transient_local), history (keep_last), depth (1 to 10000), liveliness (automatic, manual_by_topic), \
                     avoid_ros_namespace_conventions (false), or one of deadline, lifespan and liveliness_lease_duration in whole nanoseconds"
                ));
            }
        }
    }
    Ok(qos)
}

/// Whether a number is a span of time in whole nanoseconds.
fn is_span(span_ns: f64) -> bool {
    span_ns >= 1.0 && span_ns.fract() == 0.0
}

/// A span of time; the longest one of ROS 2 and longer ones are none.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole and positive, as `is_span` says")]
fn span(span_ns: f64) -> Option<Duration> {
    (span_ns < 9.2e18).then(|| Duration::from_nanos(span_ns as u64))
}

/// `qos_overrides` that are for no endpoint among `places` (`TOPIC.ROLE`), in words.
pub(crate) fn idle(parameters: &[(String, ParameterOverride)], places: &[String]) -> Vec<String> {
    let overrides = parameters.iter().filter_map(|(name, _)| name.strip_prefix(PREFIX));
    let at = |name: &str, place: &String| name.strip_prefix(place.as_str()).is_some_and(|rest| rest.starts_with('.'));
    let idle = overrides.filter(|name| !places.iter().any(|place| at(name, place)));
    let words = |name: &str| {
        let known: Vec<String> = places.iter().map(|place| format!("{PREFIX}{place}.…")).collect();
        let given = format!("{PREFIX}{name}");
        format!("-p {given} is for no topic of this node in that role{}", hint(&given, &known))
    };
    idle.map(words).collect()
}

#[cfg(test)]
mod tests {
    use ros2_client::qos::{Durability, History, Liveliness, Reliability};

    use super::{ParameterOverride, idle, overridden, played, reliable};

    fn text(name: &str, value: &str) -> (String, ParameterOverride) {
        (name.to_owned(), ParameterOverride::Text(value.to_owned()))
    }

    #[test]
    fn overrides_are_for_one_topic_and_one_role() {
        let parameters = [
            text("qos_overrides./sim/servo_state.publisher.reliability", "best_effort"),
            text("qos_overrides./sim/servo_state.subscription.durability", "transient_local"),
            ("qos_overrides./sim/servo_state.publisher.depth".to_owned(), ParameterOverride::Number(3.0)),
        ];
        let qos = overridden(&parameters, "/sim/servo_state", "publisher", reliable()).unwrap();
        assert_eq!(qos.reliability, Reliability::BestEffort);
        assert_eq!((qos.durability, qos.history), (Durability::Volatile, History::KeepLast { depth: 3 }));
        assert_eq!(overridden(&parameters, "/other", "publisher", reliable()).unwrap(), reliable());
    }

    #[test]
    fn spans_are_in_nanoseconds_and_the_longest_is_none() {
        let number =
            |policy: &str, value| (format!("qos_overrides./a.publisher.{policy}"), ParameterOverride::Number(value));
        let parameters = [
            number("deadline", 1e8),
            number("lifespan", i64::MAX as f64),
            text("qos_overrides./a.publisher.liveliness", "automatic"),
        ];
        let qos = overridden(&parameters, "/a", "publisher", reliable()).unwrap();
        assert_eq!((qos.deadline, qos.lifespan), (Some(std::time::Duration::from_millis(100)), None));
        assert!(overridden(&[number("deadline", 0.5)], "/a", "publisher", reliable()).is_err());
    }

    #[test]
    fn a_recorded_topic_is_played_as_it_was_offered() {
        let offered = |durability: &str, deadline_s: u64| {
            format!(
                "- history: keep_last\n  depth: 300\n  reliability: best_effort\n  durability: {durability}\n  deadline:\n    \
                 sec: {deadline_s}\n    nsec: 5\n  lifespan:\n    sec: 9223372036\n    nsec: 854775807\n"
            )
        };
        let latched = played(&offered("transient_local", 2));
        assert_eq!(latched.durability, Durability::TransientLocal);
        assert_eq!((latched.history, latched.lifespan), (History::KeepLast { depth: 1000 }, None));
        assert_eq!(latched.deadline, Some(std::time::Duration::new(2, 5)));
        let two = played(&[offered("volatile", 2), offered("transient_local", 3)].concat());
        assert_eq!((two.durability, two.history), (Durability::Volatile, History::KeepLast { depth: 600 }));
        assert_eq!(two.deadline, None, "they do not agree");
        assert_eq!(played("- durability: 1\n").durability, Durability::TransientLocal, "as Foxy and Humble write it");
        assert_eq!(played("").durability, Durability::Volatile);
    }

    #[test]
    fn overrides_for_nothing_are_told_with_what_may_be_meant() {
        let parameters = [
            text("qos_overrides./sim/servo_stat.publisher.reliability", "best_effort"),
            text("qos_overrides./sim/servo_state.subscription.depth", "3"),
            text("qos_overrides./sim/servo_state.publisher.depth", "3"),
        ];
        let told = idle(&parameters, &["/sim/servo_state.publisher".to_owned()]);
        assert_eq!(told.len(), 2, "{told:?}");
        assert!(told.iter().all(|words| words.contains("did you mean `qos_overrides./sim/servo_state.publisher.…`?")));
    }

    #[test]
    fn a_policy_that_is_none_is_refused_in_words() {
        let parameters = [text("qos_overrides./a.publisher.reliability", "perhaps")];
        assert!(overridden(&parameters, "/a", "publisher", reliable()).unwrap_err().contains("best_effort"));
    }

    #[test]
    fn each_policy_of_ros_is_followed_or_refused_with_the_way_out() {
        let one = |policy: &str, value: &str| {
            let given =
                value.parse().map_or_else(|_| ParameterOverride::Text(value.to_owned()), ParameterOverride::Bool);
            let parameters = [(format!("qos_overrides./a.publisher.{policy}"), given)];
            overridden(&parameters, "/a", "publisher", reliable())
        };
        assert_eq!(one("liveliness", "manual_by_topic").unwrap().liveliness, Liveliness::ManualByTopic);
        for (policy, value) in [
            ("reliability", "system_default"),
            ("durability", "system_default"),
            ("history", "system_default"),
            ("history", "keep_last"),
            ("liveliness", "system_default"),
            ("avoid_ros_namespace_conventions", "false"),
        ] {
            assert_eq!(one(policy, value).unwrap(), reliable(), "{policy} {value}");
        }
        assert!(one("history", "keep_all").unwrap_err().contains("give a depth"));
        assert!(one("avoid_ros_namespace_conventions", "true").unwrap_err().contains("rt/"));
    }
}
