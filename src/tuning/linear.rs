//! The linear picture about a point: normal equations of misses and priors, and what they promise.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::tuning::bench::{Misses, square};
use crate::tuning::knob::Knob;

/// Sum of squares of the distances from what is likeliest beforehand, in standard deviations.
#[must_use]
pub fn prior_square(knobs: &[Knob], positions: &[f64]) -> f64 {
    let distance = |(knob, position): (&Knob, &f64)| Some(position - knob.prior_centre()?);
    knobs.iter().zip(positions).filter_map(distance).map(|distance| distance * distance).sum()
}

/// A parameter of whose mark less than this share is its own is taken for a mixture of others.
const ALIKE: f64 = 1e-4;

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
        self.least(misses, &self.gradient(misses))
    }

    fn gradient(&self, misses: &Misses) -> DVector<f64> {
        gradient(self.knobs, self.positions, misses, self.slopes, self.temperature)
    }

    fn least(&self, misses: &Misses, gradient: &DVector<f64>) -> f64 {
        let cost = square(misses) / self.temperature + prior_square(self.knobs, self.positions);
        self.solver.as_ref().map_or(cost, |solver| cost - gradient.dot(&solver.solve(gradient)))
    }

    /// The least cost from these misses on, where a parameter besides may go from nothing to `most`; `along` are the misses' changes per unit of it.
    ///
    /// This is the score test of a parameter at nothing with all others fitted along (Rao 1948), its step held inside the range.
    #[must_use]
    pub fn cost_along(&self, misses: &Misses, along: &Misses, most: f64) -> f64 {
        let gradient_here = self.gradient(misses);
        let cost = self.least(misses, &gradient_here);
        let Some(solver) = &self.solver else { return cost };
        let shared = gradient(&[], &[], along, self.slopes, self.temperature);
        let follow = solver.solve(&shared);
        let own = |misses: &Misses| {
            along.iter().zip(misses).map(|(along, misses)| along.dot(misses)).sum::<f64>() / self.temperature
        };
        let score = own(misses) - follow.dot(&gradient_here);
        let curvature = own(along) - follow.dot(&shared);
        // What the others can do as well has no step of its own.
        if curvature <= ALIKE * own(along) {
            return cost;
        }
        let step = (-score / curvature / most).clamp(0.0, 1.0) * most;
        cost + 2.0 * score * step + curvature * step * step
    }
}

/// Rows of a block that stays in the cache.
const BLOCK_ROWS: usize = 1024;

/// `aᵀ b` of tall matrices, block by block: nalgebra's `tr_mul` multiplies column by column, ten times slower here.
#[must_use]
pub fn crossed(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut product = DMatrix::zeros(a.ncols(), b.ncols());
    for first in (0..a.nrows()).step_by(BLOCK_ROWS) {
        let count = BLOCK_ROWS.min(a.nrows() - first);
        product.gemm(1.0, &a.rows(first, count).transpose(), &b.rows(first, count), 1.0);
    }
    product
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
        hessian += crossed(slopes, slopes);
    }
    hessian /= temperature;
    for (k, _) in knobs.iter().enumerate().filter(|(_, knob)| knob.prior_centre().is_some()) {
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
    for (k, centre) in knobs.iter().enumerate().filter_map(|(k, knob)| Some((k, knob.prior_centre()?))) {
        gradient[k] += positions[k] - centre;
    }
    gradient
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params;

    /// Something without pattern between -1 and 1.
    fn value(row: usize, column: usize) -> f64 {
        2.0 * (row as f64 * 0.618_033_988_75 + column as f64 * 0.414_213_562_37 * (row + 1) as f64).fract() - 1.0
    }

    /// The score of one parameter more promises what solving for all of them together gives.
    #[test]
    fn a_parameter_more_promises_what_the_joint_solution_gives() {
        let knobs: Vec<Knob> = Knob::nuisances(&params::reference()).into_iter().take(3).collect();
        let positions = vec![0.4, -0.2, 0.1];
        let misses = vec![DVector::from_fn(40, |row, _| 3.0 * value(row, 0))];
        let slopes = vec![DMatrix::from_fn(40, 3, |row, column| value(row, column + 1))];
        for sign in [1.0, -1.0] {
            let along = vec![DVector::from_fn(40, |row, _| sign * (value(row, 7) - value(row, 0)))];
            let joint = vec![DMatrix::from_fn(40, 4, |row, k| if k < 3 { slopes[0][(row, k)] } else { along[0][row] })];
            let solved = Projection::new(&knobs, &positions, &joint, 2.0).cost(&misses);
            let alone = Projection::new(&knobs, &positions, &slopes, 2.0);
            let (nothing, far) = (alone.cost(&misses), 100.0 * sign);
            assert!(solved < 0.9 * nothing, "{solved} of {nothing}");
            assert!((alone.cost_along(&misses, &along, far) - solved).abs() < 1e-6 * solved);
            // The wrong way nothing is to be had; half of the way less.
            assert!((alone.cost_along(&misses, &along, -far) - nothing).abs() < 1e-9 * nothing);
            let near = alone.cost_along(&misses, &along, 0.2 * sign);
            assert!(solved < near && near < nothing, "{near}");
        }
    }

    /// What the others can do as well promises nothing more.
    #[test]
    fn a_mixture_of_the_others_promises_nothing() {
        let misses = vec![DVector::from_fn(40, |row, _| value(row, 0))];
        let slopes = vec![DMatrix::from_fn(40, 2, |row, column| value(row, column + 1))];
        let along = vec![slopes[0].column(0) - 2.0 * slopes[0].column(1)];
        let projection = Projection::new(&[], &[], &slopes, 1.0);
        assert!((projection.cost_along(&misses, &along, 3.0) - projection.cost(&misses)).abs() < 1e-9);
    }
}
