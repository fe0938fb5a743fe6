//! One step of a fit: damped and inside the bounds; and what it teaches about the slopes.

use nalgebra::{DMatrix, DVector};

use crate::estimation::coordinate::{Coordinate, Residuals};

/// Corrects slopes by the change of the residuals that a step brought (Broyden 1965, equation 4.5).
pub(super) fn correct(slopes: &mut [DMatrix<f64>], from: &[f64], to: &[f64], before: &Residuals, after: &Residuals) {
    let step = DVector::from_iterator(from.len(), to.iter().zip(from).map(|(b, a)| b - a));
    let length = step.norm_squared();
    if length == 0.0 {
        return;
    }
    for ((slope, before), after) in slopes.iter_mut().zip(before).zip(after) {
        let surprise = after - before - &*slope * &step;
        slope.ger(1.0 / length, &surprise, &step, 1.0);
    }
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
