//! `/diagnostics`: the node's health once a second, as ROS 2 monitors read it.

use serde::{Deserialize, Serialize};

use super::core::Input;
use super::intake::{Counts, Refusal};
use super::integration::Output;
use crate::msg::Header;

/// Full name of [`DiagnosticArray`].
pub const TYPE_NAME: &str = "diagnostic_msgs/msg/DiagnosticArray";

/// `diagnostic_msgs/msg/KeyValue`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyValue {
    /// What.
    pub key: String,
    /// How much.
    pub value: String,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// 0 ok, 1 warning, 2 error, 3 stale.
    pub level: u8,
    /// Component.
    pub name: String,
    /// One line.
    pub message: String,
    /// Device.
    pub hardware_id: String,
    /// Figures.
    pub values: Vec<KeyValue>,
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    /// When.
    pub header: Header,
    /// Components.
    pub status: Vec<DiagnosticStatus>,
}

/// The health of one second.
#[must_use]
pub fn compile(
    node: &str,
    time_ns: i64,
    newest: Option<&Output>,
    tripped: bool,
    counts: &[Counts; 3],
) -> DiagnosticArray {
    let mut status = Vec::new();
    let key_value = |key: &str, value: String| KeyValue { key: key.to_owned(), value };
    let mut add = |part: &str, level, message: &str, values| {
        let (name, message) = (format!("{node}: {part}"), message.to_owned());
        status.push(DiagnosticStatus { level, name, message, hardware_id: String::new(), values });
    };
    let (level, message) = match newest {
        None => (3, "waiting for inputs"),
        Some(_) if tripped => (2, "fail-safe: inputs are missing"),
        Some(_) => (0, "running"),
    };
    let figures = newest.map_or_else(Vec::new, |output| {
        vec![
            key_value("overruns", output.overruns.to_string()),
            key_value("worst wake-up lateness [us]", format!("{:.1}", output.worst_lateness_us)),
        ]
    });
    add("integration", level, message, figures);
    for input in Input::ALL {
        let counts = counts[input as usize];
        let mut values = vec![
            key_value("samples used", counts.used.to_string()),
            key_value("source restarts", counts.restarts.to_string()),
        ];
        values.extend(
            Refusal::ALL.iter().map(|&refusal| key_value(refusal.words(), counts.refused(refusal).to_string())),
        );
        let (level, message) = match (counts.used, counts.all_refused()) {
            (0, 0) => (3, "nothing heard"),
            (_, 0) => (0, "heard"),
            _ => (1, "some samples refused"),
        };
        add(input.topic(), level, message, values);
    }
    DiagnosticArray { header: Header::at(time_ns), status }
}

#[cfg(test)]
mod tests {
    use super::compile;

    #[test]
    fn silence_is_stale_and_every_part_is_there() {
        let array = compile("/govtwin", 5, None, false, &<[_; 3]>::default());
        assert_eq!(array.status.len(), 4);
        assert!(array.status.iter().all(|status| status.level == 3));
        assert_eq!(array.status[1].name, "/govtwin: governor/command");
    }
}
