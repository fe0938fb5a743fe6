//! Single effects of a stage without a sheet fitted anew from where the plain law has it.
//!
//! Refitted without an effect, a stage may end far from its dead band and zero to make up for what it lacks, and effects that are added there then
//! stay behind that ridge.

use crate::estimation::annealing::annealed;
use crate::estimation::fit::{Effort, Fit, fit};
use crate::evidence::Shared;
use crate::hypotheses::Explored;
use crate::hypotheses::explorer::{Hypothesis, kappa};
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use crate::model::support::{Placed, Variant};
use govtwin_model::effects::EffectSpec;
use govtwin_model::parameters::Unit;

/// Sizes from which an effect starts, in typical ones.
const SIZES: [f64; 2] = [1.0, -1.0];
/// Rounds of a fit at each temperature.
const ROUNDS: usize = 3;

/// Fits every single effect from the unfitted stage as well, and keeps what is better.
pub fn singles(found: &mut Explored, problem: &Problem, sheet: &FittedModel, catalogue: &[&'static EffectSpec]) {
    let mut fitted: Vec<(usize, Unit, Vec<FreeParameter>, Fit)> = Vec::new();
    for (effect, spec) in catalogue.iter().enumerate() {
        let of = |size| sheet.with_effect(spec, Variant { size, further: 1.0 });
        let places: Vec<Placed> = SIZES.into_iter().filter_map(of).collect();
        let Some((base, free_parameters, _)) = places.first() else { continue };
        let starts: Vec<Vec<f64>> = places.iter().map(|(_, _, positions)| positions.clone()).collect();
        let rough = annealed(problem, base, free_parameters, &starts, ROUNDS);
        let Some(best) = rough.into_iter().min_by(|a, b| a.cost().total_cmp(&b.cost())) else { continue };
        let fine = fit(problem, base, free_parameters, &best.positions, Effort::FULL, Some(&best.slopes));
        fitted.push((effect, base.clone(), free_parameters.clone(), fine));
    }
    let shared = Shared::new(problem, &found.discrepancy, found.refitted().cost());
    for (effect, base, free_parameters, fit) in fitted {
        let known = found.hypotheses.iter().position(|one| one.effects == [effect]);
        if known.is_some_and(|place| found.hypotheses[place].model.cost() <= fit.cost()) {
            continue;
        }
        let model = FittedModel::new(vec![catalogue[effect]], base, free_parameters, fit);
        let anew = Hypothesis::new(&shared, kappa(problem), vec![effect], model, true);
        match known {
            Some(place) => found.hypotheses[place] = anew,
            None => found.hypotheses.push(anew),
        }
    }
    found.hypotheses.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
}
