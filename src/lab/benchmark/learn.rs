//! Learning the weights of the posterior: by log score, on units whose faults are known.
//!
//! The log score of a unit is the logarithm of the probability that was given to what is truly in it: the very set of faults, nothing, or something
//! unknown where the catalogue lacks it. It is proper (Gneiting & Raftery 2007): only honest probabilities do best. It is the sum of what its three
//! questions score, so that each is learned by itself: is it unknown, which set, at which stage. A listed effect struck from the table is a unit
//! outside the catalogue that costs no simulation.

use nalgebra::{DMatrix, DVector};

use crate::battery::Label;
use crate::benchmark::statistics::weight_of_sound;
use govtwin_diagnosis::decision::features::score;
use govtwin_diagnosis::decision::posterior::{Hypotheses, Posterior};
use govtwin_diagnosis::decision::weights::{Questions, Weights};
use govtwin_diagnosis::hypotheses::table::{EvidenceRow, EvidenceTable};
use govtwin_diagnosis::result::Interval;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_model::effects::find;
use govtwin_model::units::NORMAL_90;

/// Weight of a unit with an effect struck beside one as it is.
const STRUCK: f64 = 0.3;

/// Precision of the weights beforehand, about what they are with nothing learned. Of 1, 3, 10 and 30 this scores best on units not seen.
const RIDGE: f64 = 1.0;

/// Gain in evidence from which a struck effect leaves a gap.
const VISIBLE: f64 = 15.0;

/// Least probability that is given to anything: what was not fitted, or nearly excluded.
const LEAST: f64 = 1e-3;

/// A unit to learn from.
#[derive(Clone, Debug)]
pub struct Example {
    table: EvidenceTable,
    truth: TrueAnswer,
    struck: Vec<String>,
    weight: f64,
}

/// What is truly in a unit, as a hypothesis.
#[derive(Clone, Debug, PartialEq)]
enum TrueAnswer {
    Effects(Vec<String>),
    Unknown(Vec<String>),
}

/// The examples that a unit makes: as it is, and each single effect struck from it in turn.
#[must_use]
pub fn examples(label: &Label, table: &EvidenceTable) -> Vec<Example> {
    let mut ids: Vec<String> = label.effects.iter().map(|truth| truth.id.clone()).collect();
    let stages = || label.effects.iter().map(|truth| truth.stage.id().to_owned()).collect::<Vec<_>>();
    let as_is = |truth| Example { table: table.clone(), truth, struck: Vec::new(), weight: 1.0 };
    if !label.listed {
        return vec![as_is(TrueAnswer::Unknown(stages()))];
    }
    let mut all = Vec::new();
    let best = |with: bool| {
        let rows = table.rows.iter().filter(|row| ids.iter().all(|id| row.effects.contains(id)) == with);
        rows.map(EvidenceRow::evidence).fold(f64::NEG_INFINITY, f64::max)
    };
    let empty = table.rows.iter().find(|row| row.effects.is_empty()).map_or(0.0, EvidenceRow::evidence);
    if ids.len() == 1 && best(true) - empty > VISIBLE {
        all.push(Example {
            table: table.clone(),
            truth: TrueAnswer::Unknown(stages()),
            struck: ids.clone(),
            weight: STRUCK,
        });
    }
    ids.sort();
    all.push(as_is(TrueAnswer::Effects(ids)));
    all
}

impl Example {
    fn hypotheses(&self, set_weights: &[f64]) -> Option<Hypotheses> {
        let struck: Vec<&str> = self.struck.iter().map(String::as_str).collect();
        Hypotheses::new(&self.table, &struck, set_weights)
    }

    /// Whether a fault set, by its row of the table, is what is in the unit.
    fn is_truth(&self, row: usize) -> bool {
        let TrueAnswer::Effects(ids) = &self.truth else { return false };
        let mut effects = self.table.rows[row].effects.clone();
        effects.sort();
        effects == *ids
    }

    fn is_sound(&self) -> bool {
        self.truth == TrueAnswer::Effects(Vec::new())
    }
}

/// One question that was asked of a unit: the features of every answer, and which are right.
struct Answered {
    answers: Vec<Vec<f64>>,
    right: Vec<bool>,
    weight: f64,
}

impl Answered {
    /// Log probability of the right answers, its gradient, and the information matrix; none where no answer is right.
    fn of(&self, weights: &[f64]) -> Option<(f64, DVector<f64>, DMatrix<f64>)> {
        if !self.right.contains(&true) {
            return None;
        }
        let count = weights.len();
        let scores: Vec<f64> = self.answers.iter().map(|features| score(features, weights)).collect();
        let most = scores.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (mut all, mut some) = (0.0, 0.0);
        let (mut mean, mut inside) = (DVector::<f64>::zeros(count), DVector::<f64>::zeros(count));
        let mut square = DMatrix::<f64>::zeros(count, count);
        for ((features, score), right) in self.answers.iter().zip(scores).zip(&self.right) {
            let p = (score - most).exp();
            let features = DVector::from_column_slice(features);
            all += p;
            mean.axpy(p, &features, 1.0);
            square.ger(p, &features, &features, 1.0);
            if *right {
                some += p;
                inside.axpy(p, &features, 1.0);
            }
        }
        mean /= all;
        square /= all;
        square -= &mean * mean.transpose();
        let probability = (some / all).max(1e-300);
        inside /= some.max(1e-300);
        Some((probability.ln(), inside - mean, square))
    }
}

/// What examples answer to one question; `ask` sees an example's hypotheses, by these weights of sets.
fn choices(
    examples: &[Example],
    set_weights: &[f64],
    ask: impl Fn(&Example, Hypotheses) -> Option<Answered>,
) -> Vec<Answered> {
    let more = sound_weight(examples);
    let one = |example: &Example| {
        let choice = ask(example, example.hypotheses(set_weights)?)?;
        Some(Answered { weight: example.weight * if example.is_sound() { more } else { 1.0 }, ..choice })
    };
    examples.iter().filter_map(one).collect()
}

/// Which set is it, where nothing is unknown?
fn of_sets(example: &Example, of: Hypotheses) -> Option<Answered> {
    let TrueAnswer::Effects(_) = example.truth else { return None };
    let right = of.sets.iter().map(|(row, _)| example.is_truth(*row)).collect();
    Some(Answered { answers: of.sets.into_iter().map(|(_, of)| of).collect(), right, weight: 1.0 })
}

/// Is something unknown?
fn of_unknown(example: &Example, of: Hypotheses) -> Answered {
    let known = vec![0.0; of.unknown.len()];
    let is_unknown = matches!(example.truth, TrueAnswer::Unknown(_));
    Answered { answers: vec![of.unknown, known], right: vec![is_unknown, !is_unknown], weight: 1.0 }
}

/// At which stage is it?
fn of_stages(example: &Example, of: Hypotheses) -> Option<Answered> {
    let TrueAnswer::Unknown(stages) = &example.truth else { return None };
    let right = of.stages.iter().map(|(id, _)| stages.contains(id)).collect();
    Some(Answered { answers: of.stages.into_iter().map(|(_, of)| of).collect(), right, weight: 1.0 })
}

/// Mean log score of examples as they are, none struck, natural logarithms; what was not fitted counts as excluded.
#[must_use]
pub fn log_score(examples: &[Example], weights: &Weights) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for example in examples.iter().filter(|example| example.struck.is_empty()) {
        let posterior = Posterior::new(&example.table, weights, &[]);
        let probability: f64 = match example.truth {
            TrueAnswer::Unknown(_) => posterior.unknown(),
            TrueAnswer::Effects(_) => {
                posterior.sets.iter().filter(|(row, _)| example.is_truth(*row)).map(|(_, p)| p).sum()
            }
        };
        sum += probability.max(LEAST).ln();
        count += 1.0;
    }
    sum / count.max(1.0)
}

/// By how much more a sound unit counts than a faulty one.
fn sound_weight(examples: &[Example]) -> f64 {
    let as_they_are = || examples.iter().filter(|example| example.struck.is_empty());
    weight_of_sound(as_they_are().filter(|example| example.is_sound()).count(), as_they_are().count())
}

/// The weights that score best on these examples; `settled` puts weights in place that are not to be learned. Those of sets come first: how
/// probable nothing is among them enters the others.
fn fit(examples: &[Example], questions: &Questions, settled: &dyn Fn(Weights) -> Weights) -> Weights {
    let before = questions.beforehand();
    let sets = best(&choices(examples, &before.sets, of_sets), &before.sets);
    let sets = settled(Weights { sets, ..before.clone() }).sets;
    let unknown = best(&choices(examples, &sets, |example, of| Some(of_unknown(example, of))), &before.unknown);
    let stages = best(&choices(examples, &sets, of_stages), &before.stages);
    settled(Weights { sets, unknown, stages, ..before })
}

/// The weights of one question: Newton's method on the log score with a Gaussian prior about what they are beforehand.
fn best(choices: &[Answered], beforehand: &[f64]) -> Vec<f64> {
    if beforehand.is_empty() {
        return Vec::new();
    }
    let centre = DVector::from_column_slice(beforehand);
    let count = centre.len();
    let mut weights = centre.clone();
    let value = |weights: &DVector<f64>| {
        let log = |one: &Answered| one.of(weights.as_slice()).map_or(0.0, |(log, ..)| (log.exp() + LEAST).ln());
        let prior = -0.5 * RIDGE * (weights - &centre).norm_squared();
        prior + choices.iter().map(|one| one.weight * log(one)).sum::<f64>()
    };
    let mut best = value(&weights);
    let mut damping = 1e-2;
    for _ in 0..200 {
        let mut gradient = -RIDGE * (&weights - &centre);
        let mut information = DMatrix::identity(count, count) * (RIDGE + damping);
        for one in choices {
            if let Some((log, towards, spread)) = one.of(weights.as_slice()) {
                // What has next to no probability, as a set whose fit went astray, pulls no weight.
                let counts = one.weight * log.exp() / (log.exp() + LEAST);
                gradient += towards * counts;
                information += spread * counts;
            }
        }
        let Some(cholesky) = information.cholesky() else { break };
        let next = &weights + cholesky.solve(&gradient);
        let found = value(&next);
        if found > best + 1e-9 {
            (weights, best) = (next, found);
            damping *= 0.3;
        } else if damping > 1e6 {
            break;
        } else {
            damping *= 10.0;
        }
    }
    weights.iter().copied().collect()
}

/// Spread of the relative error of sizes where a single effect was named rightly, one standard deviation: a tenth of them lie outside `NORMAL_90` of
/// it.
#[must_use]
pub fn size_spread(units: &[(&Label, &DiagnosisReport)]) -> f64 {
    let mut errors: Vec<f64> = units
        .iter()
        .filter_map(|(label, report)| {
            let ([truth], [named]) = (label.effects.as_slice(), report.effects.as_slice()) else { return None };
            let neutral = find(&truth.id)?.parameters.first()?.neutral;
            let fitted = named.parameters.first().filter(|_| named.id == truth.id)?.value.value;
            fitted.is_finite().then(|| ((fitted - neutral) / (truth.size - neutral) - 1.0).abs())
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let place = errors.len().saturating_sub(1) * 9 / 10;
    errors.get(place).map_or(0.1, |error| error / NORMAL_90)
}

/// Factor by which intervals of the explained share are to be widened so that nine tenths of what came true lies inside; 1 at least, since a few
/// claims that all came true say little of how much too wide they were.
#[must_use]
pub fn explained_fraction_widening(claims: &[(Interval, f64)]) -> f64 {
    let mut short: Vec<f64> = claims.iter().map(|(claim, came_true)| claim.falls_short(*came_true)).collect();
    short.sort_by(f64::total_cmp);
    // The rank of conformal prediction: one claim more than there are must lie inside as often (Vovk, Gammerman & Shafer 2005).
    let rank = (9 * (short.len() + 1)).div_ceil(10);
    rank.checked_sub(1).and_then(|place| short.get(place)).copied().unwrap_or(1.0).max(1.0)
}

/// Whether the likeliest single word of a posterior is right: an effect that is there, unknown, or nothing.
fn first_is_right(example: &Example, weights: &Weights) -> bool {
    let table = &example.table;
    let posterior = Posterior::new(table, weights, &[]);
    let (unknown, none) = (posterior.unknown(), posterior.nothing(table));
    let known = 1.0 - unknown - none;
    match &example.truth {
        TrueAnswer::Unknown(_) => unknown > known.max(none),
        TrueAnswer::Effects(ids) if ids.is_empty() => none >= known.max(unknown),
        TrueAnswer::Effects(ids) => {
            let first = posterior.sets.iter().find(|(row, _)| !table.rows[*row].effects.is_empty());
            known > none.max(unknown)
                && first.is_some_and(|(row, _)| table.rows[*row].effects.iter().all(|id| ids.contains(id)))
        }
    }
}

/// What learning came to, each part judged by weights that never saw it.
#[derive(Clone, Debug, PartialEq)]
pub struct LearningResult {
    /// Weights of all parts together.
    pub weights: Weights,
    /// Mean log score of Bayes' theorem on evidence as it is.
    pub bayes: f64,
    /// Mean log score of the weights learned on the other parts.
    pub held_out: f64,
    /// Share of units whose first word is right by these.
    pub held_out_right: f64,
    /// Mean log score on what was learned from.
    pub seen: f64,
    /// For each part the weights of all others.
    pub of_others: Vec<Weights>,
}

/// Learns the answers to some questions from all parts, and judges each by the others; `settled` puts weights in place that are not to be learned.
#[must_use]
pub fn learn(parts: &[Vec<Example>], questions: &Questions, settled: &dyn Fn(Weights) -> Weights) -> LearningResult {
    let bayes = questions.bayes();
    let all: Vec<Example> = parts.iter().flatten().cloned().collect();
    let (mut held_out, mut right, mut count) = (0.0, 0.0, 0.0_f64);
    let mut of_others = Vec::new();
    for (left, part) in parts.iter().enumerate() {
        let others: Vec<Example> =
            parts.iter().enumerate().filter(|(k, _)| *k != left).flat_map(|(_, part)| part.iter().cloned()).collect();
        let weights = fit(&others, questions, settled);
        let own: Vec<&Example> = part.iter().filter(|example| example.struck.is_empty()).collect();
        held_out += log_score(part, &weights) * own.len() as f64;
        right += own.iter().filter(|example| first_is_right(example, &weights)).count() as f64;
        count += own.len() as f64;
        of_others.push(weights);
    }
    let weights = fit(&all, questions, settled);
    let seen = log_score(&all, &weights);
    LearningResult {
        weights,
        bayes: log_score(&all, &bayes),
        held_out: held_out / count.max(1.0),
        held_out_right: right / count.max(1.0),
        seen,
        of_others,
    }
}
