//! How far: the share of the gap that closes on processes left out of the fit, with an interval from resampled blocks.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::diagnosis::outcome::Interval;
use crate::diagnosis::search::Model;
use crate::frame::Estimate;
use crate::parameters::Unit;
use crate::signal::Signal;
use crate::tuning::fit::{Bench, square};
use crate::tuning::knob::unit_at;

/// Length of a block, s: longer than what one miss has to do with the next.
const BLOCK_S: f64 = 2.0;

/// Resamplings behind an interval.
const RESAMPLINGS: usize = 400;

/// Share of what all recordings say of an effect that the others must say to fit it without one.
const TELLING: f64 = 0.2;

/// What one trial says of a knob.
fn own(model: &Model, trial: usize, knob: usize) -> f64 {
    model.fit.slopes[trial].column(knob).norm_squared()
}

/// A model judged on each trial by a fit without it.
#[derive(Clone, Debug)]
pub struct HeldOut {
    /// Estimates by trial.
    pub estimates: Vec<Vec<Estimate>>,
    /// Cost of the misses by trial.
    pub costs: Vec<f64>,
}

/// Leaves out each trial in turn: a Gauss–Newton step from the fit to all, with the trial's own terms taken off.
#[must_use]
pub fn held_out(bench: &Bench, model: &Model) -> HeldOut {
    let n = model.knobs.len();
    let count = bench.trials.len();
    let mut held = HeldOut { estimates: Vec::with_capacity(count), costs: Vec::with_capacity(count) };
    for left in 0..count {
        let (mut hessian, mut gradient) = (DMatrix::<f64>::zeros(n, n), DVector::<f64>::zeros(n));
        for trial in (0..count).filter(|&trial| trial != left || count == 1) {
            let slope = &model.fit.slopes[trial];
            hessian += slope.tr_mul(slope);
            gradient += slope.tr_mul(&model.fit.misses[trial]);
        }
        for (k, knob) in model.knobs.iter().enumerate() {
            if knob.has_prior() {
                hessian[(k, k)] += 1.0;
                gradient[k] += model.fit.positions[k];
            } else if hessian[(k, k)] < TELLING * (hessian[(k, k)] + own(model, left, k)) {
                // An effect of which the other recordings say next to nothing stays where the fit to all has it.
                hessian[(k, k)] = f64::MAX.sqrt();
                gradient[k] = 0.0;
            }
        }
        let change = hessian.cholesky().map_or_else(|| DVector::zeros(n), |cholesky| cholesky.solve(&gradient));
        let unit = shortened(bench, model, &change, left);
        held.estimates.push(bench.simulate(&unit, left));
        held.costs.push(square(&vec![bench.misses(&unit, left)]));
    }
    held
}

/// The unit after that share of a step that suits the other trials best: one linear step is good for a few deviations only.
fn shortened(bench: &Bench, model: &Model, change: &DVector<f64>, left: usize) -> Unit {
    // Shortened as a whole: its parts make up for each other.
    let whole = (2.0 / change.amax().max(1e-12)).min(1.0);
    let at = |share: f64| -> Vec<f64> {
        let knobs = model.knobs.iter().zip(&model.fit.positions).zip(change.iter());
        knobs
            .map(|((knob, position), change)| {
                let (low, high) = knob.range(&model.base);
                (position - share * whole * change).clamp(low, high)
            })
            .collect()
    };
    let cost = |positions: &[f64]| -> f64 {
        let unit = unit_at(&model.base, &model.knobs, positions);
        let others = (0..bench.trials.len()).filter(|&trial| trial != left);
        let known = model.knobs.iter().zip(positions).filter(|(knob, _)| knob.has_prior());
        others.map(|trial| bench.misses(&unit, trial).norm_squared()).sum::<f64>()
            + known.map(|(_, p)| p * p).sum::<f64>()
    };
    let positions = [1.0, 0.5, 0.2, 0.0]
        .map(at)
        .into_iter()
        .map(|positions| (cost(&positions), positions))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map_or_else(|| model.fit.positions.clone(), |(_, positions)| positions);
    unit_at(&model.base, &model.knobs, &positions)
}

/// Squared misses of both positions over their noise, in blocks: refitted, with effects, noise.
fn blocks(bench: &Bench, refitted: &HeldOut, with_effects: &HeldOut) -> Vec<Vec<[f64; 3]>> {
    bench
        .trials
        .iter()
        .enumerate()
        .map(|(index, trial)| {
            let mut rows = Vec::new();
            let size = trial.samples_in(BLOCK_S);
            for start in (0..trial.samples.len()).step_by(size) {
                let mut sums = [0.0; 3];
                for k in start..(start + size).min(trial.samples.len()) {
                    let measured = &trial.frames[trial.samples[k]].measured;
                    for signal in [Signal::ServomotorPosition, Signal::SpoolPosition] {
                        let floor = bench.floor_square(index, signal);
                        let miss = |estimate: &Estimate| signal.of(measured) - signal.of(&estimate.signals);
                        let (before, after) =
                            (miss(&refitted.estimates[index][k]), miss(&with_effects.estimates[index][k]));
                        if before.is_finite() && after.is_finite() && floor > 0.0 {
                            sums[0] += before * before / floor;
                            sums[1] += after * after / floor;
                            sums[2] += 1.0;
                        }
                    }
                }
                rows.push(sums);
            }
            rows
        })
        .collect()
}

fn ratio(sums: [f64; 3]) -> f64 {
    let gap = sums[0] - sums[2];
    if gap <= 0.0 { 0.0 } else { ((sums[0] - sums[1]) / gap).clamp(-1.0, 1.0) }
}

/// Closure `(MSE_refitted − MSE_effects) / (MSE_refitted − noise²)` with its 90 % interval.
///
/// Blocks are drawn with replacement within each trial, so that every process keeps its weight.
#[must_use]
pub fn closure(bench: &Bench, refitted: &HeldOut, with_effects: &HeldOut, seed: u64) -> Interval {
    let blocks = blocks(bench, refitted, with_effects);
    let add = |sums: &mut [f64; 3], block: &[f64; 3]| sums.iter_mut().zip(block).for_each(|(sum, part)| *sum += part);
    let mut all = [0.0; 3];
    blocks.iter().flatten().for_each(|block| add(&mut all, block));
    let mut dice = ChaCha8Rng::seed_from_u64(seed);
    let mut ratios: Vec<f64> = (0..RESAMPLINGS)
        .map(|_| {
            let mut sums = [0.0; 3];
            for trial in &blocks {
                for _ in 0..trial.len() {
                    add(&mut sums, &trial[dice.random_range(0..trial.len())]);
                }
            }
            ratio(sums)
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    let value = ratio(all);
    let (low, high) = (ratios[RESAMPLINGS / 20], ratios[RESAMPLINGS - 1 - RESAMPLINGS / 20]);
    Interval { value, low: low.min(value), high: high.max(value) }
}
