//! Noise of its own: a model that chatters otherwise than the refitted sheet is judged by the chatter that it predicts.

use crate::diagnosis::model::FittedModel;
use crate::estimation::coordinate::square;
use crate::likelihood::problem::Problem;
use crate::parameters::Unit;

/// Share of the least cost by which a model must be likelier with the noise of its own: less is not worth a new search.
const NOTABLE: f64 = 0.1;

/// The same in cost: less may be chance.
const LEAST_GAIN: f64 = 20.0;

/// The problem with the noise laid out along a unit, and what that unit then costs: its residuals, and how much wider that noise is than before.
///
/// But for a constant the cost is minus twice the logarithm of its likelihood.
fn own(problem: &Problem, unit: &Unit) -> (Problem, f64) {
    let own = problem.laid_along(unit);
    let residuals: f64 = own.residuals_of(std::slice::from_ref(unit)).iter().map(square).sum();
    let cost = residuals + own.width() - problem.width();
    (own, cost)
}

/// Whether what is likeliest with the noise of its own is notably likelier than the least that anything costs with that of the problem.
fn is_notable(own_cost: f64, least: f64) -> bool {
    own_cost < (1.0 - NOTABLE) * least - LEAST_GAIN
}

/// What a model costs more with the noise laid out along itself than with that of the problem; next to nothing among models that chatter alike.
#[must_use]
pub fn charge(problem: &Problem, model: &FittedModel) -> f64 {
    own(problem, &model.unit()).1 - model.fit.square
}

/// A problem of new recordings with the noise that a diagnosis would count with: along the improved unit where that is notably likelier so.
#[must_use]
pub fn laid_for(problem: Problem, refitted: &Unit, improved: &Unit) -> Problem {
    let least =
        problem.residuals_of(&[refitted.clone(), improved.clone()]).iter().map(square).fold(f64::INFINITY, f64::min);
    let (own, cost) = own(&problem, improved);
    if is_notable(cost, least) { own } else { problem }
}
