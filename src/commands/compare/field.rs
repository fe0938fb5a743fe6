//! The models of a comparison: for one seed the searches, the models that they find, and their estimates for the test rows.

use anyhow::Context;
use govtwin_correction::booster::{Hyperparameters, Objective};
use govtwin_correction::model::{Learned, Model};
use govtwin_correction::split::RowSplit;
use govtwin_correction::table::FeatureTable;
use govtwin_correction::training::{self, GuardKind, Recipe};
use govtwin_lab::comparison::Contender;
use govtwin_lab::comparison::ablation::{Parents, gated, of_data, of_hybrid};
use govtwin_lab::comparison::contenders::{self, data_only, mechanism, trained};
use govtwin_lab::comparison::summary::Searched;
use govtwin_model::parameters::Unit;

use crate::commands::learn::{self, SearchJob};
use crate::commands::output::Progress;

/// Who competes, and how their hyperparameters were found.
pub struct Competitors {
    /// What every model says of the rows that judge.
    pub contenders: Vec<Contender>,
    /// The searches.
    pub searches: Vec<Searched>,
    /// The paper's hybrid.
    pub paper: Model,
}

/// One search by each kind, and what each found, the Bayesian one first.
fn searched(
    args: &learn::Args,
    (table, split, learned): (&FeatureTable, &RowSplit, Learned),
    (id, nouns): (&'static str, [&'static str; 2]),
    seed: u64,
    searches: &mut Vec<Searched>,
) -> anyhow::Result<[Hyperparameters; 2]> {
    let [bayesian, random] = nouns;
    let job = |kind, noun| SearchJob { id, kind, noun, objective: Objective::L1 };
    let found = args.search(table, split, learned, job("bayesian", bayesian), seed)?;
    let chance = args.search(table, split, learned, job("random", random), seed)?;
    let at = |search: &Searched| -> anyhow::Result<Hyperparameters> {
        Ok(training::at(search.best().context("no evaluation of the search succeeded")?.0))
    };
    let with = [at(&found)?, at(&chance)?];
    searches.extend([found, chance]);
    Ok(with)
}

/// All that trees can make, by one seed and with equal effort: one search of either kind for each of data alone, the paper's hybrid and this one.
pub fn field(
    args: &learn::Args,
    parents: &Parents<'_>,
    split: &RowSplit,
    seed: u64,
    unit: &Unit,
) -> anyhow::Result<Competitors> {
    let (plain, best) = (parents.plain, parents.drawn);
    let data = data_only(plain);
    let mut searches = vec![];
    let job = (plain, split, Learned::Residual);
    let [paper, paper_by_chance] =
        searched(args, job, ("mdhm", ["evaluations, MDHM", "evaluations, MDHM at random"]), seed, &mut searches)?;
    let job = (&data, split, Learned::Signal);
    let [alone, _] =
        searched(args, job, ("ddm", ["evaluations, DDM", "evaluations, DDM at random"]), seed, &mut searches)?;
    let job = (best, split, Learned::Residual);
    let nouns = ["evaluations, hybrid", "evaluations, hybrid at random"];
    let [with, _] = searched(args, job, ("hybrid", nouns), seed, &mut searches)?;

    let progress = Progress::new(7, "models");
    let rows = (&split.train[..], &split.test[..]);
    let mut contenders = vec![mechanism(plain, &split.test)];
    contenders.push(Contender { id: "drawn", title: "MBM, inputs drawn in", ..mechanism(parents.drawn, &split.test) });
    if let Some(table) = parents.refitted {
        let of = mechanism(table, &split.test);
        contenders.push(Contender { id: "refitted", title: "MBM, that and refitted", ..of });
    }
    let (_, estimates) =
        trained(&data, rows, Recipe { learned: Learned::Signal, with: &alone, seed }, unit, GuardKind::Range)?;
    contenders.push(Contender { id: "ddm", title: "DDM", estimates });
    progress.step();
    let (_, estimates) = gated(&data, split, &of_data(&alone), seed)?;
    contenders.push(Contender { id: "ddm_gate", title: "DDM, gate", estimates });
    progress.step();
    let residual = |with| Recipe { learned: Learned::Residual, with, seed };
    let (_, estimates) = trained(plain, rows, residual(&Hyperparameters::MANUAL), unit, GuardKind::Range)?;
    contenders.push(Contender { id: "lightgbm", title: "LightGBM hybrid", estimates });
    progress.step();
    let (_, estimates) = trained(plain, rows, residual(&paper_by_chance), unit, GuardKind::Range)?;
    contenders.push(Contender { id: "random", title: "LightGBM hybrid, random search", estimates });
    progress.step();
    let (model, estimates) = trained(plain, rows, residual(&paper), unit, GuardKind::Processes)?;
    contenders.push(Contender { id: "mdhm", title: "MDHM", estimates });
    let guarded = contenders::estimates(&model.forest()?, plain, &split.test, Learned::Residual, Some(&model.guard));
    contenders.push(Contender { id: "guarded", title: "MDHM, guarded", estimates: guarded });
    progress.step();
    let (_, estimates) = trained(best, rows, residual(&with), unit, GuardKind::Range)?;
    contenders.push(Contender { id: "hybrid", title: "hybrid, better twin", estimates });
    progress.step();
    let (_, estimates) = gated(best, split, &of_hybrid(&with), seed)?;
    contenders.push(Contender { id: "gate", title: "hybrid, better twin, gate", estimates });
    progress.step();
    Ok(Competitors { contenders, searches, paper: model })
}
