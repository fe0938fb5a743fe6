//! One transducer of a file: its noise and its step.

use crate::parameters::{SENSOR_ENTRIES, Sensor, SensorEntry};
use crate::params::yaml::Node;

use super::{Mapping, Merge, get};

/// Attributes of one transducer.
const KEYS: [&str; 4] = ["noise", "step", "unit", "source"];

impl Merge<'_> {
    pub(super) fn sensor(&mut self, section: &str, name: &str, node: &Node) {
        let path = [section, name];
        let Some(entry) = SENSOR_ENTRIES.iter().find(|entry| entry.name == name) else {
            return self.unknown(&path, SENSOR_ENTRIES.iter().map(|entry| entry.name));
        };
        let Node::Map(map) = node else {
            let found = node.describe();
            return self.problem(&path, format!("expected `{{noise: …, step: …}}` in {}, found {found}", entry.unit));
        };
        let before = self.problems.len();
        self.attributes(&path, map, &KEYS);
        self.unit(&path, map, entry.unit);
        let source = self.source(&path, map);
        let old = (entry.get)(&self.sheet.unit.sensors);
        let noise = self.sensor_value(entry, [section, name, "noise"], map).unwrap_or(old.noise);
        let step = self.sensor_value(entry, [section, name, "step"], map).unwrap_or(old.step);
        if self.problems.len() == before {
            (entry.set)(&mut self.sheet.unit.sensors, Sensor { noise, step });
            self.record(&path, source);
        }
    }

    fn sensor_value(&mut self, entry: &SensorEntry, path: [&str; 3], map: &Mapping) -> Option<f64> {
        let node = get(map, path[2])?;
        self.number(&path, node, entry.unit, (0.0, entry.max))
    }
}
