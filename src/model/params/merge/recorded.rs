//! How a position is recorded: its scale and offset, as in a map of `govtwin import`; and how fast the unit's clock runs beside the recorded one.

use crate::parameters::ChannelReading;
use crate::params::yaml::Node;

use super::{Mapping, Merge, get};

/// What may be recorded in other units.
const CHANNELS: [&str; 3] = ["spool_position", "servomotor_position", TIME];
const TIME: &str = "time";
/// Attributes of a channel; time has no offset.
const KEYS: [&str; 3] = ["scale", "source", "offset"];
/// Scales beyond are no unit of a position; the same for offsets.
const MOST: f64 = 1.0e12;
/// A stage that travels in microseconds, or in months, is none.
const MOST_OF_TIME: f64 = 1.0e6;

impl Merge<'_> {
    pub(super) fn recorded(&mut self, section: &str, name: &str, node: &Node) {
        let path = [section, name];
        if !CHANNELS.contains(&name) {
            return self.unknown(&path, CHANNELS);
        }
        let Node::Map(map) = node else {
            let found = node.describe();
            let wanted = if name == TIME {
                "`{scale: …}` to seconds of the unit"
            } else {
                "`{scale: …, offset: …}` to pu"
            };
            return self.problem(&path, format!("expected {wanted}, found {found}"));
        };
        let before = self.problems.len();
        self.attributes(&path, map, if name == TIME { &KEYS[..2] } else { &KEYS });
        let source = self.source(&path, map);
        let scale_pu = self.recorded_value([section, name, "scale"], map).unwrap_or(1.0);
        let offset_pu = self.recorded_value([section, name, "offset"], map).unwrap_or(0.0);
        if scale_pu == 0.0 {
            self.problem(&path, "a scale of 0 leaves nothing of the channel");
        } else if name == TIME && scale_pu < 0.0 {
            self.problem(&path, "a scale below 0 turns time round");
        }
        if self.problems.len() == before {
            let recorded = &mut self.sheet.unit.recorded;
            let reading = ChannelReading { scale_pu, offset_pu };
            match name {
                TIME => recorded.clock_ratio = scale_pu,
                "spool_position" => recorded.spool_position = reading,
                _ => recorded.servomotor_position = reading,
            }
            self.record(&path, source);
        }
    }

    fn recorded_value(&mut self, path: [&str; 3], map: &Mapping) -> Option<f64> {
        let node = get(map, path[2])?;
        let most = if path[1] == TIME { MOST_OF_TIME } else { MOST };
        self.number(&path, node, "1", (-most, most))
    }
}
