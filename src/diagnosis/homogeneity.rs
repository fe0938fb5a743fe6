//! Whether the recordings agree: the same parameters must fit each of them, or they are not of one unit.

use crate::estimation::fit::{Effort, fit};
use crate::hypotheses::Explored;
use crate::hypotheses::profile::{fitted_best, profiles};
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use crate::words::WRONG_DATA;
use govtwin_model::effects::EffectSpec;
use nalgebra::DMatrix;

/// Work of the fit to some of the recordings.
const ALONE: Effort = Effort { rounds: 6, refresh: 3, ..Effort::FULL };

/// What recordings must gain by parameters of their own to be of different units, in halves of a log-likelihood.
const STRANGE: f64 = 60.0;
/// The same as a share of what their common fit leaves beyond noise, and as a share of the noise itself.
const STRANGE_SHARES: (f64, f64) = (0.5, 0.15);

/// Recordings of more are not tried in two halves: there are too many.
const MOST_IN_HALVES: usize = 6;

/// Share of the gap that a model may leave and still speak for one unit, unless each recording gains by itself.
const EXPLAINED: f64 = 0.3;

/// Some of the recordings, fitted by themselves.
struct Part {
    recordings: Vec<usize>,
    model: FittedModel,
}

impl Part {
    /// By how much they fit better than with the rest, where these deviations of the sheet are theirs alone.
    fn gain(&self, together: &FittedModel) -> f64 {
        let square: f64 = self.recordings.iter().map(|&k| together.fit.residuals[k].norm_squared()).sum();
        (square + together.fit.prior - self.model.cost()).max(0.0)
    }

    fn names(&self, problem: &Problem) -> String {
        let names: Vec<&str> = self.recordings.iter().map(|&k| problem.recordings[k].name.as_str()).collect();
        names.join(" and ")
    }
}

/// Fits recordings by themselves, from where all together stand; says in a sentence that they are not of one unit, where they are not.
pub fn disagreement(problem: &Problem, found: &Explored, catalogue: &[&'static EffectSpec]) -> Option<String> {
    let leader = found.leader();
    let floor = problem.expected_cost();
    let left = leader.cost() - floor;
    // What one unit leaves beyond noise is no more than its equations are wrong by.
    let is_strange = left >= STRANGE.max(STRANGE_SHARES.1 * floor);
    if problem.recordings.len() < 2 || leader.fit.slopes.len() < problem.recordings.len() || !is_strange {
        return None;
    }
    let least = (STRANGE_SHARES.0 * left).max(STRANGE);
    // The sheet's deviations count once in what fits all, and in each part by itself.
    let gain = |parts: &[Part]| leader.cost() - parts.iter().map(|part| part.model.cost()).sum::<f64>();
    let each: Vec<Part> = (0..problem.recordings.len()).map(|k| fitted(problem, vec![k], leader)).collect();
    let own = gain(&each);
    let each_gains = own >= least.max(STRANGE_SHARES.1 * floor);
    // A model that explains the gap of all of them speaks for one unit.
    let explained = EXPLAINED * (found.refitted().cost() - floor);
    if left < explained && !each_gains {
        return None;
    }
    let said = if each_gains {
        let mut telling: Vec<&Part> = each.iter().filter(|part| part.gain(leader) > 0.25 * own).collect();
        telling.sort_by(|a, b| b.gain(leader).total_cmp(&a.gain(leader)));
        let names: Vec<String> = telling.iter().map(|part| part.names(problem)).collect();
        format!(
            "although each recording fits its own: {}. Are they of different units? Farthest from the rest: {}.",
            apart(problem, &each)?,
            names.join(", ")
        )
    } else {
        // Each half confirms itself, so that there may be an effect in it; both must leave as little as those of one unit.
        let halves = halves(problem, found, catalogue).filter(|halves| gain(halves) >= least)?;
        if halves.iter().map(|part| part.model.cost()).sum::<f64>() - floor > explained {
            return None;
        }
        format!("although two sets fit them: {}. Are they of two units?", apart(problem, &halves)?)
    };
    Some(format!("One set of parameters does not fit all recordings, {said} {WRONG_DATA}"))
}

/// Recordings fitted by themselves, from where a model of all of them stands.
fn fitted(problem: &Problem, recordings: Vec<usize>, model: &FittedModel) -> Part {
    let FittedModel { effects, base, free_parameters, fit: all, .. } = model;
    let known: Option<Vec<DMatrix<f64>>> = recordings.iter().map(|&k| all.slopes.get(k).cloned()).collect();
    let fit = fit(&problem.part(&recordings), base, free_parameters, &all.positions, ALONE, known.as_deref());
    Part { recordings, model: FittedModel::new(effects.clone(), base.clone(), free_parameters.clone(), fit) }
}

/// Recordings fitted by themselves, with one effect where it gains much; it is sought as that of all recordings is.
fn searched(problem: &Problem, refitted: &FittedModel, catalogue: &[&'static EffectSpec], half: Vec<usize>) -> Part {
    let part = problem.part(&half);
    let without = fitted(problem, half, refitted);
    let sheet = FittedModel::sheet(&part, &refitted.base, &refitted.free_parameters);
    let places = profiles(&part, &sheet, catalogue, without.model.cost());
    let found = fitted_best(&part, &sheet, catalogue, &places).map(|found| {
        let FittedModel { base, free_parameters, fit: first, .. } = &found;
        found.or_better(fit(&part, base, free_parameters, &first.positions, ALONE, Some(&first.slopes)))
    });
    match found.filter(|found| found.cost() + STRANGE < without.model.cost()) {
        Some(model) => Part { model, ..without },
        None => without,
    }
}

/// The two halves, of two recordings at least, that promise to fit best by themselves, each with one effect at most.
fn halves(problem: &Problem, found: &Explored, catalogue: &[&'static EffectSpec]) -> Option<[Part; 2]> {
    let count = problem.recordings.len();
    if !(4..=MOST_IN_HALVES).contains(&count) {
        return None;
    }
    let models = || found.hypotheses.iter().filter(|one| one.effects.len() < 2).map(|one| &one.model);
    let least = |half: &Vec<usize>| models().map(|model| model.least_cost_of(half)).fold(f64::INFINITY, f64::min);
    let split = |places: u32| -> [Vec<usize>; 2] {
        [0, 1].map(|side| (0..count).filter(|k| places >> k & 1 == side).collect())
    };
    let all = (0..1_u32 << (count - 1)).map(split).filter(|halves| halves.iter().all(|half| half.len() > 1));
    let cost = |halves: &[Vec<usize>; 2]| halves.iter().map(least).sum::<f64>();
    let halves = all.map(|halves| (cost(&halves), halves)).min_by(|a, b| a.0.total_cmp(&b.0))?.1;
    Some(halves.map(|half| searched(problem, found.refitted(), catalogue, half)))
}

/// The parameter that two parts see farthest apart, in its deviations.
fn apart(problem: &Problem, parts: &[Part]) -> Option<String> {
    let key = |part: &Part, k: usize| part.model.free_parameters.get(k).map(|one| one.key(&part.model.base));
    let first = parts.first()?;
    // Parameters of effects stand behind those of the sheet.
    let is_common = |k: &usize| key(first, *k).is_some() && parts.iter().all(|part| key(part, *k) == key(first, *k));
    let mut farthest: Option<(f64, usize, &Part, &Part)> = None;
    for k in (0..).take_while(is_common) {
        for (place, a) in parts.iter().enumerate() {
            for b in &parts[place + 1..] {
                let distance = a.model.fit.positions[k] - b.model.fit.positions[k];
                let size = distance.abs() / (a.model.spread[(k, k)] + b.model.spread[(k, k)]).sqrt().max(1e-9);
                if farthest.is_none_or(|(best, ..)| size > best) {
                    farthest = Some((size, k, a, b));
                }
            }
        }
    }
    let (size, k, a, b) = farthest?;
    let value = |part: &Part| part.model.free_parameters[k].value(&part.model.base, part.model.fit.positions[k]);
    let (key, unit) = key(a, k)?;
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    let (in_a, in_b) = (a.names(problem), b.names(problem));
    (size > 3.0)
        .then(|| format!("{key} would be {:.4e}{unit} in {in_a} and {:.4e}{unit} in {in_b}", value(a), value(b)))
}
