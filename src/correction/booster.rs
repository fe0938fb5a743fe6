//! Training of the trees: the only file that knows LightGBM.
//!
//! L1 objective (Liu et al. 2025, 3.3) unless another is asked for, one thread, fixed seeds, no values treated as missing: the same rows give the same trees.
//! What leaves this file are plain [`Tree`]s read from LightGBM's own text, which predict as it does, to the last bit.

use lightgbm3::{Booster, Dataset, ImportanceType};
use serde::Serialize;
use serde_json::json;

use super::forest::Tree;
use govtwin_model::stored::with_words;

/// Name and version of what trains.
pub const NAME: &str = "LightGBM 4 through lightgbm3 1.0";

/// The fewest training rows for which a guard can be learned.
pub(crate) const FEWEST_ROWS: usize = 200;

with_words! {
    /// What trees make least.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Objective: id {
        /// Mean absolute error, the paper's: few rows far off do not count for more than others.
        L1 = "regression_l1",
        /// Squares up to `HUBER_PU`, straight beyond.
        Huber = "huber",
        /// Mean squared error.
        L2 = "regression",
        /// Pinball losses at the three quartiles (Koenker and Bassett 1978), a list of trees for each, put together as Tukey's trimean
        /// `(q₂₅ + 2 q₅₀ + q₇₅)/4`: few rows far off do not count here either. Three times the trees.
        Quantile = "quantile",
    }
}

/// Where Huber's loss turns from squares to straight, in the target's unit; the coefficient's unit is the signal's.
const HUBER_PU: f64 = 0.01;

impl Objective {
    /// The lists of trees that are grown for it: the library's `alpha`, and how much of each counts.
    fn parts(self) -> &'static [(f64, f64)] {
        match self {
            Self::Quantile => &[(0.25, 0.25), (0.5, 0.5), (0.75, 0.25)],
            Self::L1 | Self::Huber | Self::L2 => &[(HUBER_PU, 1.0)],
        }
    }
}

/// The hyperparameters in the paper's three groups (4.1.3): complexity, regularisation, sampling.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Hyperparameters {
    /// What is made least.
    pub objective: Objective,
    /// Complexity: trees.
    pub num_iterations: u32,
    /// Complexity: share of each tree that counts.
    pub learning_rate: f64,
    /// Complexity: levels of a tree.
    pub max_depth: u32,
    /// Complexity: leaves of a tree.
    pub num_leaves: u32,
    /// Regularisation: rows that a leaf needs.
    pub min_data_in_leaf: u32,
    /// Regularisation: shrinks leaves by a constant; the coefficient is in the target's unit times rows.
    pub lambda_l1: f64,
    /// Regularisation: shrinks leaves in proportion, in rows; a coefficient.
    pub lambda_l2: f64,
    /// Sampling: share of rows that each tree sees; a share of 1.
    pub bagging_fraction: f64,
    /// Sampling: share of features that each tree sees; a share of 1.
    pub feature_fraction: f64,
}

impl Hyperparameters {
    /// What a person takes from the library's documentation: the "manual" model of the comparison, set before any test row was seen.
    pub const MANUAL: Self = Self {
        objective: Objective::L1,
        num_iterations: 200,
        learning_rate: 0.05,
        max_depth: 8,
        num_leaves: 31,
        min_data_in_leaf: 20,
        lambda_l1: 0.0,
        lambda_l2: 0.0,
        bagging_fraction: 0.8,
        feature_fraction: 0.8,
    };
}

/// Why nothing was trained.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TrainError {
    /// Too few rows.
    #[error("too little data: {found} rows teach, at least {FEWEST_ROWS} are needed; give more or longer recordings")]
    TooFew {
        /// Rows given.
        found: usize,
    },
    /// Nothing to learn from.
    #[error("{0}")]
    Unusable(String),
    /// The library refused.
    #[error("LightGBM: {0}")]
    Library(String),
}

/// Trees and what they were made of.
#[derive(Clone, Debug, PartialEq)]
pub struct GrownTrees {
    /// The trees.
    pub trees: Vec<Tree>,
    /// Gain of each feature.
    pub importance: Vec<f64>,
}

/// Grows trees on rows of `features` values each.
///
/// # Errors
/// Where there are too few rows, where a number is not finite, or where the library refuses.
pub fn grow(
    values: &[f64],
    features: usize,
    targets: &[f64],
    with: &Hyperparameters,
    seed: u64,
) -> Result<GrownTrees, TrainError> {
    let mut grown = GrownTrees { trees: vec![], importance: vec![0.0; features] };
    for &(alpha, weight) in with.objective.parts() {
        let booster = train(values, features, targets, with, (alpha, seed))?;
        let importance = booster.feature_importance(ImportanceType::Gain).map_err(|error| library(&error))?;
        let text = booster.save_string().map_err(|error| library(&error))?;
        let mut part = trees(&text)?;
        part.iter_mut().flat_map(|tree| &mut tree.leaf).for_each(|leaf| *leaf *= weight);
        grown.trees.extend(part);
        grown.importance.iter_mut().zip(importance).for_each(|(sum, gain)| *sum += gain);
    }
    Ok(grown)
}

fn library(error: &lightgbm3::Error) -> TrainError {
    TrainError::Library(error.to_string())
}

fn train(
    values: &[f64],
    features: usize,
    targets: &[f64],
    with: &Hyperparameters,
    (alpha, seed): (f64, u64),
) -> Result<Booster, TrainError> {
    if targets.len() < FEWEST_ROWS {
        return Err(TrainError::TooFew { found: targets.len() });
    }
    if features == 0 || values.len() != features * targets.len() {
        let found = format!("{} values for {} rows of {features} features", values.len(), targets.len());
        return Err(TrainError::Unusable(found));
    }
    if !values.iter().chain(targets).all(|value| value.is_finite()) {
        return Err(TrainError::Unusable("a feature or target is not finite; prepare the recordings first".into()));
    }
    #[expect(clippy::cast_possible_truncation, reason = "LightGBM keeps labels in single precision")]
    let labels: Vec<f32> = targets.iter().map(|value| *value as f32).collect();
    let width = i32::try_from(features).map_err(|_| TrainError::Unusable("too many features".into()))?;
    let dataset = Dataset::from_slice(values, &labels, width, true).map_err(|error| library(&error))?;
    let parameters = json!({
        "objective": with.objective.id(),
        "alpha": alpha,
        "num_iterations": with.num_iterations,
        "learning_rate": with.learning_rate,
        "max_depth": with.max_depth,
        "num_leaves": with.num_leaves,
        "min_data_in_leaf": with.min_data_in_leaf,
        "lambda_l1": with.lambda_l1,
        "lambda_l2": with.lambda_l2,
        "bagging_fraction": with.bagging_fraction,
        "bagging_freq": 1,
        "feature_fraction": with.feature_fraction,
        "seed": seed % (1 << 31),
        "deterministic": true,
        "force_row_wise": true,
        "num_threads": 1,
        "use_missing": false,
        "verbosity": -1,
    });
    Booster::train(dataset, &parameters).map_err(|error| library(&error))
}

/// The trees of LightGBM's text.
fn trees(text: &str) -> Result<Vec<Tree>, TrainError> {
    // The text is blocks apart by empty lines; those of trees begin with their number.
    text.split("\n\n").filter(|block| block.trim_start().starts_with("Tree=")).map(tree).collect()
}

fn tree(block: &str) -> Result<Tree, TrainError> {
    let field = |name: &str| {
        block.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix('=')).unwrap_or("").split_whitespace()
    };
    let unread = |word: &str| TrainError::Library(format!("its text holds `{word}`, which is no number"));
    let whole = |name| -> Result<Vec<i32>, TrainError> {
        field(name).map(|word| word.parse().map_err(|_| unread(word))).collect()
    };
    let real = |name| -> Result<Vec<f64>, TrainError> {
        field(name).map(|word| word.parse().map_err(|_| unread(word))).collect()
    };
    if field("num_cat").next() != Some("0") {
        return Err(TrainError::Library("its text has splits on categories, which no feature here is".into()));
    }
    let feature =
        field("split_feature").map(|word| word.parse().map_err(|_| unread(word))).collect::<Result<_, _>>()?;
    Ok(Tree {
        feature,
        threshold: real("threshold")?,
        left: whole("left_child")?,
        right: whole("right_child")?,
        leaf: real("leaf_value")?,
    })
}

/// LightGBM's own ways to predict one row, beside which the trees of this house are measured.
pub struct Reference(Booster);

impl Reference {
    /// Trains like [`grow`] and keeps the library's booster, the first where an objective has several.
    ///
    /// # Errors
    /// As [`grow`], and where the fast path cannot be set up.
    pub fn train(
        values: &[f64],
        features: usize,
        targets: &[f64],
        with: &Hyperparameters,
        seed: u64,
    ) -> Result<Self, TrainError> {
        let mut booster = train(values, features, targets, with, (with.objective.parts()[0].0, seed))?;
        booster.single_row_fast_init::<f64>(Some(&json!({"num_threads": 1}))).map_err(|error| library(&error))?;
        Ok(Self(booster))
    }

    /// The plain call; NaN where the library refuses.
    pub fn plain(&self, row: &[f64]) -> f64 {
        let width = self.0.num_features();
        let predicted = self.0.predict_with_params(row, width, true, "num_threads=1");
        predicted.ok().and_then(|values| values.first().copied()).unwrap_or(f64::NAN)
    }

    /// The library's fast path for single rows; NaN where it refuses.
    pub fn fast(&self, row: &[f64]) -> f64 {
        let predicted = self.0.predict_single_row_fast(row);
        predicted.ok().and_then(|values| values.first().copied()).unwrap_or(f64::NAN)
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::{FEWEST_ROWS, Hyperparameters, Reference, TrainError, grow};
    use crate::forest::Forest;

    const WIDTH: usize = 6;

    fn rows(count: usize) -> (Vec<f64>, Vec<f64>) {
        let mut random = ChaCha8Rng::seed_from_u64(7);
        let values: Vec<f64> = (0..count * WIDTH).map(|_| random.random_range(-1.0..1.0)).collect();
        let targets = values
            .as_chunks::<WIDTH>()
            .0
            .iter()
            .map(|row| 0.02 * (3.0 * row[0]).sin() + 0.01 * row[1] * row[2])
            .collect();
        (values, targets)
    }

    fn quick() -> Hyperparameters {
        Hyperparameters { num_iterations: 60, ..Hyperparameters::MANUAL }
    }

    #[test]
    fn trees_predict_as_the_library_does_to_the_last_bit() {
        let (values, targets) = rows(3000);
        let grown = grow(&values, WIDTH, &targets, &quick(), 1).unwrap();
        let reference = Reference::train(&values, WIDTH, &targets, &quick(), 1).unwrap();
        let forest = Forest::new(&grown.trees, WIDTH).unwrap();
        let fresh = rows(4000).0;
        for row in fresh.as_chunks::<WIDTH>().0 {
            assert_eq!(forest.value(row).to_bits(), reference.plain(row).to_bits());
            assert_eq!(forest.value(row).to_bits(), reference.fast(row).to_bits());
        }
    }

    #[test]
    fn it_learns_and_the_same_seed_gives_the_same_trees() {
        let (values, targets) = rows(3000);
        let grown = grow(&values, WIDTH, &targets, &quick(), 1).unwrap();
        assert_eq!(grown, grow(&values, WIDTH, &targets, &quick(), 1).unwrap());
        assert_ne!(grown.trees, grow(&values, WIDTH, &targets, &quick(), 2).unwrap().trees);
        let forest = Forest::new(&grown.trees, WIDTH).unwrap();
        let (before, after) =
            values.as_chunks::<WIDTH>().0.iter().zip(&targets).fold((0.0, 0.0), |(before, after), (row, target)| {
                (before + target.abs(), after + (target - forest.value(row)).abs())
            });
        assert!(after < 0.3 * before, "{after} against {before}");
        let strongest = (0..WIDTH).max_by(|&a, &b| grown.importance[a].total_cmp(&grown.importance[b]));
        assert_eq!(strongest, Some(0));
    }

    #[test]
    fn every_objective_finds_the_middle_and_quartiles_are_little_moved_by_rows_far_off() {
        use super::Objective;
        let (values, clean) = rows(3000);
        // Errors that lie to one side: one row in eight is far off.
        let dirty: Vec<f64> =
            clean.iter().enumerate().map(|(at, target)| target + if at % 8 == 0 { 0.5 } else { 0.0 }).collect();
        let [l1, huber, l2, quantile] = Objective::ALL.map(|objective| {
            let with = Hyperparameters { objective, ..quick() };
            let grown = grow(&values, WIDTH, &dirty, &with, 1).unwrap();
            assert_eq!(grown.trees.len(), 60 * objective.parts().len());
            let forest = Forest::new(&grown.trees, WIDTH).unwrap();
            let missed = values
                .as_chunks::<WIDTH>()
                .0
                .iter()
                .zip(&clean)
                .map(|(row, target)| (target - forest.value(row)).abs());
            missed.sum::<f64>() / 3000.0
        });
        assert!(l1 < 0.5 * l2 && quantile < 0.5 * l2, "{l1} {huber} {l2} {quantile}");
        assert!(huber < l2, "{huber} {l2}");
    }

    #[test]
    fn too_little_or_bad_data_is_refused() {
        let (values, targets) = rows(FEWEST_ROWS - 1);
        let error = grow(&values, WIDTH, &targets, &quick(), 1).unwrap_err();
        assert_eq!(error, TrainError::TooFew { found: FEWEST_ROWS - 1 });
        assert!(error.to_string().contains("at least 200"));
        let (mut values, targets) = rows(500);
        values[17] = f64::NAN;
        assert!(grow(&values, WIDTH, &targets, &quick(), 1).unwrap_err().to_string().contains("not finite"));
        assert!(grow(&values[1..], WIDTH, &targets, &quick(), 1).is_err());
    }

    #[test]
    fn a_constant_target_gives_a_constant() {
        let (values, _) = rows(500);
        let grown = grow(&values, WIDTH, &[0.5; 500], &quick(), 1).unwrap();
        let forest = Forest::new(&grown.trees, WIDTH).unwrap();
        assert_eq!(forest.value(&values[..WIDTH]), 0.5);
    }
}
