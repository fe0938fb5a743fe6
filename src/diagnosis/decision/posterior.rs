//! The posterior over fault sets: evidence, prior odds and a few learned weights make probabilities that sum to 1.
//!
//! Three questions, each with learned weights. Is something unknown at work: does the best fault set leave more than a right model would (a logistic
//! regression)? If not, which set (a conditional logit over the evidence of all fitted sets, the sheet alone among them; McFadden 1974)? If so, at which
//! stage (a conditional logit over the evidence of discrepancy terms there)? The weights and what they multiply stand in [`super::weights`].

use std::collections::BTreeMap;

use crate::decision::features::{FARTHEST, FREEDOM, ODDS, by_kind, oddness, score, shares, softmax};
use crate::decision::stage_alone;
use crate::decision::weights::{OF_STAGES, Questions, Weights};
use crate::evidence::parts::PartFit;
use crate::hypotheses::table::{EvidenceRow, EvidenceTable};
use crate::likelihood::problem::SOUND_MEAN_SQUARE;
use govtwin_model::effects::{Stage, find};

/// Spread of the logarithm of χ² between sound units beyond what their number of samples brings: 0.07 of 19 generated ones at 100 Hz.
const SCATTER: f64 = 0.1;

/// Share that counts for a stage without any known effect.
const LEAST_SHARE: f64 = 0.03;

/// The hypotheses of a table with their features.
#[derive(Clone, Debug)]
pub struct Hypotheses {
    /// Fault sets by their row of the table.
    pub sets: Vec<(usize, Vec<f64>)>,
    /// Probability of each of them if nothing is unknown.
    of_sets: Vec<f64>,
    /// Something unknown, against all sets together.
    pub unknown: Vec<f64>,
    /// Stages by id, where something unknown may be; none where nothing unknown is weighed.
    pub stages: Vec<(String, Vec<f64>)>,
    /// By what nats are divided for what the best set leaves beyond a right model.
    pub scale: f64,
}

impl Hypotheses {
    /// Those of a table, without sets of struck effects; none of an empty table. How probable sets are if nothing is unknown is by these weights of sets.
    #[must_use]
    pub fn new(table: &EvidenceTable, struck: &[&str], set_weights: &[f64]) -> Option<Self> {
        if let Some(stage) = &table.stage_alone {
            let (sets, of_sets, scale) = stage_alone::sets(table, stage, struck, set_weights)?;
            // Whether something unknown acts is left to what transducers account for.
            return Some(Self { sets, of_sets, unknown: Vec::new(), stages: Vec::new(), scale });
        }
        let allowed = |row: &&EvidenceRow| !row.effects.iter().any(|id| struck.contains(&id.as_str()));
        let rows: Vec<(usize, &EvidenceRow)> = table.rows.iter().enumerate().filter(|(_, row)| allowed(row)).collect();
        let odds = |row: &EvidenceRow| row.evidence() - ODDS * row.effects.len() as f64;
        let leader = rows.iter().map(|(_, row)| *row).max_by(|a, b| odds(a).total_cmp(&odds(b)))?;
        let top = rows.iter().map(|(_, row)| row.evidence()).fold(f64::NEG_INFINITY, f64::max);
        let by_rate = |features: &[f64]| by_kind(table, features);
        let expected = (SOUND_MEAN_SQUARE * table.samples).max(1.0);
        let scale = 1.0 + (leader.cost - expected).max(0.0) / FREEDOM;
        let set = |&(k, row): &(usize, &EvidenceRow)| {
            let lost = (top - row.evidence()).min(FARTHEST) / scale;
            let features = by_rate(&[
                lost,
                lost.ln_1p(),
                row.effects.len() as f64,
                f64::from(u8::from(row.effects.is_empty())),
                row.prior_per_parameter.min(20.0),
                oddness(row),
            ]);
            (k, features)
        };
        let sets: Vec<(usize, Vec<f64>)> = rows.iter().map(set).collect();
        let probabilities = softmax(sets.iter().map(|(_, features)| score(features, set_weights)).collect());
        let scatter = (SCATTER.powi(2) + 2.0 / table.samples.max(1.0)).sqrt();
        let deviations = |row: &EvidenceRow| (row.cost / expected).max(1e-3).ln() / scatter;
        let is_nothing = |((_, row), _): &(&(usize, &EvidenceRow), &f64)| row.effects.is_empty();
        let nothing: f64 = rows
            .iter()
            .zip(&probabilities)
            .filter(is_nothing)
            .map(|((_, row), probability)| probability * deviations(row).clamp(0.0, 20.0))
            .sum();
        let gained = (table.unknown.values().copied().fold(f64::NEG_INFINITY, f64::max) - top).max(-FARTHEST);
        let unknown = by_rate(&[
            1.0,
            deviations(leader).asinh(),
            nothing,
            leader.prior_per_parameter.min(20.0),
            oddness(leader),
            leader.effects.len() as f64,
            signed_log(gained / (leader.cost / expected).max(1.0)),
        ]);
        // What comes nearest to something unknown mostly acts at its stage.
        let mut known: BTreeMap<&str, f64> = BTreeMap::new();
        for ((_, row), probability) in rows.iter().zip(&probabilities) {
            for spec in row.effects.iter().filter_map(|id| find(id)) {
                *known.entry(spec.stage.id()).or_default() += probability / row.effects.len() as f64;
            }
        }
        let all = known.values().sum::<f64>().max(f64::MIN_POSITIVE);
        let worst = table.parts.iter().map(PartFit::excess).fold(1.0, f64::max);
        let stage = |id: &String| {
            let share = known.get(id.as_str()).map_or(0.0, |known| known / all);
            let gained: f64 = table.parts.iter().map(|part| part.gained_at(id)).sum();
            let mut features = [0.0; OF_STAGES.len()];
            features[0] = (share + LEAST_SHARE).ln();
            if let Some(place) = Stage::ALL.iter().position(|stage| stage.id() == id) {
                features[1 + place] = signed_log(gained / worst);
            }
            (id.clone(), by_rate(&features))
        };
        let stages = table.unknown.keys().map(stage).collect();
        Some(Self { unknown, stages, sets, of_sets: probabilities, scale })
    }
}

/// What nats of evidence count for between two sets: in the logarithm of their odds, by the first two features of a set.
#[derive(Clone, Copy, Debug)]
pub struct CountedNats {
    scale: f64,
    scaled: f64,
    logarithm: f64,
}

impl CountedNats {
    /// Those of a unit's table by these weights.
    #[must_use]
    pub fn new(table: &EvidenceTable, weights: &Weights) -> Self {
        let scale = Hypotheses::new(table, &[], &weights.sets).map_or(1.0, |all| all.scale);
        let [first, second] = shares(table);
        let count = Questions::of(table).sets.len();
        let of = |feature: usize| -(first * weights.sets[feature] + second * weights.sets[feature + count]);
        Self { scale, scaled: of(0), logarithm: of(1) }
    }

    /// Each nat as one.
    pub const FULL: Self = Self { scale: 1.0, scaled: 1.0, logarithm: 0.0 };

    /// By what nats are divided for what the best set leaves beyond a right model.
    #[must_use]
    pub fn scale(self) -> f64 {
        self.scale
    }

    /// What so many nats count for: nothing at least, and no more than they are.
    #[must_use]
    pub fn of(self, nats: f64) -> f64 {
        let scaled = nats.max(0.0) / self.scale;
        (self.scaled * scaled + self.logarithm * scaled.ln_1p()).clamp(0.0, nats.max(0.0))
    }
}

/// Logarithm of 1 and the size, with the sign.
fn signed_log(value: f64) -> f64 {
    value.abs().ln_1p().copysign(value)
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
    /// By these weights; sets of struck effects are left out.
    #[must_use]
    pub fn new(table: &EvidenceTable, weights: &Weights, struck: &[&str]) -> Self {
        let Some(all) = Hypotheses::new(table, struck, &weights.sets) else {
            return Self { sets: Vec::new(), unknown: Vec::new() };
        };
        let unknown = if all.stages.is_empty() { 0.0 } else { logistic(score(&all.unknown, &weights.unknown)) };
        let of_stages = softmax(all.stages.iter().map(|(_, of)| score(of, &weights.stages)).collect());
        let rows = all.sets.iter().map(|(row, _)| *row);
        let mut sets: Vec<(usize, f64)> = rows.zip(all.of_sets.iter().map(|share| (1.0 - unknown) * share)).collect();
        sets.sort_by(|a, b| b.1.total_cmp(&a.1));
        Self {
            sets,
            unknown: all.stages.into_iter().zip(of_stages).map(|((id, _), share)| (id, unknown * share)).collect(),
        }
    }

    /// Probability that an effect is present: the sum over the sets that hold it.
    #[must_use]
    pub fn inclusion(&self, table: &EvidenceTable, id: &str) -> f64 {
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
    pub fn nothing(&self, table: &EvidenceTable) -> f64 {
        self.sets
            .iter()
            .filter(|(row, _)| table.rows[*row].effects.is_empty())
            .map(|(_, probability)| probability)
            .sum()
    }
}

/// Probability with these log odds.
fn logistic(log_odds: f64) -> f64 {
    1.0 / (1.0 + (-log_odds).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decision::weights::{CHAIN, STAGE_ALONE};
    use crate::evidence::parts::Part;
    use crate::hypotheses::table::StageEvidence;

    fn row(effects: &[&str], evidence: f64, cost: f64) -> EvidenceRow {
        EvidenceRow {
            effects: effects.iter().map(|id| (*id).to_owned()).collect(),
            refined: true,
            cost,
            grid: [[evidence; 3]; 4],
            sizes: vec![1.1; effects.len()],
            ..EvidenceRow::default()
        }
    }

    /// Where every set leaves far more than a right model would and the best one hardly less than nothing does, it is not said that there is nothing.
    #[test]
    fn nothing_that_leaves_much_is_something_unknown() {
        let of = |cost: f64| {
            let rows = vec![row(&["feedback_lag"], -0.5 * cost + 20.0, cost - 45.0), row(&[], -0.5 * cost, cost)];
            let unknown = [("spool".to_owned(), -0.5 * cost - 30.0)].into();
            Posterior::new(
                &EvidenceTable { samples: 1e3, rows, unknown, ..EvidenceTable::default() },
                &CHAIN.shipped(),
                &[],
            )
        };
        assert!(of(4600.0).unknown() > 0.9, "{}", of(4600.0).unknown());
        assert!(of(900.0).unknown() < 0.1, "{}", of(900.0).unknown());
    }

    /// With nothing learned the odds of two sets are those of Bayes' theorem.
    #[test]
    fn evidence_alone_gives_the_odds_of_bayes() {
        let rows = vec![
            row(&["backlash", "load"], 0.0, 600.0),
            row(&["backlash"], -2.0, 604.0),
            row(&["load"], -3.0, 606.0),
            row(&[], -8.0, 616.0),
        ];
        let table = EvidenceTable { samples: 1e3, rows, ..EvidenceTable::default() };
        let posterior = Posterior::new(&table, &CHAIN.bayes(), &[]);
        let p = |row: usize| posterior.sets.iter().find(|(k, _)| *k == row).unwrap().1;
        for (a, b, nats) in [(0, 1, 2.0 - 5.0), (1, 2, 1.0), (1, 3, 6.0 - 5.0)] {
            assert!(((p(a) / p(b)).ln() - nats).abs() < 1e-9, "{a} {b}: {}", (p(a) / p(b)).ln());
        }
        let sum: f64 = posterior.sets.iter().map(|(_, p)| p).sum();
        assert!((sum - 1.0).abs() < 1e-12 && (posterior.inclusion(&table, "load") - p(0) - p(2)).abs() < 1e-12);
        assert_eq!(Posterior::new(&table, &CHAIN.bayes(), &["load"]).sets.len(), 2);
    }

    /// Where the best set leaves much, the errors of its equations are correlated: nats count for less, and the first for most.
    #[test]
    fn nats_count_for_less_where_much_is_left() {
        let table = |cost: f64| EvidenceTable {
            samples: 1e3,
            rows: vec![row(&["load"], -0.5 * cost, cost)],
            ..EvidenceTable::default()
        };
        let counted = |cost: f64, nats: f64| CountedNats::new(&table(cost), &CHAIN.shipped()).of(nats);
        assert!(counted(920.0, 10.0) > counted(4000.0, 10.0) && counted(4000.0, 10.0) > 0.0);
        assert!(counted(920.0, 20.0) < 2.0 * counted(920.0, 10.0) && counted(920.0, 20.0) > counted(920.0, 10.0));
        assert!((CountedNats::new(&table(900.0), &CHAIN.bayes()).of(7.0) - 7.0).abs() < 1e-12);
    }

    /// What the best set leaves speaks for something unknown, and its stage is where discrepancy terms explain most of a part on its own.
    #[test]
    fn what_is_left_is_something_unknown() {
        let of = |left: f64| {
            let rows = vec![row(&["load"], -200.0 - left, 640.0 + 2.0 * left), row(&[], -800.0, 1840.0)];
            let unknown: BTreeMap<String, f64> = [("spool".to_owned(), -500.0), ("esv".to_owned(), -490.0)].into();
            let part = |part: Part, gained: f64| PartFit {
                part,
                cost: 920.0,
                samples: 1e3,
                evidence: -500.0,
                unknown: [("spool".to_owned(), -500.0 + gained), ("esv".to_owned(), -501.0)].into(),
            };
            let parts = vec![part(Part::Controls, 400.0), part(Part::Servomotor, 0.0)];
            Posterior::new(
                &EvidenceTable { samples: 1e3, rows, unknown, parts, ..EvidenceTable::default() },
                &CHAIN.bayes(),
                &[],
            )
        };
        let (right, wrong) = (of(0.0), of(400.0));
        assert!(right.unknown() < 0.1 && wrong.unknown() > 0.9, "{} {}", right.unknown(), wrong.unknown());
        let spool = wrong.unknown.iter().find(|(id, _)| id == "spool").unwrap().1;
        assert!(spool > 0.9 * wrong.unknown(), "{spool} of {}", wrong.unknown());
        let sum: f64 = wrong.sets.iter().map(|(_, p)| p).sum::<f64>() + wrong.unknown();
        assert!((sum - 1.0).abs() < 1e-12);
    }

    /// Of a stage alone what fits better and predicts worse what was left out of the fit is not the likelier.
    #[test]
    fn pieces_left_out_count() {
        let of = |square: f64| {
            let left_out = |square, row| EvidenceRow { left_out_square: Some(square), ..row };
            let rows = vec![left_out(square, row(&["load"], 0.0, 100.0)), left_out(1e-6, row(&[], -9.0, 100.0))];
            let stage_alone = Some(StageEvidence { sheet: false, pieces: 6 });
            let table = EvidenceTable { samples: 100.0, rows, stage_alone, ..EvidenceTable::default() };
            let posterior = Posterior::new(&table, &STAGE_ALONE.bayes(), &[]);
            let sum: f64 = posterior.sets.iter().map(|(_, p)| p).sum::<f64>() + posterior.unknown();
            assert!((sum - 1.0).abs() < 1e-12);
            posterior.nothing(&table) / posterior.inclusion(&table, "load")
        };
        assert!(of(1e-6) < 0.1 && of(2e-5) > 10.0 * of(1e-6), "{} {}", of(1e-6), of(2e-5));
    }
}
