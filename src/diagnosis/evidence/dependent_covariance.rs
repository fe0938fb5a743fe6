//! Noise of its own: a model that chatters otherwise than the refitted sheet is judged by the chatter that it predicts.

use crate::diagnosis::model::FittedModel;
use crate::estimation::coordinate::square;
use crate::likelihood::problem::Problem;
use crate::parameters::Unit;

/// The problem with the noise laid out along a unit, and what that unit then costs: its residuals, and how much wider that noise is than before.
///
/// But for a constant the cost is minus twice the logarithm of its likelihood.
#[must_use]
pub fn own(problem: &Problem, unit: &Unit) -> (Problem, f64) {
    let own = problem.laid_along(unit);
    let residuals: f64 = own.residuals_of(std::slice::from_ref(unit)).iter().map(square).sum();
    let cost = residuals + own.width() - problem.width();
    (own, cost)
}

/// What a model costs more with the noise laid out along itself than with that of the problem; next to nothing among models that chatter alike.
#[must_use]
pub fn charge(problem: &Problem, model: &FittedModel) -> f64 {
    own(problem, &model.unit()).1 - model.fit.square
}
