//! Learning the numbers of the posterior: by log score, on units whose faults are known.
//!
//! The log score of a unit is the logarithm of the probability that was given to what is truly in it: the very set of faults and nothing else, nothing, or
//! something else where the catalogue lacks it. It is proper (Gneiting & Raftery 2007): only honest probabilities do best. A listed effect struck from the table
//! is a unit outside the catalogue that costs no simulation.

use crate::battery::Label;
use crate::benchmark::statistics::weight_of_sound;
use govtwin_diagnosis::decision::hyperparameters::Hyperparameters;
use govtwin_diagnosis::decision::posterior::Posterior;
use govtwin_diagnosis::hypotheses::table::EvidenceTable;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_model::effects::find;
use govtwin_model::units::NORMAL_90;

/// Weight of a unit with an effect struck beside one as it is.
const STRUCK: f64 = 0.3;

/// Precision of the logarithms of the numbers beforehand, about their usual values: each is known to a factor of three or so.
const RIDGE: f64 = 1.0;

/// Gain in cost from which a struck effect leaves a gap.
const VISIBLE: f64 = 30.0;

/// Least probability that is given to anything: what was not fitted, or nearly excluded.
const LEAST: f64 = 1e-3;

/// First and last step of the search along the logarithm of a number.
const STEPS: (f64, f64) = (0.8, 0.01);

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
    Unknown,
}

/// The examples that a unit makes: as it is, and a single effect struck from it.
pub fn examples(label: &Label, table: &EvidenceTable) -> Vec<Example> {
    let as_is = |truth| Example { table: table.clone(), truth, struck: Vec::new(), weight: 1.0 };
    if !label.listed {
        return vec![as_is(TrueAnswer::Unknown)];
    }
    let mut ids: Vec<String> = label.effects.iter().map(|truth| truth.id.clone()).collect();
    ids.sort();
    let mut all = Vec::new();
    let best = |with: bool| {
        let rows = table.rows.iter().filter(|row| ids.iter().all(|id| row.effects.contains(id)) == with);
        rows.map(|row| row.cost).fold(f64::INFINITY, f64::min)
    };
    if ids.len() == 1 && best(false) - best(true) > VISIBLE {
        all.push(Example {
            truth: TrueAnswer::Unknown,
            struck: ids.clone(),
            weight: STRUCK,
            ..as_is(TrueAnswer::Unknown)
        });
    }
    all.push(as_is(TrueAnswer::Effects(ids)));
    all
}

impl Example {
    fn is_sound(&self) -> bool {
        self.truth == TrueAnswer::Effects(Vec::new())
    }

    /// Probability of what is truly there.
    fn probability(&self, numbers: &Hyperparameters) -> f64 {
        let struck: Vec<&str> = self.struck.iter().map(String::as_str).collect();
        let posterior = Posterior::new(&self.table, numbers, &struck);
        let TrueAnswer::Effects(ids) = &self.truth else { return posterior.something_else };
        let is_truth = |row: usize| {
            let mut effects = self.table.rows[row].effects.clone();
            effects.sort();
            effects == *ids
        };
        posterior.complete.iter().filter(|(row, _)| is_truth(*row)).map(|(_, p)| p).sum()
    }
}

/// Mean log score of examples as they are, none struck, natural logarithms; what was not fitted counts as excluded.
pub fn log_score(examples: &[Example], numbers: &Hyperparameters) -> f64 {
    let as_they_are: Vec<f64> = examples
        .iter()
        .filter(|example| example.struck.is_empty())
        .map(|example| example.probability(numbers).max(LEAST).ln())
        .collect();
    as_they_are.iter().sum::<f64>() / as_they_are.len().max(1) as f64
}

/// The numbers that score best on these examples: a search along each in turn, in ever smaller steps (Hooke & Jeeves 1961).
fn fit(examples: &[Example]) -> Hyperparameters {
    let as_they_are = || examples.iter().filter(|example| example.struck.is_empty());
    let sound = weight_of_sound(as_they_are().filter(|example| example.is_sound()).count(), as_they_are().count());
    let usual = Hyperparameters::usual();
    let value = |moves: &[f64; Hyperparameters::LEARNED]| {
        let numbers = usual.moved(moves);
        let of = |example: &Example| {
            let weight = example.weight * if example.is_sound() { sound } else { 1.0 };
            weight * (example.probability(&numbers) + LEAST).ln()
        };
        examples.iter().map(of).sum::<f64>() - 0.5 * RIDGE * moves.iter().map(|one| one * one).sum::<f64>()
    };
    let mut moves = [0.0; Hyperparameters::LEARNED];
    let mut best = value(&moves);
    let mut step = STEPS.0;
    while step > STEPS.1 {
        let before = best;
        for k in 0..moves.len() {
            for sign in [1.0, -1.0] {
                let mut tried = moves;
                tried[k] += sign * step;
                let found = value(&tried);
                if found > best {
                    (moves, best) = (tried, found);
                    break;
                }
            }
        }
        if best <= before {
            step *= 0.5;
        }
    }
    usual.moved(&moves)
}
/// Spread of the relative error of sizes where a single effect was named rightly, one standard deviation: a tenth of them lie outside `NORMAL_90` of
/// it. None where none was.
pub fn size_spread(units: &[(&Label, &DiagnosisReport)]) -> Option<f64> {
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
    errors.get(place).map(|error| error / NORMAL_90)
}
/// Whether the likeliest single word of a posterior is right: an effect that is there, unknown, or nothing.
fn first_is_right(example: &Example, numbers: &Hyperparameters) -> bool {
    let table = &example.table;
    let posterior = Posterior::new(table, numbers, &[]);
    let (unknown, none) = (posterior.unknown(), posterior.nothing(table));
    let known = 1.0 - unknown - none;
    match &example.truth {
        TrueAnswer::Unknown => unknown > known.max(none),
        TrueAnswer::Effects(ids) if ids.is_empty() => none >= known.max(unknown),
        TrueAnswer::Effects(ids) => {
            let first = posterior.sets.iter().find(|(row, _)| !table.rows[*row].effects.is_empty());
            known > none.max(unknown)
                && first.is_some_and(|(row, _)| table.rows[*row].effects.iter().all(|id| ids.contains(id)))
        }
    }
}

/// What learning came to, each part judged by numbers that never saw it.
#[derive(Clone, Debug, PartialEq)]
pub struct LearningResult {
    /// Numbers of all parts together.
    pub numbers: Hyperparameters,
    /// Mean log score of the usual numbers, nothing learned.
    pub usual: f64,
    /// Mean log score of the numbers learned on the other parts.
    pub held_out: f64,
    /// Share of units whose first word is right by these.
    pub held_out_right: f64,
    /// Mean log score on what was learned from.
    pub seen: f64,
    /// For each part the numbers of all others.
    pub of_others: Vec<Hyperparameters>,
}

/// Learns from all parts, and judges each by the others.
pub fn learn(parts: &[Vec<Example>]) -> LearningResult {
    let all: Vec<Example> = parts.iter().flatten().cloned().collect();
    let (mut held_out, mut right, mut count) = (0.0, 0.0, 0.0_f64);
    let mut of_others = Vec::new();
    for (left, part) in parts.iter().enumerate() {
        let others: Vec<Example> =
            parts.iter().enumerate().filter(|(k, _)| *k != left).flat_map(|(_, part)| part.iter().cloned()).collect();
        let numbers = fit(&others);
        let own: Vec<&Example> = part.iter().filter(|example| example.struck.is_empty()).collect();
        held_out += log_score(part, &numbers) * own.len() as f64;
        right += own.iter().filter(|example| first_is_right(example, &numbers)).count() as f64;
        count += own.len() as f64;
        of_others.push(numbers);
    }
    let numbers = fit(&all);
    LearningResult {
        usual: log_score(&all, &Hyperparameters::usual()),
        held_out: held_out / count.max(1.0),
        held_out_right: right / count.max(1.0),
        seen: log_score(&all, &numbers),
        numbers,
        of_others,
    }
}
