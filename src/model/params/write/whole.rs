//! Writes a whole sheet: every parameter with unit, tolerance and source, so that its reader can check and correct each.

use std::path::Path;

use super::{line, name_of, quoted, section_of, tolerance_yaml, transducers};
use crate::parameters::{ENTRIES, Unit};
use crate::params::error::{FileProblem, ParamsError};
use crate::params::number::number_text;
use crate::params::{reference, sheet_over_reference};

/// The contents of a whole sheet besides its values.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WholeSheet {
    /// What the unit is called; left out where empty.
    pub name: String,
    /// Lines of comment at the head of the file.
    pub head: Vec<String>,
    /// The source of each of the parameters, in the order of [`ENTRIES`].
    pub sources: Vec<String>,
}

/// The text of a sheet with every parameter; it reads back as the same unit, whatever the shipped sheet holds.
///
/// # Errors
/// When a value is out of its range or at odds with another.
pub fn whole_text(path: &Path, unit: &Unit, whole: &WholeSheet) -> Result<String, ParamsError> {
    let mut lines: Vec<String> = whole.head.iter().map(|comment| line(0, "", "", comment)).collect();
    if !whole.name.is_empty() {
        lines.push(line(0, "name", &quoted(&whole.name), ""));
    }
    let mut section = "";
    for (place, (entry, tolerance)) in ENTRIES.iter().zip(&unit.tolerances).enumerate() {
        if section != section_of(entry) {
            section = section_of(entry);
            lines.push(line(0, section, "", ""));
        }
        let source = whole.sources.get(place).map_or("", String::as_str);
        let value = format!(
            "{{value: {}, unit: \"{}\", tol: {}, source: {}}}",
            number_text((entry.get)(&unit.parameters)),
            entry.unit,
            tolerance_yaml(*tolerance),
            quoted(source)
        );
        lines.push(line(2, name_of(entry), &value, ""));
    }
    transducers(&mut lines, &unit.sensors, &reference().sensors);
    lines.push(String::new());
    let text = lines.join("\n");
    let invalid =
        |problems| ParamsError::Invalid { what: crate::params::PARAMETER, path: path.to_path_buf(), problems };
    let read = sheet_over_reference(&text, path).map_err(invalid)?;
    if read.unit != *unit {
        let message = "the unit has effects or values that a sheet cannot hold".to_owned();
        return Err(invalid(vec![FileProblem { line: None, key: String::new(), message }]));
    }
    Ok(text)
}
