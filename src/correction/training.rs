//! From a table to a model: cross-validated loss, the search's space, the final fit with its guard and band.

use std::collections::BTreeMap;

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::band::Band;
use super::booster::{self, FEWEST_ROWS, Hyperparameters, Objective, TrainError, grow};
use super::forest::{Forest, Tree};
use super::guard::Guard;
use super::model::{Learned, Model, fingerprint};
use super::reach::{Reach, Unseen};
use super::search::Hyperparameter;
use super::split::{RowSplit, folds, without};
use super::table::FeatureTable;
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Process;

/// Share of rows that a model's band is to cover.
const COVERAGE_SHARE: f64 = 0.9;

const fn dimension(
    name: &'static str,
    group: &'static str,
    range: [f64; 2],
    logarithmic: bool,
    whole: bool,
) -> Hyperparameter {
    Hyperparameter { name, group, range, logarithmic, whole }
}

/// The space of the search, in the paper's three groups; set before any test row was seen.
pub const SPACE: [Hyperparameter; 9] = [
    dimension("num_iterations", "complexity", [50.0, 400.0], true, true),
    dimension("learning_rate", "complexity", [0.01, 0.3], true, false),
    dimension("max_depth", "complexity", [3.0, 12.0], false, true),
    dimension("num_leaves", "complexity", [7.0, 127.0], true, true),
    dimension("min_data_in_leaf", "regularisation", [5.0, 200.0], true, true),
    dimension("lambda_l1", "regularisation", [1e-3, 10.0], true, false),
    dimension("lambda_l2", "regularisation", [1e-3, 10.0], true, false),
    dimension("bagging_fraction", "sampling", [0.5, 1.0], false, false),
    dimension("feature_fraction", "sampling", [0.3, 1.0], false, false),
];

/// The hyperparameters at a point of [`SPACE`].
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "whole numbers from 3 to 400, by the space"
)]
pub fn at(point: &[f64]) -> Hyperparameters {
    let value = |index: usize| point.get(index).copied().unwrap_or_else(|| SPACE[index].value(0.5));
    let whole = |index: usize| value(index).round() as u32;
    Hyperparameters {
        objective: Objective::L1,
        num_iterations: whole(0),
        learning_rate: value(1),
        max_depth: whole(2),
        num_leaves: whole(3),
        min_data_in_leaf: whole(4),
        lambda_l1: value(5),
        lambda_l2: value(6),
        bagging_fraction: value(7),
        feature_fraction: value(8),
    }
}

/// The target of training.
pub fn targets(table: &FeatureTable, rows: &[usize], learned: Learned) -> Vec<f64> {
    let of = |&row: &usize| match learned {
        Learned::Residual => table.marks[row].residual(),
        Learned::Signal => table.marks[row].measured,
    };
    rows.iter().map(of).collect()
}

/// What trees learn, how they are grown, and from which seed.
#[derive(Clone, Copy, Debug)]
pub struct Recipe<'a> {
    /// What they say.
    pub learned: Learned,
    /// How they are grown.
    pub with: &'a Hyperparameters,
    /// The seed.
    pub seed: u64,
}

/// Grows trees on some rows of a table.
///
/// # Errors
/// As [`grow`].
pub fn fit(table: &FeatureTable, rows: &[usize], recipe: Recipe<'_>) -> Result<(Vec<Tree>, Vec<f64>), TrainError> {
    let Recipe { learned, with, seed } = recipe;
    let width = table.layout.features.len();
    let grown = grow(&table.select(rows), width, &targets(table, rows, learned), with, seed)?;
    Ok((grown.trees, grown.importance))
}

/// The same, ready to be walked.
///
/// # Errors
/// As [`grow`].
pub fn forest(table: &FeatureTable, rows: &[usize], recipe: Recipe<'_>) -> Result<Forest, TrainError> {
    walkable(&fit(table, rows, recipe)?.0, table.layout.features.len())
}

/// Residuals of rows that the trees were not trained on: the row, and target − prediction.
///
/// # Errors
/// As [`grow`], and where every fold has too few rows.
pub fn out_of_fold(
    table: &FeatureTable,
    folds: &[RowSplit],
    recipe: Recipe<'_>,
) -> Result<Vec<(usize, f64)>, TrainError> {
    Ok(missed(table, folds, recipe)?.concat())
}

/// The same fold by fold; a fold with too few training rows gives none.
fn missed(table: &FeatureTable, folds: &[RowSplit], recipe: Recipe<'_>) -> Result<Vec<Vec<(usize, f64)>>, TrainError> {
    let most = folds.iter().map(|fold| fold.train.len()).max().unwrap_or(0);
    if most < FEWEST_ROWS {
        return Err(TrainError::TooFew { found: most });
    }
    let of = |fold: &RowSplit| -> Result<Vec<(usize, f64)>, TrainError> {
        // The first folds of few recordings may be too short for training.
        if fold.train.len() < FEWEST_ROWS {
            return Ok(vec![]);
        }
        let forest = forest(table, &fold.train, recipe)?;
        let targets = targets(table, &fold.test, recipe.learned);
        let residual = |(&row, target): (&usize, f64)| (row, target - forest.value(table.row(row)));
        Ok(fold.test.iter().zip(targets).map(residual).collect())
    };
    folds.par_iter().map(of).collect()
}

/// What bounds corrections.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GuardKind {
    /// The range of each feature, and of the corrections, in the training rows.
    Range,
    /// That, and the distance from those rows, with weights learned on folds that leave a process out: models of their own, trained for nothing
    /// else.
    Processes,
}

/// The guard of training rows, with the required reach if they are of two processes or more, and its band.
///
/// # Errors
/// As [`grow`].
pub fn guard(
    table: &FeatureTable,
    rows: &[usize],
    recipe: Recipe<'_>,
    kind: GuardKind,
) -> Result<(Guard, Option<Band>), TrainError> {
    let mut guard = Guard::of(&table.select(rows), table.layout.features.len(), &targets(table, rows, recipe.learned));
    let by_time = folds(table, rows);
    let missed_by_time = missed(table, &by_time, recipe).unwrap_or_default();
    let motions = missed_by_time.iter().flatten().map(|(row, missed)| (table.marks[*row].motion, *missed));
    let band = Band::of(&motions.collect::<Vec<_>>(), COVERAGE_SHARE);
    if kind == GuardKind::Range {
        return Ok((guard, band));
    }
    let left_out: Vec<RowSplit> = Process::ALL.map(|process| without(table, rows, process)).into();
    let alone = left_out.iter().filter(|fold| fold.train.len() >= FEWEST_ROWS && !fold.test.is_empty()).count() < 2;
    // A model of the signal itself has no twin to fall back on.
    let Some(band) = band.filter(|_| recipe.learned == Learned::Residual && !alone) else { return Ok((guard, band)) };
    let missed_unseen = missed(table, &left_out, recipe)?;
    let folds = left_out.iter().zip(&missed_unseen).enumerate();
    let by_time = by_time.iter().zip(&missed_by_time).map(|fold| (left_out.len(), fold));
    let names: Vec<String> = table.layout.features.iter().map(super::features::Feature::name).collect();
    let of = |rows: &[usize]| -> Vec<&[f64]> { rows.iter().map(|&row| table.row(row)).collect() };
    let scales_of = of(rows);
    let reach = |taught: &[usize]| Reach::of(&names, &of(taught), &scales_of);
    let mut unseen = vec![];
    for (group, (fold, missed)) in folds.chain(by_time) {
        let Some(reach) = reach(&fold.train) else { continue };
        unseen.extend(missed.iter().map(|&(row, missed)| {
            let (mark, distance) = (&table.marks[row], reach.distance(table.row(row)));
            let (target, half_width) = (mark.residual(), band.half_width(mark.motion));
            Unseen { group, distance, target, said: target - missed, half_width }
        }));
    }
    guard.reach = reach(rows).map(|reach| reach.learned(&unseen, COVERAGE_SHARE));
    Ok((guard, Some(band)))
}

/// Trees of the library, for rows of `width` numbers, ready to be walked.
///
/// # Errors
/// Where the library gave trees that are none.
pub fn walkable(trees: &[Tree], width: usize) -> Result<Forest, TrainError> {
    Forest::new(trees, width).map_err(|error| TrainError::Library(error.to_string()))
}

/// Mean absolute error over the validation rows of all folds: the search's objective (MAE, as the paper's step 5).
///
/// # Errors
/// As `out_of_fold`.
pub fn loss(table: &FeatureTable, folds: &[RowSplit], recipe: Recipe<'_>) -> Result<f64, TrainError> {
    let residuals = out_of_fold(table, folds, recipe)?;
    if residuals.is_empty() {
        return Err(TrainError::TooFew { found: 0 });
    }
    let count = residuals.len() as f64;
    Ok(residuals.iter().map(|(_, residual)| residual.abs()).sum::<f64>() / count)
}

/// Trains the final model on `rows`, with its guard from the same rows and its band from their cross-validation.
///
/// # Errors
/// As [`grow`].
pub fn model(
    table: &FeatureTable,
    rows: &[usize],
    recipe: Recipe<'_>,
    unit: &Unit,
    kind: GuardKind,
) -> Result<Model, TrainError> {
    let (trees, importance) = fit(table, rows, recipe)?;
    let (guard, band) = guard(table, rows, recipe, kind)?;
    let layout = &table.layout;
    let features: Vec<String> = layout.features.iter().map(super::features::Feature::name).collect();
    Ok(Model {
        program: concat!("govtwin ", env!("CARGO_PKG_VERSION")).to_owned(),
        signal: layout.signal.id().to_owned(),
        unit: layout.signal.unit().to_owned(),
        learned: recipe.learned,
        opening: layout.opening,
        rate_of_inputs: layout.rate_of_inputs,
        period_ns: layout.period_ns,
        twin: fingerprint(unit),
        features,
        guard,
        band,
        importance,
        booster: booster::NAME.to_owned(),
        hyperparameters: named(recipe.with),
        training: BTreeMap::from([
            ("rows".to_owned(), rows.len().to_string()),
            ("seed".to_owned(), recipe.seed.to_string()),
        ]),
        trees,
    })
}

/// Hyperparameters by the library's names.
pub fn named(with: &Hyperparameters) -> BTreeMap<String, f64> {
    let value = serde_json::to_value(with).unwrap_or_default();
    let fields = value.as_object().into_iter().flatten();
    fields.filter_map(|(name, value)| Some((name.clone(), value.as_f64()?))).collect()
}

#[cfg(test)]
mod tests {
    use super::{GuardKind, Recipe, SPACE, at, loss, model, named};
    use crate::booster::{Hyperparameters, TrainError};
    use crate::corrector::Corrector;
    use crate::model::{Learned, Model};
    use crate::split::{folds, seven_to_three};
    use crate::table::tests::{of, recording};
    use govtwin_model::twin::Twin;

    const QUICK: Recipe<'static> = Recipe {
        learned: Learned::Residual,
        with: &Hyperparameters { num_iterations: 80, learning_rate: 0.15, ..Hyperparameters::MANUAL },
        seed: 1,
    };

    /// A gap that the features determine: the sign of the command's error against its middle.
    fn gap(frame: &govtwin_model::frame::Frame, _: f64) -> f64 {
        if frame.inputs.opening_command_pu > 0.4 { 0.02 } else { -0.01 }
    }

    #[test]
    fn a_model_trained_saved_and_run_live_closes_a_gap_it_has_not_seen() {
        let recordings: Vec<_> = (0..4).map(|k| recording(&format!("{k}"), 500 * k, 400, gap)).collect();
        let table = of(&recordings);
        let split = seven_to_three(&table);
        let unit = govtwin_model::params::reference();
        let trained = model(&table, &split.train, QUICK, &unit, GuardKind::Range).unwrap();
        let model = Model::from_text(&trained.to_text().unwrap()).unwrap();
        assert_eq!(model, trained);
        let mut corrector = Corrector::new(&model).unwrap();
        let mut twin = Twin::new(&unit);
        let last = &recordings[3];
        let (mut before, mut after, mut covered) = (0.0, 0.0, 0);
        for frame in &last.frames {
            let correction = corrector.step(frame, &twin.step(frame));
            let measured = frame.measured.spool_position_pu;
            before += (measured - correction.uncorrected).abs();
            after += (measured - correction.corrected).abs();
            covered += usize::from((measured - correction.corrected).abs() <= correction.half_width);
        }
        assert!(after < 0.2 * before, "{after} against {before}");
        assert!(covered > 300, "{covered} of 400");
    }

    #[test]
    fn too_little_data_is_said() {
        let table = of(&[recording("a", 0, 60, gap)]);
        let split = seven_to_three(&table);
        let unit = govtwin_model::params::reference();
        let error = model(&table, &split.train, QUICK, &unit, GuardKind::Range).unwrap_err();
        assert_eq!(error, TrainError::TooFew { found: 42 });
        assert!(loss(&table, &folds(&table, &split.train), QUICK).is_err());
    }

    #[test]
    fn points_of_the_space_are_hyperparameters() {
        let point: Vec<f64> = SPACE.iter().map(|dimension| dimension.value(1.0)).collect();
        let with = at(&point);
        let named = named(&with);
        for (dimension, value) in SPACE.iter().zip(point) {
            assert!((named[dimension.name] - value).abs() < 1e-9, "{}", dimension.name);
        }
    }

    #[test]
    fn a_process_that_no_row_taught_is_no_worse_than_its_twin_under_the_guard() {
        use super::guard;
        use crate::guard::GuardCounts;
        use crate::split::without_process;
        use govtwin_model::recording::Process;
        // What is right in one process is wrong in the next.
        let gaps = [0.02, -0.02, 0.015, 0.005];
        let recordings: Vec<_> = (0..4)
            .map(|k| recording(&format!("{k}"), 500 * k, 1500, move |_, _| gaps[usize::try_from(k).unwrap()]))
            .collect();
        let mut table = of(&recordings);
        for mark in &mut table.marks {
            mark.process = Process::ALL[mark.recording];
        }
        let split = without_process(&table, Process::ALL[3]);
        let (guard, band) = guard(&table, &split.train, QUICK, GuardKind::Processes).unwrap();
        let range = super::guard(&table, &split.train, QUICK, GuardKind::Range).unwrap();
        assert!(range.0.reach.is_none() && range.1 == band);
        assert!(band.is_some() && guard.reach.is_some());
        let forest = super::forest(&table, &split.train, QUICK).unwrap();
        let (mut twin, mut bare, mut guarded) = (0.0, 0.0, 0.0);
        for &row in &split.test {
            let (residual, raw) = (table.marks[row].residual(), forest.value(table.row(row)));
            twin += residual.abs();
            bare += (residual - raw).abs();
            guarded += (residual - guard.apply(raw, table.row(row), &mut GuardCounts::default()).value).abs();
        }
        assert!(bare > 1.5 * twin, "{bare} against {twin}: the test shows nothing");
        assert!(guarded <= twin + 1e-9, "{guarded} against {twin}");
    }
}
