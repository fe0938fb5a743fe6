//! `govtwin replay`: simulate recordings and compare with what was measured.

mod files;
mod follow;
mod ladder;
mod made;
mod node_run;
pub mod origin;
mod residual;
mod rows;
mod simulated;
mod validation;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use govtwin_bag::{Interpolation, Positions, ReadOptions, Stream};
use govtwin_correction::corrector::Corrector;
use govtwin_correction::rate;
use govtwin_correction::row::RateOfInputs;
use govtwin_correction::shipped;
use govtwin_diagnosis::replay_summary::{ParameterDifferences, RecordingSource, Residual, summarise};
use govtwin_model::parameters::Unit;
use govtwin_model::params::{self, Sheet};
use govtwin_model::replay::Replayed;
use govtwin_model::replay::ladder::Ladder;
use govtwin_model::twin::{Cut, Twin};
use govtwin_pages::replay::{ladder_table, process_table, reason_for_dashes, reason_for_stars};
use rayon::iter::{IndexedParallelIterator, IntoParallelRefIterator};

use super::bags::{self, Bag, GivenBag, MapArgs, Mapped, TopicArgs};
use super::output::{Output, Progress, print, table_text, warn_all};
use super::provenance;
use crate::commands::choice::{RATES_OF_INPUTS, choice};
use crate::commands::{Outcome, sheet_of, usage};
use follow::{Followed, Way};
use node_run::NodeRun;
use residual::{Choice, Shipped};
use validation::Requirements;

/// The page.
const PAGE: &str = "replay.html";

/// The figures.
const FIGURES: &str = "replay.json";

/// Arguments of `govtwin replay`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Bags: files, bag folders, or folders that contain bags. In a folder without metadata.yaml each bag is
    /// separate.
    #[arg(value_name = "BAG", required = true)]
    bags: Vec<PathBuf>,
    #[command(flatten)]
    topics: TopicArgs,
    #[command(flatten)]
    map: MapArgs,
    /// Data sheet (parameter file) of the unit; without it, the shipped reference unit.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Measured signal that replaces the simulated one, to compare a single stage with its own recorded input.
    #[arg(long, value_enum, default_value_t = CutAt::None)]
    cut: CutAt,
    /// Add the correction of this residual model of `govtwin train`, or `none`, and report the remaining error; may be
    /// repeated.
    ///
    /// Without it, the shipped model corrects the twin if the sheet is that of the shipped reference unit, unless --then
    /// is given; the output says so, or why it cannot. With several models, or with --then, each model is applied to the
    /// unit for which it was trained, and one table compares all units and models.
    #[arg(long, value_name = "MODEL")]
    residual: Vec<PathBuf>,
    /// Adapt the residual model to a unit that ages, from recording to recording in order of time.
    ///
    /// A test of the measured signal detects drift. The correction then follows by a bounded bias and gain, or by
    /// retrained leaves of its trees. Not with --then or several models.
    #[arg(long, requires = "residual")]
    adapt: bool,
    /// Also replay with this parameter file, such as refitted.yaml and then fitted.yaml of a diagnosis; may be
    /// repeated.
    ///
    /// One table compares all units.
    #[arg(long, value_name = "FILE")]
    then: Vec<PathBuf>,
    /// Inputs of the twin between two recorded rows; without it, those of the training of the residual model, else as rows
    /// come.
    ///
    /// Where rows are 30 ms apart or closer, inputs hold, as live. Farther apart they run straight, round sharp bends of the
    /// command, and a trip comes when the unit moved.
    #[arg(long, value_parser = choice(RATES_OF_INPUTS))]
    rate_of_inputs: Option<RateOfInputs>,
    /// Limit that every recording must keep, such as `spool.rmse<=0.5%`, or `@FILE` with one limit a line; may be
    /// repeated.
    ///
    /// A limit is [PROCESS.]SIGNAL.MEASURE<=VALUE[UNIT] or >=. PROCESS is startup, load_increase, shutdown or
    /// load_rejection; SIGNAL is servomotor, spool, pilot_valve or control_pressure; MEASURE is mae, rmse, max (largest
    /// error), bias or r2; UNIT is %, pu, Pa, kPa, bar or MPa. A limit that no recording shows is broken too. With
    /// --residual the corrected figures are judged.
    #[arg(long, value_name = "LIMIT")]
    require: Vec<String>,
    /// Figures of an earlier replay, its replay.json, than which this one must not be worse.
    ///
    /// Compares MAE, RMSE and the largest error of recordings of the same name, of each process and overall.
    #[arg(long, value_name = "FILE")]
    against: Option<PathBuf>,
    /// By how much an error may exceed that of --against, %.
    #[arg(long, value_name = "PERCENT", default_value = "1%", requires = "against", value_parser = percent)]
    worse_by: f64,
    /// File for the limits and how they stand as JUnit XML, which CI servers show.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Figures of the node that ran while the recording was made (`govtwin run --out`); the page shows how late its ticks
    /// were.
    #[arg(long = "run", value_name = "FILE", requires = "out")]
    node_run: Option<PathBuf>,
    /// Folder for the page, the figures and bags with the simulated state; created if missing.
    ///
    /// Of the bags in the folder, only those of an earlier replay are replaced.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON instead of tables: the content of DIR/replay.json.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Prints MAE, RMSE and R² of servomotor and spool per process and overall. With --out, also writes
replay.html (plots), replay.json (all figures) and, for each recording, a bag with the simulated
state on /sim/servo_state next to the recorded topics.

Examples:
  govtwin replay bags/reference --out look
  govtwin replay bags/practice/case_03 --then diagnosis/case_03/fitted.yaml    # after `diagnose`
  govtwin replay bags/reference --require 'servomotor.rmse<=0.6%' --require 'load_rejection.servomotor.max<=7%'
  govtwin replay nightly --against approved/replay.json --worse-by 10% --junit replay.xml --out look

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 finished with warnings, 4 a limit is broken.";

/// A share, given in percent.
fn percent(text: &str) -> std::result::Result<f64, String> {
    let number: Option<f64> = text.trim().trim_end_matches('%').trim_end().parse().ok();
    let percent = number.filter(|percent| percent.is_finite() && *percent >= 0.0);
    percent.map(|percent| percent / 100.0).ok_or_else(|| "expected a percentage of 0 or above, such as 10%".to_owned())
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum CutAt {
    /// Everything is simulated.
    None,
    /// The measured servomotor position feeds the regulator: compares the spool (as in Liu et al. 2025).
    #[value(alias = "servo", alias = "guide-vane", alias = "servomotor_position")]
    Servomotor,
    /// The measured spool position drives the servomotor: compares the servomotor stage alone.
    #[value(alias = "valve", alias = "main-valve", alias = "distributing-valve", alias = "spool_position")]
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

/// One bag, replayed, with what was drawn of it.
struct Result {
    replayed: Replayed,
    source: RecordingSource,
    read: GivenBag,
    /// What the bag with the simulated state says of itself.
    about: BTreeMap<String, String>,
    corrected: Option<residual::Corrected>,
}

impl Result {
    /// What limits are held against: the corrected recording, where there is a residual.
    fn judged(&self) -> &Replayed {
        self.corrected.as_ref().map_or(&self.replayed, |corrected| &corrected.replayed)
    }
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let sheet = sheet_of(args.params.as_deref())?;
    let node_run = args.node_run.as_deref().map(NodeRun::read).transpose()?;
    let mapped = args.map.open(&args.bags)?;
    let bags = bags::find(&mapped.paths)?;
    let output = args.out.as_ref().map(|out| Output::claim(out, &[PAGE, FIGURES])).transpose()?;
    if let Some(out) = &args.out {
        files::refuse_to_overwrite(out, &bags)?;
    }
    let mut choice = Choice::new(args, &sheet.unit)?;
    let climbs = !args.then.is_empty() || choice.models.len() > 1;
    if climbs && args.adapt {
        return Err(usage("--adapt follows one residual; leave out --then and further --residual"));
    }
    let mut requirements = Requirements::read(args, choice.models.len())?;
    let mut results = replay_all(args, &sheet.unit, (&bags, &mapped), &mut choice, climbs, requirements.as_mut())?;
    let Choice { models, driven, shipped, .. } = choice;
    // On a ladder every model has a unit of its own.
    let single = models.first().filter(|_| !climbs);
    let mut adaptation = None;
    if let Some((_, model)) = single.filter(|_| args.adapt) {
        let corrector = residual::ready(model, &sheet.unit, args.cut.cut())?.adapting(model)?;
        adaptation = residual::adapt(corrector, &mut results);
    }
    let together: Vec<_> = results.iter().map(|one| (&one.replayed, &one.source)).collect();
    let mut summary = summarise(parameters(&sheet), args.cut.cut(), driven.id(), &together);
    let mut text = table_text(&process_table(&summary));
    text.extend(reason_for_dashes(&summary).map(|reason| format!("{reason}\n")));
    let (mut after, mut judged) = (None, None);
    if climbs {
        let (ladder, last) = ladder::climb(args, &sheet.unit, &models, &results, &summary)?;
        text += &ladder_text(&ladder);
        summary.ladder = Some(ladder);
        after = last;
    }
    if let Some((path, model)) = single {
        let corrected: Vec<_> = results.iter().filter_map(|one| Some((one.corrected.as_ref()?, &one.source))).collect();
        let with = residual::summary(path, &corrected, &summary, args.cut.cut());
        let assumed = rate::assumed(model);
        text += &format!("With the residual of {}, {assumed}:\n{}", path.display(), table_text(&process_table(&with)));
        text.extend((shipped == Shipped::Used).then_some("`--residual none` leaves it out.\n"));
        text.extend(adaptation.as_ref().map(|adaptation| format!("Adaptation: {}.\n", adaptation.words())));
        summary.residual = with.residual.clone().map(|residual| Residual { adaptation, ..residual });
        judged = Some(with);
    }
    if let Shipped::Unfit(reason) = &shipped {
        text += &format!("{} is not used: {reason}.\n", shipped::NAME);
    }
    if let Some(requirements) = &requirements {
        let replayed: Vec<&Replayed> = results.iter().map(Result::judged).collect();
        let validation = requirements.judge(judged.as_ref().unwrap_or(&summary), &replayed);
        text += &validation::text(&validation);
        summary.validation = Some(validation);
    }
    let made = made::describe(args, &sheet, (driven, &shipped), &mapped, &results)?;
    made.origins().iter().for_each(|origin| text += &format!("{origin}\n"));
    summary.provenance = Some(made);
    if args.json {
        text = serde_json::to_string_pretty(&summary)? + "\n";
    } else if args.out.is_none() {
        text += "Add --out DIR for plots, all figures and bags with the simulated state.\n";
    }
    print(&text)?;
    if let Some(output) = output {
        files::write_all(output, &summary, &results, &bags, &sheet.unit, (after.as_ref(), node_run.as_ref()), args)?;
    }
    if let (Some(requirements), Some(validation)) = (&requirements, &summary.validation) {
        requirements.write(validation)?;
    }
    let of_recordings = summary.recordings.iter().flat_map(|one| {
        let name = &one.name;
        one.warnings.iter().map(move |warning| format!("{name}: {warning}"))
    });
    let warnings: Vec<String> = mapped.warnings.iter().cloned().chain(of_recordings).collect();
    warn_all(&warnings);
    let is_kept = summary.validation.as_ref().is_none_or(|validation| validation.passed);
    Ok(match (is_kept, warnings.is_empty()) {
        (false, _) => Outcome::Failed,
        (true, false) => Outcome::Warnings,
        (true, true) => Outcome::Ok,
    })
}

/// Replays every bag, corrected where there is one residual for all; the bags decide on the shipped one.
fn replay_all(
    args: &Args,
    unit: &Unit,
    (bags, mapped): (&[Bag], &Mapped),
    choice: &mut Choice,
    climbs: bool,
    requirements: Option<&mut Requirements>,
) -> anyhow::Result<Vec<Result>> {
    let twin = Twin::new(unit).with_cut(args.cut.cut());
    // A further unit or a learned residual runs along all rows again.
    let whole = !args.then.is_empty() || !choice.models.is_empty();
    let way = Way { args, unit, twin: &twin, whole };
    let mut held: Vec<Option<Followed>> = bags.iter().map(|_| None).collect();
    if choice.is_open() {
        held = on_all(bags, held, |bag, _| way.hold(bag).map(Some))?;
        choice.settle(args, unit, bags.iter().zip(held.iter().flatten().map(|held| &held.replayed)));
    }
    if let Some(requirements) = requirements {
        requirements.suit(args, choice.driven.id(), !choice.models.is_empty())?;
    }
    let single = choice.models.first().filter(|_| !climbs);
    let corrector = single.map(|(_, model)| residual::ready(model, unit, args.cut.cut())).transpose()?;
    let mut results = on_all(bags, held, |bag, held| {
        let followed = way.drive(bag, choice.driven, held)?;
        describe(args, (bag, mapped.given(&bag.path)), followed, unit, corrector.as_ref())
    })?;
    residual::check_rates(&choice.models, &choice.shipped, &mut results)?;
    Ok(results)
}

fn ladder_text(ladder: &Ladder) -> String {
    let stars = reason_for_stars(ladder).map(|reason| format!("{reason}\n")).unwrap_or_default();
    let findings: String = ladder.findings.iter().map(|finding| format!("{finding}\n")).collect();
    format!("{}{stars}{findings}", table_text(&ladder_table(ladder)))
}

/// How the bags are read.
fn options(args: &Args, interpolation: Interpolation, unit: &Unit) -> ReadOptions {
    let positions = Positions::of(unit.recorded);
    let mut options = ReadOptions { topics: args.topics.topics(), positions, interpolation, ..ReadOptions::default() };
    match args.cut {
        CutAt::None => {}
        CutAt::Servomotor => options.required.push(Stream::ServoState),
        // Behind the spool neither command nor ESV counts, and the sheet knows a tank pressure.
        CutAt::Spool => options.required = vec![Stream::ServoState],
    }
    options
}

/// Works on every bag, in parallel, with results in the order of the bags; all that fail are named at once.
fn on_all<With: Send, Made: Send>(
    bags: &[Bag],
    with: Vec<With>,
    work: impl Fn(&Bag, With) -> anyhow::Result<Made> + Sync,
) -> anyhow::Result<Vec<Made>> {
    let mut all = vec![];
    let mut errors = vec![];
    for result in Progress::each(bags.par_iter().zip(with), "recordings", |(bag, with)| work(bag, with)) {
        match result {
            Ok(made) => all.push(made),
            Err(error) => errors.push(format!("{error:#}")),
        }
    }
    match errors.len() {
        0 => Ok(all),
        1 => anyhow::bail!("{}", errors.remove(0)),
        count => anyhow::bail!("{count} of {} bags cannot be replayed:\n  {}", bags.len(), errors.join("\n  ")),
    }
}

/// A replay with where it is from, and its correction.
fn describe(
    args: &Args,
    (bag, given): (&Bag, &Path),
    Followed { replayed, health, between }: Followed,
    unit: &Unit,
    corrector: Option<&Corrector>,
) -> anyhow::Result<Result> {
    let mut warnings: Vec<String> = health.warnings.iter().map(ToString::to_string).collect();
    warnings.extend(bags::doubt_of_pressure(&replayed.recording, &args.topics.topics(), unit));
    let [warned, noted] = bags::doubts(&replayed.recording, unit);
    warnings.extend(warned);
    let marked = provenance::marked(Some(&health), given)?;
    let source = RecordingSource {
        path: given.display().to_string(),
        bytes: health.files.iter().map(|file| file.bytes).sum(),
        origin: marked.origin.clone(),
        warnings,
        notes: health.notes.iter().map(ToString::to_string).chain(between).chain(noted).collect(),
    };
    let about = simulated::about(&bag.name, &health, &marked);
    let corrected = corrector.map(|corrector| residual::correct(corrector, &replayed));
    let read = GivenBag { path: bag.path.clone(), name: bag.name.clone(), health: Some(health), ..GivenBag::default() };
    Ok(Result { replayed, source, read, about, corrected })
}

fn parameters(sheet: &Sheet) -> ParameterDifferences {
    let files = sheet.files.iter().map(|path| path.display().to_string()).collect();
    ParameterDifferences::new(sheet.name.clone(), files, &sheet.unit, &params::reference())
}
