//! Qualities of service: what the node asks for, and `qos_overrides` parameters that change it.

use std::time::Duration;

use ros2_client::QosProfile;
use ros2_client::qos::{Durability, History, Reliability, WhenFull};

use super::arguments::{Given, nearest};

/// Prefix of the parameters that change a quality of service.
pub const PREFIX: &str = "qos_overrides.";

/// Best effort, the newest ten: what inputs are read with. It matches every writer.
#[must_use]
pub fn best_effort() -> QosProfile {
    QosProfile { history: History::KeepLast { depth: 10 }, ..QosProfile::subscription_default() }
}

/// Best effort like [`best_effort`], but the newest 8192: what is recorded is read with. At 1 kHz they outlast a disk that
/// keeps the recorder waiting for 8 s. To keep all would keep 64 with RustDDS.
#[must_use]
pub fn recorded() -> QosProfile {
    QosProfile { history: History::KeepLast { depth: 8192 }, ..best_effort() }
}

/// The same, reliable and with what publishers keep for those who come later. It matches only publishers that keep it.
#[must_use]
pub fn latched() -> QosProfile {
    QosProfile {
        reliability: Reliability::Reliable { when_full: WhenFull::Fail },
        durability: Durability::TransientLocal,
        ..recorded()
    }
}

/// Reliable, so that every reader matches, but never waiting: where the window is full the sample is dropped.
#[must_use]
pub fn reliable() -> QosProfile {
    QosProfile {
        reliability: Reliability::Reliable { when_full: WhenFull::Fail },
        durability: Durability::Volatile,
        history: History::KeepLast { depth: 10 },
        ..QosProfile::publisher_default()
    }
}

/// Reliable like [`reliable`], and the newest is kept for those who subscribe later.
#[must_use]
pub fn kept() -> QosProfile {
    QosProfile { durability: Durability::TransientLocal, history: History::KeepLast { depth: 1 }, ..reliable() }
}

/// Applies `qos_overrides.TOPIC.ROLE.POLICY` parameters to a topic's quality of service; the later one wins.
///
/// # Errors
/// In words, on a policy or a value that is none.
pub fn overridden(
    parameters: &[(String, Given)],
    topic: &str,
    role: &str,
    mut qos: QosProfile,
) -> Result<QosProfile, String> {
    let prefix = format!("{PREFIX}{topic}.{role}.");
    for (name, given) in parameters {
        let Some(policy) = name.strip_prefix(&prefix) else { continue };
        match (policy, given) {
            ("reliability", Given::Text(text)) if text == "reliable" => {
                qos.reliability = Reliability::Reliable { when_full: WhenFull::Fail };
            }
            ("reliability", Given::Text(text)) if text == "best_effort" => qos.reliability = Reliability::BestEffort,
            ("durability", Given::Text(text)) if text == "volatile" => qos.durability = Durability::Volatile,
            ("durability", Given::Text(text)) if text == "transient_local" => {
                qos.durability = Durability::TransientLocal;
            }
            ("history", Given::Text(text)) if text == "keep_last" => {}
            ("liveliness", Given::Text(text)) if text == "automatic" => {}
            ("deadline", Given::Number(span_ns)) if is_span(*span_ns) => qos.deadline = span(*span_ns),
            ("lifespan", Given::Number(span_ns)) if is_span(*span_ns) => qos.lifespan = span(*span_ns),
            ("liveliness_lease_duration", Given::Number(span_ns)) if is_span(*span_ns) => {
                qos.liveliness_lease = span(*span_ns);
            }
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole and in range")]
            ("depth", Given::Number(depth)) if (1.0..=10_000.0).contains(depth) && depth.fract() == 0.0 => {
                qos.history = History::KeepLast { depth: *depth as usize };
            }
            _ => {
                return Err(format!(
                    "{name} is {given}: expected reliability (reliable, best_effort), durability (volatile, \
                     transient_local), history (keep_last), depth (1 to 10000), liveliness (automatic), or one of deadline, \
                     lifespan and liveliness_lease_duration in whole nanoseconds"
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
#[must_use]
pub fn idle(parameters: &[(String, Given)], places: &[String]) -> Vec<String> {
    let overrides = parameters.iter().filter_map(|(name, _)| name.strip_prefix(PREFIX));
    let at = |name: &str, place: &String| name.strip_prefix(place.as_str()).is_some_and(|rest| rest.starts_with('.'));
    let idle = overrides.filter(|name| !places.iter().any(|place| at(name, place)));
    let words = |name: &str| {
        let hint = nearest(name, places.iter())
            .map(|place| format!("; did you mean `{PREFIX}{place}.…`?"))
            .unwrap_or_default();
        format!("-p {PREFIX}{name} is for no topic of this node in that role{hint}")
    };
    idle.map(words).collect()
}

#[cfg(test)]
mod tests {
    use ros2_client::qos::{Durability, History, Reliability};

    use super::{Given, idle, overridden, reliable};

    fn text(name: &str, value: &str) -> (String, Given) {
        (name.to_owned(), Given::Text(value.to_owned()))
    }

    #[test]
    fn overrides_are_for_one_topic_and_one_role() {
        let parameters = [
            text("qos_overrides./sim/servo_state.publisher.reliability", "best_effort"),
            text("qos_overrides./sim/servo_state.subscription.durability", "transient_local"),
            ("qos_overrides./sim/servo_state.publisher.depth".to_owned(), Given::Number(3.0)),
        ];
        let qos = overridden(&parameters, "/sim/servo_state", "publisher", reliable()).unwrap();
        assert_eq!(qos.reliability, Reliability::BestEffort);
        assert_eq!((qos.durability, qos.history), (Durability::Volatile, History::KeepLast { depth: 3 }));
        assert_eq!(overridden(&parameters, "/other", "publisher", reliable()).unwrap(), reliable());
    }

    #[test]
    fn spans_are_in_nanoseconds_and_the_longest_is_none() {
        let number = |policy: &str, value| (format!("qos_overrides./a.publisher.{policy}"), Given::Number(value));
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
}
