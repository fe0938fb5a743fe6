//! How a position is recorded: its scale and offset, as in a map of `govtwin import`.

use crate::parameters::ChannelReading;
use crate::params::yaml::Node;

use super::{Mapping, Merge, get};

/// Channels that may be recorded in other units.
const CHANNELS: [&str; 2] = ["spool_position", "servomotor_position"];
/// Attributes of one.
const KEYS: [&str; 3] = ["scale", "offset", "source"];
/// Scales beyond are no unit of a position; the same for offsets.
const MOST: f64 = 1.0e12;

impl Merge<'_> {
    pub(super) fn recorded(&mut self, section: &str, name: &str, node: &Node) {
        let path = [section, name];
        if !CHANNELS.contains(&name) {
            return self.unknown(&path, CHANNELS);
        }
        let Node::Map(map) = node else {
            let found = node.describe();
            return self.problem(&path, format!("expected `{{scale: …, offset: …}}` to pu, found {found}"));
        };
        let before = self.problems.len();
        self.attributes(&path, map, &KEYS);
        let source = self.source(&path, map);
        let scale_pu = self.recorded_value([section, name, "scale"], map).unwrap_or(1.0);
        let offset_pu = self.recorded_value([section, name, "offset"], map).unwrap_or(0.0);
        if scale_pu == 0.0 {
            self.problem(&path, "a scale of 0 leaves nothing of the channel");
        }
        if self.problems.len() == before {
            let recorded = &mut self.sheet.unit.recorded;
            let reading = ChannelReading { scale_pu, offset_pu };
            match name {
                "spool_position" => recorded.spool_position = reading,
                _ => recorded.servomotor_position = reading,
            }
            self.record(&path, source);
        }
    }

    fn recorded_value(&mut self, path: [&str; 3], map: &Mapping) -> Option<f64> {
        let node = get(map, path[2])?;
        self.number(&path, node, "1", (-MOST, MOST))
    }
}
