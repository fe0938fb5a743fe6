//! The learned numbers of the posterior, and the features that they multiply.
//!
//! [`Weights::bayes`] is Bayes' theorem with nothing learned; `govtwin calibrate` learns the weights by log score on generated units.

use serde::{Deserialize, Serialize};

/// The weights as shipped; `govtwin calibrate` writes such a file.
const SHIPPED: &str = include_str!("../../../params/diagnosis_weights.json");

/// What a weight multiplies, and its value beforehand.
#[derive(Clone, Copy, Debug)]
pub struct PosteriorFeature {
    /// What the weight multiplies.
    pub name: &'static str,
    /// The weight with nothing learned, at fast and at slow rates.
    pub bayes: [f64; 2],
}

const fn feature(name: &'static str, bayes: [f64; 2]) -> PosteriorFeature {
    PosteriorFeature { name, bayes }
}

/// Features of a fault set. Where the best set leaves more than a right model would, its equations or its noise are wrong in some way, and so are nats:
/// what it leaves beyond that is spread over some thirty numbers, by any of which a further effect may gain as much. Such errors are correlated from
/// sample to sample, so that the first nats count most: their logarithm is a feature beside them.
pub const OF_SETS: [PosteriorFeature; 6] = [
    feature("nats of evidence lost against the best set, over what that leaves beyond a right model", [-1.0; 2]),
    feature("logarithm of 1 and these", [0.0; 2]),
    feature("number of effects", [-5.0; 2]),
    feature("nothing at work", [0.0; 2]),
    feature("prior χ² per parameter", [0.0; 2]),
    feature("squares of the sizes' distances from the typical one", [0.0; 2]),
];

/// Features of something unknown against all that is known, of the set that is best by Bayes' theorem.
pub const OF_UNKNOWN: [PosteriorFeature; 7] = [
    feature("any unit", [-3.0; 2]),
    feature("inverse hyperbolic sine of the deviations by which ln χ² is off that of sound units", [1.5, 0.5]),
    feature(
        "these deviations of nothing at work where χ² is too large, by its probability if nothing is unknown",
        [0.5; 2],
    ),
    feature("prior χ² per parameter", [0.0; 2]),
    feature("squares of the sizes' distances from the typical one", [0.0; 2]),
    feature("number of effects", [0.0; 2]),
    feature(
        "logarithm of the nats that discrepancy terms at a stage gain beyond the set, negative where they lose",
        [0.5; 2],
    ),
];

/// Features of a stage, where something is unknown. What discrepancy terms there gain in parts of the chain on their own is weighed stage by stage: those
/// of the supply reach every signal and explain a little of everything, those of the regulator and the sensors only what has their few shapes.
pub const OF_STAGES: [PosteriorFeature; 8] = [
    feature("logarithm of the share that effects there have of all that is known", [0.5; 2]),
    feature("logarithm of 1 and the nats gained in parts on their own over their χ², of the regulator", [0.5; 2]),
    feature("the same of the pilot valve", [0.5; 2]),
    feature("the same of the ESV", [0.5; 2]),
    feature("the same of the spool", [0.5; 2]),
    feature("the same of the servomotor", [0.5; 2]),
    feature("the same of the supply", [0.5; 2]),
    feature("the same of the sensors", [0.5; 2]),
];

/// Names of the rates, in the order of the weights: each feature counts for both, by their share of the samples.
const RATES: [&str; 2] = ["at fast rates", "at slow rates"];

/// What the weights multiply, in their order.
#[must_use]
pub fn names(features: &[PosteriorFeature]) -> Vec<String> {
    let of = |rate: &&str| features.iter().map(|feature| format!("{}, {rate}", feature.name)).collect::<Vec<_>>();
    RATES.iter().flat_map(of).collect()
}

/// The weights with nothing learned.
#[must_use]
pub fn beforehand(features: &[PosteriorFeature]) -> Vec<f64> {
    (0..RATES.len()).flat_map(|rate| features.iter().map(move |feature| feature.bayes[rate])).collect()
}

/// The learned numbers, with where they come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weights {
    /// One for each of [`OF_SETS`].
    pub sets: Vec<f64>,
    /// One for each of [`OF_UNKNOWN`].
    pub unknown: Vec<f64>,
    /// One for each of [`OF_STAGES`].
    pub stages: Vec<f64>,
    /// What the weights multiply, group by group, as a reader of the file needs it.
    pub features: [Vec<String>; 3],
    /// Expected logarithm of the equation error of a size: one standard deviation of the logarithm of fitted over true size.
    pub size_spread: f64,
    /// By how much the interval of the explained share is widened, as a factor of its half-widths.
    #[serde(rename = "closure_widening")]
    pub explained_fraction_widening: f64,
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
        Self {
            sets: beforehand(&OF_SETS),
            unknown: beforehand(&OF_UNKNOWN),
            stages: beforehand(&OF_STAGES),
            features: [names(&OF_SETS), names(&OF_UNKNOWN), names(&OF_STAGES)],
            size_spread: 0.1,
            explained_fraction_widening: 1.0,
            provenance: serde_json::Value::Null,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_weights_are_of_these_features() {
        let weights: Weights = serde_json::from_str(SHIPPED).unwrap();
        assert_eq!(weights.features, Weights::bayes().features);
        for (weights, features) in
            [(&weights.sets, &OF_SETS[..]), (&weights.unknown, &OF_UNKNOWN[..]), (&weights.stages, &OF_STAGES[..])]
        {
            assert_eq!(weights.len(), 2 * features.len());
            assert!(weights.iter().all(|weight| weight.is_finite()));
        }
        assert!(weights.size_spread > 0.0 && weights.explained_fraction_widening > 0.0);
    }
}
