//! What a right model leaves: noise, and a little more, since no equation is exact.

use nalgebra::DVector;

use crate::diagnosis::model::Model;
use crate::diagnosis::rivals::Found;
use crate::signal::Signal;
use crate::tuning::fit::Bench;
use crate::tuning::noise::ALIKE;
use crate::tuning::trial::Trial;
use crate::twin::Cut;

/// Cost per sample of a sound unit: the noise model is a little generous.
///
/// Measured on sound units of the battery and of `practice` at 100 Hz.
const CALM: f64 = 0.64;

/// The noise is taken to be louder than the sheet's by this factor at most, in squares.
const LOUDEST: f64 = 2.5;

/// By how much a right model may leave more than the noise, as a share of the floor: no equation is exact, and between slow samples nobody knows the
/// inputs. Measured on the generated battery of seed 77.
pub const LEEWAY: (f64, f64) = (0.15, 1.5);

/// Median of the squares of normal values of unit size.
const MEDIAN_SQUARE: f64 = 0.4549;

/// The cost that a right model would have.
#[must_use]
pub fn floor(bench: &Bench, found: &Found) -> f64 {
    // How loud chatter is differs from unit to unit: the median of what the best model leaves knows it, whatever happens now and then.
    let quiet: f64 = Signal::ALL
        .into_iter()
        .map(|signal| {
            let mut squares = squares_left(bench, &found.best, signal);
            squares.sort_by(f64::total_cmp);
            let median = squares.get(squares.len() / 2).copied().unwrap_or(0.0);
            (median / MEDIAN_SQUARE).clamp(CALM / ALIKE, LOUDEST * CALM / ALIKE) * squares.len() as f64
        })
        .sum();
    let quiet = quiet + CALM / ALIKE * swings(bench, &found.best) as f64;
    let leeway = |trial: &Trial| match trial.cut {
        Cut::None if trial.is_slow() => LEEWAY.1,
        Cut::None => LEEWAY.0,
        _ => 0.0,
    };
    let leeway = bench.trials.iter().map(leeway).fold(0.0, f64::max);
    found.beyond().min((1.0 + leeway) * quiet)
}

/// Squares of what a model leaves of one signal, where it was measured.
fn squares_left(bench: &Bench, model: &Model, signal: Signal) -> Vec<f64> {
    let mut squares = Vec::new();
    for (trial, misses) in bench.trials.iter().zip(&model.fit.misses) {
        let Some(place) = trial.place(signal) else { continue };
        let of_signal = misses.rows(trial.miss(place, 0), trial.samples.len());
        squares.extend(of_signal.iter().filter(|miss| **miss != 0.0).map(|miss| miss * miss));
    }
    squares
}

/// How many of a model's misses are of swings.
fn swings(bench: &Bench, model: &Model) -> usize {
    let of = |(trial, misses): (&Trial, &DVector<f64>)| misses.len() - trial.miss(trial.signals().count(), 0);
    bench.trials.iter().zip(&model.fit.misses).map(of).sum()
}
