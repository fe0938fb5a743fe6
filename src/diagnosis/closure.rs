//! How far: the share of the gap that closes on data left out of the fit, with an interval from resampled blocks.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::diagnosis::outcome::Interval;
use crate::diagnosis::search::Model;
use crate::frame::Estimate;
use crate::signal::Signal;
use crate::tuning::fit::{Bench, Effort, fit, square};
use crate::tuning::knob::{Knob, unit_at};
use crate::tuning::linear::normal;
use crate::tuning::trial::Trial;

/// Length of a block, s: longer than what one miss has to do with the next.
const BLOCK_S: f64 = 2.0;

/// Resamplings behind an interval.
const RESAMPLINGS: usize = 400;

/// So many parts are left out in turn; every block of a recording belongs to the one after that of the block before it.
const PARTS: usize = 5;

/// Farthest that a fit may move when a part is left out, in units of a knob: one linear step is good for no more.
const FARTHEST: f64 = 2.0;

/// Share of what all recordings say of an effect that the others must say to fit it without one.
const TELLING: f64 = 0.2;

/// Steps of a fit without a recording, from the fit to all.
const REFIT: Effort = Effort { rounds: 4, refresh: 100, temperature: 1.0 };

/// Estimates by trial, each made by a fit that did not see it.
pub type LeftOut = Vec<Vec<Estimate>>;

/// Leaves out every fifth block of every recording at a time: what to expect of new recordings of the same processes.
///
/// A process may be over in seconds, so that a longer piece would be all that there is of it. With four fifths of every process at hand the fit
/// hardly moves, so that one Gauss–Newton step refits it.
#[must_use]
pub fn without_parts(bench: &Bench, model: &Model) -> LeftOut {
    let trials = 0..bench.trials.len();
    let mut estimates: LeftOut = trials.clone().map(|trial| bench.simulate(&model.unit(), trial)).collect();
    if model.fit.slopes.is_empty() {
        return estimates;
    }
    let (hessian, gradient) = normal(&model.knobs, &model.fit.positions, &model.fit.misses, &model.fit.slopes, 1.0);
    for part in 0..PARTS {
        let (mut hessian, mut gradient) = (hessian.clone(), gradient.clone());
        for (trial, (slope, misses)) in bench.trials.iter().zip(model.fit.slopes.iter().zip(&model.fit.misses)) {
            for place in 0..trial.signals().count() {
                for block in part_of(trial, part) {
                    let (first, count) = (trial.miss(place, block.start), block.len());
                    let rows = slope.rows(first, count);
                    hessian -= rows.tr_mul(&rows);
                    gradient -= rows.tr_mul(&misses.rows(first, count));
                }
            }
        }
        hessian += DMatrix::identity(model.knobs.len(), model.knobs.len()) * 1e-9;
        let Some(cholesky) = hessian.cholesky() else { continue };
        let unit = unit_at(&model.base, &model.knobs, &moved(model, &cholesky.solve(&gradient)));
        for trial in trials.clone() {
            let anew = bench.simulate(&unit, trial);
            for block in part_of(&bench.trials[trial], part) {
                estimates[trial][block.clone()].clone_from_slice(&anew[block]);
            }
        }
    }
    estimates
}

/// The samples of a part, block by block.
fn part_of(trial: &Trial, part: usize) -> impl Iterator<Item = Range<usize>> {
    let (samples, size) = (trial.samples.len(), trial.samples_in(BLOCK_S));
    (0..samples).step_by(size).map(move |start| start..(start + size).min(samples)).skip(part).step_by(PARTS)
}

/// Positions after a step that is shortened as a whole, since its parts make up for each other.
fn moved(model: &Model, step: &DVector<f64>) -> Vec<f64> {
    let share = (FARTHEST / step.amax().max(1e-12)).min(1.0);
    let knobs = model.knobs.iter().zip(&model.fit.positions).zip(step.iter());
    knobs
        .map(|((knob, position), step)| {
            let (low, high) = knob.range(&model.base);
            (position - share * step).clamp(low, high)
        })
        .collect()
}

/// A model judged on each recording by a fit without it.
#[derive(Clone, Debug)]
pub struct Refitted {
    /// Estimates by trial.
    pub estimates: LeftOut,
    /// Cost of the misses by trial.
    pub costs: Vec<f64>,
}

/// Leaves out each recording in turn and refits on the others; a single recording is judged by its own fit.
#[must_use]
pub fn without_recordings(bench: &Bench, model: &Model) -> Refitted {
    let count = bench.trials.len();
    let mut all = Refitted { estimates: Vec::with_capacity(count), costs: Vec::with_capacity(count) };
    for left in 0..count {
        let unit = if count == 1 { model.unit() } else { refitted_without(bench, model, left) };
        all.estimates.push(bench.simulate(&unit, left));
        all.costs.push(square(&vec![bench.misses(&unit, left)]));
    }
    all
}

fn refitted_without(bench: &Bench, model: &Model, left: usize) -> crate::parameters::Unit {
    // An effect of which the other recordings say next to nothing stays where the fit to all has it.
    let says = |trial: usize, knob: usize| model.fit.slopes[trial].column(knob).norm_squared();
    let (free, held): (Vec<usize>, Vec<usize>) = (0..model.knobs.len()).partition(|&k| {
        let all: f64 = (0..bench.trials.len()).map(|trial| says(trial, k)).sum();
        model.knobs[k].has_prior() || all - says(left, k) > TELLING * all
    });
    let pick = |of: &[usize]| -> (Vec<Knob>, Vec<f64>) {
        of.iter().map(|&k| (model.knobs[k], model.fit.positions[k])).unzip()
    };
    let (held_knobs, held_positions) = pick(&held);
    let base = unit_at(&model.base, &held_knobs, &held_positions);
    let (knobs, start) = pick(&free);
    let slopes: Vec<DMatrix<f64>> =
        (0..bench.trials.len()).filter(|&k| k != left).map(|k| model.fit.slopes[k].select_columns(&free)).collect();
    let found = fit(&bench.without(left), &base, &knobs, &start, REFIT, Some(&slopes));
    unit_at(&base, &knobs, &found.positions)
}

/// Squared misses of a signal in a trial over its noise, at each sample where it was measured: refitted, with effects.
fn squares(bench: &Bench, index: usize, signal: Signal, twins: [&LeftOut; 2]) -> Vec<Option<[f64; 2]>> {
    let floor = bench.floor_square(index, signal);
    let [Some(before), Some(after)] = twins.map(|twin| bench.squares(index, signal, &twin[index])) else {
        return Vec::new();
    };
    let over = before.iter().zip(&after).map(|(before, after)| [before / floor, after / floor]);
    over.map(|over| over.iter().all(|square| square.is_finite()).then_some(over)).collect()
}

/// Sums over both positions in blocks: squares refitted, squares with effects, noise.
///
/// Noise that a twin leaves less than is not there: the floor of a signal is what its transducer and chatter should leave, or what the better
/// twin does leave if that is less.
fn blocks(bench: &Bench, refitted: &LeftOut, with_effects: &LeftOut) -> Vec<Vec<[f64; 3]>> {
    let mut blocks: Vec<Vec<[f64; 3]>> = bench
        .trials
        .iter()
        .map(|trial| vec![[0.0; 3]; trial.samples.len().div_ceil(trial.samples_in(BLOCK_S))])
        .collect();
    for signal in Signal::POSITIONS {
        let all: Vec<_> =
            (0..bench.trials.len()).map(|index| squares(bench, index, signal, [refitted, with_effects])).collect();
        let there = || all.iter().flatten().flatten();
        let count = there().count() as f64;
        let least = [0, 1].map(|twin| there().map(|over| over[twin]).sum::<f64>() / count);
        let noise = least[0].min(least[1]).min(1.0);
        for (index, samples) in all.iter().enumerate() {
            let size = bench.trials[index].samples_in(BLOCK_S);
            for (k, over) in samples.iter().enumerate() {
                if let Some([before, after]) = over {
                    let block = &mut blocks[index][k / size];
                    block[0] += before;
                    block[1] += after;
                    block[2] += noise;
                }
            }
        }
    }
    blocks
}

fn ratio(sums: [f64; 3]) -> f64 {
    let gap = sums[0] - sums[2];
    if gap <= 0.0 { 0.0 } else { ((sums[0] - sums[1]) / gap).clamp(-1.0, 1.0) }
}

/// Closure `(MSE_refitted − MSE_effects) / (MSE_refitted − noise²)` with its 90 % interval.
///
/// Blocks are drawn with replacement within each trial, so that every process keeps its weight.
#[must_use]
pub fn closure(bench: &Bench, refitted: &LeftOut, with_effects: &LeftOut, seed: u64) -> Interval {
    closure_of(bench, refitted, with_effects, 0..bench.trials.len(), seed)
}

/// The same of some of the trials.
#[must_use]
pub fn closure_of(
    bench: &Bench,
    refitted: &LeftOut,
    with_effects: &LeftOut,
    trials: Range<usize>,
    seed: u64,
) -> Interval {
    let blocks = &blocks(bench, refitted, with_effects)[trials];
    let add = |sums: &mut [f64; 3], block: &[f64; 3]| sums.iter_mut().zip(block).for_each(|(sum, part)| *sum += part);
    let mut all = [0.0; 3];
    blocks.iter().flatten().for_each(|block| add(&mut all, block));
    let mut dice = ChaCha8Rng::seed_from_u64(seed);
    let mut ratios: Vec<f64> = (0..RESAMPLINGS)
        .map(|_| {
            let mut sums = [0.0; 3];
            for trial in blocks {
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
