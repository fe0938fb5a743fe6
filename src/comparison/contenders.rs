//! The models of the comparison that trees can make, each trained on the same rows with the same features.

use super::{Contender, Standing};
use crate::parameters::Unit;
use crate::recording::Process;
use crate::residual::booster::{Hyperparameters, TrainError};
use crate::residual::features::Feature;
use crate::residual::forest::Forest;
use crate::residual::guard::{Counts, Guard};
use crate::residual::model::{Learned, Model};
use crate::residual::split::without_process;
use crate::residual::table::{Layout, Table};
use crate::residual::training::{self, targets};

/// The same table without the twin's words: what a model of data alone sees.
#[must_use]
pub fn data_only(table: &Table) -> Table {
    let keep: Vec<usize> =
        (0..table.layout.features.len()).filter(|&index| !table.layout.features[index].channel().is_model()).collect();
    let features: Vec<Feature> = keep.iter().map(|&index| table.layout.features[index]).collect();
    let values = (0..table.marks.len()).flat_map(|row| keep.iter().map(move |&index| table.row(row)[index])).collect();
    Table {
        layout: Layout { features, ..table.layout.clone() },
        values,
        marks: table.marks.clone(),
        left_out: table.left_out,
    }
}

/// The twin alone.
#[must_use]
pub fn mechanism(table: &Table, rows: &[usize]) -> Contender {
    let estimates = rows.iter().map(|&row| table.marks[row].model).collect();
    Contender { id: "mbm", title: "MBM", estimates }
}

/// The word of trees for rows; with a guard, as a node runs them.
#[must_use]
pub fn estimates(forest: &Forest, table: &Table, rows: &[usize], learned: Learned, guard: Option<&Guard>) -> Vec<f64> {
    let mut counts = Counts::default();
    let of = |&row: &usize| {
        let raw = forest.value(table.row(row));
        let value = guard.map_or(raw, |guard| guard.apply(raw, table.row(row), &mut counts).0);
        match learned {
            Learned::Residual => table.marks[row].model + value,
            Learned::Signal => value,
        }
    };
    rows.iter().map(of).collect()
}

/// A trained model and what it says of the rows that judge.
///
/// # Errors
/// Where it cannot be trained.
pub fn trained(
    table: &Table,
    split: (&[usize], &[usize]),
    learned: Learned,
    with: &Hyperparameters,
    seed: u64,
    unit: &Unit,
) -> Result<(Model, Vec<f64>), TrainError> {
    let model = training::model(table, split.0, learned, with, seed, unit)?;
    let forest = model.forest().map_err(|error| TrainError::Library(error.to_string()))?;
    let said = estimates(&forest, table, split.1, learned, None);
    Ok((model, said))
}

/// Every process left out of training in turn: MBM, DDM and hybrid, with the manual hyperparameters.
///
/// A search would have seen the process, so it takes no part. The hybrid stands twice: bare, and under its guard.
///
/// # Errors
/// Where a model cannot be trained.
pub fn leave_one_out(
    table: &Table,
    seed: u64,
    mut done: impl FnMut(),
) -> Result<Vec<(Process, Vec<Standing>)>, TrainError> {
    let data = data_only(table);
    let mut all = vec![];
    for process in Process::ALL {
        let split = without_process(table, process);
        if split.test.is_empty() || split.train.is_empty() {
            continue;
        }
        let forest = |table: &Table, learned| -> Result<Forest, TrainError> {
            let (trees, _) = training::fit(table, &split.train, learned, &Hyperparameters::MANUAL, seed)?;
            Forest::new(&trees, table.layout.features.len()).map_err(|error| TrainError::Library(error.to_string()))
        };
        let width = table.layout.features.len();
        let targets = targets(table, &split.train, Learned::Residual);
        let guard = Guard::of(&table.select(&split.train), width, &targets);
        let hybrid = forest(table, Learned::Residual)?;
        done();
        let alone = forest(&data, Learned::Signal)?;
        done();
        let said = |guard| estimates(&hybrid, table, &split.test, Learned::Residual, guard);
        let contenders = [
            mechanism(table, &split.test),
            Contender {
                id: "ddm",
                title: "DDM",
                estimates: estimates(&alone, &data, &split.test, Learned::Signal, None),
            },
            Contender { id: "hybrid", title: "LightGBM hybrid", estimates: said(None) },
            Contender { id: "guarded", title: "LightGBM hybrid, guarded", estimates: said(Some(&guard)) },
        ];
        all.push((process, contenders.iter().map(|one| Standing::of(table, &split.test, one)).collect()));
    }
    Ok(all)
}
