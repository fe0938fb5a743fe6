//! The posterior over fault sets and something unknown: probabilities that follow the evidence of the fitted sets, and cannot contradict it.
//!
//! A set that leaves χ² over n independent samples has the likelihood `∫ s⁻ⁿ exp(−χ²/2s²) ds/s ∝ (χ²)^(−n/2)` where nobody knows the scale s of what
//! is left (Jeffreys's prior; Student's t of all residuals together): what counts is the factor by which a set lowers χ², whatever the noise. What the
//! laws of effects get wrong is left by the right set too, so no set is better for leaving less than that.
//!
//! Whether something else is at work rests on what each set leaves, beside what it explains. It is at work beside a set that explains most of the gap, and
//! instead of one that does not. The numbers that this takes stand in [`super::hyperparameters`]; nothing else is learned. A lower χ² of a set never
//! lowers its probability.

use std::collections::BTreeMap;

use crate::decision::hyperparameters::Hyperparameters;
use crate::evidence::distortion::Distortion;
use crate::hypotheses::table::{EvidenceRow, EvidenceTable, StageEvidence};
use crate::likelihood::noise::log_sum;
use crate::likelihood::problem::SOUND_MEAN_SQUARE;
use govtwin_model::effects::{Stage, find};

/// Share of its probability that something unknown has evenly over all stages, wherever the nearest effects act.
const ANYWHERE: f64 = 0.05;

/// Sets that are searched for distortions, at most, and their least share.
const LEADERS: usize = 2;
const LEAST_LEADER: f64 = 0.05;

/// Numbers over which what a set of a stage alone leaves beyond a right model is spread: errors of equations hold for a movement, not for a sample.
const FREEDOM: f64 = 30.0;

/// What nats of a stage alone count for where no data sheet holds the stage: learned on generated stages (seeds 501 and 503), for the posterior before this one.
const FREE_STAGE: f64 = 0.16;

/// Squares below this are taken for it, pu²: no recording is finer.
const LEAST_SQUARE: f64 = 1e-12;

/// Least χ², as a share of the independent samples: no fit is better than the rounding of its residuals.
const LEAST_COST: f64 = 1e-6;

/// Smaller p-values say no more: no tail is known that far.
const LEAST_P: f64 = 1e-9;

/// Probabilities of the hypotheses of a table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Posterior {
    /// Probability of each fitted set, by its row of the table, whether it is all that is at work or something else as well; the sheet alone is one of them.
    pub sets: Vec<(usize, f64)>,
    /// Probability of something unknown instead of them, by stage.
    pub unknown: Vec<(String, f64)>,
    /// Probability of each set that it is all that is at work, by its row.
    pub complete: Vec<(usize, f64)>,
    /// Probability of something else at work, beside a set or instead of it.
    pub something_else: f64,
}

/// A fault set as the posterior sees it.
struct Weighed {
    /// Its row of the table.
    row: usize,
    /// Its probability if it is known that nothing else is at work.
    share: f64,
    /// Probability that something else is at work as well, or instead.
    unexplained: f64,
    /// Probability that it is at work instead, if it is.
    instead: f64,
}

impl Weighed {
    /// Probability of something unknown instead of the set, if the set is the likeliest known.
    fn unknown(&self) -> f64 {
        self.unexplained * self.instead
    }
}

impl Posterior {
    /// Of a table; sets of struck effects are left out.
    pub fn new(table: &EvidenceTable, numbers: &Hyperparameters, struck: &[&str]) -> Self {
        let all = weighed(table, numbers, struck);
        let unknown: f64 = all.iter().map(|one| one.share * one.unknown()).sum();
        let mut sets: Vec<(usize, f64)> = all.iter().map(|one| (one.row, one.share * (1.0 - one.unknown()))).collect();
        sets.sort_by(|a, b| b.1.total_cmp(&a.1));
        let stages = stages(table, &all);
        Self {
            sets,
            unknown: stages.into_iter().map(|(stage, share)| (stage, share * unknown)).collect(),
            complete: all.iter().map(|one| (one.row, one.share * (1.0 - one.unexplained))).collect(),
            something_else: all.iter().map(|one| one.share * one.unexplained).sum(),
        }
    }

    /// Probability that an effect is present: the sum over the sets that hold it.
    pub fn inclusion(&self, table: &EvidenceTable, id: &str) -> f64 {
        let holds = |row: usize| table.rows[row].effects.iter().any(|effect| effect == id);
        // A sum of nothing is -0, which reports would show.
        self.sets.iter().filter(|(row, _)| holds(*row)).map(|(_, probability)| probability).sum::<f64>() + 0.0
    }

    /// Probability of something unknown at any stage.
    pub fn unknown(&self) -> f64 {
        self.unknown.iter().map(|(_, probability)| probability).sum()
    }

    /// Probability that there is nothing.
    pub fn nothing(&self, table: &EvidenceTable) -> f64 {
        let is_empty = |row: usize| table.rows[row].effects.is_empty();
        self.sets.iter().filter(|(row, _)| is_empty(*row)).map(|(_, probability)| probability).sum()
    }
}

/// The fault sets of a table with their probabilities, without sets of struck effects.
fn weighed(table: &EvidenceTable, numbers: &Hyperparameters, struck: &[&str]) -> Vec<Weighed> {
    let allowed = |row: &EvidenceRow| !row.effects.iter().any(|id| struck.contains(&id.as_str()));
    let empty = table.rows.iter().find(|row| row.effects.is_empty()).map(|row| row.cost);
    let of = |row: &EvidenceRow| Gap::new(table.samples.max(1.0), empty.unwrap_or(row.cost), row);
    let numbered = table.rows.iter().enumerate().filter(|(_, row)| allowed(row));
    let rows: Vec<(usize, &EvidenceRow, Gap)> = numbered.map(|(number, row)| (number, row, of(row))).collect();
    let scores: Vec<f64> = rows.iter().map(|(_, row, gap)| score(table, numbers, row, *gap)).collect();
    let total = log_sum(scores.iter().copied());
    let one = |(&(row, fitted, gap), score): (&(usize, &EvidenceRow, Gap), &f64)| Weighed {
        row,
        share: (score - total).exp(),
        unexplained: unexplained(table, numbers, fitted, gap),
        instead: gap.instead(table.samples.max(1.0), numbers.error_spread),
    };
    rows.iter().zip(&scores).map(one).filter(|one| one.share.is_finite()).collect()
}

/// What a set explains and leaves of the recordings, in χ².
#[derive(Clone, Copy)]
struct Gap {
    /// What the sheet alone leaves and the set does not.
    explained: f64,
    /// What the set leaves.
    left: f64,
}

impl Gap {
    /// Of a set, where nothing but the sheet costs so much.
    fn new(samples: f64, empty: f64, row: &EvidenceRow) -> Self {
        let left = row.cost.max(LEAST_COST * samples);
        Self { explained: if empty.is_finite() { (empty - left).max(0.0) } else { 0.0 }, left }
    }

    /// Probability that something unknown acts instead of the set, where something else is at work: a half where the set explains half of the gap
    /// beyond noise, less where it explains more.
    fn instead(self, samples: f64, spread: f64) -> f64 {
        let beyond = (self.left - SOUND_MEAN_SQUARE * samples).max(0.0);
        if self.explained <= 0.0 { 1.0 } else { 1.0 / (1.0 + (self.explained / beyond).powf(1.0 / spread)) }
    }
}

/// Logarithm of the evidence of a fitted set and of the odds against its effects.
fn score(table: &EvidenceTable, numbers: &Hyperparameters, row: &EvidenceRow, gap: Gap) -> f64 {
    match &table.stage_alone {
        Some(stage) => of_stage_alone(table, stage, row) - numbers.rarity * row.effects.len() as f64,
        None => numbers.score(table.samples.max(1.0), gap.left + gap.explained, gap.left, row.effects.len()),
    }
}

/// Logarithm of the likelihood of a set of a stage alone: its nats, over what the best set leaves beyond a right model. With a data sheet what it
/// misses on pieces left out of its fit counts as well.
///
/// Nothing around a stage holds its equations' errors, which are alike for a whole movement: what fits better proves little where much is left.
fn of_stage_alone(table: &EvidenceTable, stage: &StageEvidence, row: &EvidenceRow) -> f64 {
    let least = table.rows.iter().map(|row| row.cost).fold(f64::INFINITY, f64::min);
    let scale = 1.0 + (least - table.samples.max(1.0)).max(0.0) / FREEDOM;
    let nats = -0.5 * (row.cost - least) / scale;
    if stage.sheet { nats + left_out(table, stage, row) } else { FREE_STAGE * nats }
}

/// Logarithm of the likelihood of what a set of a stage alone misses on pieces left out, a draw each.
fn left_out(table: &EvidenceTable, stage: &StageEvidence, row: &EvidenceRow) -> f64 {
    let most = table.rows.iter().filter_map(|row| row.left_out_square).fold(LEAST_SQUARE, f64::max);
    // What nobody tried on pieces left out is taken for as bad as the worst that was.
    -0.5 * stage.pieces as f64 * row.left_out_square.unwrap_or(most).max(LEAST_SQUARE).ln()
}

/// Probability that something else is at work, beside a set or instead of it, where the set leaves so much.
///
/// What it leaves beyond noise is held against what equations and the laws of its effects get wrong; a sheet that is far off counts as well. A stage
/// alone shows its equations as they are; whether something unknown acts there is left to what transducers account for.
fn unexplained(table: &EvidenceTable, numbers: &Hyperparameters, row: &EvidenceRow, gap: Gap) -> f64 {
    if table.stage_alone.is_some() {
        return 0.0;
    }
    let samples = table.samples.max(1.0);
    let wrong = numbers.equation_error + numbers.law_error * gap.explained / samples;
    let left = (gap.left / samples - SOUND_MEAN_SQUARE) / wrong;
    // A sheet is stretched by whatever its parameters have to stand in for.
    let stretched = (row.prior_per_parameter - 1.0) / numbers.sheet_error;
    let by_size = left.max(stretched).max(0.0).powf(1.0 / numbers.error_spread);
    // What stands out somewhere needs no size: something rare may be at work, as rare as a further effect.
    let by_place = rare_distortion(table, row).map_or(1.0, distortion_odds);
    let odds = by_size + (by_size + (-numbers.rarity).exp()) * (by_place - 1.0);
    if odds.is_finite() { odds / (1.0 + odds) } else { 1.0 }
}

/// The distortion that a set is held against, where it is rare: the sheet alone against what it leaves, sets of effects against the least that any of them
/// leaves of those that were looked at, so that their order stays.
fn rare_distortion<'a>(table: &'a EvidenceTable, row: &EvidenceRow) -> Option<&'a Distortion> {
    let alike = table.rows.iter().filter(|other| other.effects.is_empty() == row.effects.is_empty());
    let least = alike.filter_map(|other| other.distortion.as_ref()).max_by(|a, b| a.p_value.total_cmp(&b.p_value));
    least.filter(|distortion| distortion.p_value < (-1.0_f64).exp())
}

/// By how much a distortion speaks for something else, as odds: `1 / (−e p ln p)` is the most that a p-value can say (Sellke, Bayarri & Berger 2001,
/// *The American Statistician* 55(1), equation 2).
fn distortion_odds(distortion: &Distortion) -> f64 {
    let p = distortion.p_value.max(LEAST_P);
    -1.0 / (std::f64::consts::E * p * p.ln())
}

/// Where something unknown acts, if it does: where the known effects act that come nearest to it.
fn stages(table: &EvidenceTable, sets: &[Weighed]) -> Vec<(String, f64)> {
    let mut near: BTreeMap<&str, f64> = BTreeMap::new();
    for one in sets {
        let effects = &table.rows[one.row].effects;
        for spec in effects.iter().filter_map(|id| find(id)) {
            *near.entry(spec.stage.id()).or_default() += one.share / effects.len() as f64;
        }
    }
    let all = near.values().sum::<f64>().max(f64::MIN_POSITIVE);
    let evenly = ANYWHERE / Stage::ALL.len() as f64;
    let weight = |stage: Stage| evenly + (1.0 - ANYWHERE) * near.get(stage.id()).map_or(0.0, |near| near / all);
    let total: f64 = Stage::ALL.into_iter().map(weight).sum();
    Stage::ALL.into_iter().map(|stage| (stage.id().to_owned(), weight(stage) / total)).collect()
}

/// Rows of the likeliest fault sets, whatever else is at work, likeliest first: those whose distortions are worth a look.
pub fn leaders(table: &EvidenceTable, numbers: &Hyperparameters) -> Vec<usize> {
    let mut all = weighed(table, numbers, &[]);
    all.retain(|one| one.share > LEAST_LEADER && !table.rows[one.row].effects.is_empty());
    all.sort_by(|a, b| b.share.total_cmp(&a.share));
    all.into_iter().take(LEADERS).map(|one| one.row).collect()
}

/// Row of the set that leads by the evidence and the odds against its effects, whatever else is at work; none of an empty table.
pub fn likeliest(table: &EvidenceTable, numbers: &Hyperparameters) -> Option<usize> {
    weighed(table, numbers, &[]).into_iter().max_by(|a, b| a.share.total_cmp(&b.share)).map(|one| one.row)
}

/// What nats of evidence count for between two sets near the best one: the slope of the score along χ², which the scale of the noise divides.
#[derive(Clone, Copy, Debug)]
pub struct CountedNats {
    each: f64,
}

impl CountedNats {
    /// Those of a unit's table.
    pub fn new(table: &EvidenceTable, numbers: &Hyperparameters) -> Self {
        let samples = table.samples.max(1.0);
        let best = table.rows.iter().map(|row| row.cost).fold(f64::INFINITY, f64::min);
        let each = if best.is_finite() { numbers.tempering * samples / best.max(samples) } else { numbers.tempering };
        Self { each: each.min(1.0) }
    }

    /// Each nat as one.
    pub const FULL: Self = Self { each: 1.0 };

    /// By what nats are divided.
    pub fn scale(self) -> f64 {
        1.0 / self.each
    }

    /// What so many nats count for: nothing at least.
    pub fn of(self, nats: f64) -> f64 {
        self.each * nats.max(0.0)
    }
}

#[cfg(test)]
mod tests;
