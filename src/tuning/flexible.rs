//! A flexible model of the servomotor stage without physics: what any law of spool and opening could explain, and what it leaves.
//!
//! The speed is a free broken line over the spool's position some samples ago, plus a drift with the opening. It is linear in its
//! coefficients, also in free runs, so that its best fit is found at once. What it leaves stands for noise where no data
//! sheet gives one (the output-error form: Ljung 1999, *System Identification*, section 4.2).

use nalgebra::{DMatrix, DVector};

use crate::signal::Signal;
use crate::tuning::noise::SignalNoise;
use crate::tuning::trial::Trial;
use crate::units::seconds_from_nanos;

/// Delays of the spool that are tried, samples.
const DELAYS: [usize; 7] = [0, 1, 2, 3, 5, 8, 12];
/// Samples for each corner of the broken line.
const SAMPLES_PER_CORNER: usize = 60;
/// Fewest and most corners.
const CORNERS: (usize, usize) = (2, 9);
/// Least noise that is believed, pu: a recording is never exact.
const LEAST_NOISE_PU: f64 = 2.0e-5;

/// What the flexible model says of some recordings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flexible {
    /// Speed per spool position of the best straight law, pu of stroke per second and pu of spool.
    pub gain_1_s: f64,
    /// Whether opening is faster than closing at the same spool position.
    pub opens_faster: bool,
    /// Greatest spool position either way, pu.
    pub farthest_spool_pu: f64,
    /// Share of the squared movement that the flexible model explains, 1 for all.
    pub explained: f64,
    /// Noise of the servomotor position: white from sample to sample, wandering from what the flexible model leaves.
    pub noise: SignalNoise,
}

/// One trial as the model sees it.
struct Run {
    step_s: Vec<f64>,
    spool_pu: Vec<f64>,
    opening_pu: Vec<f64>,
}

impl Run {
    fn of(trial: &Trial) -> Self {
        let whole: Vec<_> = trial
            .samples
            .iter()
            .map(|&row| &trial.frames[row])
            .filter(|frame| {
                frame.measured.servomotor_position_pu.is_finite() && frame.measured.spool_position_pu.is_finite()
            })
            .collect();
        Self {
            step_s: whole.windows(2).map(|pair| seconds_from_nanos(pair[1].time_ns - pair[0].time_ns)).collect(),
            spool_pu: whole.iter().map(|frame| Signal::SpoolPosition.of(&frame.measured)).collect(),
            opening_pu: whole.iter().map(|frame| Signal::ServomotorPosition.of(&frame.measured)).collect(),
        }
    }

    /// Movement since the start by each shape of speed, and the movement that was measured.
    fn movement(&self, delay: usize, shapes: &dyn Fn(f64, f64) -> Vec<f64>) -> (Vec<Vec<f64>>, Vec<f64>) {
        let mut rows = Vec::with_capacity(self.step_s.len());
        let mut sum: Vec<f64> = Vec::new();
        for (k, step_s) in self.step_s.iter().enumerate() {
            let spool_pu = |k: usize| self.spool_pu[k.saturating_sub(delay)];
            let speeds = shapes(0.5 * (spool_pu(k) + spool_pu(k + 1)), self.opening_pu[0]);
            sum.resize(speeds.len(), 0.0);
            for (sum, speed) in sum.iter_mut().zip(speeds) {
                *sum += step_s * speed;
            }
            rows.push(sum.clone());
        }
        (rows, self.opening_pu.iter().skip(1).map(|opening| opening - self.opening_pu[0]).collect())
    }
}

/// The least squares of movements over shapes: coefficients, misses run by run.
fn solved(runs: &[Run], delay: usize, shapes: &dyn Fn(f64, f64) -> Vec<f64>) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
    let parts: Vec<_> = runs.iter().map(|run| run.movement(delay, shapes)).collect();
    let width = parts.iter().find_map(|(rows, _)| rows.first()).map(Vec::len)?;
    let (mut hessian, mut gradient) = (DMatrix::<f64>::zeros(width, width), DVector::<f64>::zeros(width));
    for (rows, movement) in &parts {
        for (row, moved) in rows.iter().zip(movement) {
            let row = DVector::from_column_slice(row);
            gradient += *moved * &row;
            hessian.ger(1.0, &row, &row, 1.0);
        }
    }
    let ridge = 1e-9 * hessian.trace().max(f64::MIN_POSITIVE);
    let best = (hessian + DMatrix::identity(width, width) * ridge).cholesky()?.solve(&gradient);
    let misses = parts.iter().map(|(rows, movement)| {
        let said = |row: &[f64]| row.iter().zip(best.iter()).map(|(a, b)| a * b).sum::<f64>();
        movement.iter().zip(rows).map(|(moved, row)| moved - said(row)).collect()
    });
    let misses: Vec<Vec<f64>> = misses.collect();
    Some((best.iter().copied().collect(), misses))
}

fn sum_of_squares(misses: &[Vec<f64>]) -> f64 {
    misses.iter().flatten().map(|miss| miss * miss).sum()
}

/// Fits the model to trials that hold spool and servomotor position; none where they hold too little, or nothing moves.
#[must_use]
pub fn flexible(trials: &[Trial]) -> Option<Flexible> {
    let runs: Vec<Run> = trials.iter().map(Run::of).filter(|run| run.spool_pu.len() > 2).collect();
    let mut spools: Vec<f64> = runs.iter().flat_map(|run| run.spool_pu.iter().copied()).collect();
    spools.sort_by(f64::total_cmp);
    let count = spools.len();
    let farthest_spool_pu = spools.first()?.abs().max(spools.last()?.abs());
    let moved: f64 = runs.iter().flat_map(|run| run.opening_pu.iter().map(|y| (y - run.opening_pu[0]).powi(2))).sum();
    if farthest_spool_pu == 0.0 || moved == 0.0 {
        return None;
    }
    let (straight, _) = solved(&runs, 0, &|spool_pu, _| vec![spool_pu, 1.0])?;
    let (both_ways, _) = solved(&runs, 0, &|spool_pu, _| vec![spool_pu.max(0.0), spool_pu.min(0.0)])?;
    let corners = (count / SAMPLES_PER_CORNER).clamp(CORNERS.0, CORNERS.1);
    let at: Vec<f64> = (1..=corners).map(|k| spools[k * (count - 1) / (corners + 1)]).collect();
    let shapes = |spool_pu: f64, start_pu: f64| {
        let line = [1.0, spool_pu, start_pu].into_iter();
        line.chain(at.iter().map(|corner| (spool_pu - corner).max(0.0))).collect::<Vec<f64>>()
    };
    let (_, misses) = DELAYS
        .into_iter()
        .filter_map(|delay| solved(&runs, delay, &shapes))
        .min_by(|a, b| sum_of_squares(&a.1).total_cmp(&sum_of_squares(&b.1)))?;
    let left = sum_of_squares(&misses);
    // Each coefficient takes a sample's worth of noise along.
    let freedom = count.saturating_sub(corners + 4).max(1);
    Some(Flexible {
        gain_1_s: straight[0],
        opens_faster: both_ways[0].abs() > both_ways[1].abs(),
        farthest_spool_pu,
        explained: 1.0 - left / moved,
        noise: noise(&runs, &misses, freedom),
    })
}

/// White noise from the bends of the slowest half, wandering from the misses of free runs.
fn noise(runs: &[Run], misses: &[Vec<f64>], freedom: usize) -> SignalNoise {
    let bends = runs.iter().flat_map(|run| run.opening_pu.windows(3).map(|y| (y[0] - 2.0 * y[1] + y[2]).abs()));
    let mut bends: Vec<f64> = bends.collect();
    bends.sort_by(f64::total_cmp);
    // The variance of a second difference is six times that of one sample.
    let still = bends.get(bends.len() / 4).map_or(0.0, |bend| bend / (0.319 * 6.0_f64.sqrt()));
    let steps = runs.iter().flat_map(|run| run.opening_pu.windows(2).map(|y| (y[1] - y[0]).abs()));
    let step = steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
    let least = if step.is_finite() { step / 12.0_f64.sqrt() } else { 0.0 };
    let white = still.max(least.min(1e-3)).max(LEAST_NOISE_PU);
    let variance = (sum_of_squares(misses) / freedom as f64 - white * white).max(0.25 * white * white);
    let products = misses.iter().flat_map(|run| run.windows(2).map(|pair| pair[0] * pair[1]));
    let (alike, pairs) = products.fold((0.0, 0_usize), |(sum, count), product| (sum + product, count + 1));
    let likeness = (alike / pairs.max(1) as f64 / variance).clamp(0.1, 0.999);
    let mut periods: Vec<f64> = runs.iter().flat_map(|run| run.step_s.iter().copied()).collect();
    periods.sort_by(f64::total_cmp);
    let period_s = periods.get(periods.len() / 2).copied().unwrap_or(0.1);
    SignalNoise {
        white,
        chatter: 0.0,
        chatter_wander: 0.0,
        doubt: 0.0,
        wander: variance.sqrt(),
        wander_time_s: -period_s / likeness.ln(),
    }
}
