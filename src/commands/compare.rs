//! `govtwin compare`: the twin, data-only models and hybrids under one split and the same features, as the paper compares them.

mod field;

use std::collections::BTreeMap;

use anyhow::{Context, bail};
use govtwin_correction::band::Band;
use govtwin_correction::booster::Hyperparameters;
use govtwin_correction::model::Model;
use govtwin_correction::row::RateOfInputs;
use govtwin_correction::split::{RowSplit, seven_to_three};
use govtwin_correction::table::FeatureTable;
use govtwin_diagnosis::identification::calibration::PARTS;
use govtwin_diagnosis::replay_summary::cut_id;
use govtwin_lab::comparison::Contender;
use govtwin_lab::comparison::ablation::{Parents, STEPS, ablation, same_rows};
use govtwin_lab::comparison::breakdown::{ErrorBreakdown, breakdown};
use govtwin_lab::comparison::closed::closed_loop;
use govtwin_lab::comparison::contenders::leave_one_out;
use govtwin_lab::comparison::coverage::covered_by_distance;
use govtwin_lab::comparison::limit::{LimitKnowledge, limit};
use govtwin_lab::comparison::page::{HYBRIDS, Shown, breakdown_table, models_table, page, spread_table};
use govtwin_lab::comparison::refit::{refit, teaching};
use govtwin_lab::comparison::summary::{
    ComparisonSummary, FreeRunFigures, Importance, ModelFigures, SCHEMA, claims, covered, spread,
};
use govtwin_model::parameters::Unit;
use govtwin_model::signal::Signal;
use govtwin_model::twin::Cut;
use govtwin_pages::table::Table as Printed;

use super::choice::choice;
use super::learn::{self, OPENINGS, TrainingData, grid_ns};
use super::output::{Output, Progress, print, table_text};
use crate::commands::Outcome;
use field::{Competitors, field};

/// Arguments of `govtwin compare`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    #[command(flatten)]
    learn: learn::Args,
    /// Source of the guide-vane opening; that of Liu et al. 2025 is `servomotor`.
    #[arg(long, default_value = "servomotor", value_parser = choice(OPENINGS))]
    cut: Cut,
    /// Number of seeds, each with its own searches; the spread is shown.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=100))]
    seeds: u64,
    /// Also refit the better twin on the training rows, which takes several minutes.
    #[arg(long)]
    refit: bool,
    /// Effect of `govtwin effects` to fit as well, such as one that a diagnosis of the training rows names; may be
    /// repeated.
    #[arg(long = "effect", value_name = "ID", requires = "refit")]
    effects: Vec<String>,
    /// Evaluations of the search for each network; without it, as many as for the trees.
    #[cfg(feature = "deep")]
    #[arg(long, value_name = "N")]
    network_iterations: Option<usize>,
}

const HELP: &str = "\
All models have the same features and the same split: the first 70 % of each process for training,
the last 30 % for testing.
  MBM               the twin alone
  DDM               data-only model
  LightGBM hybrid   twin and trees with manual hyperparameters
  MDHM              the same with Bayesian-optimised hyperparameters
  better twin       hybrids on a twin whose inputs are linear between rows, also with a gate
  LSTM, TCN         network hybrids, with the cargo feature `deep`
Also compares row by row where the MDHM loses to the DDM, the gain of each step to the better
hybrid, each process left out of training, and a residual inside the loop with the additive one in
a closed-loop free run. Writes DIR/compare.html and DIR/compare.json. An interrupted run continues.

Example:
  govtwin compare bags/reference --quick --out compared    # some minutes

Exit codes: 0 ok, 1 not possible, 2 wrong usage.";

#[cfg(feature = "deep")]
impl Args {
    /// Evaluations of each network's search.
    fn network_budget(&self) -> usize {
        self.learn.scaled(self.network_iterations.unwrap_or(self.learn.iterations))
    }
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    #[cfg(feature = "deep")]
    learn::networks::one_thread_each();
    let output = Output::claim(&args.learn.out, &["compare.html", "compare.json"])?;
    let ready = args.learn.prepare(args.cut, RateOfInputs::Hold, &[])?;
    let split = seven_to_three(&ready.table);
    if split.test.is_empty() {
        bail!(
            "no rows are left to judge on: {} rows were found; give more or longer recordings",
            ready.table.marks.len()
        );
    }
    let drawn = ready.table_of(&ready.sheet.unit, RateOfInputs::Linear);
    let refitted = args.refit.then(|| refitted(args, &ready, &split)).transpose()?;
    let unit = refitted.unwrap_or_else(|| ready.sheet.unit.clone());
    let refitted = args.refit.then(|| ready.table_of(&unit, RateOfInputs::Linear));
    let parents = Parents { plain: &ready.table, drawn: &drawn, refitted: refitted.as_ref() };
    check_rows(&parents)?;
    let seeds: Vec<u64> = (0..args.seeds).map(|k| args.learn.seed + k).collect();
    let figures_of = |contenders: &[Contender]| -> Vec<ModelFigures> {
        contenders.iter().map(|one| ModelFigures::of(&ready.table, &split.test, one)).collect()
    };
    let (mut first, mut every, mut steps): (Option<Competitors>, Vec<Vec<ModelFigures>>, Vec<Vec<ModelFigures>>) =
        (None, vec![], vec![]);
    for &seed in &seeds {
        let mut found = field(&args.learn, &parents, &split, seed, &ready.sheet.unit)?;
        #[cfg(feature = "deep")]
        learn::networks::compete(
            &args.learn,
            args.network_budget(),
            (&ready.table, &split, seed),
            (&mut found.contenders, &mut found.searches),
        )?;
        let rows = (&ready.table, &split.test[..]);
        for known in [LimitKnowledge::Inputs, LimitKnowledge::Rows] {
            let recordings = (&ready.recordings[..], grid_ns(&unit));
            found.contenders.push(limit(&unit, ready.cut, recordings, rows, (known, seed)));
        }
        every.push(figures_of(&found.contenders));
        first.get_or_insert(found);
        let progress = Progress::new(STEPS, "steps of the ablation");
        steps.push(figures_of(&ablation(&parents, &split, &Hyperparameters::MANUAL, seed, || progress.step())?));
    }
    let field = first.context("no seed was given")?;
    let broken = broken(&parents, &split, &field)?;
    let progress = Progress::new(12, "models with a process left out");
    let left_out = leave_one_out(parents.plain, parents.drawn, args.learn.seed, || progress.step())?;
    drop(progress);
    let closed_loop = free_run(args, &ready)?;

    let table = &ready.table;
    let models = figures_of(&field.contenders);
    let named = |id: &str| models.iter().find(|one| one.id == id).context("a model of the comparison is missing");
    let mut ranked: Vec<&ModelFigures> = models.iter().filter(|one| HYBRIDS.contains(&one.id)).collect();
    ranked.sort_by(|a, b| a.overall.mae.total_cmp(&b.overall.mae));
    let of_hybrid = field.contenders.iter().find(|one| one.id == "mdhm").map(|one| &one.estimates[..]);
    let alone = [named("mbm")?, named("ddm")?];
    let by_distance = |band: Band| -> anyhow::Result<_> {
        Ok(covered_by_distance(table, &split.test, &field.paper.forest()?, (&field.paper.guard, &band)))
    };
    let summary = ComparisonSummary {
        schema: SCHEMA,
        program: concat!("govtwin ", env!("CARGO_PKG_VERSION")),
        origin: ready.origin.clone(),
        settings: settings(args, &ready, &field.paper),
        rows: BTreeMap::from([
            ("train", split.train.len() as u64),
            ("test", split.test.len() as u64),
            ("purged", split.purged as u64),
            ("left out", table.left_out),
        ]),
        recordings: ready.cleanings.clone(),
        ranking: ranked.iter().map(|one| one.id).collect(),
        claims: [("MDHM", named("mdhm")?), ("the gated hybrid", named("gate")?)]
            .into_iter()
            .flat_map(|(of, hybrid)| claims(of, hybrid, alone))
            .collect(),
        models,
        seeds,
        spread: spread(&every),
        ablation: spread(&steps),
        breakdown: broken,
        left_out_process: left_out,
        band_by_distance: field.paper.band.map(by_distance).transpose()?.unwrap_or_default(),
        searches: field.searches,
        importance: importance(&field.paper),
        band: field.paper.band.zip(of_hybrid).map(|(band, said)| covered(table, &split.test, said, &band)),
        closed_loop,
    };
    let shown = Shown { rows: table, judging: &split.test, contenders: &field.contenders };
    write(args, output, &summary, &shown)
}

/// Refuses twins of which one says nothing finite of some rows: no two models could be compared.
fn check_rows(parents: &Parents<'_>) -> anyhow::Result<()> {
    if !same_rows(parents.plain, parents.drawn) || !parents.refitted.is_none_or(|table| same_rows(parents.plain, table))
    {
        bail!(
            "the twin says nothing finite of some rows where inputs run straight between rows, so that no two models can be compared"
        );
    }
    Ok(())
}

/// Leaves page and JSON, and says what is in them.
fn write(args: &Args, mut output: Output, summary: &ComparisonSummary, shown: &Shown<'_>) -> anyhow::Result<Outcome> {
    let html = output.path("compare.html");
    output.add("compare.html", page(summary, shown).to_html().as_bytes())?;
    output.add_json("compare.json", summary)?;
    output.place()?;
    if args.learn.json {
        print(&(serde_json::to_string_pretty(summary)? + "\n"))?;
    } else {
        say(summary, shown.rows.layout.signal.unit())?;
        print(&format!("Page: {}\n", html.display()))?;
    }
    Ok(Outcome::Ok)
}

/// The unit refitted on the rows that teach.
fn refitted(args: &Args, ready: &TrainingData, split: &RowSplit) -> anyhow::Result<Unit> {
    let unit = &ready.sheet.unit;
    let effects: Vec<&str> = args.effects.iter().map(String::as_str).collect();
    for id in &effects {
        super::generate::effect::known(unit, id)?;
    }
    let progress = Progress::new(PARTS, "parts of the refit");
    let recordings = teaching(&ready.recordings, &ready.table, split);
    Ok(refit(&recordings, unit, &effects, grid_ns(unit), &|| progress.step()))
}

/// Where the paper's hybrid loses to data alone.
fn broken(parents: &Parents<'_>, split: &RowSplit, field: &Competitors) -> anyhow::Result<ErrorBreakdown> {
    let named = |id: &str| field.contenders.iter().find(|one| one.id == id).context("a model is missing");
    let models = [named("mdhm")?, named("ddm")?, named("mbm")?, named("gate")?];
    let tables: Vec<(&'static str, &FeatureTable)> = [("mbm", parents.plain), ("drawn", parents.drawn)]
        .into_iter()
        .chain(parents.refitted.map(|one| ("refitted", one)))
        .collect();
    Ok(breakdown(&tables, &split.test, &models, &field.paper.guard))
}

/// The residual inside the loop beside the additive one, whatever the cut of the rest.
fn free_run(args: &Args, ready: &TrainingData) -> anyhow::Result<Option<FreeRunFigures>> {
    if ready.table.layout.signal != Signal::SpoolPosition {
        return Ok(None);
    }
    let ready = &args.learn.prepare(Cut::None, RateOfInputs::Linear, &[])?;
    let progress = Progress::new(3, "steps of the residual inside the loop");
    let split = seven_to_three(&ready.table);
    let (unit, seed) = (&ready.sheet.unit, args.learn.seed);
    let recordings = (&ready.recordings[..], grid_ns(unit));
    Ok(Some(closed_loop(unit, recordings, &ready.table, &split, seed, || progress.step())?))
}

fn settings(args: &Args, ready: &TrainingData, hybrid: &Model) -> BTreeMap<&'static str, String> {
    #[cfg(feature = "deep")]
    let networks = format!("{}, on every fourth row of the folds", args.network_budget());
    #[cfg(not(feature = "deep"))]
    let networks = "none: built without the cargo feature `deep`".to_owned();
    let named = hybrid.hyperparameters.iter().map(|(name, value)| format!("{name} {value}"));
    BTreeMap::from([
        ("unit", ready.sheet.name.clone()),
        ("signal", hybrid.signal.clone()),
        ("cut", cut_id(args.cut).to_owned()),
        ("period, s", format!("{}", govtwin_model::units::seconds_from_nanos(hybrid.period_ns))),
        ("seed", args.learn.seed.to_string()),
        ("evaluations of each search", args.learn.budget().0.to_string()),
        ("seeds", args.seeds.to_string()),
        (
            "better twin",
            if args.refit {
                format!("inputs drawn in, refitted, effects: {}", args.effects.join(", "))
            } else {
                "inputs drawn in".to_owned()
            },
        ),
        ("evaluations of each network's search", networks),
        ("booster", hybrid.booster.clone()),
        ("hyperparameters of the MDHM", named.collect::<Vec<_>>().join(", ")),
        ("features", hybrid.features.len().to_string()),
    ])
}

fn importance(model: &Model) -> Vec<Importance> {
    let whole: f64 = model.importance.iter().sum::<f64>().max(f64::MIN_POSITIVE);
    let of = |(name, gain): (&String, &f64)| Importance {
        feature: name.clone(),
        group: govtwin_correction::features::named(name).map_or("", |feature| feature.group().title()),
        gain_share: gain / whole,
    };
    let mut all: Vec<Importance> = model.features.iter().zip(&model.importance).map(of).collect();
    all.sort_by(|a, b| b.gain_share.total_cmp(&a.gain_share));
    all
}

fn say(summary: &ComparisonSummary, unit: &str) -> anyhow::Result<()> {
    print(&table_text(&models_table(&summary.models, unit)))?;
    print("Over all seeds:\n")?;
    print(&table_text(&spread_table(&summary.spread, unit)))?;
    print("What each step brings, with the manual hyperparameters:\n")?;
    print(&table_text(&spread_table(&summary.ablation, unit)))?;
    print("Where the MDHM loses to the DDM:\n")?;
    print(&table_text(&breakdown_table(&summary.breakdown, unit)))?;
    let mut table = Printed::new().words("claim").numbers("paper").numbers("here").words("unit");
    for claim in &summary.claims {
        table.row([&*claim.what, claim.paper, &claim.here, claim.unit]);
    }
    print(&table_text(&table))?;
    for unseen in &summary.left_out_process {
        let said: Vec<String> =
            unseen.models.iter().map(|model| format!("{} {:.5}", model.title, model.overall.mae)).collect();
        print(&format!("Left out of training: {}: MAE {}\n", unseen.process, said.join(", ")))?;
        for at in &unseen.band {
            print(&format!("  its band, {}: {}\n", at.distance, at.words(unit)))?;
        }
    }
    for (signal, models) in
        summary.closed_loop.iter().flat_map(|run| [("spool", &run.spool), ("servomotor", &run.servomotor)])
    {
        let said: Vec<String> = models.iter().map(|one| format!("{} {:.5}", one.title, one.overall.mae)).collect();
        print(&format!("Closed-loop free run, {signal}: MAE {}\n", said.join(", ")))?;
    }
    if let Some(band) = &summary.band {
        let (stated, found) = (100.0 * band.coverage_share, 100.0 * band.overall_share);
        print(&format!("Band: {stated:.0} % stated, {found:.1} % of the judging rows inside.\n"))?;
        for at in &summary.band_by_distance {
            print(&format!("  under the guard, {}, {}: {}\n", at.process, at.distance, at.words(unit)))?;
        }
    }
    if let Some(origin) = &summary.origin {
        print(&format!("{origin}\n"))?;
    }
    Ok(())
}
