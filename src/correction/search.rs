//! The search for hyperparameters: Bayesian optimisation with a Gaussian process and expected improvement, and random search beside it.
//!
//! After Liu et al. 2025, section 3.2: `EI = (f⁺ − μ)·Φ(Z) + σ·φ(Z)`, `Z = (f⁺ − μ)/σ`, with `f⁺` the best loss so far and μ, σ the
//! process's word for a point. The process (Matérn 5/2, a length for each dimension) is egobox-gp's; this file is the only one that
//! knows it. It sees the logarithm of the loss, so that a few bad points do not hide differences among good ones.

use egobox_gp::correlation_models::Matern52Corr;
use egobox_gp::mean_models::ConstantMean;
use egobox_gp::{GaussianProcess, GpParams};
use linfa::Dataset;
use linfa::traits::Fit;
use ndarray::{Array1, Array2};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;
use statrs::distribution::{Continuous, ContinuousCDF, Normal};

/// Candidates among which expected improvement is highest: anywhere, and near the best points.
const ANYWHERE: usize = 1500;
const NEARBY: usize = 500;

type Surrogate = GaussianProcess<f64, ConstantMean, Matern52Corr>;

/// One hyperparameter.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Hyperparameter {
    /// The library's name for it.
    pub name: &'static str,
    /// The paper's group: complexity, regularisation or sampling.
    pub group: &'static str,
    /// Lowest and highest value, in its own unit.
    pub range: [f64; 2],
    /// Whether equal ratios count as equal steps.
    pub logarithmic: bool,
    /// Whether only whole numbers count.
    pub whole: bool,
}

impl Hyperparameter {
    /// The value at a place from 0 to 1.
    pub fn value(&self, place: f64) -> f64 {
        let [low, high] = self.range;
        let value = if self.logarithmic { low * (high / low).powf(place) } else { low + (high - low) * place };
        if self.whole { value.round() } else { value }
    }

    /// The place of a value.
    fn place(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        if self.logarithmic { (value / low).ln() / (high / low).ln() } else { (value - low) / (high - low) }
    }
}

/// One evaluation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// Values, one for each dimension.
    pub values: Vec<f64>,
    /// The value of the objective.
    pub loss: f64,
    /// Expected improvement of the loss's logarithm when it was chosen, `null` where chance chose; a ratio.
    pub expected_gain: Option<f64>,
}

/// The Gaussian process along one dimension, the others at the best point.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Slice {
    /// Name of the dimension.
    pub name: &'static str,
    /// Value, middle, and middle ± 2σ of the loss.
    pub points: Vec<[f64; 4]>,
}

/// The trial with the smallest loss; the first of equals.
pub fn best(trials: &[Evaluation]) -> Option<&Evaluation> {
    trials.iter().filter(|trial| trial.loss.is_finite()).min_by(|a, b| a.loss.total_cmp(&b.loss))
}

/// Draws points at random: `already` are the trials done, for going on where a search stopped.
///
/// # Errors
/// What the objective fails with.
pub fn random<E>(
    space: &[Hyperparameter],
    budget: usize,
    seed: u64,
    mut objective: impl FnMut(&[f64]) -> Result<f64, E>,
) -> Result<Vec<Evaluation>, E> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut trials = vec![];
    for _ in 0..budget {
        let values = anywhere(space, &mut random);
        trials.push(Evaluation { loss: objective(&values)?, values, expected_gain: None });
    }
    Ok(trials)
}

/// Draws `initial` points at random, then goes where improvement is expected most, until `budget` points are known.
///
/// Its first points are those of [`random`] with the same seed.
///
/// # Errors
/// What the objective fails with.
pub fn bayesian<E>(
    space: &[Hyperparameter],
    initial: usize,
    budget: usize,
    seed: u64,
    mut objective: impl FnMut(&[f64]) -> Result<f64, E>,
) -> Result<Vec<Evaluation>, E> {
    let mut trials = random(space, initial.min(budget), seed, &mut objective)?;
    let mut draws = ChaCha8Rng::seed_from_u64(seed ^ 0x5EED);
    while trials.len() < budget {
        let (values, expected_gain) = match next(space, &trials, &mut draws) {
            Some((values, gain)) => (values, Some(gain)),
            // Where no process fits, such as to losses that are all equal, chance goes on.
            None => (anywhere(space, &mut draws), None),
        };
        trials.push(Evaluation { loss: objective(&values)?, values, expected_gain });
    }
    Ok(trials)
}

fn anywhere(space: &[Hyperparameter], random: &mut ChaCha8Rng) -> Vec<f64> {
    space.iter().map(|dimension| dimension.value(random.random())).collect()
}

/// The most promising point.
fn next(space: &[Hyperparameter], trials: &[Evaluation], random: &mut ChaCha8Rng) -> Option<(Vec<f64>, f64)> {
    let process = fit(space, trials)?;
    let best = best(trials)?;
    let mut candidates: Vec<Vec<f64>> = (0..ANYWHERE).map(|_| anywhere(space, random)).collect();
    for k in 0..NEARBY {
        let width = if k % 2 == 0 { 0.1 } else { 0.03 };
        let near = |(dimension, value): (&Hyperparameter, &f64)| {
            let step: f64 = StandardNormal.sample(random);
            dimension.value((dimension.place(*value) + width * step).clamp(0.0, 1.0))
        };
        candidates.push(space.iter().zip(&best.values).map(near).collect());
    }
    candidates.retain(|values| trials.iter().all(|trial| trial.values != *values));
    let (means, variances) = predict(&process, space, &candidates)?;
    let gains =
        means.iter().zip(&variances).map(|(mean, variance)| expected_gain(best.loss.ln(), *mean, variance.sqrt()));
    let (at, gain) = gains.enumerate().filter(|(_, gain)| gain.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some((candidates.swap_remove(at), gain))
}

/// Expected improvement on `best`, for a loss.
fn expected_gain(best: f64, mean: f64, spread: f64) -> f64 {
    let Ok(normal) = Normal::new(0.0, 1.0) else { return 0.0 };
    if spread > 0.0 {
        let z = (best - mean) / spread;
        (best - mean) * normal.cdf(z) + spread * normal.pdf(z)
    } else {
        0.0
    }
}

fn places(space: &[Hyperparameter], points: &[Vec<f64>]) -> Array2<f64> {
    let place = |(row, column): (usize, usize)| space[column].place(points[row][column]);
    Array2::from_shape_fn((points.len(), space.len()), place)
}

fn fit(space: &[Hyperparameter], trials: &[Evaluation]) -> Option<Surrogate> {
    let known: Vec<&Evaluation> = trials.iter().filter(|trial| trial.loss > 0.0 && trial.loss.is_finite()).collect();
    let points: Vec<Vec<f64>> = known.iter().map(|trial| trial.values.clone()).collect();
    let losses: Array1<f64> = known.iter().map(|trial| trial.loss.ln()).collect();
    let spread = losses.iter().fold(f64::NEG_INFINITY, |high, loss| high.max(*loss))
        - losses.iter().fold(f64::INFINITY, |low, loss| low.min(*loss));
    if known.len() < 3 || spread < 1e-12 {
        return None;
    }
    let data = Dataset::new(places(space, &points), losses);
    // Losses of trees jump a little from point to point: the nugget takes it. Several starts are seeded, a single one is not.
    let process = GpParams::new(ConstantMean::default(), Matern52Corr::default()).n_start(4).nugget(1e-6);
    process.fit(&data).ok()
}

fn predict(process: &Surrogate, space: &[Hyperparameter], points: &[Vec<f64>]) -> Option<(Vec<f64>, Vec<f64>)> {
    let places = places(space, points);
    let means = process.predict(&places).ok()?;
    let variances = process.predict_var(&places).ok()?;
    Some((means.to_vec(), variances.iter().map(|variance| variance.max(0.0)).collect()))
}

/// What the process makes of all trials, along each dimension through the best point; empty where none fits.
pub fn slices(space: &[Hyperparameter], trials: &[Evaluation]) -> Vec<Slice> {
    let (Some(process), Some(best)) = (fit(space, trials), best(trials)) else { return vec![] };
    let along = |index: usize| {
        let place = |step: u32| f64::from(step) / 60.0;
        let mut values: Vec<f64> = (0..=60).map(|step| space[index].value(place(step))).collect();
        values.dedup();
        let points: Vec<Vec<f64>> = values
            .iter()
            .map(|value| {
                let mut point = best.values.clone();
                point[index] = *value;
                point
            })
            .collect();
        let (means, variances) = predict(&process, space, &points)?;
        let said = values.iter().zip(means.iter().zip(&variances)).map(|(value, (mean, variance))| {
            let two = 2.0 * variance.sqrt();
            [*value, mean.exp(), (mean - two).exp(), (mean + two).exp()]
        });
        Some(Slice { name: space[index].name, points: said.collect() })
    };
    (0..space.len()).filter_map(along).collect()
}

#[cfg(test)]
mod tests {
    use std::convert::Infallible;

    use approx::assert_relative_eq;

    use super::{Hyperparameter, bayesian, best, expected_gain, random, slices};

    const SPACE: [Hyperparameter; 3] = [
        Hyperparameter { name: "a", group: "x", range: [0.001, 1.0], logarithmic: true, whole: false },
        Hyperparameter { name: "b", group: "x", range: [-2.0, 2.0], logarithmic: false, whole: false },
        Hyperparameter { name: "c", group: "y", range: [1.0, 40.0], logarithmic: false, whole: true },
    ];

    /// A bowl with its bottom, 0.1, at a = 0.03, b = 0.7, c = 11.
    #[expect(clippy::unnecessary_wraps, reason = "the search takes objectives that may fail")]
    fn bowl(values: &[f64]) -> Result<f64, Infallible> {
        let a = (values[0] / 0.03).ln() / 7.0;
        Ok(0.1 + a * a + (values[1] - 0.7).powi(2) / 16.0 + ((values[2] - 11.0) / 40.0).powi(2))
    }

    #[test]
    fn it_finds_the_bottom_and_chance_does_not() {
        for seed in 1..4 {
            let guided = bayesian(&SPACE, 8, 30, seed, bowl).unwrap();
            let chance = random(&SPACE, 30, seed, bowl).unwrap();
            assert_eq!(guided[..8], chance[..8]);
            let (guided, chance) = (best(&guided).unwrap().loss - 0.1, best(&chance).unwrap().loss - 0.1);
            assert!(guided < 0.002 && guided < 0.5 * chance, "seed {seed}: {guided} against {chance}");
        }
    }

    #[test]
    fn the_same_seed_gives_the_same_trace_within_the_ranges() {
        let trials = bayesian(&SPACE, 5, 15, 3, bowl).unwrap();
        assert_eq!(trials, bayesian(&SPACE, 5, 15, 3, bowl).unwrap());
        for trial in &trials {
            assert!(SPACE.iter().zip(&trial.values).all(|(dimension, value)| {
                let [low, high] = dimension.range;
                *value >= low * 0.999_999 && *value <= high * 1.000_001 && (!dimension.whole || value.fract() == 0.0)
            }));
        }
        assert!(trials[5..].iter().all(|trial| trial.expected_gain.is_some_and(|gain| gain >= 0.0)));
    }

    #[test]
    fn the_slices_show_the_bowl() {
        let trials = bayesian(&SPACE, 8, 30, 1, bowl).unwrap();
        let slices = slices(&SPACE, &trials);
        assert_eq!(slices.len(), 3);
        let lowest = slices[1].points.iter().min_by(|a, b| a[1].total_cmp(&b[1])).unwrap();
        assert!((lowest[0] - 0.7).abs() < 0.3, "{lowest:?}");
        assert!(slices[1].points.iter().all(|[_, middle, low, high]| low <= middle && middle <= high));
    }

    #[test]
    fn expected_improvement_in_closed_form() {
        // At the best loss itself: σ·φ(0). Far better: the distance. Known exactly: nothing.
        assert_relative_eq!(expected_gain(1.0, 1.0, 0.5), 0.5 / (2.0 * std::f64::consts::PI).sqrt(), epsilon = 1e-12);
        assert_relative_eq!(expected_gain(1.0, -9.0, 0.1), 10.0, epsilon = 1e-9);
        assert_eq!(expected_gain(1.0, 0.0, 0.0), 0.0);
    }

    #[test]
    fn losses_that_are_all_equal_are_no_trouble() {
        let trials = bayesian(&SPACE, 4, 8, 1, |_| Ok::<_, Infallible>(1.0)).unwrap();
        assert_eq!(trials.len(), 8);
        assert!(slices(&SPACE, &trials).is_empty());
    }
}
