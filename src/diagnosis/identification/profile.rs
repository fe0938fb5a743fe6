//! Where a fit starts: sizes of effects are profiled over their whole ranges, one on top of the other.

use nalgebra::DMatrix;

use crate::estimation::coordinate::{Coordinate, prior_square, square};
use crate::estimation::fit::pictured;
use crate::estimation::following::{Displaced, followed, profile_sizes};
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::problem::Problem;
use govtwin_model::parameters::Unit;

/// Promising places that are simulated for each that is kept.
const TRIED: usize = 3;

/// A usual size of an effect, in typical ones.
const USUAL_SIZE: f64 = 1.0;

/// A place on the way: sizes that have been chosen follow like the sheet.
#[derive(Clone, Debug)]
struct Place {
    positions: Vec<f64>,
    /// Sizes that are still to be chosen.
    open: Vec<usize>,
    cost: f64,
}

/// The best `count` places by profiles of the sizes of all effects, likeliest first, and one of usual sizes; the sheet alone where there is no effect.
///
/// One after the other gets its size, first the one that gains most, and at each size of its profile the sheet and the sizes that have been chosen follow.
pub(super) fn profile_starts(
    problem: &Problem,
    base: &Unit,
    free_parameters: &[FreeParameter],
    count: usize,
) -> Vec<Vec<f64>> {
    let start = |free_parameter: &FreeParameter| match free_parameter {
        FreeParameter::Effect { .. } if free_parameter.position(base) != 0.0 => free_parameter.position(base),
        FreeParameter::Effect { .. } => free_parameter.prior_centre().unwrap_or(0.0),
        _ => free_parameter.start(base),
    };
    let is_size = |k: &usize| matches!(free_parameters[*k], FreeParameter::Effect { parameter: 0, .. });
    let open = (0..free_parameters.len()).filter(is_size).collect();
    let mut best = vec![Place { positions: free_parameters.iter().map(start).collect(), open, cost: f64::INFINITY }];
    while best.iter().any(|place| !place.open.is_empty()) {
        let mut next: Vec<Place> =
            best.iter().flat_map(|place| grown(problem, base, free_parameters, place, count)).collect();
        next.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        next.truncate(count);
        best = next;
    }
    // Dead bands and stops leave small steps in the cost, behind which one step cannot see: a usual size is a start too.
    let usual = |free_parameter: &FreeParameter| match free_parameter {
        FreeParameter::Effect { .. } if free_parameter.position(base) == 0.0 => {
            USUAL_SIZE.min(free_parameter.range(base).1)
        }
        _ => start(free_parameter),
    };
    let has_size = free_parameters.iter().any(|one| matches!(one, FreeParameter::Effect { .. }));
    let usual = has_size.then(|| free_parameters.iter().map(usual).collect());
    best.into_iter().map(|place| place.positions).chain(usual).collect()
}

/// The best places at which one more free parameter has its size.
fn grown(problem: &Problem, base: &Unit, free_parameters: &[FreeParameter], place: &Place, count: usize) -> Vec<Place> {
    // What follows comes first.
    let mut order: Vec<usize> = (0..free_parameters.len()).filter(|k| !place.open.contains(k)).collect();
    let following = order.len();
    order.extend(&place.open);
    let coordinates: Vec<FreeParameter> = order.iter().map(|&k| free_parameters[k]).collect();
    let at: Vec<f64> = order.iter().map(|&k| place.positions[k]).collect();
    let (_, slopes): (_, Vec<DMatrix<f64>>) = pictured(problem, base, &coordinates, &at);
    let mut displaced = Vec::new();
    for own in following..order.len() {
        let sizes = profile_sizes(coordinates[own].range(base));
        for size in sizes.into_iter().chain([at[own]]) {
            let mut positions = at.clone();
            positions[own] = size;
            let (base, coordinates) = (base.clone(), coordinates.clone());
            displaced.push((own, Displaced { base, coordinates, positions, columns: (0..following).collect() }));
        }
    }
    let (owns, displaced): (Vec<usize>, Vec<Displaced<FreeParameter>>) = displaced.into_iter().unzip();
    let promised = followed(problem, &slopes, &displaced);
    let mut promising: Vec<(usize, Displaced<FreeParameter>, f64)> = owns
        .into_iter()
        .zip(displaced)
        .zip(promised)
        .map(|((own, one), promised)| (own, Displaced { positions: promised.positions, ..one }, promised.cost))
        .collect();
    promising.sort_by(|a, b| a.2.total_cmp(&b.2));
    promising.truncate(TRIED * count);
    let units: Vec<Unit> = promising.iter().map(|(_, one, _)| one.subject()).collect();
    let residuals = problem.residuals_of(&units);
    promising
        .into_iter()
        .zip(residuals)
        .map(|((own, one, _), residuals)| {
            let mut positions = place.positions.clone();
            order.iter().zip(&one.positions).for_each(|(&k, position)| positions[k] = *position);
            let open = place.open.iter().copied().filter(|&k| k != order[own]).collect();
            Place { cost: square(&residuals) + prior_square(free_parameters, &positions), positions, open }
        })
        .collect()
}
