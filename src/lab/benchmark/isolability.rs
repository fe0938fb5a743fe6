//! The cause of a miss: recordings that could not have shown it, or the method.

use nalgebra::DMatrix;

use crate::benchmark::validation::laid_along;
use govtwin_diagnosis::estimation::coordinate::Residuals;
use govtwin_diagnosis::estimation::fit::{beside, pictured};
use govtwin_diagnosis::estimation::linear::least_cost;
use govtwin_diagnosis::identification::free_parameter::FreeParameter;
use govtwin_model::effects::find;
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::recording::Recording;

/// An effect at a size: its id, and as many of its parameters as are known, in their units.
pub type Sized<'a> = (&'a str, Vec<f64>);

/// The information of the recordings about effects that an answer left out, in halves of a log-likelihood; none where the catalogue has no equation for one.
///
/// The effects are simulated at their size on top of the refitted unit. From what they change in the residuals is taken off what the sheet's
/// tolerances could do instead, and what the effects could that the answer names, at the sizes that it gives them (projection: the gain in
/// likelihood that a perfect observer with the same equations could expect). Below
/// [`SEEN`](crate::benchmark::scored::SEEN) these recordings could not have shown it.
pub fn expected_log_bayes_factor(
    recordings: Vec<Recording>,
    refitted: &Unit,
    hidden: &[Sized],
    answer: &[Sized],
) -> Option<f64> {
    let with = |effects: &[Sized]| {
        effects.iter().try_fold(refitted.clone(), |mut unit, (id, known)| {
            let spec = find(id)?;
            let known = known.iter().copied().map(Some).chain(std::iter::repeat(None));
            let values = spec
                .parameters
                .iter()
                .zip(known)
                .map(|(spec, known)| known.unwrap_or(spec.on(&refitted.parameters).typical))
                .collect();
            unit.effects.push(EffectSetting { id: spec.id.to_owned(), values });
            Some(unit)
        })
    };
    let wanted = with(hidden)?;
    let answers: Vec<Unit> = answer.iter().filter_map(|one| with(std::slice::from_ref(one))).collect();
    let problem = laid_along(recordings, refitted);
    let free_parameters = FreeParameter::nuisances(refitted);
    let zeros = vec![0.0; free_parameters.len()];
    let (at, mut columns) = pictured(&problem, refitted, &free_parameters, &zeros);
    let units: Vec<Unit> = std::iter::once(wanted).chain(answers).collect();
    let mut changes = problem
        .residuals_of(&units)
        .into_iter()
        .map(|moved| moved.iter().zip(&at).map(|(moved, at)| moved - at).collect::<Residuals>());
    let change = changes.next()?;
    for answer in changes {
        for (columns, answer) in columns.iter_mut().zip(answer) {
            *columns = beside(columns, &DMatrix::from_columns(&[answer]));
        }
    }
    Some(least_cost(&free_parameters, &zeros, &change, &columns).max(0.0))
}
