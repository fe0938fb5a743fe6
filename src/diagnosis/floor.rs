//! What a right model leaves: noise, and a little more, since no equation is exact.

use nalgebra::DVector;

use crate::diagnosis::model::Model;
use crate::diagnosis::rivals::Found;
use crate::signal::Signal;
use crate::tuning::bench::Bench;
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
            let (mut squares, out_of_step) = squares_left(bench, &found.best, signal);
            squares.sort_by(f64::total_cmp);
            let median = squares.get(squares.len() / 2).copied().unwrap_or(0.0);
            (median / MEDIAN_SQUARE).clamp(CALM / ALIKE, LOUDEST * CALM / ALIKE) * squares.len() as f64 + out_of_step
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

/// Squares of what a model leaves of one signal where it was measured, and their sum where the signal swings of itself: no model is in step there, so
/// that nothing less is to be expected of a right one.
fn squares_left(bench: &Bench, model: &Model, signal: Signal) -> (Vec<f64>, f64) {
    let (mut calm, mut out_of_step) = (Vec::new(), 0.0);
    for (index, (trial, misses)) in bench.trials.iter().zip(&model.fit.misses).enumerate() {
        let (Some(place), Some(swinging)) = (trial.place(signal), bench.swinging_samples(index, signal)) else {
            continue;
        };
        let of_signal = misses.rows(trial.miss(place, 0), trial.samples.len());
        for (miss, swinging) in of_signal.iter().zip(swinging).filter(|(miss, _)| **miss != 0.0) {
            if swinging {
                out_of_step += miss * miss;
            } else {
                calm.push(miss * miss);
            }
        }
    }
    (calm, out_of_step)
}

/// How many of a model's misses are of swings.
fn swings(bench: &Bench, model: &Model) -> usize {
    let of = |(trial, misses): (&Trial, &DVector<f64>)| misses.len() - trial.miss(trial.signals().count(), 0);
    bench.trials.iter().zip(&model.fit.misses).map(of).sum()
}
