//! Writes an overlay: a file with the differences only, which reads back to the last bit.

mod effects;
mod whole;

use std::collections::BTreeMap;
use std::path::Path;

use crate::effects::find_in;
use crate::parameters::{ChannelReading, ChannelReadings, ENTRIES, SENSOR_ENTRIES, Sensors, Tolerance, Unit};
use crate::params::yaml::quoted;
use govtwin_files::write_atomically;

use super::error::{FileProblem, ParamsError};
use super::merge::{name_of, section_of};
use super::number::number_text;
use super::{reference, sheet_over_reference};

pub use whole::{WholeSheet, whole_text};

/// The contents of an overlay file.
#[derive(Clone, Debug, PartialEq)]
pub struct Overlay {
    /// The unit; the file holds what of it differs from the shipped one.
    pub unit: Unit,
    /// What the unit is called; left out where empty.
    pub name: String,
    /// The source of all values; left out where empty.
    pub source: String,
    /// Lines of comment at the head of the file.
    pub head: Vec<String>,
    /// Comments behind values, such as confidence intervals, by key, for effects `id.parameter`; a key with a comment is
    /// always written.
    pub comments: BTreeMap<String, String>,
}

/// Writes `overlay` to `path`, whole or not at all; nothing is written that would not read back as the same unit.
///
/// # Errors
/// When a value is out of its range or at odds with another, a comment belongs to no key, an effect is not in the
/// catalogue, or the file cannot be written.
pub fn write(path: &Path, overlay: &Overlay) -> Result<(), ParamsError> {
    let text = overlay_text(path, overlay)?;
    write_atomically(path, text.as_bytes()).map_err(|reason| ParamsError::Write { path: path.to_path_buf(), reason })
}

/// What [`write()`] writes to `path`.
///
/// # Errors
/// As [`write()`], but for the file.
pub fn overlay_text(path: &Path, overlay: &Overlay) -> Result<String, ParamsError> {
    let text = text(overlay);
    let invalid = |problems| ParamsError::Invalid { what: super::PARAMETER, path: path.to_path_buf(), problems };
    let sheet = sheet_over_reference(&text, path).map_err(invalid)?;
    let of_effect = |key: &str| {
        let (id, name) = key.split_once('.').unwrap_or_default();
        let set = overlay.unit.effects.iter().any(|setting| setting.id == id);
        set && find_in(&overlay.unit, id).is_some_and(|spec| spec.parameters.iter().any(|p| p.name == name))
    };
    let unknown = overlay.comments.keys().find(|key| ENTRIES.iter().all(|entry| entry.key != **key) && !of_effect(key));
    if let Some(key) = unknown {
        let message = "a comment for a key that does not exist".to_owned();
        return Err(invalid(vec![FileProblem { line: None, key: key.clone(), message }]));
    }
    if sheet.unit != overlay.unit {
        let message = "the unit has effects or values that a parameter file cannot hold".to_owned();
        return Err(invalid(vec![FileProblem { line: None, key: String::new(), message }]));
    }
    Ok(text)
}

fn text(overlay: &Overlay) -> String {
    let shipped = reference();
    let unit = &overlay.unit;
    let mut lines: Vec<String> = overlay.head.iter().map(|comment| line(0, "", "", comment)).collect();
    for (key, value) in [("name", &overlay.name), ("source", &overlay.source)] {
        if !value.is_empty() {
            lines.push(line(0, key, &quoted(value), ""));
        }
    }

    let mut section = "";
    for (entry, (tolerance, shipped_tolerance)) in ENTRIES.iter().zip(unit.tolerances.iter().zip(&shipped.tolerances)) {
        let value = (entry.get)(&unit.parameters);
        let comment = overlay.comments.get(entry.key);
        let same = value.to_bits() == (entry.get)(&shipped.parameters).to_bits() && tolerance == shipped_tolerance;
        if same && comment.is_none() {
            continue;
        }
        if section != section_of(entry) {
            section = section_of(entry);
            lines.push(line(0, section, "", ""));
        }
        let mut value = number_text(value);
        if tolerance != shipped_tolerance {
            value = format!("{{value: {value}, unit: \"{}\", tol: {}}}", entry.unit, tolerance_yaml(*tolerance));
        }
        lines.push(line(2, name_of(entry), &value, comment.map_or("", String::as_str)));
    }

    transducers(&mut lines, &unit.sensors, &shipped.sensors);
    recorded(&mut lines, unit);
    if !unit.effects.is_empty() {
        lines.push(line(0, "effects", "", ""));
        unit.effects.iter().for_each(|setting| effects::push(&mut lines, overlay, setting));
    }
    lines.push(String::new());
    lines.join("\n")
}

/// The transducers that differ from the shipped ones.
fn transducers(lines: &mut Vec<String>, sensors: &Sensors, shipped: &Sensors) {
    let differing = SENSOR_ENTRIES.iter().filter(|entry| (entry.get)(sensors) != (entry.get)(shipped));
    for (index, entry) in differing.enumerate() {
        if index == 0 {
            lines.push(line(0, "sensors", "", ""));
        }
        let sensor = (entry.get)(sensors);
        let value = format!("{{noise: {}, step: {}}}", number_text(sensor.noise), number_text(sensor.step));
        lines.push(line(2, entry.name, &value, ""));
    }
}

/// How the positions are recorded, where that is not in pu, and the clock, where it is not the unit's.
fn recorded(lines: &mut Vec<String>, unit: &Unit) {
    if unit.recorded == ChannelReadings::default() {
        return;
    }
    let ChannelReadings { spool_position, servomotor_position, clock_ratio } = unit.recorded;
    lines.push(line(0, "recorded", "", "pu = recorded × scale + offset"));
    let channels = [("spool_position", spool_position), ("servomotor_position", servomotor_position)];
    for (name, reading) in channels.into_iter().filter(|(_, reading)| *reading != ChannelReading::default()) {
        let (scale, offset) = (number_text(reading.scale_pu), number_text(reading.offset_pu));
        lines.push(line(2, name, &format!("{{scale: {scale}, offset: {offset}}}"), ""));
    }
    if clock_ratio != 1.0 {
        let comment = "seconds of the unit for each second recorded";
        lines.push(line(2, "time", &format!("{{scale: {}}}", number_text(clock_ratio)), comment));
    }
}

/// The value of `tol:`.
fn tolerance_yaml(tolerance: Option<Tolerance>) -> String {
    match tolerance {
        None => "~".to_owned(),
        Some(Tolerance::Relative(spread)) => number_text(spread),
        Some(Tolerance::Absolute(spread)) => format!("{}, abs: true", number_text(spread)),
        Some(Tolerance::LogNormal(spread)) => format!("{}, log: true", number_text(spread)),
    }
}

/// One line: indentation, key, value, comment, each where it is there.
fn line(indent: usize, key: &str, value: &str, comment: &str) -> String {
    // A line break in a comment would let its rest be read as keys.
    let comment = comment.split_whitespace().collect::<Vec<_>>().join(" ");
    let mut parts = Vec::new();
    if !key.is_empty() {
        parts.push(format!("{key}:"));
    }
    parts.push(value.to_owned());
    if !comment.is_empty() {
        parts.push(format!("# {comment}"));
    }
    parts.retain(|part| !part.is_empty());
    format!("{:indent$}{}", "", parts.join(" "))
}
