//! `replay --require` and `--against`: the replay as a test that can fail, for people and for CI servers.

use std::path::{Path, PathBuf};

use anyhow::Context;
use govtwin_diagnosis::replay_summary::{ReplaySummary, cut_id};
use govtwin_diagnosis::replay_validation::{Baseline, Check, RequiredLimit, Stretch, Validation, validate};
use govtwin_files::Claim;
use govtwin_model::replay::Replayed;
use govtwin_pages::replay::worst_stretch_of;
use quick_junit::{NonSuccessKind, Report, TestCase, TestCaseStatus, TestSuite};

use super::Args;
use crate::commands::output::{claim_place, write_atomically};
use crate::commands::usage;

/// Larger files are no baseline and hold no limits, bytes.
const LARGEST_BYTES: u64 = 1 << 28;

/// Broken checks that standard output lists; the JSON has all.
const MOST_LISTED: usize = 20;

/// What a replay is held against.
pub struct Requirements {
    limits: Vec<RequiredLimit>,
    baseline: Option<Baseline>,
    worse_by: f64,
    junit: Option<(PathBuf, Claim)>,
}

impl Requirements {
    /// What the command line asks for, read before the work; `None` where it asks for nothing.
    pub fn read(args: &Args, models: usize) -> anyhow::Result<Option<Self>> {
        if args.require.is_empty() && args.against.is_none() {
            return if args.junit.is_some() {
                Err(usage("--junit reports limits: give --require or --against"))
            } else {
                Ok(None)
            };
        }
        if !args.then.is_empty() || models > 1 {
            return Err(usage("--require and --against judge one unit: leave out --then and further --residual"));
        }
        let mut limits = Vec::new();
        for text in &args.require {
            match text.strip_prefix('@') {
                Some(path) => limits.extend(limits_of(Path::new(path))?),
                None => limits.push(text.parse().map_err(|error| usage(format!("--require: {error}")))?),
            }
        }
        let baseline = args.against.as_deref().map(|path| {
            let text = govtwin_files::read_bytes(path, LARGEST_BYTES).with_context(|| named(args))?;
            Baseline::read(&text).with_context(|| named(args))
        });
        let baseline = baseline.transpose()?;
        let junit =
            args.junit.as_ref().map(|path| Ok::<_, anyhow::Error>((path.clone(), claim_place("--junit", path)?)));
        Ok(Some(Self { limits, baseline, worse_by: args.worse_by, junit: junit.transpose()? }))
    }

    /// Refuses a baseline that was made otherwise than this replay.
    pub fn suit(&mut self, args: &Args, inputs: &str, is_corrected: bool) -> anyhow::Result<()> {
        let Some(baseline) = self.baseline.take() else { return Ok(()) };
        let cut = cut_id(args.cut.cut());
        self.baseline = Some(baseline.of_replay(cut, inputs, is_corrected).with_context(|| named(args))?);
        Ok(())
    }

    /// Holds the figures against them; `replayed` stand in the order of the summary's recordings.
    pub fn judge(&self, summary: &ReplaySummary, replayed: &[&Replayed]) -> Validation {
        let baseline = self.baseline.as_ref().map(|baseline| (baseline, self.worse_by));
        validate(summary, &self.limits, baseline, |at, signal| {
            let [from_s, to_s] = worst_stretch_of(replayed.get(at)?, signal)?;
            Some(Stretch { from_s, to_s })
        })
    }

    /// Writes the report for a CI server, where one is asked for.
    pub fn write(&self, validation: &Validation) -> anyhow::Result<()> {
        let Some((path, _)) = &self.junit else { return Ok(()) };
        write_atomically(path, junit(validation).to_string().context("--junit")?.as_bytes())
    }
}

fn named(args: &Args) -> String {
    format!("--against {}", args.against.as_deref().unwrap_or(Path::new("")).display())
}

/// The limits of a file, one a line; what stands behind a `#` is for people.
fn limits_of(path: &Path) -> anyhow::Result<Vec<RequiredLimit>> {
    let named = || format!("--require @{}", path.display());
    let text = govtwin_files::read_text(path, LARGEST_BYTES).with_context(named)?;
    let lines = text.lines().enumerate().map(|(at, line)| (at + 1, line.split('#').next().unwrap_or_default().trim()));
    let limits = lines.filter(|(_, line)| !line.is_empty());
    let limits: Vec<RequiredLimit> = limits
        .map(|(at, line)| line.parse().with_context(|| format!("{}:{at}", path.display())))
        .collect::<anyhow::Result<_>>()?;
    anyhow::ensure!(!limits.is_empty(), "{}: expected limits, one a line, found none", named());
    Ok(limits)
}

/// What people read of it.
pub fn text(validation: &Validation) -> String {
    let broken: Vec<&Check> = validation.broken().collect();
    let all = validation.checks.len();
    let mut text = format!("Validation: {} of {all} checks pass.\n", all - broken.len());
    text.extend(broken.iter().take(MOST_LISTED).map(|check| format!("  fails  {check}\n")));
    if broken.len() > MOST_LISTED {
        text += &format!("  and {} more\n", broken.len() - MOST_LISTED);
    }
    text
}

/// One suite a recording, process or overall, one case a check.
fn junit(validation: &Validation) -> Report {
    let mut suites: Vec<TestSuite> = Vec::new();
    for check in &validation.checks {
        let mut status = TestCaseStatus::success();
        if check.is_broken() {
            status = TestCaseStatus::non_success(NonSuccessKind::Failure);
            status.set_type("limit").set_message(check.to_string());
        }
        let signal = govtwin_diagnosis::replay_validation::short_name(check.signal);
        let mut case = TestCase::new(format!("{signal}.{}: {}", check.measure.id(), check.limit), status);
        case.set_classname(format!("govtwin.replay.{}", check.of));
        let at = suites.iter().position(|suite| suite.name.as_str() == check.of).unwrap_or_else(|| {
            suites.push(TestSuite::new(check.of.as_str()));
            suites.len() - 1
        });
        suites[at].add_test_case(case);
    }
    let mut report = Report::new("govtwin replay");
    report.add_test_suites(suites);
    report
}
