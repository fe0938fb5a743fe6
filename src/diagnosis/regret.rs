//! Regret of the search: what it found for the true fault set, beside what a fit reaches that begins at the true values.
//!
//! Nothing of it enters a verdict. It is asked for only where somebody knows the unit, such as a benchmark.

use crate::estimation::coordinate::Coordinate;
use crate::estimation::fit::{Effort, fit};
use crate::hypotheses::Explored;
use crate::hypotheses::explorer::Hypothesis;
use crate::likelihood::problem::Problem;
use crate::model::support::{Variant, add};
use crate::result::Regret;
use govtwin_model::effects::EffectSpec;
use govtwin_model::parameters::{ENTRIES, Unit};

/// The regret for a unit of these true values; none where one of its effects is not in the catalogue.
pub fn regret(
    problem: &Problem,
    explored: &Explored,
    catalogue: &[&'static EffectSpec],
    true_values: &Unit,
) -> Option<Regret> {
    let start = explored.refitted();
    let mut placed = (start.base.clone(), start.free_parameters.clone(), Vec::new());
    for free_parameter in &placed.1 {
        let index = free_parameter.entry()?;
        placed.2.push(free_parameter.position_at(&placed.0, (ENTRIES[index].get)(&true_values.parameters)));
    }
    let known = placed.0.effects.clone();
    for setting in true_values.effects.iter().filter(|setting| known.iter().all(|one| one.id != setting.id)) {
        let spec = catalogue.iter().find(|spec| spec.id == setting.id)?;
        let first = placed.2.len();
        add(&mut placed, spec, Variant { size: 0.0, further: 1.0 });
        for (k, value) in (first..placed.2.len()).zip(&setting.values) {
            placed.2[k] = placed.1[k].position_at(&placed.0, *value);
        }
    }
    let (base, free_parameters, mut positions) = placed;
    for (position, free_parameter) in positions.iter_mut().zip(&free_parameters) {
        let (low, high) = free_parameter.range(&base);
        *position = position.clamp(low, high);
    }
    let reached = fit(problem, &base, &free_parameters, &positions, Effort::FULL, None).cost();
    let effects: Vec<String> = base.effects[known.len()..].iter().map(|setting| setting.id.clone()).collect();
    // The true set costs no more than one within it: its further effects may be nothing.
    let is_true = |id: &str| effects.iter().any(|one| one == id);
    let bounds =
        |one: &&Hypothesis| effects.iter().all(|id| one.model.has(id)) || one.model.ids().into_iter().all(is_true);
    let found = explored.hypotheses.iter().filter(bounds).map(|one| one.model.cost()).fold(f64::INFINITY, f64::min);
    Some(Regret { effects, found, reached })
}
