//! Noise of its own: a model that chatters otherwise than the refitted sheet is judged by the chatter that it predicts.

use crate::diagnosis::decide::SEEN;
use crate::diagnosis::model::Model;
use crate::parameters::Unit;
use crate::tuning::fit::{Bench, square};

/// Share of the least cost by which a model must be likelier with the noise of its own: less is not worth a new search.
const NOTABLE: f64 = 0.1;

/// What a unit costs with the noise laid out along itself: its misses then, and how much wider that noise is than that of the bench.
///
/// But for a constant that is minus twice the logarithm of its likelihood.
fn own_cost(bench: &Bench, unit: &Unit) -> f64 {
    let own = bench.laid_along(unit);
    let misses: f64 = own.misses_of(std::slice::from_ref(unit)).iter().map(square).sum();
    misses + own.width() - bench.width()
}

/// Whether what is likeliest with the noise of its own is notably likelier than the least that anything costs with that of the bench.
fn is_notable(own_cost: f64, least: f64) -> bool {
    own_cost < (1.0 - NOTABLE) * least - SEEN
}

/// What a model costs more with the noise laid out along itself than with that of the bench; next to nothing among models that chatter alike.
#[must_use]
pub fn charge(bench: &Bench, model: &Model) -> f64 {
    own_cost(bench, &model.unit()) - model.fit.square
}

/// The unit that is notably likelier with the noise of its own than any model is with that of the bench; none where there is none.
#[must_use]
pub fn louder(bench: &Bench, before: &Model, tried: &[Model]) -> Option<Unit> {
    let least = tried.iter().map(Model::cost).fold(before.cost(), f64::min);
    let own: Vec<(f64, &Model)> = tried.iter().map(|model| (model.cost() + charge(bench, model), model)).collect();
    let (cost, likeliest) = own.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    is_notable(cost, least).then(|| likeliest.unit())
}

/// A bench of new recordings with the noise that a diagnosis would count with: along the improved unit where that is notably likelier so.
#[must_use]
pub fn laid_for(bench: Bench, improved: &Unit, refitted: &Unit) -> Bench {
    let least = bench.misses_of(&[improved.clone(), refitted.clone()]).iter().map(square).fold(f64::INFINITY, f64::min);
    if is_notable(own_cost(&bench, improved), least) { bench.laid_along(improved) } else { bench }
}
