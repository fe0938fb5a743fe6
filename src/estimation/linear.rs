//! The linear picture about a point: normal equations of residuals and priors, and what they promise.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::estimation::coordinate::{Coordinate, Residuals, prior_square, square};

/// A parameter of whose mark less than this share is its own is taken for a mixture of others.
const ALIKE: f64 = 1e-4;

/// A position whose slopes tell, for residuals near it, the least cost that could be reached along them, to first order.
#[derive(Debug)]
pub struct Projection<'a, C> {
    coordinates: &'a [C],
    positions: &'a [f64],
    slopes: &'a [DMatrix<f64>],
    temperature: f64,
    solver: Option<Cholesky<f64, Dyn>>,
}

impl<'a, C: Coordinate> Projection<'a, C> {
    /// Slopes and coordinates may be of different number: coordinates without a slope stay where they are, slopes without a coordinate are free.
    #[must_use]
    pub fn new(coordinates: &'a [C], positions: &'a [f64], slopes: &'a [DMatrix<f64>], temperature: f64) -> Self {
        let n = slopes.first().map_or(0, DMatrix::ncols);
        let coordinates = &coordinates[..n.min(coordinates.len())];
        let solver = (hessian(coordinates, slopes, temperature) + DMatrix::identity(n, n) * 1e-9).cholesky();
        Self { coordinates, positions, slopes, temperature, solver }
    }

    /// The least cost from these residuals on.
    #[must_use]
    pub fn cost(&self, residuals: &Residuals) -> f64 {
        self.least(residuals, &self.gradient(residuals))
    }

    fn gradient(&self, residuals: &Residuals) -> DVector<f64> {
        gradient(self.coordinates, self.positions, residuals, self.slopes, self.temperature)
    }

    fn least(&self, residuals: &Residuals, gradient: &DVector<f64>) -> f64 {
        let cost = square(residuals) / self.temperature + prior_square(self.coordinates, self.positions);
        self.solver.as_ref().map_or(cost, |solver| cost - gradient.dot(&solver.solve(gradient)))
    }

    /// The least cost from these residuals on, where a parameter besides may go from nothing to `most`; `along` are the residuals' changes per unit of it.
    ///
    /// This is the score test of a parameter at nothing with all others fitted along (Rao 1948), its step held inside the range.
    #[must_use]
    pub fn cost_along(&self, residuals: &Residuals, along: &Residuals, most: f64) -> f64 {
        let gradient_here = self.gradient(residuals);
        let cost = self.least(residuals, &gradient_here);
        let Some(solver) = &self.solver else { return cost };
        let shared = gradient::<C>(&[], &[], along, self.slopes, self.temperature);
        let follow = solver.solve(&shared);
        let own = |residuals: &Residuals| {
            along.iter().zip(residuals).map(|(along, residuals)| along.dot(residuals)).sum::<f64>() / self.temperature
        };
        let score = own(residuals) - follow.dot(&gradient_here);
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

/// Normal matrix and gradient, priors included; slopes behind those of the coordinates have none.
#[must_use]
pub fn normal<C: Coordinate>(
    coordinates: &[C],
    positions: &[f64],
    residuals: &Residuals,
    slope: &[DMatrix<f64>],
    temperature: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    (hessian(coordinates, slope, temperature), gradient(coordinates, positions, residuals, slope, temperature))
}

fn hessian<C: Coordinate>(coordinates: &[C], slopes: &[DMatrix<f64>], temperature: f64) -> DMatrix<f64> {
    let n = slopes.first().map_or(coordinates.len(), DMatrix::ncols);
    let mut hessian = DMatrix::zeros(n, n);
    for slopes in slopes {
        hessian += crossed(slopes, slopes);
    }
    hessian /= temperature;
    for (k, _) in coordinates.iter().enumerate().filter(|(_, coordinate)| coordinate.prior_centre().is_some()) {
        hessian[(k, k)] += 1.0;
    }
    hessian
}

fn gradient<C: Coordinate>(
    coordinates: &[C],
    positions: &[f64],
    residuals: &Residuals,
    slopes: &[DMatrix<f64>],
    temperature: f64,
) -> DVector<f64> {
    let mut gradient = DVector::zeros(slopes.first().map_or(coordinates.len(), DMatrix::ncols));
    for (slopes, residuals) in slopes.iter().zip(residuals) {
        gradient += slopes.tr_mul(residuals);
    }
    gradient /= temperature;
    for (k, centre) in
        coordinates.iter().enumerate().filter_map(|(k, coordinate)| Some((k, coordinate.prior_centre()?)))
    {
        gradient[k] += positions[k] - centre;
    }
    gradient
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identification::free_parameter::FreeParameter;
    use crate::params;

    /// Something without pattern between -1 and 1.
    fn value(row: usize, column: usize) -> f64 {
        2.0 * (row as f64 * 0.618_033_988_75 + column as f64 * 0.414_213_562_37 * (row + 1) as f64).fract() - 1.0
    }

    /// The score of one parameter more promises what solving for all of them together gives.
    #[test]
    fn a_parameter_more_promises_what_the_joint_solution_gives() {
        let free_parameters: Vec<FreeParameter> =
            FreeParameter::nuisances(&params::reference()).into_iter().take(3).collect();
        let positions = vec![0.4, -0.2, 0.1];
        let residuals = vec![DVector::from_fn(40, |row, _| 3.0 * value(row, 0))];
        let slopes = vec![DMatrix::from_fn(40, 3, |row, column| value(row, column + 1))];
        for sign in [1.0, -1.0] {
            let along = vec![DVector::from_fn(40, |row, _| sign * (value(row, 7) - value(row, 0)))];
            let joint = vec![DMatrix::from_fn(40, 4, |row, k| if k < 3 { slopes[0][(row, k)] } else { along[0][row] })];
            let solved = Projection::new(&free_parameters, &positions, &joint, 2.0).cost(&residuals);
            let alone = Projection::new(&free_parameters, &positions, &slopes, 2.0);
            let (nothing, far) = (alone.cost(&residuals), 100.0 * sign);
            assert!(solved < 0.9 * nothing, "{solved} of {nothing}");
            assert!((alone.cost_along(&residuals, &along, far) - solved).abs() < 1e-6 * solved);
            // The wrong way nothing is to be had; half of the way less.
            assert!((alone.cost_along(&residuals, &along, -far) - nothing).abs() < 1e-9 * nothing);
            let near = alone.cost_along(&residuals, &along, 0.2 * sign);
            assert!(solved < near && near < nothing, "{near}");
        }
    }

    /// What the others can do as well promises nothing more.
    #[test]
    fn a_mixture_of_the_others_promises_nothing() {
        let residuals = vec![DVector::from_fn(40, |row, _| value(row, 0))];
        let slopes = vec![DMatrix::from_fn(40, 2, |row, column| value(row, column + 1))];
        let along = vec![slopes[0].column(0) - 2.0 * slopes[0].column(1)];
        let projection = Projection::<FreeParameter>::new(&[], &[], &slopes, 1.0);
        assert!((projection.cost_along(&residuals, &along, 3.0) - projection.cost(&residuals)).abs() < 1e-9);
    }
}
