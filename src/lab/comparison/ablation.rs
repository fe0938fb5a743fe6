//! What each step from the paper's hybrid to this one brings, with one set of hyperparameters on the same rows.

use super::Contender;
use super::contenders::{data_only, estimates, keeping, mechanism};
use super::gate::BlendGate;
use govtwin_correction::booster::{Hyperparameters, Objective, TrainError};
use govtwin_correction::features::Feature;
use govtwin_correction::model::Learned;
use govtwin_correction::split::{RowSplit, folds};
use govtwin_correction::table::FeatureTable;
use govtwin_correction::training::{self, Recipe};

/// How many steps there are with a refitted parent; one less without.
pub const STEPS: usize = 12;

/// The same rows under several parents.
#[derive(Clone, Copy, Debug)]
pub struct Parents<'a> {
    /// The twin of the unit as given, its inputs held between rows: the paper's.
    pub plain: &'a FeatureTable,
    /// The same, its inputs drawn in between rows.
    pub drawn: &'a FeatureTable,
    /// That, refitted on the rows that teach. It is the better twin, but trees on top of it find no more.
    pub refitted: Option<&'a FeatureTable>,
}

/// Trains on the training rows; its estimates for the test rows.
///
/// # Errors
/// Where it cannot be trained.
pub fn said(table: &FeatureTable, split: &RowSplit, recipe: Recipe<'_>) -> Result<Vec<f64>, TrainError> {
    let forest = training::forest(table, &split.train, recipe)?;
    Ok(estimates(&forest, table, &split.test, recipe.learned, None))
}

/// Models under a gate that was learned on folds of the rows that teach: each what it learns and by which hyperparameters.
///
/// # Errors
/// Where a model cannot be trained.
pub fn gated(
    table: &FeatureTable,
    split: &RowSplit,
    models: &[(Learned, Hyperparameters)],
    seed: u64,
) -> Result<(BlendGate, Vec<f64>), TrainError> {
    let folds = folds(table, &split.train);
    let mut rows: Vec<(usize, Vec<f64>)> = vec![];
    let mut words: Vec<Vec<f64>> = vec![vec![]; split.test.len()];
    for (learned, with) in models {
        let recipe = Recipe { learned: *learned, with, seed };
        let missed = training::out_of_fold(table, &folds, recipe)?;
        // Every model misses on the same rows in the same order.
        rows.resize_with(missed.len(), Default::default);
        for (own, (row, missed)) in rows.iter_mut().zip(missed) {
            own.0 = row;
            own.1.push(table.marks[row].measured - missed);
        }
        let judged = said(table, split, recipe)?;
        words.iter_mut().zip(judged).for_each(|(own, word)| own.push(word));
    }
    let gate = BlendGate::learned(table, models.len(), &rows);
    let mixed = split.test.iter().zip(&words).map(|(&row, words)| gate.value(table.marks[row].motion, words)).collect();
    Ok((gate, mixed))
}

/// What the hybrid's gate chooses among: the residual by absolute errors and by squares, and the signal itself.
pub fn of_hybrid(with: &Hyperparameters) -> [(Learned, Hyperparameters); 3] {
    let squares = Hyperparameters { objective: Objective::L2, ..*with };
    [(Learned::Residual, *with), (Learned::Residual, squares), (Learned::Signal, *with)]
}

/// The same choice for data alone, so that a gate is no advantage of the hybrid's.
pub fn of_data(with: &Hyperparameters) -> [(Learned, Hyperparameters); 2] {
    [(Learned::Signal, *with), (Learned::Signal, Hyperparameters { objective: Objective::L2, ..*with })]
}

/// All steps: the paper's list of features, rates, drawn inputs, a refit, other objectives, other targets.
///
/// # Errors
/// Where a model cannot be trained.
pub fn ablation(
    parents: &Parents<'_>,
    split: &RowSplit,
    with: &Hyperparameters,
    seed: u64,
    mut done: impl FnMut(),
) -> Result<Vec<Contender>, TrainError> {
    let papers = keeping(parents.plain, |feature| !feature.is_rate_of_input());
    let (alone, alone_rates) = (data_only(&papers), data_only(parents.plain));
    let best = parents.drawn;
    let other = |objective| Hyperparameters { objective, ..*with };
    let mut steps: Vec<(&str, &str, &FeatureTable, Learned, Hyperparameters)> = vec![
        ("ddm_without_rates", "DDM, the paper's features", &alone, Learned::Signal, *with),
        ("ddm_rates", "DDM, with rates", &alone_rates, Learned::Signal, *with),
        ("paper", "hybrid, the paper's features", &papers, Learned::Residual, *with),
        ("rates", "… with rates", parents.plain, Learned::Residual, *with),
        ("drawn", "… on inputs drawn in", parents.drawn, Learned::Residual, *with),
    ];
    if let Some(table) = parents.refitted {
        steps.push(("refitted", "… that, on the refitted twin", table, Learned::Residual, *with));
    }
    steps.extend([
        ("huber", "… that, by Huber's loss", best, Learned::Residual, other(Objective::Huber)),
        ("l2", "… that, by squares", best, Learned::Residual, other(Objective::L2)),
        ("quantile", "… that, by quartiles", best, Learned::Residual, other(Objective::Quantile)),
        ("direct", "… that, direct with the twin's words", best, Learned::Signal, *with),
    ]);
    let mut contenders =
        vec![Contender { id: "mbm_best", title: "the twin alone, inputs drawn in", ..mechanism(best, &split.test) }];
    for (id, title, table, learned, with) in steps {
        contenders.push(Contender { id, title, estimates: said(table, split, Recipe { learned, with: &with, seed })? });
        done();
    }
    let (_, estimates) = gated(&alone_rates, split, &of_data(with), seed)?;
    contenders.push(Contender { id: "ddm_gate", title: "DDM, with rates and a gate", estimates });
    done();
    let (_, estimates) = gated(best, split, &of_hybrid(with), seed)?;
    contenders.push(Contender { id: "gate", title: "… a gate between all three", estimates });
    done();
    Ok(contenders)
}

/// Whether two tables hold the same rows.
pub fn same_rows(one: &FeatureTable, other: &FeatureTable) -> bool {
    let places = |table: &FeatureTable| table.marks.iter().map(|mark| (mark.recording, mark.frame)).collect::<Vec<_>>();
    let names = |table: &FeatureTable| table.layout.features.iter().map(Feature::name).collect::<Vec<_>>();
    places(one) == places(other) && names(one) == names(other)
}
