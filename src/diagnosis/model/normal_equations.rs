//! The normal equations of a fit: squares and products of its residuals and slopes, by recording and with the priors.

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::estimation::coordinate::Coordinate;
use crate::estimation::fit::Fit;
use crate::estimation::linear::crossed;
use crate::identification::free_parameter::FreeParameter;
use crate::model::support::SIZE_PRIOR;
use govtwin_model::parameters::Unit;

/// Normal equations of a fitted model: residuals and priors along its free parameters.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    pub(crate) cost: f64,
    /// Priors included.
    pub(crate) hessian: DMatrix<f64>,
    pub(crate) gradient: DVector<f64>,
    /// What each recording has to say.
    pub(crate) parts: Vec<RecordingNormal>,
    /// Free parameters that are held at a bound: they follow nothing.
    pub(crate) held: Vec<usize>,
}

/// One recording's part in the normal equations.
#[derive(Clone, Debug)]
pub(crate) struct RecordingNormal {
    pub cost: f64,
    pub hessian: DMatrix<f64>,
    pub gradient: DVector<f64>,
}

/// What each recording of a fit has to say.
pub(crate) fn parts(fit: &Fit) -> Vec<RecordingNormal> {
    let of = |(residuals, slopes): (&DVector<f64>, &DMatrix<f64>)| RecordingNormal {
        cost: residuals.norm_squared(),
        hessian: crossed(slopes, slopes),
        gradient: slopes.tr_mul(residuals),
    };
    fit.residuals.iter().zip(&fit.slopes).map(of).collect()
}

/// Covariance of the free parameters about a fit; infinite where it says nothing.
pub(crate) fn covariance(free_parameters: &[FreeParameter], parts: &[RecordingNormal]) -> DMatrix<f64> {
    let n = free_parameters.len();
    let mut hessian = parts.iter().fold(DMatrix::identity(n, n) * 1e-9, |sum, part| sum + &part.hessian);
    for k in (0..n).filter(|&k| free_parameters[k].prior_centre().is_some()) {
        hessian[(k, k)] += 1.0;
    }
    hessian.try_inverse().unwrap_or_else(|| DMatrix::from_diagonal(&DVector::from_element(n, f64::INFINITY)))
}

impl NormalEquations {
    /// Those of a fit of a unit, of what each recording has to say.
    pub(crate) fn new(
        base: &Unit,
        free_parameters: &[FreeParameter],
        fit: &Fit,
        mut parts: Vec<RecordingNormal>,
    ) -> Self {
        let n = free_parameters.len();
        let is_held = |k: &usize| {
            let (free_parameter, position) = (&free_parameters[*k], fit.positions[*k]);
            let (low, high) = free_parameter.range(base);
            free_parameter.prior_centre().is_some() && (position <= low || position >= high) && low < high
        };
        let held: Vec<usize> = (0..n).filter(is_held).collect();
        for part in &mut parts {
            for &k in &held {
                part.hessian.row_mut(k).fill(0.0);
                part.hessian.column_mut(k).fill(0.0);
                part.gradient[k] = 0.0;
            }
        }
        let mut hessian = parts.iter().fold(DMatrix::zeros(n, n), |sum, part| sum + &part.hessian);
        let mut gradient = parts.iter().fold(DVector::zeros(n), |sum, part| sum + &part.gradient);
        for (k, free_parameter) in free_parameters.iter().enumerate() {
            let position = fit.positions[k];
            if !held.contains(&k) {
                gradient[k] += free_parameter.prior_centre().map_or(0.0, |centre| position - centre);
            }
            hessian[(k, k)] += match free_parameter {
                FreeParameter::Effect { parameter: 0, .. } => 1.0 / (SIZE_PRIOR.1 * position.abs().max(1e-3)).powi(2),
                FreeParameter::Free { .. } => 1e-6,
                _ => 1.0,
            };
        }
        Self { cost: fit.cost(), hessian, gradient, parts, held }
    }

    /// By how much the cost could still fall by the slopes at hand: next to nothing where a fit has ended.
    pub fn unfinished(&self) -> f64 {
        let Some(cholesky) = Cholesky::new(self.hessian.clone()) else { return 0.0 };
        self.gradient.dot(&cholesky.solve(&self.gradient))
    }

    /// The cost of all recordings but each in turn: one Gauss-Newton step refits the rest.
    pub fn cost_without_each(&self) -> Vec<f64> {
        let of = |part: &RecordingNormal| {
            let gain = Cholesky::new(&self.hessian - &part.hessian)
                .map_or(0.0, |cholesky| part.gradient.dot(&cholesky.solve(&part.gradient)));
            self.cost - part.cost - gain
        };
        self.parts.iter().map(of).collect()
    }
}
