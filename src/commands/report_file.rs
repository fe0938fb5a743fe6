//! Reports of diagnoses, read back within bounds, and only as they were written.

use std::path::Path;

use anyhow::{Context, bail};
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_files::{folder_of, look_at, read_text};
use govtwin_model::provenance::Provenance;
use serde::Deserialize;
use serde_json::Value;

use super::diagnose::NAMES;
use super::provenance::file;

/// More than a report of one unit has with all its evidence.
pub const LARGEST_BYTES: u64 = 1 << 24;

/// The text of a report, without the mark of byte order that editors of other systems put before it.
pub fn text(path: &Path) -> anyhow::Result<String> {
    let text = read_text(path, LARGEST_BYTES).with_context(|| format!("cannot read {}", path.display()))?;
    Ok(text.trim_start_matches('\u{feff}').to_owned())
}

/// Whether a file is there. What cannot be looked at is not taken for absent: nothing would be missed where it was left out.
pub fn is_there(path: &Path) -> anyhow::Result<bool> {
    let kind = look_at(path).with_context(|| format!("cannot look at {}", path.display()))?;
    Ok(kind.is_some_and(|kind| kind.is_file()))
}

/// The text of a file of at most so many bytes; nothing where none is there.
pub fn text_if_there(path: &Path, largest_bytes: u64) -> anyhow::Result<Option<String>> {
    if !is_there(path)? {
        return Ok(None);
    }
    read_text(path, largest_bytes).map(Some).with_context(|| format!("cannot read {}", path.display()))
}

/// A report as JSON.
pub fn read(path: &Path) -> anyhow::Result<Value> {
    serde_json::from_str(&text(path)?).with_context(|| path.display().to_string())
}

/// The report of a diagnosis, or of a baseline.
pub fn diagnosis(path: &Path) -> anyhow::Result<DiagnosisReport> {
    of_json(&read(path)?, path)
}

/// The same of its JSON; the files beside it are its own.
pub fn of_json(report: &Value, path: &Path) -> anyhow::Result<DiagnosisReport> {
    let read = DiagnosisReport::of_json(report).with_context(|| path.display().to_string())?;
    let written = read.provenance.iter().flat_map(|made| &made.written);
    for (name, stated) in written.filter(|(name, _)| NAMES.contains(&name.as_str())) {
        let beside = folder_of(path).join(name);
        if !is_there(&beside)? {
            continue;
        }
        let found = file(&beside)?.sha256;
        if found != *stated {
            bail!(
                "{}: {name} beside it: expected the file that was written with the report (SHA-256 {stated:.12}), found another ({found:.12}), changed or of \
                 another diagnosis; take both from one run of `govtwin diagnose`",
                path.display()
            );
        }
    }
    Ok(read)
}

/// What the report in a file was made from; none where it does not say.
pub fn provenance(path: &Path) -> anyhow::Result<Option<Provenance>> {
    made_from(&read(path)?).with_context(|| path.display().to_string())
}

/// What a report was made from; none where it does not say.
pub fn made_from(report: &Value) -> serde_json::Result<Option<Provenance>> {
    report.get("provenance").map_or(Ok(None), Option::deserialize)
}
