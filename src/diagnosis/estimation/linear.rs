//! The linear picture about a point: normal equations of residuals and priors, and what they promise.

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

use crate::estimation::coordinate::{Coordinate, Residuals, prior_square, square};

/// Rows of a block that stays in the cache.
const BLOCK_ROWS: usize = 1024;

/// The sum of what each block of so many rows contributes; `of_block` gets its first row and its number of rows.
fn summed_over_blocks(
    rows: usize,
    shape: (usize, usize),
    of_block: impl Fn(usize, usize) -> DMatrix<f64> + Sync + Send,
) -> DMatrix<f64> {
    let of_block = |block: usize| of_block(block * BLOCK_ROWS, BLOCK_ROWS.min(rows - block * BLOCK_ROWS));
    let blocks: Vec<DMatrix<f64>> = (0..rows.div_ceil(BLOCK_ROWS)).into_par_iter().map(of_block).collect();
    // In the order of the blocks, so that the number of threads changes nothing.
    blocks.into_iter().fold(DMatrix::zeros(shape.0, shape.1), |sum, block| sum + block)
}

/// `aᵀ b` of tall matrices, block by block: nalgebra's `tr_mul` multiplies column by column, ten times slower here.
pub fn crossed(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    summed_over_blocks(a.nrows(), (a.ncols(), b.ncols()), |first, count| {
        a.rows(first, count).transpose() * b.rows(first, count)
    })
}

/// Columns whose products are made together; what lies below the diagonal is not made twice.
const PANEL_COLUMNS: usize = 64;

/// `aᵀ a` of a tall matrix of many columns.
pub fn gram(a: &DMatrix<f64>) -> DMatrix<f64> {
    let columns = a.ncols();
    let mut gram = summed_over_blocks(a.nrows(), (columns, columns), |first, count| {
        let rows = a.rows(first, count);
        let across = rows.transpose();
        let mut gram = DMatrix::zeros(columns, columns);
        for left in (0..columns).step_by(PANEL_COLUMNS) {
            let right = columns.min(left + PANEL_COLUMNS);
            let panel = across.rows(0, right) * rows.columns(left, right - left);
            gram.view_mut((0, left), panel.shape()).copy_from(&panel);
        }
        gram
    });
    gram.fill_lower_triangle_with_upper_triangle();
    gram
}

/// Normal matrix and gradient, priors included; slopes behind those of the coordinates have none.
pub fn normal<C: Coordinate>(
    coordinates: &[C],
    positions: &[f64],
    residuals: &Residuals,
    slopes: &[DMatrix<f64>],
    temperature: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let n = slopes.first().map_or(coordinates.len(), DMatrix::ncols);
    let (mut hessian, mut gradient) = (DMatrix::zeros(n, n), DVector::zeros(n));
    for (slopes, residuals) in slopes.iter().zip(residuals) {
        hessian += crossed(slopes, slopes);
        gradient += slopes.tr_mul(residuals);
    }
    hessian /= temperature;
    gradient /= temperature;
    for (k, coordinate) in coordinates.iter().enumerate() {
        if let Some(centre) = coordinate.prior_centre() {
            hessian[(k, k)] += 1.0;
            gradient[k] += positions[k] - centre;
        }
    }
    (hessian, gradient)
}

/// The least cost that can be reached along slopes from a position, to first order.
pub fn least_cost<C: Coordinate>(
    coordinates: &[C],
    positions: &[f64],
    residuals: &Residuals,
    slopes: &[DMatrix<f64>],
) -> f64 {
    let (hessian, gradient) = normal(coordinates, positions, residuals, slopes, 1.0);
    let cost = square(residuals) + prior_square(coordinates, positions);
    let n = hessian.nrows();
    let solver = (hessian + DMatrix::identity(n, n) * 1e-9).cholesky();
    solver.map_or(cost, |solver| cost - gradient.dot(&solver.solve(&gradient)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identification::free_parameter::FreeParameter;
    use govtwin_model::params;

    /// Something without pattern between -1 and 1.
    fn value(row: usize, column: usize) -> f64 {
        2.0 * (row as f64 * 0.618_033_988_75 + column as f64 * 0.414_213_562_37 * (row + 1) as f64).fract() - 1.0
    }

    /// It is the cost at the solution of the normal equations, residuals and priors together.
    #[test]
    fn the_least_cost_is_that_of_the_joint_solution() {
        let free_parameters: Vec<FreeParameter> =
            FreeParameter::nuisances(&params::reference()).into_iter().take(3).collect();
        let positions = vec![0.4, -0.2, 0.1];
        let residuals = vec![DVector::from_fn(40, |row, _| 3.0 * value(row, 0) + 2.0 * value(row, 1))];
        let slopes = vec![DMatrix::from_fn(40, 3, |row, column| value(row, column + 1))];
        let (hessian, gradient) = normal(&free_parameters, &positions, &residuals, &slopes, 1.0);
        let step = hessian.cholesky().unwrap().solve(&gradient);
        let there: Vec<f64> = positions.iter().zip(&step).map(|(position, step)| position - step).collect();
        let left = vec![&residuals[0] - &slopes[0] * &step];
        let solved = square(&left) + prior_square(&free_parameters, &there);
        let nothing = square(&residuals) + prior_square(&free_parameters, &positions);
        assert!(solved < 0.95 * nothing, "{solved} of {nothing}");
        let least = least_cost(&free_parameters, &positions, &residuals, &slopes);
        assert!((least - solved).abs() < 1e-6 * solved, "{least} for {solved}");
    }

    #[test]
    fn a_gram_matrix_is_the_product_with_the_transpose() {
        let a = DMatrix::from_fn(BLOCK_ROWS + 5, 2 * PANEL_COLUMNS + 3, |row, column| {
            ((7 * row + 3 * column) as f64).sin()
        });
        assert!((gram(&a) - a.transpose() * &a).amax() < 1e-9);
    }
}
