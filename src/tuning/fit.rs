//! Bounded, prior-weighted least squares over simulations: Gauss–Newton with Levenberg's damping.

use nalgebra::DMatrix;

use crate::parameters::Unit;
use crate::tuning::bench::{Bench, Misses, square};
use crate::tuning::descent::{correct, step};
use crate::tuning::knob::{Knob, unit_at};
use crate::tuning::linear::normal;

/// Step of a forward difference, in units of a knob.
pub const DIFFERENCE: f64 = 0.05;

/// A fit: positions of the knobs, what it cost, and the local picture around it.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Position of each knob.
    pub positions: Vec<f64>,
    /// Sum of squares of the misses.
    pub square: f64,
    /// Sum of squares of the priors.
    pub prior: f64,
    /// Misses at the positions.
    pub misses: Misses,
    /// Change of the misses per unit of each knob, by trial.
    pub slopes: Vec<DMatrix<f64>>,
}

impl Fit {
    /// Squares of misses and priors together.
    #[must_use]
    pub fn cost(&self) -> f64 {
        self.square + self.prior
    }
}

/// Two sets of slopes of one trial as one.
#[must_use]
pub fn beside(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut both = DMatrix::zeros(a.nrows(), a.ncols() + b.ncols());
    both.columns_mut(0, a.ncols()).copy_from(a);
    both.columns_mut(a.ncols(), b.ncols()).copy_from(b);
    both
}

/// Slopes of the misses about a position, by every knob from the `first` on.
#[must_use]
pub fn slopes(
    bench: &Bench,
    base: &Unit,
    knobs: &[Knob],
    positions: &[f64],
    first: usize,
    at: &Misses,
) -> Vec<DMatrix<f64>> {
    let mut steps = Vec::with_capacity(knobs.len());
    let units: Vec<Unit> = (first..knobs.len())
        .map(|k| {
            let mut moved = positions.to_vec();
            let step = if positions[k] + DIFFERENCE > knobs[k].range(base).1 { -DIFFERENCE } else { DIFFERENCE };
            moved[k] += step;
            steps.push(step);
            unit_at(base, knobs, &moved)
        })
        .collect();
    let moved = bench.misses_of(&units);
    (0..at.len())
        .map(|trial| {
            let mut slope = DMatrix::zeros(at[trial].len(), steps.len());
            for (k, step) in steps.iter().enumerate() {
                slope.set_column(k, &((&moved[k][trial] - &at[trial]) / *step));
            }
            slope
        })
        .collect()
}

/// Sum of squares of the distances from what is likeliest beforehand, in standard deviations.
#[must_use]
pub fn prior_square(knobs: &[Knob], positions: &[f64]) -> f64 {
    let distance = |(knob, position): (&Knob, &f64)| Some(position - knob.prior_centre()?);
    knobs.iter().zip(positions).filter_map(distance).map(|distance| distance * distance).sum()
}

/// Dampings tried side by side, as multiples of the current one.
const DAMPINGS: [f64; 4] = [1.0, 30.0, 1.0e3, 3.0e4];

/// How much work a fit may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Steps at most.
    pub rounds: usize,
    /// All slopes are measured anew after so many steps; between, they are corrected by what the steps showed.
    pub refresh: usize,
    /// By what the squares of the misses are divided: above 1, what is known beforehand weighs more. A fit that cools from a high
    /// temperature gives a strange parameter its due before it stretches familiar ones beyond what the sheet allows.
    pub temperature: f64,
}

impl Effort {
    /// Enough to tell whether a model is worth more.
    pub const SCOUT: Self = Self { rounds: 3, refresh: 100, temperature: 1.0 };
    /// Enough for the figures of a report.
    pub const FULL: Self = Self { rounds: 9, refresh: 3, temperature: 1.0 };
}

/// Fits the knobs from a start.
///
/// `known` are slopes for the leading knobs, good enough to begin with, which saves most of the work. Between measurements the
/// slopes follow Broyden (1965): the least change that agrees with the step just made.
#[must_use]
pub fn fit(
    bench: &Bench,
    base: &Unit,
    knobs: &[Knob],
    start: &[f64],
    effort: Effort,
    known: Option<&[DMatrix<f64>]>,
) -> Fit {
    let mut positions = start.to_vec();
    let mut misses = bench.misses_of(&[unit_at(base, knobs, &positions)]).pop().unwrap_or_default();
    let mut slope = match known {
        None => slopes(bench, base, knobs, &positions, 0, &misses),
        Some(known) => {
            let kept = known.first().map_or(0, DMatrix::ncols);
            let fresh = slopes(bench, base, knobs, &positions, kept, &misses);
            known.iter().zip(&fresh).map(|(a, b)| beside(a, b)).collect()
        }
    };
    let mut cost = square(&misses) / effort.temperature + prior_square(knobs, &positions);
    let mut damping = 1e-3;
    let mut fresh = known.is_none();
    let mut age = 0;
    for _ in 0..effort.rounds {
        let (hessian, gradient) = normal(knobs, &positions, &misses, &slope, effort.temperature);
        let mut gain = 0.0;
        // All dampings at once: units side by side cost little more than one.
        let dampings = DAMPINGS.map(|times| times * damping);
        let candidates = dampings.map(|damping| step(base, knobs, &positions, &hessian, &gradient, damping));
        let tried = bench.misses_of(&candidates.each_ref().map(|candidate| unit_at(base, knobs, candidate)));
        let totals: Vec<f64> = tried
            .iter()
            .zip(&candidates)
            .map(|(misses, candidate)| square(misses) / effort.temperature + prior_square(knobs, candidate))
            .collect();
        let best = (0..totals.len()).min_by(|&a, &b| totals[a].total_cmp(&totals[b])).unwrap_or(0);
        // The shortest step says most about the slopes here, and the one taken is learned of last.
        for k in (0..totals.len()).filter(|&k| k != best).chain([best]) {
            correct(&mut slope, &positions, &candidates[k], &misses, &tried[k]);
        }
        if totals[best] < cost {
            gain = cost - totals[best];
            (positions, misses, cost) = (candidates[best].clone(), tried[best].clone(), totals[best]);
            damping = (0.1 * dampings[best]).max(1e-6);
        } else {
            damping *= 1000.0;
        }
        age += 1;
        let small = gain <= 1e-2 + 1e-6 * cost;
        if small && (fresh || effort.refresh > effort.rounds) {
            break;
        }
        fresh = false;
        if small || age >= effort.refresh {
            slope = slopes(bench, base, knobs, &positions, 0, &misses);
            (fresh, age, damping) = (true, 0, 1e-3);
        } else if let Some(kept) = known.and_then(<[_]>::first).map(DMatrix::ncols) {
            // An effect's own slopes bend most and are few.
            let tail = slopes(bench, base, knobs, &positions, kept, &misses);
            for (slope, tail) in slope.iter_mut().zip(&tail) {
                slope.columns_mut(kept, tail.ncols()).copy_from(tail);
            }
        }
    }
    Fit { square: square(&misses), prior: prior_square(knobs, &positions), positions, misses, slopes: slope }
}
