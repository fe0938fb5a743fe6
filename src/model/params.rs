//! Parameter files: the shipped unit, overlays over it, and errors with suggested fixes.
//!
//! A file holds only what differs from the shipped unit, or from the file that its `base` names:
//!
//! ```yaml
//! name: unit 2 after the overhaul
//! base: station.yaml                  # optional, beside this file; `reference_unit` is the shipped one, as without `base`
//! source: overhaul protocol           # optional, for every value of the file
//! oil:
//!   bulk_modulus_pa: 1.1e9            # a bare number keeps the tolerance
//!   density_kg_m3: {value: 865.0, unit: kg/m3, tol: 0.01, source: laboratory}
//! sensors:
//!   spool_position_pu: {noise: 5.0e-4}
//! ```
//!
//! Keys and physical ranges are those of [`crate::parameters::ENTRIES`]. A tolerance is the standard
//! deviation from unit to unit: relative, or with `abs: true` in the parameter's unit, or with
//! `log: true` of the natural logarithm; `tol: ~` takes it away.

mod consistency;
pub mod error;
mod merge;
mod number;
mod sheet;
pub mod suggest;
mod write;
pub mod yaml;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use crate::parameters::{ENTRIES, OwnEffect, Parameters, SENSOR_ENTRIES, Unit};
use govtwin_files::read_text;

pub use consistency::{Conflict, conflicts};
pub use error::{FileProblem, ParamsError};
pub use number::{number_text, quantity_text, tolerance_text};
pub use sheet::{Origin, Sheet, unit_digest};
pub use suggest::nearest;
pub use write::{Overlay, WholeSheet, overlay_text, whole_text, write};

/// What a `base` may be called that is the shipped unit, where no file has that name.
const SHIPPED_NAME: &str = "reference_unit";

/// Text of the shipped sheet.
const REFERENCE: &str = include_str!("../../params/reference_unit.yaml");

/// What errors call such a file.
const PARAMETER: &str = "parameter";

/// More than any parameter file holds; guards against being handed a bag.
const LARGEST_FILE_BYTES: u64 = 1 << 20;

#[expect(clippy::expect_used, reason = "the text is part of the program; a test reads it")]
static SHIPPED: LazyLock<Sheet> = LazyLock::new(|| read_reference().expect("the shipped sheet is whole"));

/// The reference unit as shipped with the program: a full-sized governor, of which the shipped recordings are simulated.
///
/// ```
/// let unit = govtwin_model::params::reference();
/// assert!(unit.effects.is_empty() && unit.parameters.servomotor.stroke_m > 0.0);
/// ```
pub fn reference() -> Unit {
    SHIPPED.unit.clone()
}

/// Its parameters alone.
pub(crate) fn reference_parameters() -> &'static Parameters {
    &SHIPPED.unit.parameters
}

/// The shipped sheet with the sources of its values.
pub fn reference_sheet() -> Sheet {
    SHIPPED.clone()
}

/// The unit that a parameter file describes: the shipped unit, changed by what the file states.
///
/// # Errors
/// When the file or one of its bases cannot be read, or holds anything that is not right; all
/// problems of a file come at once.
pub fn load(path: &Path) -> Result<Unit, ParamsError> {
    load_sheet(path).map(|sheet| sheet.unit)
}

/// Like [`load`], with the sources of the values.
///
/// # Errors
/// As [`load`].
pub fn load_sheet(path: &Path) -> Result<Sheet, ParamsError> {
    load_over(path, &mut Vec::new())
}

/// The owner's effects that a parameter file defines: hypotheses for a fit or a diagnosis to try.
///
/// # Errors
/// As [`load`], and when the file defines none.
pub fn load_candidates(path: &Path) -> Result<Vec<OwnEffect>, ParamsError> {
    let own = load(path)?.own_effects;
    if own.is_empty() {
        let message = "no effect of your own in it: expected `at`, `expression` and `parameters` below an id";
        let problem = FileProblem { line: None, key: "effects".to_owned(), message: message.to_owned() };
        return Err(ParamsError::Invalid { what: PARAMETER, path: path.to_path_buf(), problems: vec![problem] });
    }
    Ok(own)
}

/// Loads `path` over its bases; `open` holds the files that are being loaded, to find a circle.
fn load_over(path: &Path, open: &mut Vec<PathBuf>) -> Result<Sheet, ParamsError> {
    let identity = path.canonicalize().map_err(|reason| ParamsError::Read {
        what: PARAMETER,
        path: path.to_path_buf(),
        reason,
    })?;
    let text = read(PARAMETER, path)?;
    let invalid = |problems| ParamsError::Invalid { what: PARAMETER, path: path.to_path_buf(), problems };
    // What stands in a file that only a `base` names is quoted once it is known for a parameter file: it may be anybody's.
    let is_base = !open.is_empty();
    let unquoted = |problems: Vec<FileProblem>| {
        let line = problems.first().and_then(|problem| problem.line);
        let message = "expected a parameter file, with sections such as `oil:`, found something else; `govtwin check` on this file says what";
        invalid(vec![FileProblem { line, key: String::new(), message: message.to_owned() }])
    };
    let document = parse(&text).map_err(|problems| if is_base { unquoted(problems) } else { invalid(problems) })?;
    open.push(identity);
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut sheet = match document.text("base") {
        None => reference_sheet(),
        Some(SHIPPED_NAME) if !folder.join(SHIPPED_NAME).exists() => reference_sheet(),
        Some(base) => {
            let base = folder.join(base);
            let at_base = |message| {
                invalid(vec![FileProblem { line: document.line(&["base"]), key: "base".to_owned(), message }])
            };
            let known = base.canonicalize().map_err(|error| {
                at_base(format!(
                    "cannot read {}: {error}; expected the path of another parameter file, from this one's folder; without `base` a file differs from \
                     the shipped unit",
                    base.display()
                ))
            })?;
            if open.contains(&known) {
                return Err(at_base(format!(
                    "{} rests on itself; one file of the circle must drop `base`",
                    base.display()
                )));
            }
            load_over(&base, open)?
        }
    };
    let problems = merge::merge(&document, Some(path), &mut sheet);
    if !problems.is_empty() {
        let is_foreign = is_base && !merge::has_sections(&document);
        return Err(if is_foreign { unquoted(problems) } else { invalid(problems) });
    }
    sheet.files.push(path.to_path_buf());
    Ok(sheet)
}

/// The shipped sheet with `text` over it, without bases; `path` is the file that holds or will hold the text.
fn sheet_over_reference(text: &str, path: &Path) -> Result<Sheet, Vec<FileProblem>> {
    let document = parse(text)?;
    let mut sheet = reference_sheet();
    let problems = merge::merge(&document, Some(path), &mut sheet);
    if problems.is_empty() { Ok(sheet) } else { Err(problems) }
}

fn parse(text: &str) -> Result<yaml::Document, Vec<FileProblem>> {
    yaml::parse(text)
        .map_err(|error| vec![FileProblem { line: error.line, key: String::new(), message: error.message }])
}

/// The text of a file; `what` says in errors which kind of file it is.
///
/// # Errors
/// Where the file cannot be read as text.
pub fn read(what: &'static str, path: &Path) -> Result<String, ParamsError> {
    read_text(path, LARGEST_FILE_BYTES).map_err(|reason| ParamsError::Read { what, path: path.to_path_buf(), reason })
}

fn read_reference() -> Result<Sheet, Vec<FileProblem>> {
    let document = parse(REFERENCE)?;
    let mut sheet = Sheet::blank();
    let mut problems = merge::merge(&document, None, &mut sheet);
    let sensors = SENSOR_ENTRIES.iter().map(|entry| format!("sensors.{}", entry.name));
    for key in ENTRIES.iter().map(|entry| entry.key.to_owned()).chain(sensors) {
        if !sheet.origins.contains_key(&key) {
            problems.push(FileProblem { line: None, key, message: "missing from the shipped sheet".to_owned() });
        }
    }
    if problems.is_empty() { Ok(sheet) } else { Err(problems) }
}
