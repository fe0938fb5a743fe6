//! `govtwin diagnose`: where the gap between a unit and its twin lies, which effect causes it, how far it shrinks.

mod files;
mod given;
pub mod next_test;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, bail};
use clap::builder::PossibleValuesParser;
use govtwin_diagnosis::result::{Diagnosis, Verdict};
use govtwin_diagnosis::{DiagnosisSettings, diagnose};
use govtwin_model::effects::own;
use govtwin_model::parameters::{OwnEffect, Unit};
use govtwin_model::params;
use govtwin_model::provenance::Provenance;
use govtwin_model::recording::Recording;
use govtwin_pages::diagnosis as report;

use super::bags::{MapArgs, Recordings, TopicArgs};
use super::output::{Output, Progress, print, warn_all, width};
use super::provenance;
use crate::commands::{Outcome, sheet_of, unknown};
use given::{By, Given};

pub use files::{FITTED, NAMES, REPORT};
pub use given::UnitArgs;

/// Arguments of `govtwin diagnose`.
#[derive(Debug, Default, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Recordings of one unit: bags, bag folders, or folders that contain them.
    #[arg(value_name = "BAG", required = true)]
    pub(super) bags: Vec<PathBuf>,
    #[command(flatten)]
    pub(super) topics: TopicArgs,
    #[command(flatten)]
    pub(super) map: MapArgs,
    #[command(flatten)]
    pub(super) unit_of: UnitArgs,
    /// Folder for the results [default: diagnosis/UNIT].
    ///
    /// UNIT is the folder that contains the recordings, or the name of the single recording.
    #[arg(long, value_name = "DIR")]
    pub(super) out: Option<PathBuf>,
    /// Replace the report of another unit in the folder; without it, such a report is kept and the command ends with
    /// an error.
    #[arg(long)]
    pub(super) overwrite: bool,
    /// Leave an effect out of the catalogue; may be repeated.
    #[arg(long, value_name = "ID")]
    pub(super) without: Vec<String>,
    /// Add the effects that a parameter file defines to the catalogue (docs/own_effect.md); may be repeated.
    #[arg(long = "candidate", value_name = "FILE")]
    pub(super) candidates: Vec<PathBuf>,
    /// Seed of the bootstrap that gives the intervals of explained fractions.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(super) seed: u64,
    /// True values of the unit with its faults (parameter file), where they are known, as of a simulated unit.
    ///
    /// The report then states the regret of the search: χ² found for the true faults beside χ² reached by a fit from these
    /// values. They are used after the verdict, and for nothing else.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["no_sheet", "stage_alone"])]
    pub(super) true_values: Option<PathBuf>,
    /// Print JSON instead of a summary: the content of DIR/report.json.
    #[arg(long)]
    pub(super) json: bool,
    /// End with exit code 1 on these verdicts, separated by commas; the report is written in any case.
    #[arg(long, value_name = "VERDICTS", value_delimiter = ',', value_parser = PossibleValuesParser::new(Verdict::ALL.map(Verdict::id)))]
    pub(super) fail_on: Vec<String>,
    /// What the unit is called, where whoever asks knows.
    #[arg(skip)]
    pub(super) unit: Option<String>,
    /// Places that stand in for others, each with the one that reports show.
    #[arg(skip)]
    pub(super) stand_ins: Vec<(String, String)>,
}

/// What a diagnosis left, and what there is to say of it.
#[derive(Debug)]
pub struct Diagnosed {
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// The text of its report.
    pub json: String,
    /// What it was made from.
    pub made: Provenance,
    /// The folder of its files.
    out: PathBuf,
    /// What the recordings were judged by.
    by: By,
    /// Nothing was to be warned of while the recordings were read.
    is_clean: bool,
}

const HELP: &str = "\
The diagnosis first fits the parameters of the data sheet within their tolerances, because most
differences are parameter errors. It then adds the effects of the catalogue (`govtwin effects`),
alone and together, and reports one of six verdicts:
  named         cause found: these effects, all present at once
  class         possible causes: one of these effects; the recordings cannot distinguish them
  unknown       no effect of the catalogue explains the difference; the report shows where and how
  no_gap        no difference beyond noise and tolerances
  not_excited   the recordings do not move the unit enough to decide
  no_such_unit  servomotor stage alone: the position follows another law than a servomotor's, or does
                not depend on the spool

Files in DIR:
  report.html     the page; report.json holds the same as JSON
  refitted.yaml   the twin with fitted parameters and no effect
  fitted.yaml     the improved twin, with the effects of the verdict (of a class, the likeliest)
  next_test.mcap  the best next test: command, ESV and tank pressure; absent if none is proposed
  assumed.yaml    the estimated data sheet, with --no-sheet

`govtwin play DIR/next_test.mcap` sends the test to a governor or to the twin. Record the response
as NEW; `govtwin diagnose OLD NEW` then evaluates both. To check the result on another recording,
compare `govtwin replay --params DIR/fitted.yaml BAG` with refitted.yaml.

Reports, pages and parameter files state their provenance: program, digests of the recordings and
of the data sheet, options, seed, warnings and date (that of SOURCE_DATE_EPOCH, if set). A report is
replaced only by one that shares a recording with it, or with --overwrite.

Examples:
  govtwin diagnose bags/practice/case_03               # report in diagnosis/case_03
  govtwin diagnose --no-sheet bags/practice/case_03    # if no data sheet is known
  govtwin diagnose --params unit3.yaml monday.mcap tuesday.mcap --out unit3
  govtwin diagnose --json --fail-on named,class,unknown RUN | jq .verdict

Exit codes: 0 ok, 1 not possible or a verdict of --fail-on, 2 wrong usage, 3 finished with warnings.";

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let Diagnosed { diagnosis, json, out, by, is_clean, .. } = unit(args)?;
    if args.json {
        print(&json)?;
    } else {
        print(&report::summary(&diagnosis, width()))?;
        let unit = by.unit_taken().map_or_else(String::new, |unit| format!("unit: {unit}\n"));
        print(&format!("\n{unit}report: {}\n", out.join("report.html").display()))?;
    }
    warn_all(&diagnosis.notes);
    if args.fail_on.iter().any(|id| id == diagnosis.verdict.id()) {
        bail!("the verdict is {}, on which --fail-on ends with an error", diagnosis.verdict.id());
    }
    Ok(if is_clean && diagnosis.notes.is_empty() { Outcome::Ok } else { Outcome::Warnings })
}

/// Diagnoses a unit, and writes its report.
pub fn unit(args: &Args) -> anyhow::Result<Diagnosed> {
    let sheet = sheet_of(args.unit_of.params.as_deref())?;
    let (settings, own_effects) = settings(args)?;
    let name = args.unit.clone().unwrap_or_else(|| provenance::unit_of(&args.bags));
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from("diagnosis").join(&name));
    let output = Output::claim_over(&out, &files::NAMES, args.overwrite)?;
    let mut made = provenance::new("diagnose", &sheet, Some(args.seed))?;
    let mapped =
        if args.unit_of.stage_alone { args.map.open_as_recorded(&args.bags)? } else { args.map.open(&args.bags)? };
    let topics = args.topics.topics();
    let Given { recordings, mut unit, by } = given::read(&args.unit_of, &mapped.paths, &topics, &sheet.unit)?;
    let Recordings { recordings, warnings, read, .. } = recordings;
    by.describe(&args.unit_of, &unit, &mut made);
    unit.own_effects.extend(own_effects);
    made.recordings = provenance::inputs(&read, &mapped)?;
    if !args.overwrite {
        files::refuse_to_replace(&out, &made)?;
    }
    let warnings = [mapped.warnings, warnings].concat();
    warn_all(&warnings);
    let settings = DiagnosisSettings { setup: by.setup(), ..settings };
    let (mut diagnosis, seconds) = judge(recordings, &unit, &settings)?;
    diagnosis.notes.splice(0..0, by.note().map(str::to_owned));
    describe(&mut made, args, &name, &warnings, &diagnosis)?;
    show(&mut made, &args.stand_ins);
    let json = files::write(output, &diagnosis, (&unit, by.assumed()), &made, seconds)?;
    Ok(Diagnosed { diagnosis, json, made, out, by, is_clean: warnings.is_empty() })
}

/// Puts the places that reports show where others stand in for them.
fn show(made: &mut Provenance, stand_ins: &[(String, String)]) {
    for (from, to) in stand_ins {
        let files = made.recordings.iter_mut().flat_map(|one| &mut one.files).chain(&mut made.sheet.files);
        let texts = files.map(|file| &mut file.path).chain(made.options.values_mut()).chain(&mut made.warnings);
        texts.for_each(|text| *text = text.replace(from, to));
    }
}

/// What to try, and effects of the user's own.
fn settings(args: &Args) -> anyhow::Result<(DiagnosisSettings, Vec<OwnEffect>)> {
    let true_values = args.true_values.as_deref().map(params::load).transpose()?;
    let mut settings = DiagnosisSettings { seed: args.seed, true_values, ..DiagnosisSettings::default() };
    let mut own_effects = vec![];
    for id in &args.without {
        if govtwin_model::effects::find(id).is_none() {
            let known = settings.catalogue.iter().map(|spec| spec.id);
            return Err(unknown(&format!("--without {id}: there is no such effect"), id, known, "govtwin effects"));
        }
        settings.catalogue.retain(|spec| spec.id != id);
    }
    for path in &args.candidates {
        for own in params::load_candidates(path)? {
            let spec = own::spec(&own).map_err(anyhow::Error::msg).with_context(|| path.display().to_string())?;
            if settings.catalogue.iter().any(|known| known.id == own.id) {
                bail!("{}: `{}` is in the catalogue already; give it another id", path.display(), own.id);
            }
            settings.catalogue.push(spec);
            own_effects.push(own);
        }
    }
    Ok((settings, own_effects))
}

/// Diagnoses with a progress bar; also how long it took, s.
#[expect(clippy::disallowed_methods, reason = "a report says how long it took")]
fn judge(recordings: Vec<Recording>, unit: &Unit, settings: &DiagnosisSettings) -> anyhow::Result<(Diagnosis, f64)> {
    let start = Instant::now();
    let progress = Progress::new(100, "%");
    let diagnosis = diagnose(recordings, unit, settings, &|what, share| progress.at(share, what))?;
    Ok((diagnosis, start.elapsed().as_secs_f64()))
}

/// Completes what the report was made from: options, warnings, recordings that the diagnosis left out.
fn describe(
    made: &mut Provenance,
    args: &Args,
    name: &str,
    warnings: &[String],
    diagnosis: &Diagnosis,
) -> anyhow::Result<()> {
    name.clone_into(&mut made.unit);
    made.warnings = [warnings, &diagnosis.notes].concat();
    provenance::note_left_out(made, "Left out: ", &diagnosis.notes);
    provenance::note(made, "without", &args.without);
    provenance::note_files(made, "candidate", &args.candidates)?;
    provenance::note_files(made, "true-values", &args.true_values)?;
    provenance::options(&args.topics, &args.map, made)
}
