//! What a missed answer was missed by: recordings that could not tell, or the method.

use nalgebra::{DMatrix, DVector};

use crate::effects::find;
use crate::parameters::{EffectSetting, Unit};
use crate::recording::Recording;
use crate::tuning::fit::{Bench, Misses, slopes, square};
use crate::tuning::knob::Knob;
use crate::tuning::noise::expected;
use crate::tuning::trial::Trial;

/// An effect at a size: its id, and as many of its parameters as are known, in their units.
pub type Sized<'a> = (&'a str, Vec<f64>);

/// What the recordings say of effects that an answer left out, in halves of a log-likelihood; none where the catalogue has no equation for one.
///
/// The effects are simulated at their size on top of the refitted unit. From what they change in the misses is taken off what the sheet's
/// tolerances could do instead, and what the effects could that the answer names, at the sizes that it gives them (projection: the gain in
/// likelihood that a perfect observer with the same equations could expect). Below
/// [`SEEN`](crate::diagnosis::decide::SEEN) nobody could have told from these recordings.
#[must_use]
pub fn told(recordings: Vec<Recording>, refitted: &Unit, hidden: &[Sized], answer: &[Sized]) -> Option<f64> {
    let with = |effects: &[Sized]| {
        effects.iter().try_fold(refitted.clone(), |mut unit, (id, known)| {
            let spec = find(id)?;
            let known = known.iter().copied().map(Some).chain(std::iter::repeat(None));
            let values = spec.parameters.iter().zip(known).map(|(spec, known)| known.unwrap_or(spec.typical)).collect();
            unit.effects.push(EffectSetting { id: spec.id.to_owned(), values });
            Some(unit)
        })
    };
    let wanted = with(hidden)?;
    let answers: Vec<Unit> = answer.iter().filter_map(|one| with(std::slice::from_ref(one))).collect();
    let trials = recordings.into_iter().map(Trial::new).collect();
    let bench = Bench::new(trials, refitted, &expected(&refitted.sensors));
    let knobs = Knob::nuisances(refitted);
    let zeros = vec![0.0; knobs.len()];
    let mut units = vec![refitted.clone(), wanted];
    units.extend(answers);
    let mut misses = bench.misses_of(&units).into_iter();
    let at = misses.next()?;
    let mut changes = misses.map(|moved| moved.iter().zip(&at).map(|(moved, at)| moved - at).collect::<Misses>());
    let change = changes.next()?;
    let mut columns = slopes(&bench, refitted, &knobs, &zeros, 0, &at);
    for answer in changes {
        for (columns, answer) in columns.iter_mut().zip(&answer) {
            let place = columns.ncols();
            *columns = std::mem::replace(columns, DMatrix::zeros(0, 0)).insert_column(place, 0.0);
            columns.set_column(place, answer);
        }
    }
    Some(left_by(&knobs, &change, &columns))
}

/// The square that is left of a change when all columns may follow it, those of the sheet's parameters at the price of their priors.
fn left_by(knobs: &[Knob], change: &Misses, columns: &[DMatrix<f64>]) -> f64 {
    let free = columns.first().map_or(0, DMatrix::ncols);
    let mut inner = DMatrix::identity(free, free) * 1e-9;
    let mut along = DVector::zeros(free);
    for (columns, change) in columns.iter().zip(change) {
        inner += columns.tr_mul(columns);
        along += columns.tr_mul(change);
    }
    for (k, _) in knobs.iter().enumerate().filter(|(_, knob)| knob.has_prior()) {
        inner[(k, k)] += 1.0;
    }
    let taken = inner.cholesky().map_or(0.0, |cholesky| along.dot(&cholesky.solve(&along)));
    (square(change) - taken).max(0.0)
}
