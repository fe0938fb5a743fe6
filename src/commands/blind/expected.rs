//! Which recordings and which data sheet the reports of a folder must be of.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context, bail};
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::result::sealed;
use govtwin_model::parameters::Unit;
use govtwin_model::params::{Sheet, unit_digest};
use govtwin_model::provenance::{FileUsed, Provenance, RecordingGiven};
use serde_json::Value;

use super::cases::UnitFolder;
use crate::commands::{provenance, report_file};

/// Digests of the recordings of every unit, and of the sheet.
#[derive(Debug)]
pub struct ExpectedDigests {
    recordings: BTreeMap<String, Vec<FileUsed>>,
    /// None where each unit is judged by a sheet made of its own recordings.
    sheet: Option<String>,
    /// Reports that do not say what they are of count as well.
    unchecked: bool,
}

impl ExpectedDigests {
    /// Looks at all bags.
    pub fn new(cases: &[UnitFolder], sheet: Option<&Unit>, unchecked: bool) -> anyhow::Result<Self> {
        let of = |case: &UnitFolder| Ok((case.name.clone(), provenance::files_of_bags(&case.bags()?)));
        let recordings = cases.iter().map(of).collect::<anyhow::Result<_>>()?;
        Ok(Self { recordings, sheet: sheet.map(unit_digest), unchecked })
    }

    /// The recordings of all units, by the names of the units.
    pub fn inputs(&self, origin: Option<&str>) -> Vec<RecordingGiven> {
        let of = |(name, used): (&String, &Vec<FileUsed>)| RecordingGiven {
            name: name.clone(),
            files: used.clone(),
            synthetic: origin.is_some_and(provenance::says_synthetic),
            origin: origin.map(str::to_owned),
            ..RecordingGiven::default()
        };
        self.recordings.iter().map(of).collect()
    }

    /// What a baseline's report is made from.
    pub fn made(&self, case: &UnitFolder, method: &str, sheet: &Sheet) -> anyhow::Result<Provenance> {
        let mut made = provenance::new(&format!("blind, baseline {method}"), sheet, None)?;
        made.unit.clone_from(&case.name);
        let files = self.recordings.get(&case.name).cloned().unwrap_or_default();
        made.recordings = vec![RecordingGiven { name: case.name.clone(), files, ..RecordingGiven::default() }];
        Ok(made)
    }

    /// Reads a report of a unit; none where it is of something else. One of an early program, which has no digests, is taken as it is where that was asked
    /// for.
    pub fn read(&self, path: &Path, case: &str) -> anyhow::Result<Option<DiagnosisReport>> {
        let Ok(report) = self.checked(path, case) else { return Ok(None) };
        let report = if report.get("digests").is_none() { sealed(report) } else { report };
        report_file::of_json(&report, path).map(Some)
    }

    /// Reads a report, and refuses one of other recordings or of another sheet than the unit's.
    pub fn checked(&self, path: &Path, case: &str) -> anyhow::Result<Value> {
        let shown = path.display();
        let report = report_file::read(path)?;
        if !self.unchecked && report.get("digests").is_none() {
            bail!(
                "{shown} holds no digests: it was changed, or is of an early program; remove it, so that the unit is judged anew, or take such reports as they \
                 are with --unchecked"
            );
        }
        let Some(made) = report_file::made_from(&report).with_context(|| shown.to_string())? else {
            if self.unchecked {
                return Ok(report);
            }
            bail!(
                "{shown} does not say which recordings and data sheet it is of; remove it, so that the unit is judged anew, or take such reports \
                 as they are with --unchecked"
            );
        };
        let wanted = self.recordings.get(case).map(|files| {
            let mut all: Vec<&str> = files.iter().map(|file| file.sha256.as_str()).collect();
            all.sort_unstable();
            all
        });
        if wanted.as_ref() != Some(&made.digests()) {
            bail!(
                "{shown} is of other recordings than those of {case} (it names {}); remove it, so that the unit is judged anew",
                named(&made.recordings.iter().map(|one| one.name.as_str()).collect::<Vec<_>>())
            );
        }
        let is_made = made.options.contains_key("no-sheet");
        let Some(sheet) = &self.sheet else {
            if is_made {
                return Ok(report);
            }
            bail!(
                "{shown} was made with a data sheet ({}); leave --no-sheet out, or remove the report, so that the unit is judged anew",
                made.sheet.name
            );
        };
        if made.sheet.sha256 != *sheet {
            let name = match made.sheet.files.first() {
                Some(file) => &file.path,
                None if is_made => "made of its recordings",
                None => "the shipped one",
            };
            bail!(
                "{shown} was made with another data sheet ({name}); give that one with --params, or remove the report, so that the unit is \
                 judged anew"
            );
        }
        Ok(report)
    }
}

fn named(names: &[&str]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
