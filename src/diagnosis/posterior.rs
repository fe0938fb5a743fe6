//! The posterior over fault sets: evidence, prior odds and a few learned weights make probabilities that sum to 1.
//!
//! Hypotheses are the sheet alone, every fitted fault set, and something unknown at each stage. Their probabilities are a conditional logit
//! (McFadden 1974) over features of the evidence table. [`Weights::bayes`] is Bayes' theorem where the gap is small; the weights say how far the
//! evidence of equations that are never exact can be trusted, and are learned by log score on generated units ([`Weights`]).

use serde::{Deserialize, Serialize};

use crate::diagnosis::evidence::log_sum;
use crate::diagnosis::table::{Row, Table};
use crate::tuning::bench::GENEROUS;

/// The weights as shipped; `govtwin calibrate` writes such a file.
const SHIPPED: &str = include_str!("../../params/diagnosis_weights.json");

/// Number of features of a hypothesis.
pub const FEATURES: usize = 13;

/// What each feature is, in the order of the weights.
pub const NAMES: [&str; FEATURES] = [
    "evidence lost against the best hypothesis, over the scale of errors of equations, at fast rates",
    "the same at slow rates",
    "logarithm of 1 and that ratio, at fast rates",
    "the same at slow rates",
    "number of effects",
    "something unknown",
    "nothing",
    "strain of the sheet",
    "what the noise that it predicts itself costs more, tens of nats",
    "unknown: logarithm of the share of a visible gap that the best fault set leaves, at fast rates",
    "unknown where a gap is visible",
    "unknown: logarithm of 1 and the evidence lost, over the scale of errors of equations, negative where it is won",
    "nothing: ten squares of the logarithm of its χ² over that of sound units, at fast rates",
];

/// The learned numbers, with where they come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weights {
    /// What each weight multiplies.
    pub features: Vec<String>,
    /// One for each of [`NAMES`].
    pub weights: Vec<f64>,
    /// Expected logarithm of the equation error of a size: one standard deviation of the logarithm of fitted over true size.
    pub size_spread: f64,
    /// By how much the interval of the explained share is widened, as a factor of its half-widths.
    pub closure_widening: f64,
    /// Where they were learned: seeds, number of units, program version, scores.
    pub provenance: serde_json::Value,
}

impl Weights {
    /// The weights that come with the program.
    #[must_use]
    pub fn shipped() -> Self {
        serde_json::from_str(SHIPPED).unwrap_or_else(|_| Self::bayes())
    }

    /// Bayes' theorem with odds of e⁵ against each effect, nothing learned.
    #[must_use]
    pub fn bayes() -> Self {
        let mut weights = vec![0.0; FEATURES];
        weights[0] = -INEXACT.0;
        weights[1] = -INEXACT.0;
        weights[4] = -5.0;
        weights[5] = -5.0;
        // For losses that matter the logarithm is near the loss itself.
        weights[11] = -INEXACT.0;
        Self {
            features: NAMES.iter().map(|name| (*name).to_owned()).collect(),
            weights,
            size_spread: 0.1,
            closure_widening: 1.0,
            provenance: serde_json::Value::Null,
        }
    }
}

/// One hypothesis and its features.
#[derive(Clone, Debug, PartialEq)]
pub enum Hypothesis {
    /// The sheet alone (no effects) or a fault set, by its row of the table.
    Effects(usize),
    /// Something unknown at a stage, by its id.
    Unknown(String),
}

/// Scale of errors of equations in the evidence: nats, and a share of the evidence for a gap. Of a few pairs those that score best on units not seen.
const INEXACT: (f64, f64) = (3.0, 0.02);

/// Share with which a further nat of evidence counts by Bayes' theorem where so much evidence speaks for a gap: 1 where none does.
#[must_use]
pub fn counted_share(gap: f64) -> f64 {
    INEXACT.0 / (INEXACT.0 + INEXACT.1 * gap.max(0.0))
}

/// Evidence for a gap: of the likeliest set, less the odds against its effects, over that of the sheet alone.
#[must_use]
pub fn gap(table: &Table) -> f64 {
    let odds = |row: &Row| row.evidence() - 5.0 * row.effects.len() as f64;
    let best = table.rows.iter().map(odds).fold(f64::NEG_INFINITY, f64::max);
    let empty = table.rows.iter().find(|row| row.effects.is_empty()).map_or(best, Row::evidence);
    (best - empty).max(0.0)
}

/// Loss from which on nothing changes any more: a hypothesis that could not be simulated is as far behind as any.
const FARTHEST: f64 = 1e6;

/// The hypotheses of a table with their features; none of the struck effects.
#[must_use]
pub fn hypotheses(table: &Table, struck: &[&str]) -> Vec<(Hypothesis, [f64; FEATURES])> {
    let allowed = |row: &Row| !row.effects.iter().any(|id| struck.contains(&id.as_str()));
    let rows: Vec<usize> = (0..table.rows.len()).filter(|&k| allowed(&table.rows[k])).collect();
    let evidence = |row: &Row| row.evidence();
    let odds = |row: &Row| evidence(row) - 5.0 * row.effects.len() as f64;
    let Some(&best) = rows.iter().max_by(|&&a, &&b| odds(&table.rows[a]).total_cmp(&odds(&table.rows[b]))) else {
        return Vec::new();
    };
    let leader = &table.rows[best];
    let nothing = rows.iter().map(|&k| &table.rows[k]).find(|row| row.effects.is_empty());
    let empty = nothing.map_or(odds(leader), evidence);
    let gap = (odds(leader) - empty).max(0.0);
    let (fast, slow) = (1.0 - table.slow_share, table.slow_share);
    // Losses are counted against the best of all sets by evidence alone: what odds say of their number is a feature of its own.
    let top = rows.iter().map(|&k| evidence(&table.rows[k])).fold(f64::NEG_INFINITY, f64::max);
    // The equation of a true effect is off by a share of what the effect causes: in a large gap small differences say little.
    let scale = INEXACT.0 + INEXACT.1 * gap;
    let expected = GENEROUS * table.samples;
    let mut all = Vec::new();
    for &k in &rows {
        let row = &table.rows[k];
        let mut features = [0.0; FEATURES];
        let lost = ((top - evidence(row)) / scale).min(FARTHEST);
        features[0] = fast * lost.min(30.0);
        features[1] = slow * lost.min(30.0);
        features[2] = fast * lost.ln_1p();
        features[3] = slow * lost.ln_1p();
        features[4] = row.effects.len() as f64;
        features[6] = f64::from(u8::from(row.effects.is_empty()));
        features[7] = row.strain.min(20.0);
        if row.effects.is_empty() {
            // Sound units leave nearly the same χ² per sample, so that its logarithm is as good as normal.
            let beyond = (row.cost / expected.max(1.0)).max(1.0).ln();
            features[12] = fast * (10.0 * beyond * beyond).min(40.0);
        }
        features[8] = 0.05 * row.own_noise.clamp(-100.0, 100.0);
        all.push((Hypothesis::Effects(k), features));
    }
    let empty_cost = nothing.map_or(leader.cost, |row| row.cost);
    let share = ((leader.cost - expected) / (empty_cost - expected).max(1.0)).clamp(0.0, 1.0);
    let visible = gap / (gap + 20.0);
    let left = visible * (0.02 + share).ln();
    for (stage, evidence) in &table.unknown {
        let mut features = [0.0; FEATURES];
        features[5] = 1.0;
        features[9] = fast * left;
        features[10] = visible;
        // A few shapes explain far less of a gap than any equation does, so that their loss counts otherwise.
        let lost = ((top - evidence) / scale).min(FARTHEST);
        features[11] = lost.abs().ln_1p().copysign(lost);
        all.push((Hypothesis::Unknown(stage.clone()), features));
    }
    all
}

/// Probabilities of the hypotheses of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Posterior {
    /// Probability of each fitted set, by its row of the table; the sheet alone is one of them.
    pub sets: Vec<(usize, f64)>,
    /// Probability of something unknown, by stage.
    pub unknown: Vec<(String, f64)>,
}

impl Posterior {
    /// By these weights.
    #[must_use]
    pub fn new(table: &Table, weights: &Weights, struck: &[&str]) -> Self {
        let all = hypotheses(table, struck);
        let scores: Vec<f64> = all.iter().map(|(_, features)| score(features, &weights.weights)).collect();
        let total = log_sum(scores.iter().copied());
        let mut posterior = Self { sets: Vec::new(), unknown: Vec::new() };
        for ((hypothesis, _), score) in all.into_iter().zip(scores) {
            let probability = (score - total).exp();
            match hypothesis {
                Hypothesis::Effects(row) => posterior.sets.push((row, probability)),
                Hypothesis::Unknown(stage) => posterior.unknown.push((stage, probability)),
            }
        }
        posterior.sets.sort_by(|a, b| b.1.total_cmp(&a.1));
        posterior
    }

    /// Probability that an effect is present: the sum over the sets that hold it.
    #[must_use]
    pub fn inclusion(&self, table: &Table, id: &str) -> f64 {
        let holds = |row: usize| table.rows[row].effects.iter().any(|effect| effect == id);
        self.sets.iter().filter(|(row, _)| holds(*row)).map(|(_, probability)| probability).sum()
    }

    /// Probability of something unknown at any stage.
    #[must_use]
    pub fn unknown(&self) -> f64 {
        self.unknown.iter().map(|(_, probability)| probability).sum()
    }

    /// Probability that there is nothing.
    #[must_use]
    pub fn nothing(&self, table: &Table) -> f64 {
        self.sets
            .iter()
            .filter(|(row, _)| table.rows[*row].effects.is_empty())
            .map(|(_, probability)| probability)
            .sum()
    }
}

/// The score of a hypothesis.
#[must_use]
pub fn score(features: &[f64; FEATURES], weights: &[f64]) -> f64 {
    features.iter().zip(weights).map(|(feature, weight)| feature * weight).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_weights_are_of_these_features() {
        let weights: Weights = serde_json::from_str(SHIPPED).unwrap();
        assert_eq!(weights.features, NAMES);
        assert_eq!(weights.weights.len(), FEATURES);
        assert!(weights.weights.iter().all(|weight| weight.is_finite()));
        assert!(weights.size_spread > 0.0 && weights.closure_widening > 0.0);
    }

    /// In a small gap the odds of two sets are those of Bayes' theorem, also where their evidence differs by less than an effect's odds.
    #[test]
    fn evidence_alone_gives_the_odds_of_bayes() {
        let row = |effects: &[&str], evidence: f64| Row {
            effects: effects.iter().map(|id| (*id).to_owned()).collect(),
            refined: true,
            by_kappa: [evidence; 4],
            ..Row::default()
        };
        let rows =
            vec![row(&["backlash", "load"], 0.0), row(&["backlash"], -2.0), row(&["load"], -3.0), row(&[], -8.0)];
        let table = Table { samples: 1e3, rows, ..Table::default() };
        let posterior = Posterior::new(&table, &Weights::bayes(), &[]);
        let p = |row: usize| posterior.sets.iter().find(|(k, _)| *k == row).unwrap().1;
        // The scale of equation errors is 3 nats and a fiftieth of a gap of 1 nat.
        let counted = counted_share(1.0);
        for (a, b, nats) in [(0, 1, 2.0 * counted - 5.0), (1, 2, counted), (1, 3, 6.0 * counted - 5.0)] {
            assert!(((p(a) / p(b)).ln() - nats).abs() < 1e-9, "{a} {b}: {}", (p(a) / p(b)).ln());
        }
        let sum: f64 = posterior.sets.iter().map(|(_, p)| p).sum();
        assert!((sum - 1.0).abs() < 1e-12 && (posterior.inclusion(&table, "load") - p(0) - p(2)).abs() < 1e-12);
        assert_eq!(Posterior::new(&table, &Weights::bayes(), &["load"]).sets.len(), 2);
    }
}
