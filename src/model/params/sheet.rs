//! A unit together with where each of its values comes from.

use std::collections::BTreeMap;
use std::path::PathBuf;

use crate::parameters::{ChannelReadings, ENTRIES, Parameters, SENSOR_ENTRIES, Sensors, Unit};
use govtwin_files::digest::Digest;

/// Where a value was read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Origin {
    /// The file; `None` for the sheet shipped with the program.
    pub file: Option<PathBuf>,
    /// Line, counted from 1, where it is known.
    pub line: Option<usize>,
    /// What the file names as the value's source; empty where it names none.
    pub source: String,
}

/// A unit as merged from a file, its bases and the shipped sheet.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// What the file calls the unit; empty where it gives no name.
    pub name: String,
    /// The unit itself.
    pub unit: Unit,
    /// The files that were merged, the lowest base first; the shipped sheet is below them all.
    pub files: Vec<PathBuf>,
    /// Where each key was last set, by dotted key.
    pub origins: BTreeMap<String, Origin>,
}

impl Sheet {
    /// An empty sheet.
    pub(super) fn blank() -> Self {
        Self {
            name: String::new(),
            unit: Unit {
                parameters: Parameters::default(),
                tolerances: vec![None; ENTRIES.len()],
                sensors: Sensors::default(),
                effects: Vec::new(),
                own_effects: Vec::new(),
                recorded: ChannelReadings::default(),
            },
            files: Vec::new(),
            origins: BTreeMap::new(),
        }
    }
}

/// Digest of a unit: values, tolerances, transducers, effects, and scale and zero of its channels where they are not in pu. Two files that
/// describe the same unit have one digest.
pub fn unit_digest(unit: &Unit) -> String {
    let mut digest = Digest::default();
    for (entry, tolerance) in ENTRIES.iter().zip(&unit.tolerances) {
        digest.update(entry.key);
        digest.update_f64((entry.get)(&unit.parameters));
        digest.update(format!("{tolerance:?}"));
    }
    for entry in SENSOR_ENTRIES {
        digest.update(entry.name);
        let sensor = (entry.get)(&unit.sensors);
        digest.update_f64(sensor.noise);
        digest.update_f64(sensor.step);
    }
    digest.update(format!("{:?}{:?}", unit.effects, unit.own_effects));
    if unit.recorded != ChannelReadings::default() {
        digest.update(format!("{:?}", unit.recorded));
    }
    digest.text()
}

#[cfg(test)]
mod tests {
    use super::unit_digest;
    use crate::parameters::ChannelReading;
    use crate::params::reference;

    #[test]
    fn a_digest_tells_units_apart_and_not_their_files() {
        let mut unit = reference();
        let shipped = unit_digest(&unit);
        assert_eq!(shipped, unit_digest(&reference()));
        unit.parameters.oil.density_kg_m3 += 1e-9;
        assert_ne!(shipped, unit_digest(&unit));
        let mut unit = reference();
        let known = unit.tolerances.iter().position(Option::is_some).unwrap();
        unit.tolerances[known] = None;
        assert_ne!(shipped, unit_digest(&unit));
        // The same plant, recorded in millimetres, or from another zero.
        let recorded = |scale_pu: f64, offset_pu: f64| {
            let mut unit = reference();
            unit.recorded.servomotor_position = ChannelReading { scale_pu, offset_pu };
            unit_digest(&unit)
        };
        assert_ne!(shipped, recorded(1.0 / 600.0, 0.0));
        assert_ne!(recorded(1.0 / 600.0, 0.0), recorded(1.0 / 600.0, 0.01));
        assert_eq!(shipped, recorded(1.0, 0.0));
    }
}
