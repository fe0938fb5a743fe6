//! The models of the comparison that trees can make, each trained on the same rows with the same features.

use super::Contender;
use super::coverage::covered_by_distance;
use super::summary::{ModelFigures, UnseenProcess};
use govtwin_correction::booster::{Hyperparameters, TrainError};
use govtwin_correction::features::Feature;
use govtwin_correction::forest::Forest;
use govtwin_correction::guard::{Guard, GuardCounts};
use govtwin_correction::model::{Learned, Model};
use govtwin_correction::split::without_process;
use govtwin_correction::table::{FeatureTable, TableLayout};
use govtwin_correction::training::{self, GuardKind, Recipe};
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Process;

/// The same table with some of its features.
pub fn keeping(table: &FeatureTable, keeps: impl Fn(&Feature) -> bool) -> FeatureTable {
    let keep: Vec<usize> =
        (0..table.layout.features.len()).filter(|&index| keeps(&table.layout.features[index])).collect();
    let features: Vec<Feature> = keep.iter().map(|&index| table.layout.features[index]).collect();
    let values = (0..table.marks.len()).flat_map(|row| keep.iter().map(move |&index| table.row(row)[index])).collect();
    FeatureTable {
        layout: TableLayout { features, ..table.layout.clone() },
        values,
        marks: table.marks.clone(),
        left_out: table.left_out,
    }
}

/// The same table without the twin's words: what a model of data alone sees.
pub fn data_only(table: &FeatureTable) -> FeatureTable {
    keeping(table, |feature| !feature.channel().is_model())
}

/// The twin alone.
pub fn mechanism(table: &FeatureTable, rows: &[usize]) -> Contender {
    let estimates = rows.iter().map(|&row| table.marks[row].model).collect();
    Contender { id: "mbm", title: "MBM", estimates }
}

/// The word of trees for rows; with a guard, as a node runs them.
pub fn estimates(
    forest: &Forest,
    table: &FeatureTable,
    rows: &[usize],
    learned: Learned,
    guard: Option<&Guard>,
) -> Vec<f64> {
    let mut counts = GuardCounts::default();
    let of = |&row: &usize| {
        let raw = forest.value(table.row(row));
        let value = guard.map_or(raw, |guard| guard.apply(raw, table.row(row), &mut counts).value);
        match learned {
            Learned::Residual => table.marks[row].model + value,
            Learned::Signal => value,
        }
    };
    rows.iter().map(of).collect()
}

/// A trained model and its estimates for the test rows.
///
/// # Errors
/// Where it cannot be trained.
pub fn trained(
    table: &FeatureTable,
    split: (&[usize], &[usize]),
    recipe: Recipe<'_>,
    unit: &Unit,
    kind: GuardKind,
) -> Result<(Model, Vec<f64>), TrainError> {
    let model = training::model(table, split.0, recipe, unit, kind)?;
    let forest = model.forest().map_err(|error| TrainError::Library(error.to_string()))?;
    let said = estimates(&forest, table, split.1, recipe.learned, None);
    Ok((model, said))
}

/// Every process left out of training in turn, with the manual hyperparameters: MBM, DDM, the paper's hybrid, and the hybrid on a twin
/// whose inputs are drawn in between rows, beside that twin.
///
/// A search or a refit would have seen the process, so neither takes part. Hybrids stand bare, and under their guard. Both tables hold the
/// same rows.
///
/// # Errors
/// Where a model cannot be trained.
pub fn leave_one_out(
    plain: &FeatureTable,
    drawn: &FeatureTable,
    seed: u64,
    mut done: impl FnMut(),
) -> Result<Vec<UnseenProcess>, TrainError> {
    let data = data_only(plain);
    let mut all = vec![];
    for process in Process::ALL {
        let split = without_process(plain, process);
        if split.test.is_empty() || split.train.is_empty() {
            continue;
        }
        let recipe = |learned| Recipe { learned, with: &Hyperparameters::MANUAL, seed };
        let mut hybrids = |table: &FeatureTable, [bare, guarded]: [(&'static str, &'static str); 2]| {
            let recipe = recipe(Learned::Residual);
            let (guard, band) = training::guard(table, &split.train, recipe, GuardKind::Processes)?;
            let hybrid = training::forest(table, &split.train, recipe)?;
            done();
            let said = |guard| estimates(&hybrid, table, &split.test, Learned::Residual, guard);
            let of = |(id, title), estimates| Contender { id, title, estimates };
            let covered = band.map(|band| covered_by_distance(table, &split.test, &hybrid, (&guard, &band)));
            Ok::<_, TrainError>(([of(bare, said(None)), of(guarded, said(Some(&guard)))], covered.unwrap_or_default()))
        };
        let names = [("hybrid", "LightGBM hybrid"), ("guarded", "LightGBM hybrid, guarded")];
        let ([paper, paper_guarded], _) = hybrids(plain, names)?;
        let names = [("hybrid_drawn", "hybrid on it"), ("guarded_drawn", "hybrid on it, guarded")];
        let ([better, better_guarded], band) = hybrids(drawn, names)?;
        let alone = training::forest(&data, &split.train, recipe(Learned::Signal))?;
        done();
        let ddm = estimates(&alone, &data, &split.test, Learned::Signal, None);
        let contenders = [
            mechanism(plain, &split.test),
            Contender { id: "ddm", title: "DDM", estimates: ddm },
            paper,
            paper_guarded,
            Contender { id: "drawn", title: "MBM, inputs drawn in", ..mechanism(drawn, &split.test) },
            better,
            better_guarded,
        ];
        let models = contenders.iter().map(|one| ModelFigures::of(plain, &split.test, one)).collect();
        all.push(UnseenProcess { process: process.id(), models, band });
    }
    Ok(all)
}
