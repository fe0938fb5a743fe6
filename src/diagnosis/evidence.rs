//! What discrepancy terms on top of a fitted model would gain.
//!
//! Terms of a size count by `ln Z = −½ cost + ½ |yᵦ|² − ½ ln |H| + ½ ln |P|` with `L y = g`, `H = L Lᵀ` (Laplace's method; MacKay 1992), up to what all
//! sizes share: g and H are gradient and Hessian of residuals and priors over the free parameters and, behind them, the discrepancy terms β; P is the
//! precision of the terms' priors. What the terms gain is counted with the free parameters following; what these could gain alone is not, since a fit
//! went where it could. A discrepancy term of which every point of the chain has a little is the error of equations; much of it at one point is
//! something unknown there.

pub mod distortion;
pub mod law_error;

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::estimation::linear::crossed;
use crate::evidence::law_error::{Modulations, NO_LAW_ERROR, limits};
use crate::likelihood::noise::log_sum;
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use crate::model::discrepancy::{self, Columns};
use crate::model::normal_equations::NormalEquations;
use govtwin_model::effects::Stage;

/// Sizes of the error of equations that are tried, in moderate discrepancy terms.
pub const KAPPAS: [f64; 4] = [1e-3, 0.03, 0.1, 0.3];

/// Sizes of something unknown at one stage, in moderate discrepancy terms.
pub const UNKNOWN_SIZES: [f64; 3] = [1.0, 4.0, 16.0];

/// Normal equations of a model beside the discrepancy terms.
#[derive(Clone, Debug)]
pub struct ExtendedEquations {
    fit: NormalEquations,
    terms: usize,
    /// Over free parameters, discrepancy terms and errors of laws, without priors of the latter two.
    hessian: DMatrix<f64>,
    /// Along all of these.
    gradient: DVector<f64>,
}

/// Products of the discrepancy marks with themselves, which all models share.
#[derive(Clone, Debug)]
pub struct Shared {
    columns: Arc<Columns>,
    modulations: Modulations,
    without_effects: f64,
    gram: DMatrix<f64>,
}

impl Shared {
    /// Of these marks; the model without effects costs so much.
    pub fn new(problem: &Problem, columns: &Arc<Columns>, without_effects: f64) -> Self {
        let rows: Vec<usize> = columns.marks.iter().map(DMatrix::nrows).collect();
        let n = columns.marks.first().map_or(0, DMatrix::ncols);
        let gram = columns.marks.iter().fold(DMatrix::zeros(n, n), |sum, marks| sum + crossed(marks, marks));
        Self { columns: Arc::clone(columns), modulations: Modulations::new(problem, &rows), without_effects, gram }
    }

    /// The normal equations of a fitted model that has its slopes, beside the discrepancy terms and the errors of its effects' laws.
    pub fn extended(&self, model: &FittedModel) -> ExtendedEquations {
        let fit = model.normal.clone();
        let (n, b) = (model.free_parameters.len(), self.gram.nrows());
        let laws = self.modulations.count(model);
        let limits = limits(model, self.without_effects);
        let mut hessian = DMatrix::zeros(n + b + laws, n + b + laws);
        let mut gradient = DVector::zeros(n + b + laws);
        hessian.view_mut((n, n), (b, b)).copy_from(&self.gram);
        for (recording, residuals) in model.fit.residuals.iter().enumerate() {
            let (slopes, marks) = (&model.fit.slopes[recording], &self.columns.marks[recording]);
            let errors = self.modulations.marks(model, recording, &limits);
            let mut add = |at: (usize, usize), block: &DMatrix<f64>| {
                let mut view = hessian.view_mut(at, block.shape());
                view += block;
            };
            add((0, n), &crossed(slopes, marks));
            if laws > 0 {
                add((0, n + b), &crossed(slopes, &errors));
                add((n, n + b), &crossed(marks, &errors));
                add((n + b, n + b), &crossed(&errors, &errors));
            }
            for (first, along) in [(n, marks.tr_mul(residuals)), (n + b, errors.tr_mul(residuals))] {
                let mut view = gradient.rows_mut(first, along.len());
                view += along;
            }
        }
        for &held in &fit.held {
            hessian.row_mut(held).fill(0.0);
        }
        hessian.view_mut((0, 0), (n, n)).copy_from(&fit.hessian);
        gradient.rows_mut(0, n).copy_from(&fit.gradient);
        hessian.fill_lower_triangle_with_upper_triangle();
        ExtendedEquations { fit, terms: b, hessian, gradient }
    }
}

/// Logarithm of the determinant from a Cholesky factor.
fn log_determinant(cholesky: &Cholesky<f64, nalgebra::Dyn>) -> f64 {
    2.0 * cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>()
}

impl ExtendedEquations {
    /// Logarithm of the evidence, up to what all sizes share, where the terms are of these sizes, and errors of laws of this one; 0, which says
    /// nothing, where rounding leaves the equations without a solution.
    fn with_terms(&self, size: impl Fn(usize) -> f64, law_error: f64) -> f64 {
        let n = self.slopes();
        let mut h = self.hessian.clone();
        let mut log_precision = 0.0;
        for k in 0..self.gradient.len() - n {
            let precision = 1.0 / if k < self.terms { size(k) } else { law_error }.powi(2);
            h[(n + k, n + k)] += precision;
            log_precision += precision.ln();
        }
        let Some(cholesky) = Cholesky::new(h) else { return 0.0 };
        let gain = self.gain_of_terms(&cholesky, &self.gradient);
        0.5 * (gain - log_determinant(&cholesky) + log_precision)
    }

    /// How many free parameters come first.
    fn slopes(&self) -> usize {
        self.fit.gradient.len()
    }

    /// What the terms lower the cost by, the free parameters following.
    fn gain_of_terms(&self, cholesky: &Cholesky<f64, nalgebra::Dyn>, gradient: &DVector<f64>) -> f64 {
        let mut solved = gradient.clone();
        // Free parameters come first, so that the factor's leading block is that of the free parameters alone.
        if !cholesky.l_dirty().solve_lower_triangular_mut(&mut solved) {
            return 0.0;
        }
        solved.rows_range(self.slopes()..).norm_squared()
    }

    /// The error of equations that is likeliest, where laws are wrong by this much, in moderate discrepancy terms.
    pub fn likeliest_kappa(&self, law_error: f64) -> f64 {
        KAPPAS.into_iter().max_by(|a, b| self.at(*a, law_error).total_cmp(&self.at(*b, law_error))).unwrap_or(KAPPAS[0])
    }

    /// Logarithm of the evidence with errors of equations and of laws of these sizes.
    pub fn at(&self, kappa: f64, law_error: f64) -> f64 {
        self.with_terms(|_| kappa, law_error)
    }

    /// The same with something unknown at a stage, whatever its size.
    pub(crate) fn unknown_at(&self, stage: Stage) -> f64 {
        let at: Vec<bool> = discrepancy::places().map(|place| place.stage == stage).collect();
        if !at.contains(&true) {
            return f64::NEG_INFINITY;
        }
        let all = KAPPAS[1..].iter().flat_map(|&kappa| UNKNOWN_SIZES.map(|size| (kappa, size)));
        let count = ((KAPPAS.len() - 1) * UNKNOWN_SIZES.len()) as f64;
        log_sum(all.map(|(kappa, size)| self.with_terms(|k| if at[k] { size } else { kappa }, NO_LAW_ERROR)))
            - count.ln()
    }

    /// By how much something unknown at one place lowers the cost, and the most probable sizes of all terms, in moderate terms; `sizes` are those of
    /// the unknown and of the error of equations beforehand. What is to be explained may be given by its products with the terms' marks.
    pub fn terms(&self, place: usize, sizes: (f64, f64), goal: Option<&DVector<f64>>) -> (f64, Vec<f64>) {
        let at = discrepancy::PLACES.get(place).map(|place| place.words);
        let here: Vec<bool> = discrepancy::places().map(|place| Some(place.words) == at).collect();
        let (n, b) = (self.slopes(), self.terms);
        let mut h = self.hessian.clone();
        for k in 0..self.gradient.len() - n {
            let size = if k >= b {
                NO_LAW_ERROR
            } else if here[k] {
                sizes.0
            } else {
                sizes.1
            };
            h[(n + k, n + k)] += 1.0 / size.powi(2);
        }
        let mut gradient = self.gradient.clone();
        if let Some(goal) = goal {
            gradient.rows_mut(0, n).fill(0.0);
            gradient.rows_mut(n, b).copy_from(goal);
        }
        let Some(cholesky) = Cholesky::new(h) else { return (0.0, vec![0.0; b]) };
        let solved = cholesky.solve(&gradient);
        (self.gain_of_terms(&cholesky, &gradient), solved.rows(n, b).iter().map(|size| -size).collect())
    }
}
