//! `govtwin replay`: simulate recordings and compare with what was measured.

mod ladder;
pub mod origin;
mod residual;
mod rows;
mod simulated;

use std::path::{Path, PathBuf};

use anyhow::bail;
use clap::ValueEnum;
use govtwin::bag::{self, Interpolation, Loaded, Positions, ReadOptions, Sealed, Stream};
use govtwin::files::remove_stale;
use govtwin::parameters::Unit;
use govtwin::params::{self, Sheet};
use govtwin::recording::Recording;
use govtwin::replay::Replayed;
use govtwin::replay::ladder::Ladder;
use govtwin::replay::summary::{Parameters, Provenance, Residual, Summary, summarise};
use govtwin::report::replay::{Pictures, ladder_table, page, process_table, reason_for_dashes, reason_for_stars};
use govtwin::residual::corrector::Corrector;
use govtwin::residual::guard::Counts;
use govtwin::twin::{Cut, Twin};
use govtwin::units::nanos_from_seconds;
use rayon::iter::{IntoParallelIterator, IntoParallelRefIterator, ParallelIterator};

use super::bags::{self, Bag, MapArgs, Mapped, TopicArgs};
use super::model;
use super::output::{Output, Progress, print, warn};
use crate::commands::Outcome;

/// The page.
const PAGE: &str = "replay.html";

/// The figures.
const FIGURES: &str = "replay.json";

/// Simulate recordings and compare with what was measured.
///
/// Prints MAE, RMSE and R² of servomotor and spool per process and overall. With --out, also writes
/// replay.html (pictures), replay.json (all figures) and, for each recording, a bag with the
/// simulated state on /sim/servo_state beside everything that was recorded.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Bags: files, bag folders, or folders that hold bags. A folder without metadata.yaml stands
    /// for the separate bags in it.
    #[arg(value_name = "BAG", required = true)]
    bags: Vec<PathBuf>,
    #[command(flatten)]
    topics: TopicArgs,
    #[command(flatten)]
    map: MapArgs,
    /// Parameter file of the unit; without it the shipped reference unit.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// The measured signal that stands in for the simulated one, so that a stage is judged by its own input.
    #[arg(long, value_enum, default_value_t = CutAt::None)]
    cut: CutAt,
    /// Also correct the twin by this model of `govtwin train`, and show what that leaves. Several may be given, then or with
    /// `--then` each on top of the unit that it was trained for, as rungs of a ladder.
    #[arg(long, value_name = "MODEL")]
    residual: Vec<PathBuf>,
    /// Let the residual adapt to a unit that ages, from recording to recording in time: watch the measured signal for drift and
    /// follow it by a bounded bias and gain.
    #[arg(long, requires = "residual")]
    adapt: bool,
    /// Also replay through this parameter file, such as refitted.yaml and then fitted.yaml of a diagnosis: one table with all of them.
    #[arg(long, value_name = "FILE")]
    then: Vec<PathBuf>,
    /// What command and tank pressure do between two recorded samples.
    #[arg(long, value_enum, default_value_t = Between::Hold)]
    rate_of_inputs: Between,
    /// Folder for the page, the figures and the simulated bags; made where missing. Of the bags there only those of an earlier
    /// replay are replaced.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum CutAt {
    /// Everything is simulated.
    None,
    /// The measured servomotor position feeds the regulator: judges the spool (the paper's mode).
    Servomotor,
    /// The measured spool position drives the servomotor: judges the servomotor stage alone.
    Spool,
}

impl CutAt {
    fn cut(self) -> Cut {
        match self {
            Self::None => Cut::None,
            Self::Servomotor => Cut::Servomotor,
            Self::Spool => Cut::Spool,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Between {
    /// They hold, as for the live node.
    Hold,
    /// They run straight from sample to sample, which a slow recording of a fast command needs.
    Linear,
}

/// One bag, replayed, with what was drawn of it.
struct Result {
    replayed: Replayed,
    provenance: Provenance,
    pictures: Option<Pictures>,
    corrected: Option<(Replayed, Counts)>,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let sheet = match &args.params {
        Some(path) => params::load_sheet(path)?,
        None => params::reference_sheet(),
    };
    let mapped = args.map.open(&args.bags)?;
    let bags = bags::find(&mapped.paths)?;
    let output = args.out.as_ref().map(|out| Output::claim(out, &[PAGE, FIGURES])).transpose()?;
    if let Some(out) = &args.out {
        refuse_to_overwrite(out, &bags)?;
    }
    let models = args.residual.iter().map(|path| Ok((path.as_path(), model::load(path)?)));
    let models = models.collect::<anyhow::Result<Vec<_>>>()?;
    let climbs = !args.then.is_empty() || models.len() > 1;
    // On a ladder every model stands on a unit of its own.
    let single = models.first().filter(|_| !climbs);
    if climbs && args.adapt {
        bail!("--adapt follows one residual; leave out --then and further --residual");
    }
    let corrector = single.map(|(_, model)| residual::ready(model, &sheet.unit, args.cut.cut())).transpose()?;
    let mut results = replay_all(args, &sheet.unit, &bags, &mapped, corrector.as_ref())?;
    let mut adaptation = None;
    if let Some((_, model)) = single.filter(|_| args.adapt) {
        let corrector = residual::ready(model, &sheet.unit, args.cut.cut())?.adapting(model)?;
        adaptation = residual::adapt(corrector, &mut results);
    }
    let together: Vec<_> = results.iter().map(|one| (&one.replayed, &one.provenance)).collect();
    let between = if args.rate_of_inputs == Between::Hold { "hold" } else { "linear" };
    let mut summary = summarise(parameters(&sheet), args.cut.cut(), between, &together);
    print(&process_table(&summary).to_text())?;
    if let Some(reason) = reason_for_dashes(&summary) {
        print(&format!("{reason}\n"))?;
    }
    if climbs {
        let ladder = ladder::climb(args, &sheet.unit, &models, &results, &summary)?;
        print(&ladder_text(&ladder))?;
        summary.ladder = Some(ladder);
    }
    if let Some((path, _)) = single {
        let corrected: Vec<_> =
            results.iter().filter_map(|one| Some((one.corrected.as_ref()?, &one.provenance))).collect();
        let with = residual::summary(path, &corrected, &summary, args.cut.cut());
        print(&format!("With the residual of {}:\n{}", path.display(), process_table(&with).to_text()))?;
        if let Some(adaptation) = &adaptation {
            print(&format!("Adaptation: {}.\n", adaptation.words()))?;
        }
        summary.residual = with.residual.map(|residual| Residual { adaptation, ..residual });
    }
    let mut origins: Vec<&str> = summary.recordings.iter().filter_map(|one| one.origin.as_deref()).collect();
    origins.dedup();
    for origin in origins {
        print(&format!("{origin}\n"))?;
    }
    match output {
        Some(output) => write_all(output, &summary, &results, &bags, &sheet.unit, args)?,
        None => print("Add --out DIR for pictures, all figures and bags with the simulated state.\n")?,
    }
    let mut outcome = if mapped.warnings.is_empty() { Outcome::Ok } else { Outcome::Warnings };
    mapped.warnings.iter().for_each(|warning| warn(warning));
    for one in &summary.recordings {
        for warning in &one.warnings {
            warn(&format!("{}: {warning}", one.name));
            outcome = Outcome::Warnings;
        }
    }
    Ok(outcome)
}

fn ladder_text(ladder: &Ladder) -> String {
    let stars = reason_for_stars(ladder).map(|reason| format!("{reason}\n")).unwrap_or_default();
    let findings: String = ladder.findings.iter().map(|finding| format!("{finding}\n")).collect();
    format!("{}{stars}{findings}", ladder_table(ladder).to_text())
}

/// How the bags are read.
fn options(args: &Args, unit: &Unit) -> ReadOptions {
    let positions = Positions::of(unit.recorded);
    let mut options = ReadOptions { topics: args.topics.topics(), positions, ..ReadOptions::default() };
    if args.rate_of_inputs == Between::Linear {
        let period_ns = nanos_from_seconds(unit.parameters.regulator.large_loop_period_s).max(1);
        options.interpolation = Interpolation::Linear { period_ns };
    }
    match args.cut {
        CutAt::None => {}
        CutAt::Servomotor => options.required.push(Stream::ServoState),
        // Behind the spool neither command nor ESV counts, and the sheet knows a tank pressure.
        CutAt::Spool => options.required = vec![Stream::ServoState],
    }
    options
}

/// Replays every bag, in parallel, with results in the order of the bags; all that cannot be read are named at once.
fn replay_all(
    args: &Args,
    unit: &Unit,
    bags: &[Bag],
    mapped: &Mapped,
    corrector: Option<&Corrector>,
) -> anyhow::Result<Vec<Result>> {
    let twin = Twin::new(unit).with_cut(args.cut.cut());
    let options = options(args, unit);
    // A further unit or a learned residual runs along all rows again.
    let whole = !args.then.is_empty() || !args.residual.is_empty();
    let progress = Progress::new(bags.len(), "recordings");
    let results: Vec<anyhow::Result<Result>> = bags
        .par_iter()
        .map(|bag| {
            let from = (bag, mapped.given(&bag.path));
            let result = replay(from, &options, twin.clone(), corrector, unit, [whole, args.out.is_some()]);
            progress.step();
            result
        })
        .collect();
    drop(progress);
    let mut whole = vec![];
    let mut errors = vec![];
    for result in results {
        match result {
            Ok(result) => whole.push(result),
            Err(error) => errors.push(format!("{error:#}")),
        }
    }
    match errors.len() {
        0 => Ok(whole),
        1 => anyhow::bail!("{}", errors.remove(0)),
        count => anyhow::bail!("{count} of {} bags cannot be replayed:\n  {}", bags.len(), errors.join("\n  ")),
    }
}

fn replay(
    (bag, given): (&Bag, &Path),
    options: &ReadOptions,
    mut twin: Twin,
    corrector: Option<&Corrector>,
    unit: &Unit,
    [whole, draw]: [bool; 2],
) -> anyhow::Result<Result> {
    let (replayed, health) = if whole {
        let Loaded { recording, health } = bag::read(&bag.path, options)?;
        (Replayed::new(&mut twin, Recording { name: bag.name.clone(), ..recording }), health)
    } else {
        rows::replay(&bag.path, &bag.name, options, &mut twin)?
    };
    let mut warnings: Vec<String> = health.warnings.iter().map(ToString::to_string).collect();
    warnings.extend(bags::doubt_of_pressure(&replayed.recording, &options.topics, unit));
    let provenance = Provenance {
        path: given.display().to_string(),
        bytes: health.files.iter().map(|file| file.bytes).sum(),
        origin: origin::of(given),
        warnings,
        notes: health.notes.iter().map(ToString::to_string).collect(),
    };
    let pictures = draw.then(|| Pictures::draw(&replayed, &unit.sensors)).transpose()?;
    let corrected = corrector.map(|corrector| residual::correct(corrector, &replayed));
    Ok(Result { replayed, provenance, pictures, corrected })
}

fn parameters(sheet: &Sheet) -> Parameters {
    let files = sheet.files.iter().map(|path| path.display().to_string()).collect();
    Parameters::new(sheet.name.clone(), files, &sheet.unit, &params::reference())
}

/// Nothing may be replaced by the bags that are written but bags of an earlier replay: neither what is read, nor others, nor one another.
fn refuse_to_overwrite(out: &Path, bags: &[Bag]) -> anyhow::Result<()> {
    for bag in bags {
        if let Some(inner) = bags.iter().find(|other| *other != bag && Path::new(&other.name).starts_with(&bag.name)) {
            anyhow::bail!(
                "--out {}: the simulated bag {} of {} would lie inside {} of {}; replay the two apart",
                out.display(),
                inner.name,
                inner.path.display(),
                bag.name,
                bag.path.display()
            );
        }
        let target = out.join(&bag.name);
        if let (Ok(from), Ok(to)) = (bag.path.canonicalize(), target.canonicalize())
            && from.starts_with(&to)
        {
            anyhow::bail!(
                "--out {}: the simulated bag would take the place of {}, which is read; choose another folder",
                out.display(),
                bag.path.display()
            );
        }
        simulated::check(&target)?;
        if let Some(folder) = target.parent() {
            remove_stale(folder);
        }
    }
    Ok(())
}

/// Writes the simulated bag of a replay, anew where not all of its rows were kept.
fn write_bag(bag: &Bag, dir: &Path, replayed: &Replayed, unit: &Unit, args: &Args) -> anyhow::Result<Sealed> {
    let topics = args.topics.topics();
    if replayed.every == 1 {
        return simulated::write(&bag.path, dir, replayed, &topics);
    }
    let options = options(args, unit);
    let mut twin = Twin::new(unit).with_cut(args.cut.cut());
    let measured = replayed.scores.are_measured();
    if let Some(sealed) = rows::write(&bag.path, dir, &options, &mut twin, measured, &topics)? {
        return Ok(sealed);
    }
    let recording = bag::read(&bag.path, &options)?.recording;
    simulated::write(&bag.path, dir, &Replayed::new(&mut twin, recording), &topics)
}

/// Writes the bags, the page and the figures.
fn write_all(
    mut output: Output,
    summary: &Summary,
    results: &[Result],
    bags: &[Bag],
    unit: &Unit,
    args: &Args,
) -> anyhow::Result<()> {
    let progress = Progress::new(bags.len(), "bags written");
    let pairs: Vec<_> = results.iter().zip(bags).collect();
    let written: anyhow::Result<Vec<Sealed>> = pairs
        .into_par_iter()
        .map(|(one, bag)| {
            let sealed = write_bag(bag, &output.path(&bag.name), &one.replayed, unit, args)?;
            progress.step();
            Ok(sealed)
        })
        .collect();
    drop(progress);
    output.add_bags(written?);
    let replayed: Vec<&Replayed> = results.iter().map(|one| &one.replayed).collect();
    let pictures: Vec<Pictures> = results.iter().filter_map(|one| one.pictures.clone()).collect();
    let page = page(summary, &replayed, &pictures, &unit.sensors)?;
    let html_path = output.path(PAGE);
    output.add(PAGE, page.to_html().as_bytes())?;
    output.add_json(FIGURES, summary)?;
    output.place()?;
    print(&format!("Pictures: {}\n", html_path.display()))
}
