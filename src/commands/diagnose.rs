//! `govtwin diagnose`: where the gap between a unit and its twin lies, which effect causes it, how far it shrinks.

pub mod next_test;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, bail};
use govtwin::diagnosis::outcome::{Diagnosis, Fitted, Verdict};
use govtwin::diagnosis::{Settings, contract, diagnose};
use govtwin::effects::own;
use govtwin::parameters::Unit;
use govtwin::params::{self, Overlay};
use govtwin::recording::Recording;
use govtwin::report::diagnosis as report;

use super::bags::{self, MapArgs, Recordings, TopicArgs};
use super::output::{Output, Progress, print, warn};
use super::replay::origin;
use crate::commands::Outcome;

/// Arguments of `govtwin diagnose`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Recordings of one unit: bags, bag folders, or folders that hold them.
    #[arg(value_name = "BAG", required = true)]
    bags: Vec<PathBuf>,
    #[command(flatten)]
    topics: TopicArgs,
    #[command(flatten)]
    map: MapArgs,
    /// The unit's data sheet; without it the shipped reference unit.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Folder for report.json, report.html, refitted.yaml, fitted.yaml and next_test.mcap.
    #[arg(long, value_name = "DIR", default_value = "diagnosis")]
    out: PathBuf,
    /// Leaves an effect out of the catalogue; may be repeated.
    #[arg(long, value_name = "ID")]
    without: Vec<String>,
    /// Tries the effects that a parameter file defines beside the catalogue's; may be repeated.
    #[arg(long = "candidate", value_name = "FILE")]
    candidates: Vec<PathBuf>,
    /// No data sheet is known: judges the servomotor stage alone, driven by the recorded spool, all of it fitted freely, from positions
    /// in any unit. Taken for granted where no recording holds a command and no sheet is given.
    #[arg(long, conflicts_with = "params")]
    free: bool,
    /// Seed of the resampling behind the intervals of closures.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

const HELP: &str = "\
First refits the sheet's parameters within their tolerances: most gaps are parameters. Then tries every effect of the catalogue
(`govtwin effects`) on top, alone and together, and says one of six things:
  named        these effects, all present at once
  class        one of these effects; the recordings cannot tell which, and the report says which test would
  unknown      a gap that nothing in the catalogue explains, with its place and shape
  no_gap       nothing beyond noise and tolerances
  not_excited  the recordings do not move the unit enough to tell
  no_such_unit of a stage alone: the position follows another law than a servomotor's, or nothing of the spool
DIR/next_test.mcap is the test that is expected to settle most of what is open, a script of command, ESV and tank pressure: `govtwin play` sends
it to a governor or to the twin. Record the answer as NEW; `govtwin diagnose OLD NEW` then judges both. Where nothing is open there is no such file.
`govtwin replay --params DIR/fitted.yaml BAG` tries the claim on another recording, refitted.yaml the twin without it.

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 finished with warnings.";

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let mut unit = match &args.params {
        Some(path) => params::load(path)?,
        None => params::reference(),
    };
    let mut settings = Settings { seed: args.seed, free: args.free, ..Settings::default() };
    for id in &args.without {
        govtwin::effects::find(id).with_context(|| format!("--without {id}: no such effect; see `govtwin effects`"))?;
        settings.catalogue.retain(|spec| spec.id != id);
    }
    for path in &args.candidates {
        for own in params::load_candidates(path)? {
            let spec = own::spec(&own).map_err(anyhow::Error::msg).with_context(|| path.display().to_string())?;
            if settings.catalogue.iter().any(|known| known.id == own.id) {
                bail!("{}: `{}` is in the catalogue already; give it another id", path.display(), own.id);
            }
            settings.catalogue.push(spec);
            unit.own_effects.push(own);
        }
    }
    let output =
        Output::claim(&args.out, &["report.json", "report.html", "refitted.yaml", "fitted.yaml", contract::NEXT_TEST])?;
    let mapped = args.map.open(&args.bags)?;
    let topics = args.topics.topics();
    let (Recordings { recordings, warnings }, free) = match args.params {
        Some(_) => (bags::read(&mapped.paths, &topics, &unit)?, false),
        None => bags::read_without_sheet(&mapped.paths, &topics, &unit, args.free)?,
    };
    let warnings = [mapped.warnings, warnings].concat();
    for warning in &warnings {
        warn(warning);
    }
    settings.free = free;
    let (diagnosis, seconds) = judge(recordings, &unit, &settings)?;
    write(output, &diagnosis, &unit, &origins(&args.bags), seconds)?;
    print(&report::summary(&diagnosis))?;
    print(&format!("\nreport: {}\n", args.out.join("report.html").display()))?;
    for note in &diagnosis.notes {
        warn(note);
    }
    Ok(if warnings.is_empty() && diagnosis.notes.is_empty() { Outcome::Ok } else { Outcome::Warnings })
}

/// What the folders of the recordings say of where they come from, each saying once.
fn origins(paths: &[PathBuf]) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for origin in paths.iter().filter_map(|path| origin::of(path)) {
        if !all.contains(&origin) {
            all.push(origin);
        }
    }
    all
}

/// Diagnoses with a progress bar; also how long it took, s.
#[expect(clippy::disallowed_methods, reason = "a report says how long it took")]
fn judge(recordings: Vec<Recording>, unit: &Unit, settings: &Settings) -> anyhow::Result<(Diagnosis, f64)> {
    let start = Instant::now();
    let progress = Progress::new(100, "%");
    let diagnosis = diagnose(recordings, unit, settings, &|what, share| progress.at(share, what))?;
    Ok((diagnosis, start.elapsed().as_secs_f64()))
}

/// Writes the files of a report into a folder.
fn write(
    mut output: Output,
    diagnosis: &Diagnosis,
    unit: &Unit,
    origins: &[String],
    seconds: f64,
) -> anyhow::Result<()> {
    let mut json = serde_json::to_string_pretty(&contract::report(diagnosis, seconds))
        .context("cannot write the report as JSON")?;
    json.push('\n');
    overlay(&mut output, "refitted.yaml", &diagnosis.refitted, "refitted within tolerances, without any effect", &[])?;
    let what = match diagnosis.verdict {
        Verdict::Named => "refitted with the effects that the diagnosis names",
        Verdict::Class => "refitted with the most probable of the effects that the diagnosis could not tell apart",
        _ => "refitted within tolerances; the diagnosis names no effect",
    };
    overlay(&mut output, "fitted.yaml", &diagnosis.fitted, what, &diagnosis.parameters)?;
    match next_test::file(diagnosis, &output.path(contract::NEXT_TEST), &unit.parameters)? {
        Some(script) => output.add(contract::NEXT_TEST, &script)?,
        None => output.remove(contract::NEXT_TEST),
    }
    output.add("report.html", report::page(diagnosis, origins)?.to_html().as_bytes())?;
    output.add("report.json", json.as_bytes())?;
    output.place()
}

fn overlay(output: &mut Output, name: &str, unit: &Unit, what: &str, parameters: &[Fitted]) -> anyhow::Result<()> {
    let mut unit = unit.clone();
    unit.own_effects.retain(|own| unit.effects.iter().any(|setting| setting.id == own.id));
    let comments: BTreeMap<String, String> = parameters
        .iter()
        .filter(|one| one.name.contains('.'))
        .map(|one| (one.name.clone(), format!("90 %: {:.4e} to {:.4e} {}", one.value.low, one.value.high, one.unit)))
        .collect();
    let text = params::overlay_text(
        &output.path(name),
        &Overlay {
            unit,
            name: String::new(),
            source: "govtwin diagnose".to_owned(),
            head: vec![format!("The unit {what}.")],
            comments,
        },
    )?;
    output.add(name, text.as_bytes())
}
