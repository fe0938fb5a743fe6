//! The evidence table: what the recordings say of every fault set that was fitted, in numbers that a posterior needs and a report keeps.

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};
use serde::{Deserialize, Serialize};

use crate::evidence::distortion::Distortion;
use crate::hypotheses::Explored;
use crate::hypotheses::explorer::Hypothesis;
use crate::likelihood::problem::Problem;
use govtwin_model::effects::EffectSpec;
use govtwin_model::stored::{all_unbounded, unbounded};

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
    /// The cost that all recordings but each have, with the free parameters following; none of an older program.
    #[serde(default, deserialize_with = "all_unbounded")]
    pub cost_without_each: Vec<f64>,
    /// Size of each effect, in typical ones.
    pub sizes: Vec<f64>,
    /// The strongest distortion that it leaves; none where nobody looked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<Distortion>,
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
    /// The same of each recording; none of an older program.
    #[serde(default)]
    pub samples_of_each: Vec<f64>,
    /// Whether the sheet was made of the recordings themselves.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub assumed_sheet: bool,
    /// Whether pilot signals were recorded.
    pub pilot: bool,
    /// Fitted fault sets, likeliest first.
    pub rows: Vec<EvidenceRow>,
    /// Of a servomotor stage alone, how it was judged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stage_alone: Option<StageEvidence>,
}

impl EvidenceTable {
    /// The same as one recording less would have it.
    #[must_use]
    pub fn without(&self, recording: usize) -> Self {
        let mut table = self.clone();
        table.samples -= self.samples_of_each.get(recording).copied().unwrap_or(0.0);
        for row in &mut table.rows {
            if let Some(&cost) = row.cost_without_each.get(recording) {
                row.cost = cost;
            }
        }
        table
    }

    /// Looks for distortions in what these rows leave, where they were kept, and in what the sheet alone leaves.
    pub fn look_for_distortions(&mut self, problem: &Problem, explored: &Explored, rows: &[usize]) {
        if self.stage_alone.is_some() {
            return;
        }
        let shared = explored.shared(problem);
        for (k, (row, hypothesis)) in self.rows.iter_mut().zip(&explored.hypotheses).enumerate() {
            let is_asked = rows.contains(&k) || hypothesis.effects.is_empty();
            if !is_asked || hypothesis.model.fit.slopes.is_empty() {
                continue;
            }
            row.distortion = shared.distortion(problem, &hypothesis.model);
        }
    }

    /// The table of what was explored.
    pub fn new(problem: &Problem, explored: &Explored, catalogue: &[&'static EffectSpec]) -> Self {
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
                cost_without_each: hypothesis.model.normal.cost_without_each(),
                sizes: sizes.collect(),
                distortion: None,
                left_out_square: None,
            }
        };
        let samples = problem.independent_samples();
        let pilot = govtwin_model::signal::Signal::PilotValvePosition;
        Self {
            samples,
            samples_of_each: (0..problem.recordings.len()).map(|one| problem.only(one).independent_samples()).collect(),
            assumed_sheet: false,
            pilot: problem.recordings.iter().any(|recording| recording.has[pilot as usize]),
            rows: explored.hypotheses.par_iter().map(row).collect(),
            stage_alone: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::EvidenceRow;

    /// JSON has no infinity.
    #[test]
    fn a_set_that_could_not_be_simulated_is_read_back() {
        let row =
            EvidenceRow { cost: f64::INFINITY, cost_without_each: vec![f64::INFINITY, 3.0], ..EvidenceRow::default() };
        let text = serde_json::to_string(&row).unwrap();
        assert_eq!(serde_json::from_str::<EvidenceRow>(&text).unwrap(), row, "{text}");
    }
}
