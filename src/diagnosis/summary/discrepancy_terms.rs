//! What something unknown would be like at each point of the chain.

use crate::estimation::coordinate::Residuals;
use crate::hypotheses::Explored;
use crate::likelihood::problem::Problem;
use crate::model::{FittedModel, discrepancy};
use crate::result::DiscrepancyTerm;

/// Size of something unknown, in moderate discrepancy terms, and of the error of equations beside it, for its picture.
const UNKNOWN: (f64, f64) = (4.0, 0.03);

/// What something unknown would be like at each place, best first; beside it what it would be like if the unit were the improved twin.
pub fn discrepancy_terms(problem: &Problem, explored: &Explored, chosen: &FittedModel) -> Vec<DiscrepancyTerm> {
    let empty = explored.refitted();
    let equations = explored.extended(problem);
    let gap = empty.fit.cost() - problem.expected_cost();
    let goal = (!chosen.effects.is_empty()).then(|| -> Residuals {
        let pairs = empty.fit.residuals.iter().zip(&chosen.fit.residuals);
        pairs.map(|(refitted, improved)| refitted - improved).collect()
    });
    let mut all: Vec<DiscrepancyTerm> = discrepancy::PLACES
        .iter()
        .enumerate()
        .map(|(index, place)| {
            let (gain, sizes) = equations.terms(index, UNKNOWN, None);
            let mut curves = discrepancy::curves(place, &sizes);
            if let Some(goal) = &goal {
                let gradient = explored.discrepancy.along(goal);
                let (_, sizes) = equations.terms(index, UNKNOWN, Some(&gradient));
                for (curve, named) in curves.iter_mut().zip(discrepancy::curves(place, &sizes)) {
                    curve.named = named.points;
                }
            }
            let explains = if gap > 0.0 { (gain / gap).clamp(0.0, 1.0) } else { 0.0 };
            DiscrepancyTerm { place: place.words, stage: place.stage, unit: place.unit, explains, curves }
        })
        .collect();
    all.sort_by(|a, b| b.explains.total_cmp(&a.explains));
    all
}
