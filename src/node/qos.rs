//! Qualities of service: what the node asks for, and `qos_overrides` parameters that change it.

use ros2_client::QosProfile;
use ros2_client::qos::{Durability, History, Reliability, WhenFull};

use super::arguments::Given;

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
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole and in range")]
            ("depth", Given::Number(depth)) if (1.0..=10_000.0).contains(depth) && depth.fract() == 0.0 => {
                qos.history = History::KeepLast { depth: *depth as usize };
            }
            _ => {
                return Err(format!(
                    "{name} is {given}: expected reliability (reliable, best_effort), durability (volatile, \
                     transient_local), history (keep_last) or depth (1 to 10000)"
                ));
            }
        }
    }
    Ok(qos)
}

#[cfg(test)]
mod tests {
    use ros2_client::qos::{Durability, History, Reliability};

    use super::{Given, overridden, reliable};

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
    fn a_policy_that_is_none_is_refused_in_words() {
        let parameters = [text("qos_overrides./a.publisher.reliability", "perhaps")];
        assert!(overridden(&parameters, "/a", "publisher", reliable()).unwrap_err().contains("best_effort"));
    }
}
