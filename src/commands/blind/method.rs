//! The methods that judge a unit: the diagnosis, in a process of its own that is given bags, and true values for the regret after its verdict alone; and
//! the baselines.

use std::cell::OnceCell;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, bail};
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_lab::baselines::ground::Ground;
use govtwin_lab::baselines::{BASELINES, Baseline};
use govtwin_model::params::Sheet;

use super::cases::UnitFolder;
use super::expected::ExpectedDigests;
use super::next_test;
use crate::commands::output::write_atomically;
use crate::commands::parent;
use crate::commands::report_file::is_there;

/// A method that says something of a unit.
#[derive(Clone, Copy, Debug)]
pub enum JudgingMethod {
    /// `govtwin diagnose`.
    Diagnosis,
    /// One of the baselines.
    Baseline(&'static Baseline),
}

impl JudgingMethod {
    /// Its name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Diagnosis => "govtwin",
            Self::Baseline(baseline) => baseline.id,
        }
    }

    /// Where it leaves what it said of a unit.
    pub fn report_path(self, out: &Path, case: &str) -> PathBuf {
        match self {
            Self::Diagnosis => out.join(case).join("report.json"),
            Self::Baseline(baseline) => out.join(case).join(format!("baseline_{}.json", baseline.id)),
        }
    }

    /// What it said of a unit; none where it has not spoken, or of something else.
    pub fn report(
        self,
        (out, expected): (&Path, &ExpectedDigests),
        case: &str,
    ) -> anyhow::Result<Option<DiagnosisReport>> {
        let path = self.report_path(out, case);
        if is_there(&path)? { expected.read(&path, case) } else { Ok(None) }
    }
}

/// The methods asked for.
pub fn methods(baselines: bool, baselines_only: bool) -> Vec<JudgingMethod> {
    let others = BASELINES.iter().map(JudgingMethod::Baseline).filter(|_| baselines || baselines_only);
    (!baselines_only).then_some(JudgingMethod::Diagnosis).into_iter().chain(others).collect()
}

/// Lets every method judge a unit, unless its report is there already; the diagnosis on so many threads, by the sheet that these arguments name.
pub fn judge(
    case: &UnitFolder,
    (sheet, expected): (&Sheet, &ExpectedDigests),
    judged_by: &[OsString],
    methods: &[JudgingMethod],
    threads: usize,
    out: &Path,
) -> anyhow::Result<()> {
    let ground: OnceCell<Ground> = OnceCell::new();
    for method in methods {
        let path = method.report_path(out, &case.name);
        if is_there(&path)? {
            expected.checked(&path, &case.name)?;
            continue;
        }
        match method {
            JudgingMethod::Diagnosis => {
                next_test::forget(out, &case.name)?;
                diagnose(case, None, judged_by, threads, &out.join(&case.name))?;
            }
            JudgingMethod::Baseline(baseline) => {
                if ground.get().is_none() {
                    let made = Ground::new(case.recordings(&sheet.unit)?, &sheet.unit, &case.catalogue());
                    // Nobody else can have set it.
                    let _ = ground.set(made);
                }
                let Some(ground) = ground.get() else { continue };
                let mut report = (baseline.judge)(ground);
                report.provenance = Some(expected.made(case, baseline.id, sheet)?);
                write_atomically(&path, format!("{:#}\n", report.json()).as_bytes())?;
            }
        }
    }
    Ok(())
}

/// Runs `govtwin diagnose` on the bags of a unit, and on one more. Units are judged side by side; figures do not depend on the threads.
pub fn diagnose(
    case: &UnitFolder,
    further: Option<&Path>,
    judged_by: &[OsString],
    threads: usize,
    out: &Path,
) -> anyhow::Result<()> {
    let program = std::env::current_exe().context("cannot find this program's own file")?;
    let mut command = Command::new(program);
    command.env("RAYON_NUM_THREADS", threads.to_string()).arg("diagnose").arg("--overwrite").arg("--out").arg(out);
    parent::tell(&mut command);
    command.args(judged_by);
    if let Some(without) = &case.without {
        command.arg("--without").arg(without);
    }
    if let Some(true_values) = &case.true_values {
        command.arg("--true-values").arg(true_values);
    }
    command.args(case.topics.arguments()).args(case.bags()?.into_iter().map(|bag| bag.path)).args(further);
    let ended = command.stdin(Stdio::null()).output().context("cannot start the diagnosis")?;
    if !matches!(ended.status.code(), Some(0 | 3)) {
        let words = String::from_utf8_lossy(&ended.stderr);
        bail!("the diagnosis failed ({}): {}", ended.status, words.trim());
    }
    Ok(())
}
