//! `govtwin compare`: the twin, data-only models and hybrids under one split and the same features, as the paper compares them.

use std::collections::BTreeMap;

use anyhow::{Context, bail};
use govtwin::comparison::closed::closed_loop;
use govtwin::comparison::contenders::{self, data_only, leave_one_out, mechanism, trained};
use govtwin::comparison::summary::{FreeRun, Importance, SCHEMA, Scored, Summary, Unseen, claims, covered};
use govtwin::comparison::{Contender, Standing};
use govtwin::recording::Process;
use govtwin::replay::summary::cut_id;
use govtwin::report::comparison::{HYBRIDS, Shown, models_table, page};
use govtwin::report::table::Table as Printed;
use govtwin::residual::booster::Hyperparameters;
use govtwin::residual::model::{Learned, Model};
use govtwin::residual::split::{Split, seven_to_three};
use govtwin::residual::training;
use govtwin::signal::Signal;
use govtwin::twin::Cut;

use super::learn::{self, CutAt, Job, Ready};
use super::output::{Output, Progress, print, table_text};
use crate::commands::Outcome;

/// Compare the twin, data-only models and hybrids as the paper does.
///
/// One split (the first 70 % of each process teach, the last 30 % judge) and one list of features for all: MBM, the twin alone; DDM, data
/// only; LightGBM hybrids with manual and with Bayesian-optimised hyperparameters (MDHM); BO-LSTM and BO-TCN hybrids where the program was
/// built with the cargo feature `deep`. Then every process left out of training in turn, and
/// in closed-loop free run a residual inside the loop beside the additive one. Writes DIR/compare.html and DIR/compare.json.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    learn: learn::Args,
    /// Where the guide-vane opening comes from; the paper's mode is `servomotor`.
    #[arg(long, value_enum, default_value_t = CutAt::Servomotor)]
    cut: CutAt,
    /// Evaluations of each network's search, which takes far longer than that for trees.
    #[cfg(feature = "deep")]
    #[arg(long, value_name = "N", default_value_t = 15)]
    network_iterations: usize,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let mut output = Output::claim(&args.learn.out, &["compare.html", "compare.json"])?;
    let mut ready = args.learn.ready(args.cut)?;
    let split = seven_to_three(&ready.table);
    if split.test.is_empty() {
        bail!(
            "no rows are left to judge on: {} rows were found; give more or longer recordings",
            ready.table.marks.len()
        );
    }
    let mut field = Field { contenders: vec![mechanism(&ready.table, &split.test)], searches: vec![] };
    let hybrid = trees(args, &ready, &split, &mut field)?;
    #[cfg(feature = "deep")]
    learn::networks::compete(
        &args.learn,
        args.learn.scaled(args.network_iterations),
        &ready.table,
        &split,
        (&mut field.contenders, &mut field.searches),
    )?;
    let progress = Progress::new(8, "models with a process left out");
    let left_out = leave_one_out(&ready.table, args.learn.seed, || progress.step())?;
    drop(progress);
    let closed_loop = free_run(args, &ready)?;

    let table = &ready.table;
    let standing = |contender: &Contender| Standing::of(table, &split.test, contender);
    let standings: Vec<Standing> = field.contenders.iter().map(standing).collect();
    let named = |id: &str| standings.iter().find(|one| one.id == id).context("a model of the comparison is missing");
    let mut ranked: Vec<&Standing> = standings.iter().filter(|one| HYBRIDS.contains(&one.id)).collect();
    ranked.sort_by(|a, b| a.overall.mae.total_cmp(&b.overall.mae));
    let unseen = |(process, models): &(Process, Vec<Standing>)| Unseen {
        process: process.id(),
        models: models.iter().map(Scored::from).collect(),
    };
    let of_hybrid = field.contenders.iter().find(|one| one.id == "mdhm").map(|one| &one.estimates[..]);
    let summary = Summary {
        schema: SCHEMA,
        program: concat!("govtwin ", env!("CARGO_PKG_VERSION")),
        origin: ready.origin.take(),
        settings: settings(args, &ready, &hybrid),
        rows: BTreeMap::from([
            ("train", split.train.len() as u64),
            ("test", split.test.len() as u64),
            ("purged", split.purged as u64),
            ("left out", table.left_out),
        ]),
        recordings: std::mem::take(&mut ready.cleanings),
        ranking: ranked.iter().map(|one| one.id).collect(),
        claims: claims(named("mdhm")?, named("mbm")?, named("ddm")?),
        models: standings.iter().map(Scored::from).collect(),
        left_out_process: left_out.iter().map(unseen).collect(),
        searches: field.searches,
        importance: importance(&hybrid),
        band: hybrid.band.zip(of_hybrid).map(|(band, said)| covered(table, &split.test, said, &band)),
        closed_loop,
    };
    let shown = Shown { rows: table, judging: &split.test, contenders: &field.contenders };
    let html = output.path("compare.html");
    output.add("compare.html", page(&summary, &shown)?.to_html().as_bytes())?;
    output.add_json("compare.json", &summary)?;
    output.place()?;
    if args.learn.json {
        print(&(serde_json::to_string_pretty(&summary)? + "\n"))?;
    } else {
        say(&summary, table.layout.signal.unit())?;
        print(&format!("Pictures: {}\n", html.display()))?;
    }
    Ok(Outcome::Ok)
}

/// Who competes, and how their hyperparameters were found.
struct Field {
    contenders: Vec<Contender>,
    searches: Vec<govtwin::comparison::summary::Searched>,
}

/// Trains what trees can make; the MDHM comes back.
fn trees(args: &Args, ready: &Ready, split: &Split, field: &mut Field) -> anyhow::Result<Model> {
    let (table, unit, seed) = (&ready.table, &ready.sheet.unit, args.learn.seed);
    let data = data_only(table);
    let rows = (&split.train[..], &split.test[..]);
    let mut search = |table: &_, learned, id, kind, noun| -> anyhow::Result<Hyperparameters> {
        let found = args.learn.search(table, split, learned, Job { id, kind, noun })?;
        let with = training::at(found.best().context("no evaluation of the search succeeded")?.0);
        field.searches.push(found);
        Ok(with)
    };
    let best = search(table, Learned::Residual, "mdhm", "bayesian", "evaluations, MDHM")?;
    search(table, Learned::Residual, "mdhm", "random", "evaluations, MDHM at random")?;
    let best_alone = search(&data, Learned::Signal, "ddm", "bayesian", "evaluations, DDM")?;

    let (_, estimates) = trained(&data, rows, Learned::Signal, &best_alone, seed, unit)?;
    field.contenders.push(Contender { id: "ddm", title: "DDM", estimates });
    let (_, estimates) = trained(table, rows, Learned::Residual, &Hyperparameters::MANUAL, seed, unit)?;
    field.contenders.push(Contender { id: "lightgbm", title: "LightGBM hybrid", estimates });
    let (hybrid, estimates) = trained(table, rows, Learned::Residual, &best, seed, unit)?;
    field.contenders.push(Contender { id: "mdhm", title: "MDHM", estimates });
    let guarded = contenders::estimates(&hybrid.forest()?, table, &split.test, Learned::Residual, Some(&hybrid.guard));
    field.contenders.push(Contender { id: "guarded", title: "MDHM, guarded", estimates: guarded });
    Ok(hybrid)
}

/// The residual inside the loop beside the additive one, whatever the cut of the rest.
fn free_run(args: &Args, ready: &Ready) -> anyhow::Result<Option<FreeRun>> {
    if ready.table.layout.signal != Signal::SpoolPosition {
        return Ok(None);
    }
    let other = if args.cut == CutAt::None { None } else { Some(args.learn.ready(CutAt::None)?) };
    let ready = other.as_ref().unwrap_or(ready);
    let progress = Progress::new(3, "steps towards a residual inside the loop");
    let split = seven_to_three(&ready.table);
    let (unit, seed) = (&ready.sheet.unit, args.learn.seed);
    let judged = closed_loop(unit, &ready.recordings, &ready.table, &split, seed, || progress.step())?;
    let scored = |standings: &[Standing]| standings.iter().map(Scored::from).collect();
    Ok(Some(FreeRun { spool: scored(&judged.spool), servomotor: scored(&judged.servomotor) }))
}

fn settings(args: &Args, ready: &Ready, hybrid: &Model) -> BTreeMap<&'static str, String> {
    let cut = if args.cut == CutAt::None { Cut::None } else { Cut::Servomotor };
    #[cfg(feature = "deep")]
    let networks = format!("{}, on every fourth row of the folds", args.learn.scaled(args.network_iterations));
    #[cfg(not(feature = "deep"))]
    let networks = "none: built without the cargo feature `deep`".to_owned();
    let named = hybrid.hyperparameters.iter().map(|(name, value)| format!("{name} {value}"));
    BTreeMap::from([
        ("unit", ready.sheet.name.clone()),
        ("signal", hybrid.signal.clone()),
        ("cut", cut_id(cut).to_owned()),
        ("period, s", format!("{}", govtwin::units::seconds_from_nanos(hybrid.period_ns))),
        ("seed", args.learn.seed.to_string()),
        ("evaluations of each search", args.learn.budget().0.to_string()),
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
        group: govtwin::residual::features::named(name).map_or("", |feature| feature.group().title()),
        gain_share: gain / whole,
    };
    let mut all: Vec<Importance> = model.features.iter().zip(&model.importance).map(of).collect();
    all.sort_by(|a, b| b.gain_share.total_cmp(&a.gain_share));
    all
}

fn say(summary: &Summary, unit: &str) -> anyhow::Result<()> {
    print(&table_text(&models_table(&summary.models, unit)))?;
    let mut table = Printed::new().words("claim").numbers("paper").numbers("here").words("unit");
    for claim in &summary.claims {
        table.row([claim.what, claim.paper, &claim.here, claim.unit]);
    }
    print(&table_text(&table))?;
    for unseen in &summary.left_out_process {
        let said: Vec<String> =
            unseen.models.iter().map(|model| format!("{} {:.5}", model.title, model.overall.mae)).collect();
        print(&format!("Left out of training: {}: MAE {}\n", unseen.process, said.join(", ")))?;
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
    }
    if let Some(origin) = &summary.origin {
        print(&format!("{origin}\n"))?;
    }
    Ok(())
}
