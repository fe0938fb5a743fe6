//! The next tests that reports propose, run on the units' plants, and what is said with their answers.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::Context;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_lab::benchmark::next_test::proposed;

use super::battery::Battery;
use super::cases::UnitFolder;
use super::method::{JudgingMethod, diagnose};
use crate::commands::output::Progress;
use crate::commands::report_file::{self, is_there};

/// Folder of the second diagnosis in a unit's folder of reports.
const FOLDER: &str = "next_test";

/// Its report.
const REPORT: &str = "report.json";

/// Entropy of a posterior from which its test is run, bits: less leaves nothing to settle.
const OPEN_BITS: f64 = 0.1;

/// Where the second diagnosis of a unit is.
fn folder(out: &Path, unit: &str) -> PathBuf {
    out.join(unit).join(FOLDER)
}

/// Removes what was said with the answer to an earlier report's test.
pub fn forget(out: &Path, unit: &str) -> anyhow::Result<()> {
    let folder = folder(out, unit);
    match std::fs::remove_dir_all(&folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
        other => other.with_context(|| format!("cannot remove {}", folder.display())),
    }
}

/// What was said of a unit with the answer to its test; none where none was run.
pub fn report(out: &Path, unit: &str) -> anyhow::Result<Option<DiagnosisReport>> {
    let path = folder(out, unit).join(REPORT);
    if is_there(&path)? { report_file::diagnosis(&path).map(Some) } else { Ok(None) }
}

/// Runs the best test of every unit, side by side; hands out what failed.
pub fn run_all(
    cases: &[UnitFolder],
    made: &Battery,
    judged_by: &[OsString],
    threads: usize,
    out: &Path,
) -> Vec<String> {
    let tried = Progress::each(cases, "next tests", |case| run(case, made, judged_by, threads, out));
    let failed = cases.iter().zip(tried).filter_map(|(case, tried)| Some((case, tried.err()?)));
    failed.map(|(case, error)| format!("{}: next test: {error:#}", case.name)).collect()
}

/// Runs the best test that a unit's report proposes where something is open, and diagnoses the unit with its answer beside the recordings.
fn run(case: &UnitFolder, made: &Battery, judged_by: &[OsString], threads: usize, out: &Path) -> anyhow::Result<()> {
    let path = JudgingMethod::Diagnosis.report_path(out, &case.name);
    let tested = folder(out, &case.name);
    if !is_there(&path)? || is_there(&tested.join(REPORT))? {
        return Ok(());
    }
    let first = report_file::diagnosis(&path)?;
    let Some(proposed) = proposed(&first).filter(|one| one.entropy_bits >= OPEN_BITS) else { return Ok(()) };
    let answer = tempfile::tempdir().context("no temporary folder for the answer to a test")?;
    let Some(bag) = made.answer(&case.name, proposed, answer.path())? else { return Ok(()) };
    diagnose(case, Some(&bag), judged_by, threads, &tested)
}
