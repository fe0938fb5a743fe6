//! Noise of its own: a model that chatters otherwise than the refitted sheet is judged by the chatter that it predicts.

use crate::diagnosis::decide::SEEN;
use crate::diagnosis::model::Model;
use crate::parameters::Unit;
use crate::tuning::fit::{Bench, square};

/// Share of the least cost by which a model must be likelier with the noise of its own: less is not worth a new search.
const NOTABLE: f64 = 0.1;

/// What a model costs more with the noise laid out along itself than with that of the bench: its misses then, and how much wider that noise is.
///
/// Together with its cost that is minus twice the logarithm of its likelihood, but for a constant; among models that chatter alike the noise is as
/// good as the same, and makes no difference.
#[must_use]
pub fn charge(bench: &Bench, model: &Model) -> f64 {
    let unit = model.unit();
    let own = bench.laid_along(&unit);
    let misses: f64 = own.misses_of(&[unit]).iter().map(square).sum();
    misses - model.fit.square + own.width() - bench.width()
}

/// The unit that is notably likelier with the noise of its own than any model is with that of the bench; none where there is none.
#[must_use]
pub fn louder(bench: &Bench, before: &Model, tried: &[Model]) -> Option<Unit> {
    let least = tried.iter().map(Model::cost).fold(before.cost(), f64::min);
    let own: Vec<(f64, &Model)> = tried.iter().map(|model| (model.cost() + charge(bench, model), model)).collect();
    let (cost, likeliest) = own.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    (cost < (1.0 - NOTABLE) * least - SEEN).then(|| likeliest.unit())
}
