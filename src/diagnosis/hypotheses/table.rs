//! The evidence table: what the recordings say of every fault set that was fitted, in numbers that a posterior needs and a report keeps.

use std::collections::BTreeMap;

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use serde::{Deserialize, Serialize};

use crate::evidence::KAPPAS;
use crate::evidence::law_error::LAW_ERRORS;
use crate::evidence::parts::{PartFit, parts};
use crate::hypotheses::Explored;
use crate::hypotheses::explorer::{Hypothesis, is_stage_alone};
use crate::likelihood::noise::log_sum;
use crate::likelihood::problem::Problem;
use govtwin_model::effects::{EffectSpec, Stage};
use govtwin_model::stored::{evidence, evidence_grid, unbounded};

/// What the recordings say of one fault set.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EvidenceRow {
    /// Ids of its effects, in the order of the catalogue; none for the sheet alone.
    pub effects: Vec<String>,
    /// Whether it was fitted with care.
    pub refined: bool,
    /// Cost of the fit: squares of residuals and priors; infinite where the set could not be simulated.
    #[serde(deserialize_with = "unbounded")]
    pub cost: f64,
    /// Squares of the priors in it, in tolerances.
    pub prior: f64,
    /// Prior χ² per parameter that the recordings determine.
    #[serde(rename = "strain")]
    pub prior_per_parameter: f64,
    /// Logarithm of the evidence at each size of the error of equations ([`KAPPAS`]) and of laws (`LAW_ERRORS`).
    #[serde(deserialize_with = "evidence_grid")]
    pub grid: [[f64; LAW_ERRORS.len()]; KAPPAS.len()],
    /// Logarithm of the evidence without each recording.
    #[serde(deserialize_with = "evidence")]
    pub without_each: Vec<f64>,
    /// Size of each effect, in typical ones.
    pub sizes: Vec<f64>,
    /// Of a stage alone: mean square of what it misses on pieces left out, geometric mean of the pieces, pu²; none where that was not asked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out_square: Option<f64>,
}

/// How a servomotor stage alone was judged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct StageEvidence {
    /// Whether a data sheet was believed.
    pub sheet: bool,
    /// Pieces, each left out in turn.
    pub pieces: usize,
}

/// All of a unit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EvidenceTable {
    /// Independent samples, all signals together.
    pub samples: f64,
    /// How slow the rates are: 0 at 100 Hz, 1 at 5 Hz, a mean over independent samples.
    pub slow_share: f64,
    /// Whether the sheet was made of the recordings themselves.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub assumed_sheet: bool,
    /// Whether pilot signals were recorded.
    pub pilot: bool,
    /// Fitted fault sets, likeliest first.
    pub rows: Vec<EvidenceRow>,
    /// Logarithm of the evidence of something unknown at each stage, on the sheet alone.
    pub unknown: BTreeMap<String, f64>,
    /// Parts of the chain on their own, where recordings show them.
    #[serde(default)]
    pub parts: Vec<PartFit>,
    /// Of a servomotor stage alone, how it was judged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage_alone: Option<StageEvidence>,
}

impl EvidenceRow {
    /// Logarithm of the evidence, whatever the size of the error of equations; of a set that was fitted quickly with the usual one, since what it
    /// lacks of a fit would pass for such an error.
    #[must_use]
    pub fn evidence(&self) -> f64 {
        let all = self.grid.iter().flatten();
        if self.refined {
            log_sum(all.copied()) - ((KAPPAS.len() * LAW_ERRORS.len()) as f64).ln()
        } else {
            self.grid[1][1]
        }
    }
}

impl EvidenceTable {
    /// The same as one recording less would have it; errors of equations are then counted with their usual size.
    #[must_use]
    pub fn without(&self, recording: usize) -> Self {
        let mut table = self.clone();
        let empty =
            |table: &Self| table.rows.iter().find(|row| row.effects.is_empty()).map_or(0.0, EvidenceRow::evidence);
        let before = empty(self);
        for row in &mut table.rows {
            if let Some(&evidence) = row.without_each.get(recording) {
                row.grid = [[evidence; LAW_ERRORS.len()]; KAPPAS.len()];
            }
        }
        let moved = empty(&table) - before;
        table.unknown.values_mut().for_each(|evidence| *evidence += moved);
        table
    }

    /// The table of what was explored.
    #[must_use]
    pub fn new(problem: &Problem, explored: &Explored, catalogue: &[&'static EffectSpec]) -> Self {
        // Of a stage alone the discrepancy terms know too much; nothing unknown is weighed there.
        let alone = is_stage_alone(problem);
        let grid = |hypothesis: &Hypothesis| {
            let exact = || [[hypothesis.normal.at(KAPPAS[0], LAW_ERRORS[0]); LAW_ERRORS.len()]; KAPPAS.len()];
            if alone { exact() } else { hypothesis.normal.grid() }
        };
        let row = |hypothesis: &Hypothesis| {
            let model = &hypothesis.model;
            let first =
                model.free_parameters.len() - model.effects.iter().map(|spec| spec.parameters.len()).sum::<usize>();
            let mut place = first;
            let sizes = model.effects.iter().map(|spec| {
                place += spec.parameters.len();
                model.fit.positions[place - spec.parameters.len()]
            });
            EvidenceRow {
                effects: hypothesis.effects.iter().map(|&effect| catalogue[effect].id.to_owned()).collect(),
                refined: hypothesis.refined,
                cost: model.fit.cost(),
                prior: model.fit.prior,
                prior_per_parameter: model.prior_per_parameter(),
                grid: grid(hypothesis),
                without_each: hypothesis.normal.without_each(),
                sizes: sizes.collect(),
                left_out_square: None,
            }
        };
        let unknown = |hypothesis: Option<&Hypothesis>| {
            let hypothesis = hypothesis.filter(|_| !alone);
            let of = |stage: Stage| Some((stage.id().to_owned(), hypothesis?.normal.unknown_at(stage)));
            Stage::ALL.into_iter().filter_map(of).filter(|(_, evidence)| evidence.is_finite()).collect()
        };
        let samples = problem.independent_samples();
        let slow: f64 = (0..problem.recordings.len())
            .map(|recording| (recording, slowness(problem.recordings[recording].period_s)))
            .filter(|(_, slowness)| *slowness > 0.0)
            .map(|(recording, slowness)| slowness * problem.only(recording).independent_samples())
            .sum();
        let pilot = govtwin_model::signal::Signal::PilotValvePosition;
        Self {
            samples,
            slow_share: slow / samples.max(1e-9),
            assumed_sheet: false,
            pilot: problem.recordings.iter().any(|recording| recording.has[pilot as usize]),
            rows: explored.hypotheses.par_iter().map(row).collect(),
            unknown: unknown(explored.hypotheses.iter().find(|one| one.effects.is_empty())),
            parts: if alone { Vec::new() } else { parts(problem, explored.refitted()) },
            stage_alone: None,
        }
    }
}

/// Periods at which the weights of fast and of slow rates were learned, s.
const LEARNED_AT_S: [f64; 2] = [0.01, 0.2];

/// How slow a rate is: 0 and 1 at the rates at which weights were learned, in between by the logarithm of the period.
fn slowness(period_s: f64) -> f64 {
    let [fast_s, slow_s] = LEARNED_AT_S;
    ((period_s / fast_s).ln() / (slow_s / fast_s).ln()).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::{EvidenceRow, slowness};
    use crate::evidence::KAPPAS;
    use crate::evidence::law_error::LAW_ERRORS;

    /// JSON has no infinity.
    #[test]
    fn a_set_that_could_not_be_simulated_is_read_back() {
        let row = EvidenceRow {
            cost: f64::INFINITY,
            grid: [[f64::NEG_INFINITY; LAW_ERRORS.len()]; KAPPAS.len()],
            without_each: vec![f64::NEG_INFINITY, -3.0],
            ..EvidenceRow::default()
        };
        let text = serde_json::to_string(&row).unwrap();
        assert_eq!(serde_json::from_str::<EvidenceRow>(&text).unwrap(), row, "{text}");
    }

    #[test]
    fn a_rate_in_between_is_in_between() {
        let at = [0.001, 0.01, 0.02, 0.05, 0.1, 0.2, 1.0].map(slowness);
        assert_eq!([at[0], at[1], at[5], at[6]], [0.0, 0.0, 1.0, 1.0]);
        assert!((at[2] - 0.231).abs() < 1e-3 && (at[3] - 0.537).abs() < 1e-3 && (at[4] - 0.769).abs() < 1e-3, "{at:?}");
    }
}
