//! The evidence of a fitted fault set: its likelihood with tolerances, sizes and model error integrated out.
//!
//! `ln Z = −½ cost + ½ |yᵦ|² − ½ ln |H| + ½ ln |P| + ln p(sizes)` with `L y = g`, `H = L Lᵀ` (Laplace's method; MacKay 1992): g and H are gradient and
//! Hessian of residuals and priors over the free parameters and, behind them, the discrepancy terms β; P is the precision of the priors. What the
//! terms gain is counted with the free parameters following; what these could gain alone is not, since a fit went where it could. A discrepancy term of which every point of the chain has a
//! little is the error of equations; much of it at one point is something unknown there.

pub mod distortion;
pub mod law_error;

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::estimation::coordinate::Coordinate;
use crate::estimation::linear::crossed;
use crate::evidence::law_error::{Modulations, NO_LAW_ERROR, limits};
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::noise::log_sum;
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use crate::model::discrepancy::{self, Columns};
use crate::model::support::SIZE_PRIOR;
use govtwin_model::effects::Stage;

/// Sizes of the error of equations at which evidence is tabulated, in moderate discrepancy terms.
pub const KAPPAS: [f64; 4] = [1e-3, 0.03, 0.1, 0.3];

/// Sizes of something unknown at one stage, in moderate discrepancy terms.
pub const UNKNOWN_SIZES: [f64; 3] = [1.0, 4.0, 16.0];

/// Normal equations of a model beside the discrepancy terms.
#[derive(Clone, Debug)]
pub struct NormalEquations {
    cost: f64,
    slopes: usize,
    terms: usize,
    /// Over free parameters, discrepancy terms and errors of laws, without priors of the latter two.
    hessian: DMatrix<f64>,
    /// Along all of these.
    gradient: DVector<f64>,
    /// Logarithm of the prior density of the sizes over a Gaussian of unit precision.
    sizes: f64,
    /// Logarithm of the precision of the free parameters' priors, all together.
    log_precision: f64,
    /// What each recording has to say.
    parts: Vec<RecordingNormal>,
    /// Free parameters that are held at a bound: they follow nothing.
    held: Vec<usize>,
}

/// One recording's part in the normal equations of the free parameters.
#[derive(Clone, Debug)]
struct RecordingNormal {
    cost: f64,
    hessian: DMatrix<f64>,
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

    /// The normal equations of a fitted model that has its slopes.
    pub fn normal(&self, model: &FittedModel) -> NormalEquations {
        let (n, b) = (model.free_parameters.len(), self.gram.nrows());
        let laws = self.modulations.count(model);
        let limits = limits(model, self.without_effects);
        let mut hessian = DMatrix::zeros(n + b + laws, n + b + laws);
        let mut gradient = DVector::zeros(n + b + laws);
        let mut parts = Vec::new();
        hessian.view_mut((n, n), (b, b)).copy_from(&self.gram);
        for (recording, residuals) in model.fit.residuals.iter().enumerate() {
            let (slopes, marks) = (&model.fit.slopes[recording], &self.columns.marks[recording]);
            let errors = self.modulations.marks(model, recording, &limits);
            let part = crossed(slopes, slopes);
            let along = slopes.tr_mul(residuals);
            let mut add = |at: (usize, usize), block: &DMatrix<f64>| {
                let mut view = hessian.view_mut(at, block.shape());
                view += block;
            };
            add((0, 0), &part);
            add((0, n), &crossed(slopes, marks));
            if laws > 0 {
                add((0, n + b), &crossed(slopes, &errors));
                add((n, n + b), &crossed(marks, &errors));
                add((n + b, n + b), &crossed(&errors, &errors));
            }
            for (first, along) in [(0, along.clone()), (n, marks.tr_mul(residuals)), (n + b, errors.tr_mul(residuals))]
            {
                let mut view = gradient.rows_mut(first, along.len());
                view += along;
            }
            parts.push(RecordingNormal { cost: residuals.norm_squared(), hessian: part, gradient: along });
        }
        hessian.fill_lower_triangle_with_upper_triangle();
        let (median, spread) = SIZE_PRIOR;
        let (mut sizes, mut log_precision) = (0.0, 0.0);
        let mut held = Vec::new();
        for (k, free_parameter) in model.free_parameters.iter().enumerate() {
            let position = model.fit.positions[k];
            gradient[k] += free_parameter.prior_centre().map_or(0.0, |centre| position - centre);
            let (low, high) = free_parameter.range(&model.base);
            if free_parameter.prior_centre().is_some() && (position <= low || position >= high) && low < high {
                held.push(k);
                hessian.row_mut(k).fill(0.0);
                hessian.column_mut(k).fill(0.0);
                gradient[k] = 0.0;
                for part in &mut parts {
                    part.hessian.row_mut(k).fill(0.0);
                    part.hessian.column_mut(k).fill(0.0);
                    part.gradient[k] = 0.0;
                }
            }
            let precision = match free_parameter {
                FreeParameter::Effect { parameter: 0, .. } => {
                    let size = position.abs().max(1e-3);
                    let off = (size / median).ln() / spread;
                    // The density of the size itself; that of a Gaussian with its precision is counted by |P|.
                    sizes -= 0.5 * off * off;
                    1.0 / (spread * size).powi(2)
                }
                FreeParameter::Free { .. } => 1e-6,
                _ => 1.0,
            };
            hessian[(k, k)] += precision;
            log_precision += precision.ln();
        }
        let cost = model.fit.cost();
        NormalEquations { cost, slopes: n, terms: b, hessian, gradient, sizes, log_precision, parts, held }
    }
}

/// Logarithm of the determinant from a Cholesky factor.
fn log_determinant(cholesky: &Cholesky<f64, nalgebra::Dyn>) -> f64 {
    2.0 * cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>()
}

impl NormalEquations {
    /// Logarithm of the evidence where the terms are of these sizes, and errors of laws of this one.
    fn with_terms(&self, size: impl Fn(usize) -> f64, law_error: f64) -> f64 {
        let n = self.slopes;
        let mut h = self.hessian.clone();
        let mut log_precision = self.log_precision;
        for k in 0..self.gradient.len() - n {
            let precision = 1.0 / if k < self.terms { size(k) } else { law_error }.powi(2);
            h[(n + k, n + k)] += precision;
            log_precision += precision.ln();
        }
        let Some(cholesky) = Cholesky::new(h) else { return -0.5 * self.cost };
        let gain = self.gain_of_terms(&cholesky, &self.gradient);
        0.5 * (gain - self.cost - log_determinant(&cholesky) + log_precision) + self.sizes
    }

    /// What the terms lower the cost by, the free parameters following.
    fn gain_of_terms(&self, cholesky: &Cholesky<f64, nalgebra::Dyn>, gradient: &DVector<f64>) -> f64 {
        let mut solved = gradient.clone();
        // Free parameters come first, so that the factor's leading block is that of the free parameters alone.
        if !cholesky.l_dirty().solve_lower_triangular_mut(&mut solved) {
            return 0.0;
        }
        solved.rows_range(self.slopes..).norm_squared()
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
        let (n, b) = (self.slopes, self.terms);
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

    /// What the free parameters could still gain by the slopes at hand, nats: next to nothing where a fit has ended.
    pub fn unfinished(&self) -> f64 {
        let n = self.slopes;
        let gradient = self.gradient.rows(0, n).into_owned();
        let Some(cholesky) = Cholesky::new(self.hessian.view((0, 0), (n, n)).into_owned()) else { return 0.0 };
        0.5 * gradient.dot(&cholesky.solve(&gradient))
    }

    /// The cost of all recordings but each in turn: one Gauss-Newton step refits the rest.
    pub fn cost_without_each(&self) -> Vec<f64> {
        let n = self.slopes;
        let all = self.hessian.view((0, 0), (n, n)).into_owned();
        let of = |part: &RecordingNormal| {
            let gain = Cholesky::new(&all - &part.hessian)
                .map_or(0.0, |cholesky| part.gradient.dot(&cholesky.solve(&part.gradient)));
            self.cost - part.cost - gain
        };
        self.parts.iter().map(of).collect()
    }

    /// Cost of each recording.
    pub fn costs(&self) -> Vec<f64> {
        self.parts.iter().map(|part| part.cost).collect()
    }
}
