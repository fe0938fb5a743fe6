//! What the features of whole chains and of stages alone share, and how features make probabilities.

use crate::hypotheses::table::{EvidenceRow, EvidenceTable};
use crate::likelihood::noise::log_sum;
use crate::model::support::SIZE_PRIOR;

/// Logarithm of the odds against each effect by which the best set is chosen whose remainder is looked at.
pub(crate) const ODDS: f64 = 5.0;

/// Numbers over which what a set leaves beyond a right model is spread: four processes of ten seconds that matter, correlated for about a second.
pub(super) const FREEDOM: f64 = 30.0;

/// Loss from which on nothing changes any more: a hypothesis that could not be simulated is as far behind as any.
pub(super) const FARTHEST: f64 = 1e3;

/// Squares of the distances of a set's sizes from the typical one, in deviations of their prior.
pub(super) fn oddness(row: &EvidenceRow) -> f64 {
    let (median, spread) = SIZE_PRIOR;
    row.sizes.iter().map(|size| ((size.abs().max(1e-3) / median).ln() / spread).powi(2).min(9.0)).sum()
}

/// The two kinds of weights by the shares that a table has of them: fast and slow rates, of a stage alone no data sheet and one.
pub(super) fn shares(table: &EvidenceTable) -> [f64; 2] {
    match &table.stage_alone {
        None => [1.0 - table.slow_share, table.slow_share],
        Some(stage) if stage.sheet => [0.0, 1.0],
        Some(_) => [1.0, 0.0],
    }
}

/// Features once for each kind, times its share.
pub(super) fn by_kind(table: &EvidenceTable, features: &[f64]) -> Vec<f64> {
    shares(table).iter().flat_map(|share| features.iter().map(move |feature| share * feature)).collect()
}

/// Probabilities of hypotheses of which one is true, by their scores.
pub(super) fn softmax(scores: Vec<f64>) -> Vec<f64> {
    let total = log_sum(scores.iter().copied());
    scores.into_iter().map(|score| (score - total).exp()).collect()
}

/// The score of a hypothesis.
#[must_use]
pub fn score(features: &[f64], weights: &[f64]) -> f64 {
    features.iter().zip(weights).map(|(feature, weight)| feature * weight).sum()
}
