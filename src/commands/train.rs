//! `govtwin train`: a model of the twin's residual, found by Bayesian optimisation, evaluated on test rows.

use anyhow::{Context, bail};
use govtwin_correction::booster::{Hyperparameters, Objective};
use govtwin_correction::model::{LEFT_OUT, Learned};
use govtwin_correction::prepare::Cleaning;
use govtwin_correction::row::RateOfInputs;
use govtwin_correction::split::seven_to_three;
use govtwin_correction::training::{self, GuardKind, Recipe};
use govtwin_lab::comparison::Contender;
use govtwin_lab::comparison::contenders::{self, mechanism, trained};
use govtwin_lab::comparison::coverage::{CoveredAt, covered_by_distance};
use govtwin_lab::comparison::page::{Training, models_table, training_page};
use govtwin_lab::comparison::summary::{Covered, ModelFigures, Searched, covered};
use govtwin_model::recording::Process;
use govtwin_model::twin::Cut;
use serde::Serialize;

use super::choice::{Choice, PROCESSES, RATES_OF_INPUTS, choice};
use super::learn::{self, OPENINGS, SearchJob};
use super::output::{Output, print, table_text};
use crate::commands::Outcome;

/// Train a model of the twin's residual.
///
/// Learns measured − simulated from the inputs and from the twin's own output (Liu et al. 2025): the first 70 % of each
/// process teach, the last 30 % judge. Hyperparameters come from Bayesian optimisation on five folds by time inside the
/// teaching part. Writes DIR/model.residual for `run --residual` and `replay --residual`, and the trace of the search with the surrogate's
/// picture beside random search at the same budget as DIR/train.html and DIR/train.json.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    #[command(flatten)]
    learn: learn::Args,
    /// Source of the guide-vane opening; the model can be used only with the same source.
    #[arg(long, default_value = "none", value_parser = choice(OPENINGS))]
    cut: Cut,
    /// Inputs of the twin between two recorded rows; the model can be used only with the same option.
    ///
    /// A live node holds its last inputs. If its commands arrive much faster than the rows here, train with `linear`.
    #[arg(long, default_value = "linear", value_parser = choice(RATES_OF_INPUTS))]
    rate_of_inputs: RateOfInputs,
    /// Processes to leave out of training and testing, separated by commas.
    ///
    /// `replay --then` then shows whether the model extrapolates to them.
    #[arg(long, value_name = "PROCESS", value_delimiter = ',', value_parser = choice(PROCESSES))]
    leave_out: Vec<Process>,
    /// Guard that bounds the corrections.
    ///
    /// `range` is for a unit that keeps doing what it did in the recordings. `processes` is for other processes too:
    /// as far as the training rows can show, it makes no unknown process worse, and corrects less in the known ones.
    #[arg(long, default_value = "range", value_parser = choice(GUARDS))]
    guard: GuardKind,
    /// Objective that the trees minimise.
    #[arg(long, default_value = "l1", value_parser = choice(OBJECTIVES))]
    objective: Objective,
    /// No search: use the manual hyperparameters.
    #[arg(long)]
    manual: bool,
}

const HELP: &str = "\
Trains gradient-boosted trees (LightGBM) on the residual of the twin, the measured minus the
simulated signal. The first 70 % of each process are for training, the last 30 % for testing. The
hyperparameters are found by Bayesian optimisation; an equal random search is run for comparison.
Files in DIR:
  model.residual   the model, for `replay --residual` and `run --residual`
  train.html       errors of twin, model and guarded model; train.json holds the same as JSON

Examples:
  govtwin train bags/reference --out learned --quick
  govtwin replay bags/reference --residual learned/model.residual

docs/residual.md describes the model, its guard and its band.

Exit codes: 0 ok, 1 not possible, 2 wrong usage.";

/// What bounds corrections.
const GUARDS: [Choice<GuardKind>; 2] = [
    ("range", "Range of each feature, and of the corrections, in the training rows", GuardKind::Range),
    (
        "processes",
        "Also the distance from those rows, with weights learned on folds that leave a process out",
        GuardKind::Processes,
    ),
];

/// What trees make least.
const OBJECTIVES: [Choice<Objective>; 4] = [
    ("l1", "Absolute errors (median), as in Liu et al. 2025", Objective::L1),
    ("huber", "Huber's loss: squared up to 0.01 of the signal's unit, linear beyond", Objective::Huber),
    ("l2", "Squared errors (mean)", Objective::L2),
    (
        "quantile",
        "Errors at the three quartiles, combined as the trimean; three times as many trees",
        Objective::Quantile,
    ),
];

#[derive(Serialize)]
struct Trained {
    schema: &'static str,
    program: &'static str,
    origin: Option<String>,
    recordings: Vec<Cleaning>,
    hyperparameters: std::collections::BTreeMap<String, f64>,
    models: Vec<ModelFigures>,
    searches: Vec<Searched>,
    band: Option<Covered>,
    band_by_distance: Vec<CoveredAt>,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let left_out: Vec<Process> = Process::ALL.into_iter().filter(|own| args.leave_out.contains(own)).collect();
    let mut output = Output::claim(&args.learn.out, &["model.residual", "train.html", "train.json"])?;
    let ready = args.learn.prepare(args.cut, args.rate_of_inputs, &left_out)?;
    let table = &ready.table;
    let split = seven_to_three(table);
    if split.test.is_empty() {
        bail!("no rows are left to judge on: {} rows were found; give more or longer recordings", table.marks.len());
    }
    let mut searches = vec![];
    let objective = args.objective;
    let mut with = Hyperparameters { objective, ..Hyperparameters::MANUAL };
    if !args.manual {
        let job = |kind, noun| SearchJob { id: "hybrid", kind, noun, objective };
        for job in [job("bayesian", "evaluations, Bayesian"), job("random", "evaluations, random")] {
            searches.push(args.learn.search(table, &split, Learned::Residual, job, args.learn.seed)?);
        }
        let (point, _) = searches[0].best().context("no evaluation of the search succeeded")?;
        with = Hyperparameters { objective, ..training::at(point) };
    }
    let unit = &ready.sheet.unit;
    let rows = (&split.train[..], &split.test[..]);
    let recipe = Recipe { learned: Learned::Residual, with: &with, seed: args.learn.seed };
    let (mut model, estimates) = trained(table, rows, recipe, unit, args.guard)?;
    model.training.insert("objective".to_owned(), objective.id().to_owned());
    let names: Vec<&str> = ready.recordings.iter().map(|one| one.name.as_str()).collect();
    model.training.insert("recordings".to_owned(), names.join(", "));
    if !left_out.is_empty() {
        model.training.insert(LEFT_OUT.to_owned(), left_out.iter().map(|one| one.id()).collect::<Vec<_>>().join(", "));
    }
    model.training.insert("unit".to_owned(), ready.sheet.name.clone());
    model.training.extend(ready.origin.iter().map(|origin| ("origin".to_owned(), origin.clone())));
    let forest = model.forest()?;
    let by_distance = model.band.map(|band| covered_by_distance(table, &split.test, &forest, (&model.guard, &band)));
    let band = model.band.map(|band| covered(table, &split.test, &estimates, &band));
    let guarded = contenders::estimates(&forest, table, &split.test, Learned::Residual, Some(&model.guard));
    let scored = [
        mechanism(table, &split.test),
        Contender { id: "hybrid", title: "hybrid", estimates },
        Contender { id: "guarded", title: "hybrid, guarded", estimates: guarded },
    ]
    .map(|contender| ModelFigures::of(table, &split.test, &contender));
    let text = model.to_text().context("the model holds a number that is not finite")?;
    let path = output.path("model.residual");
    output.add("model.residual", text.as_bytes())?;

    let mut said = table_text(&models_table(&scored, model.unit.as_str()));
    said.extend(ready.origin.iter().map(|origin| format!("{origin}\n")));
    if let Some(band) = &band {
        let (stated, found) = (100.0 * band.coverage_share, 100.0 * band.overall_share);
        said += &format!("Band: {stated:.0} % stated, {found:.1} % of the judging rows inside.\n");
    }
    let band_by_distance = by_distance.unwrap_or_default();
    for at in &band_by_distance {
        said += &format!("  guarded, {}, {}: {}\n", at.process, at.distance, at.words(&model.unit));
    }
    let training = Training {
        signal: table.layout.signal,
        rows: [rows.0.len(), rows.1.len()],
        origin: ready.origin.as_deref(),
        models: &scored,
        searches: &searches,
        band: band.as_ref(),
    };
    output.add("train.html", training_page(&training).to_html().as_bytes())?;
    let figures = Trained {
        schema: "govtwin-training/1",
        program: concat!("govtwin ", env!("CARGO_PKG_VERSION")),
        origin: ready.origin,
        recordings: ready.cleanings,
        hyperparameters: model.hyperparameters,
        models: scored.into(),
        searches,
        band,
        band_by_distance,
    };
    output.add_json("train.json", &figures)?;
    output.place()?;
    print(&if args.learn.json {
        serde_json::to_string_pretty(&figures)? + "\n"
    } else {
        format!("{said}Model: {}\n", path.display())
    })?;
    Ok(Outcome::Ok)
}
