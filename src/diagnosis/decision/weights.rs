//! The learned numbers of the posterior, and the features that they multiply.
//!
//! [`Questions::bayes`] is Bayes' theorem with nothing learned; `govtwin calibrate` learns the weights by log score on generated units. Whole chains
//! and servomotor stages alone have features and weights of their own; whole chains without a data sheet have weights of their own.

use serde::{Deserialize, Serialize};

use crate::hypotheses::table::EvidenceTable;

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

/// Features of a fault set of a servomotor stage alone: [`OF_SETS`], and what it misses on pieces left out of its fit.
pub const OF_STAGE_SETS: [PosteriorFeature; 8] = [
    feature("nats of evidence lost against the best set, over what that leaves beyond a right model", [-1.0; 2]),
    feature("logarithm of 1 and these", [0.0; 2]),
    feature("number of effects", [-5.0; 2]),
    feature("nothing at work", [0.0; 2]),
    feature("prior χ² per parameter", [0.0; 2]),
    feature("squares of the sizes' distances from the typical one", [0.0; 2]),
    feature("nats lost on pieces left out against the set that misses least there, a draw each", [-1.0; 2]),
    feature("logarithm of 1 and these", [0.0; 2]),
];

/// Three questions with their features: which fault set, whether something is unknown, at which stage. Each feature counts twice, by shares that a
/// table has of two kinds.
#[derive(Debug)]
pub struct Questions {
    /// Of a fault set, where nothing is unknown.
    pub sets: &'static [PosteriorFeature],
    /// Of something unknown against all that is known.
    pub unknown: &'static [PosteriorFeature],
    /// Of a stage where something unknown is.
    pub stages: &'static [PosteriorFeature],
    /// The two kinds, in the order of the weights.
    kinds: [&'static str; 2],
    /// Whose shipped weights are these beforehand; none where nothing learned is.
    begins_with: Option<&'static Questions>,
    /// The weights as shipped; `govtwin calibrate` writes such a file.
    shipped: &'static str,
}

/// Of whole chains.
pub static CHAIN: Questions = CHAIN_QUESTIONS;

const CHAIN_QUESTIONS: Questions = Questions {
    sets: &OF_SETS,
    unknown: &OF_UNKNOWN,
    stages: &OF_STAGES,
    kinds: ["at fast rates", "at slow rates"],
    begins_with: None,
    shipped: include_str!("../../../params/diagnosis_weights.json"),
};

/// Of whole chains whose sheet was made of the recordings: wherever that is wrong, it leaves and forgives other things than a manufacturer's sheet.
///
/// Units without a sheet are few beside those with one, so learning begins with what the latter taught.
pub static ASSUMED_SHEET: Questions = Questions {
    begins_with: Some(&CHAIN),
    shipped: include_str!("../../../params/assumed_sheet_weights.json"),
    ..CHAIN_QUESTIONS
};

/// Of servomotor stages alone. Whether something unknown acts there is left to what transducers account for: in real machines the right effect leaves as
/// much as something unknown does in generated ones.
pub static STAGE_ALONE: Questions = Questions {
    sets: &OF_STAGE_SETS,
    unknown: &[],
    stages: &[],
    kinds: ["without a data sheet", "with a data sheet"],
    begins_with: None,
    shipped: include_str!("../../../params/stage_weights.json"),
};

impl Questions {
    /// Those that a table answers.
    #[must_use]
    pub fn of(table: &EvidenceTable) -> &'static Self {
        if table.stage_alone.is_some() {
            &STAGE_ALONE
        } else if table.assumed_sheet {
            &ASSUMED_SHEET
        } else {
            &CHAIN
        }
    }

    /// The weights that come with the program.
    #[must_use]
    pub fn shipped(&self) -> Weights {
        serde_json::from_str(self.shipped).unwrap_or_else(|_| self.bayes())
    }

    /// The weights before anything is learned on units of this kind.
    #[must_use]
    pub fn beforehand(&self) -> Weights {
        self.begins_with.map_or_else(|| self.bayes(), Self::shipped)
    }

    /// Bayes' theorem with odds of e⁵ against each effect, nothing learned.
    #[must_use]
    pub fn bayes(&self) -> Weights {
        let names = |features: &[PosteriorFeature]| -> Vec<String> {
            let of = |kind: &&str| features.iter().map(|one| format!("{}, {kind}", one.name)).collect::<Vec<_>>();
            self.kinds.iter().flat_map(of).collect()
        };
        Weights {
            sets: unlearned(self.sets),
            unknown: unlearned(self.unknown),
            stages: unlearned(self.stages),
            features: [names(self.sets), names(self.unknown), names(self.stages)],
            size_spread: 0.1,
            explained_fraction_widening: 1.0,
            provenance: serde_json::Value::Null,
        }
    }
}

fn unlearned(features: &[PosteriorFeature]) -> Vec<f64> {
    (0..2).flat_map(|kind| features.iter().map(move |feature| feature.bayes[kind])).collect()
}

/// The learned numbers, with where they come from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Weights {
    /// One for each feature of a set, of each kind.
    pub sets: Vec<f64>,
    /// One for each feature of something unknown.
    pub unknown: Vec<f64>,
    /// One for each feature of a stage.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_without_a_sheet_has_weights_of_its_own_that_begin_with_those_of_a_sheet() {
        let table = |assumed_sheet| EvidenceTable { assumed_sheet, ..EvidenceTable::default() };
        assert!(std::ptr::eq(Questions::of(&table(true)), &raw const ASSUMED_SHEET));
        assert!(std::ptr::eq(Questions::of(&table(false)), &raw const CHAIN));
        assert_eq!(ASSUMED_SHEET.beforehand().sets, CHAIN.shipped().sets);
        assert_eq!(CHAIN.beforehand().sets, CHAIN.bayes().sets);
    }

    #[test]
    fn the_shipped_weights_are_of_these_features() {
        for questions in [&CHAIN, &ASSUMED_SHEET, &STAGE_ALONE] {
            let weights: Weights = serde_json::from_str(questions.shipped).unwrap();
            assert_eq!(weights.features, questions.bayes().features);
            for (weights, features) in [
                (&weights.sets, questions.sets),
                (&weights.unknown, questions.unknown),
                (&weights.stages, questions.stages),
            ] {
                assert_eq!(weights.len(), 2 * features.len());
                assert!(weights.iter().all(|weight| weight.is_finite()));
            }
            assert!(weights.size_spread > 0.0 && weights.explained_fraction_widening > 0.0);
        }
    }
}
