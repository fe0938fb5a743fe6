//! One step of a fit: damped and inside the bounds; and what it teaches about the slopes.

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IndexedParallelIterator, IntoParallelRefMutIterator, ParallelIterator};

use crate::estimation::coordinate::{Coordinate, Residuals};

/// Rows of slopes that are corrected together: few enough to stay in the cache from one step to the next.
const BLOCK_ROWS: usize = 512;

/// A step that was tried.
pub(super) struct Tried<'a> {
    /// Where it led.
    pub to: &'a [f64],
    /// The residuals there.
    pub after: &'a Residuals,
}

/// Corrects slopes by the changes of the residuals that steps from one position brought, one after another (Broyden 1965, equation 4.5).
///
/// A correction of a row of slopes asks for nothing but that row, so that rows go through all steps block by block.
pub(super) fn correct(slopes: &mut [DMatrix<f64>], from: &[f64], before: &Residuals, tried: &[Tried<'_>]) {
    let step = |one: &Tried<'_>| DVector::from_iterator(from.len(), one.to.iter().zip(from).map(|(b, a)| b - a));
    let steps: Vec<DVector<f64>> = tried.iter().map(step).collect();
    let moved: Vec<(&Tried<'_>, &DVector<f64>)> =
        tried.iter().zip(&steps).filter(|(_, step)| step.norm_squared() > 0.0).collect();
    slopes.par_iter_mut().enumerate().for_each(|(recording, slopes)| {
        for first in (0..slopes.nrows()).step_by(BLOCK_ROWS) {
            let count = BLOCK_ROWS.min(slopes.nrows() - first);
            let mut block = slopes.rows(first, count).into_owned();
            for (one, step) in &moved {
                let change = one.after[recording].rows(first, count) - before[recording].rows(first, count);
                let surprise = change - &block * *step;
                block.ger(1.0 / step.norm_squared(), &surprise, step, 1.0);
            }
            slopes.rows_mut(first, count).copy_from(&block);
        }
    });
}

/// The damped step inside the bounds: coordinates that it would push through a bound stay on it.
pub(super) fn step<C: Coordinate>(
    base: &C::Subject,
    coordinates: &[C],
    positions: &[f64],
    hessian: &DMatrix<f64>,
    gradient: &DVector<f64>,
    damping: f64,
) -> Vec<f64> {
    let n = coordinates.len();
    let mut free = vec![true; n];
    loop {
        let mut h = hessian.clone();
        let mut g = gradient.clone();
        for k in 0..n {
            h[(k, k)] *= 1.0 + damping;
            h[(k, k)] += 1e-9;
            if !free[k] {
                h.row_mut(k).fill(0.0);
                h.column_mut(k).fill(0.0);
                h[(k, k)] = 1.0;
                g[k] = 0.0;
            }
        }
        let Some(cholesky) = h.cholesky() else { return positions.to_vec() };
        let change = cholesky.solve(&g);
        if change.iter().any(|one| !one.is_finite()) {
            // Where the start could not be simulated, its residuals lead nowhere.
            return positions.to_vec();
        }
        let mut next: Vec<f64> = positions.iter().zip(change.iter()).map(|(p, c)| p - c).collect();
        let mut hit = false;
        for k in 0..n {
            let (low, high) = coordinates[k].range(base);
            if free[k] && (next[k] <= low && positions[k] <= low || next[k] >= high && positions[k] >= high) {
                free[k] = false;
                hit = true;
            }
            next[k] = next[k].clamp(low, high);
        }
        if !hit {
            return next;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identification::free_parameter::FreeParameter;
    use govtwin_model::params;

    #[test]
    fn corrected_slopes_agree_with_the_last_step_and_change_no_more_than_that() {
        // More rows than a block has.
        let rows = 2 * BLOCK_ROWS + 7;
        let slopes = DMatrix::from_fn(rows, 3, |row, column| ((row * 3 + column) as f64).sin());
        let before: Residuals = vec![DVector::from_fn(rows, |row, _| (row as f64).cos())];
        let after = |step: [f64; 3]| -> Residuals {
            let change = &slopes * DVector::from(step.to_vec());
            vec![&before[0] + change.map(|change| 1.5 * change)]
        };
        let steps = [[0.1, 0.0, 0.0], [0.0, 0.0, 0.0], [0.1, -0.2, 0.0]];
        let reached = steps.map(after);
        let tried: Vec<Tried<'_>> = steps.iter().zip(&reached).map(|(to, after)| Tried { to, after }).collect();
        let mut corrected = vec![slopes.clone()];
        correct(&mut corrected, &[0.0; 3], &before, &tried);
        let predicted = &corrected[0] * DVector::from(steps[2].to_vec());
        assert!((predicted - (&reached[2][0] - &before[0])).amax() < 1e-12);
        assert_eq!(corrected[0].column(2), slopes.column(2), "no step went that way");
    }

    #[test]
    fn residuals_that_are_no_numbers_lead_nowhere() {
        let unit = params::reference();
        let all = FreeParameter::nuisances(&unit);
        let positions = vec![0.0; all.len()];
        let hessian = DMatrix::identity(all.len(), all.len());
        let gradient = |value: f64| DVector::from_element(all.len(), value);
        let next = |value: f64| step(&unit, &all, &positions, &hessian, &gradient(value), 0.0);
        assert_eq!(next(f64::NAN), positions);
        assert_eq!(next(f64::INFINITY), positions);
        assert_ne!(next(0.1), positions);
    }
}
