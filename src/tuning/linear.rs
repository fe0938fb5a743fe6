//! The linear picture about a point: normal equations of misses and priors, and what they promise.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::tuning::fit::{Misses, prior_square, square};
use crate::tuning::knob::Knob;

/// A position whose slopes tell, for misses near it, the least cost that could be reached along them, to first order.
#[derive(Debug)]
pub struct Projection<'a> {
    knobs: &'a [Knob],
    positions: &'a [f64],
    slopes: &'a [DMatrix<f64>],
    temperature: f64,
    solver: Option<Cholesky<f64, Dyn>>,
}

impl<'a> Projection<'a> {
    /// Slopes and knobs may be of different number: knobs without a slope stay where they are, slopes without a knob are free.
    #[must_use]
    pub fn new(knobs: &'a [Knob], positions: &'a [f64], slopes: &'a [DMatrix<f64>], temperature: f64) -> Self {
        let n = slopes.first().map_or(0, DMatrix::ncols);
        let knobs = &knobs[..n.min(knobs.len())];
        let solver = (hessian(knobs, slopes, temperature) + DMatrix::identity(n, n) * 1e-9).cholesky();
        Self { knobs, positions, slopes, temperature, solver }
    }

    /// The least cost from these misses on.
    #[must_use]
    pub fn cost(&self, misses: &Misses) -> f64 {
        let cost = square(misses) / self.temperature + prior_square(self.knobs, self.positions);
        let gradient = gradient(self.knobs, self.positions, misses, self.slopes, self.temperature);
        self.solver.as_ref().map_or(cost, |solver| cost - gradient.dot(&solver.solve(&gradient)))
    }
}

/// Normal matrix and gradient, priors included; slopes behind those of the knobs have none.
#[must_use]
pub fn normal(
    knobs: &[Knob],
    positions: &[f64],
    misses: &Misses,
    slope: &[DMatrix<f64>],
    temperature: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    (hessian(knobs, slope, temperature), gradient(knobs, positions, misses, slope, temperature))
}

fn hessian(knobs: &[Knob], slopes: &[DMatrix<f64>], temperature: f64) -> DMatrix<f64> {
    let n = slopes.first().map_or(knobs.len(), DMatrix::ncols);
    let mut hessian = DMatrix::zeros(n, n);
    for slopes in slopes {
        hessian += slopes.tr_mul(slopes);
    }
    hessian /= temperature;
    for (k, _) in knobs.iter().enumerate().filter(|(_, knob)| knob.has_prior()) {
        hessian[(k, k)] += 1.0;
    }
    hessian
}

fn gradient(
    knobs: &[Knob],
    positions: &[f64],
    misses: &Misses,
    slopes: &[DMatrix<f64>],
    temperature: f64,
) -> DVector<f64> {
    let mut gradient = DVector::zeros(slopes.first().map_or(knobs.len(), DMatrix::ncols));
    for (slopes, misses) in slopes.iter().zip(misses) {
        gradient += slopes.tr_mul(misses);
    }
    gradient /= temperature;
    for (k, _) in knobs.iter().enumerate().filter(|(_, knob)| knob.has_prior()) {
        gradient[k] += positions[k];
    }
    gradient
}
