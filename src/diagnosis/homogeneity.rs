//! Whether the recordings agree: the same parameters must fit each of them, or they are not of one unit.

use crate::estimation::fit::{Effort, Fit, fit};
use crate::hypotheses::Explored;
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::problem::Problem;
use crate::model::{FittedModel, covariance};
use govtwin_model::parameters::Unit;

/// Work of the fit to one recording alone.
const ALONE: Effort = Effort { rounds: 6, refresh: 3, temperature: 1.0 };

/// What recordings must gain by parameters of their own to be of different units, in halves of a log-likelihood.
const STRANGE: f64 = 60.0;
/// The same as a share of what their common fit leaves beyond noise, and as a share of the noise itself.
const STRANGE_SHARES: (f64, f64) = (0.5, 0.15);

/// Share of the gap that a model may leave and still speak for one unit.
const EXPLAINED: f64 = 0.3;

/// One recording fitted alone.
struct FittedAlone {
    gain: f64,
    fit: Fit,
    variances: Vec<f64>,
}

/// Fits each recording alone, from where all together stand; says in a sentence that they are not of one unit, where they are not.
#[must_use]
pub fn disagreement(problem: &Problem, found: &Explored) -> Option<String> {
    let model = found.leader();
    let floor = problem.expected_cost();
    if problem.recordings.len() < 2
        || model.fit.slopes.len() < problem.recordings.len()
        || model.cost() - floor < STRANGE
    {
        return None;
    }
    // A model that explains the gap of all of them speaks for one unit, however much each gains by parameters of its own.
    if model.cost() - floor < EXPLAINED * (found.refitted().cost() - floor) {
        return None;
    }
    let alone: Vec<FittedAlone> = (0..problem.recordings.len())
        .map(|recording| {
            let own = problem.only(recording);
            let known = [model.fit.slopes[recording].clone()];
            let fit = fit(&own, &model.base, &model.free_parameters, &model.fit.positions, ALONE, Some(&known));
            let together = model.fit.residuals[recording].norm_squared() + model.fit.prior;
            let variances = covariance(&model.free_parameters, &fit).diagonal().iter().copied().collect();
            FittedAlone { gain: (together - fit.cost()).max(0.0), fit, variances }
        })
        .collect();
    let gain: f64 = alone.iter().map(|one| one.gain).sum();
    let apart = apart(problem, model, &alone)?;
    if gain < (STRANGE_SHARES.0 * (model.cost() - floor)).max(STRANGE_SHARES.1 * floor).max(STRANGE) {
        return None;
    }
    let mut order: Vec<usize> = (0..alone.len()).collect();
    order.sort_by(|&a, &b| alone[b].gain.total_cmp(&alone[a].gain));
    let telling = order.iter().filter(|&&k| alone[k].gain > 0.25 * gain);
    let names: Vec<&str> = telling.map(|&k| problem.recordings[k].name.as_str()).collect();
    Some(format!(
        "One set of parameters does not fit all recordings, although each recording fits its own: {apart}. Are they of different units? Farthest \
         from the rest: {}. No effect is named for such recordings.",
        names.join(", ")
    ))
}

/// The parameter that two recordings see farthest apart, in its deviations.
fn apart(problem: &Problem, model: &FittedModel, alone: &[FittedAlone]) -> Option<String> {
    let mut farthest: Option<(f64, usize, usize, usize)> = None;
    for (k, _) in model.free_parameters.iter().enumerate() {
        for a in 0..alone.len() {
            for b in a + 1..alone.len() {
                let distance = alone[a].fit.positions[k] - alone[b].fit.positions[k];
                let size = distance.abs() / (alone[a].variances[k] + alone[b].variances[k]).sqrt().max(1e-9);
                if farthest.is_none_or(|(best, ..)| size > best) {
                    farthest = Some((size, k, a, b));
                }
            }
        }
    }
    let (size, k, a, b) = farthest?;
    let value = |free_parameter: &FreeParameter, base: &Unit, place: usize| {
        free_parameter.value(base, alone[place].fit.positions[k])
    };
    let free_parameter = &model.free_parameters[k];
    let (key, unit) = free_parameter.key(&model.base);
    let unit = if unit == "1" { String::new() } else { format!(" {unit}") };
    (size > 3.0).then(|| {
        format!(
            "{key} would be {:.4e}{unit} in {} and {:.4e}{unit} in {}",
            value(free_parameter, &model.base, a),
            problem.recordings[a].name,
            value(free_parameter, &model.base, b),
            problem.recordings[b].name
        )
    })
}
