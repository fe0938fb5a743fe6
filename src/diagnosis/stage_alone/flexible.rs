//! A flexible model of the servomotor stage without physics: what any law of spool and opening could explain, and what it leaves.
//!
//! The speed is a free broken line over the spool's position some time ago, plus a drift with the opening. What it leaves stands for the error
//! of equations where no data sheet says what to expect; what the transducers cannot show is told apart from it, from bends between neighbouring
//! samples alone.

use crate::likelihood::noise::SignalNoise;
use crate::stage_alone::plain::Plain;
use crate::stage_alone::run::{Lag, Run, SpoolLaw, solved, typical_s};

/// Samples for each corner of the broken line.
const SAMPLES_PER_CORNER: usize = 40;
/// Fewest and most corners.
const CORNERS: (usize, usize) = (2, 17);
/// Least noise that is believed, as a share of the movement: a recording is never exact.
const LEAST_NOISE: f64 = 2.0e-5;
/// Most that a step between values may stand for noise, as a share of the movement.
const MOST_STEP: f64 = 1e-3;
/// Share of a standard deviation below which a quarter of normal values lie, times the second difference's √6.
const QUIET_QUARTER: f64 = 0.319 * 2.449_489_742_783_178;

/// What the flexible model says of some recordings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Flexible {
    /// Share of the squared movement that the flexible model explains, 1 for all.
    pub explained: f64,
    /// What it leaves of the servomotor position: white from sample to sample, wandering from its free runs, in the opening's unit.
    pub noise: SignalNoise,
    /// RMS residual of a right model, due to the transducers alone: the servomotor's noise, and the spool's propagated, in the opening's unit.
    pub transducers: f64,
}

/// Greatest less least of all values.
fn span<'a>(values: impl Iterator<Item = &'a f64>) -> f64 {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(*v), high.max(*v)));
    high - low
}

/// Corners of the broken line: at even shares of the spool's samples, at the ends of the plain law's dead band, and where it saturates.
pub fn corners(runs: &[Run], law: &Plain) -> Vec<f64> {
    let mut spools: Vec<f64> = runs.iter().flat_map(|run| run.spool.iter().copied()).collect();
    spools.sort_by(f64::total_cmp);
    let count = spools.len();
    let corners = (count / SAMPLES_PER_CORNER).clamp(CORNERS.0, CORNERS.1);
    let even = (1..=corners).filter_map(|k| spools.get(k * count.saturating_sub(1) / (corners + 1)).copied());
    let bends = [law.half_band, law.half_band + law.saturates].into_iter().filter(|bend| bend.is_finite());
    even.chain(bends.flat_map(|bend| [law.zero - bend, law.zero + bend])).collect()
}

/// The broken line with these corners, and the drift with the opening.
pub fn broken_line(corners: &[f64]) -> impl Fn(f64, f64) -> Vec<f64> {
    move |spool, start| {
        let line = [1.0, spool, start].into_iter();
        line.chain(corners.iter().map(|corner| (spool - corner).max(0.0))).collect()
    }
}

/// Fits the model; none where the runs hold too little, or nothing moves.
pub fn flexible(runs: &[Run], law: &Plain) -> Option<Flexible> {
    let spools = || runs.iter().flat_map(|run| run.spool.iter());
    let count = spools().count();
    let moved: f64 = runs.iter().flat_map(|run| run.opening.iter().map(|y| (y - run.opening[0]).powi(2))).sum();
    let travel = span(runs.iter().flat_map(|run| run.opening.iter()));
    if runs.is_empty() || span(spools()) <= 0.0 || moved <= 0.0 {
        return None;
    }
    let corners = corners(runs, law);
    let shapes = broken_line(&corners);
    let (left, best, coefficients) = Lag::tried(typical_s(runs))
        .chain([law.lag])
        .filter_map(|lag| {
            let law = SpoolLaw { lag, settles_s: None, shapes: &shapes };
            let normals = law.normals(runs);
            let coefficients = solved(normals.iter())?;
            let left: f64 = normals.iter().map(|normal| normal.missed(&coefficients)).sum();
            Some((left, law, coefficients))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))?;
    let residuals: Vec<Vec<f64>> = runs.iter().map(|run| best.residuals(run, &coefficients)).collect();
    let white = white(runs.iter().map(|run| run.opening.as_slice()), travel);
    // Each coefficient takes a sample's worth of noise along.
    let freedom = count.saturating_sub(corners.len() + 4).max(1);
    Some(Flexible {
        explained: 1.0 - left / moved,
        noise: noise(runs, &residuals, left / freedom as f64, white),
        transducers: transducers(runs, law.above_1_s.abs().max(law.below_1_s.abs()), white),
    })
}

/// White noise of a channel, from the bends of its slowest quarter and from its steps; no less than what is believed of any that travels so far.
fn white<'a>(channels: impl Iterator<Item = &'a [f64]> + Clone, travel: f64) -> f64 {
    let bends = channels.clone().flat_map(|channel| channel.windows(3).map(|y| (y[0] - 2.0 * y[1] + y[2]).abs()));
    let mut bends: Vec<f64> = bends.collect();
    bends.sort_by(f64::total_cmp);
    let still = bends.get(bends.len() / 4).map_or(0.0, |bend| bend / QUIET_QUARTER);
    let steps = channels.flat_map(|channel| channel.windows(2).map(|y| (y[1] - y[0]).abs()));
    let step = steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
    let least = if step.is_finite() { step / 12.0_f64.sqrt() } else { 0.0 };
    still.max(least.min(MOST_STEP * travel)).max(LEAST_NOISE * travel)
}

/// Time between samples, s.
pub(crate) fn period_s(runs: &[Run]) -> f64 {
    let mut periods: Vec<f64> = runs.iter().flat_map(|run| run.time_s.windows(2).map(|two| two[1] - two[0])).collect();
    periods.sort_by(f64::total_cmp);
    periods.get(periods.len() / 2).copied().unwrap_or(0.1)
}

/// RMS residual of a right model over free runs: the servomotor's transducer at the sample and at the start, the spool's noise summed up, and
/// what the spool does between its samples, whose trapezoids are wrong by a twelfth of a step's change.
fn transducers(runs: &[Run], gain_1_s: f64, white: f64) -> f64 {
    let period_s = period_s(runs);
    let spools = || runs.iter().map(|run| run.spool.as_slice());
    let spool_white = self::white(spools(), span(spools().flatten()));
    let changes = || spools().flat_map(|spool| spool.windows(2).map(|two| (two[1] - two[0]).powi(2)));
    let change_square = changes().sum::<f64>() / changes().count().max(1) as f64;
    let summed = (gain_1_s * spool_white).powi(2) * period_s * 0.5 * typical_s(runs);
    let between = 2.0 * (gain_1_s * period_s / 12.0).powi(2) * change_square;
    (2.0 * white * white + summed + between).sqrt()
}

/// White noise as given, wandering from the residuals of free runs, of this mean square.
fn noise(runs: &[Run], residuals: &[Vec<f64>], mean_square: f64, white: f64) -> SignalNoise {
    let variance = (mean_square - white * white).max(0.25 * white * white);
    let products = residuals.iter().flat_map(|run| run.windows(2).map(|pair| pair[0] * pair[1]));
    let (alike, pairs) = products.fold((0.0, 0_usize), |(sum, count), product| (sum + product, count + 1));
    let likeness = (alike / pairs.max(1) as f64 / variance).clamp(0.1, 0.999);
    SignalNoise {
        white,
        chatter: 0.0,
        chatter_wander: 0.0,
        doubt: 0.0,
        wander: variance.sqrt(),
        wander_time_s: -period_s(runs) / likeness.ln(),
    }
}
