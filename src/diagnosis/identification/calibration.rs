//! Calibration: a fit from the best sizes of profiles, with what it is worth: intervals, correlations, bounds, what the data said.

mod words;

use nalgebra::{DMatrix, DVector};

use crate::estimation::annealing::annealed;
use crate::estimation::coordinate::{Coordinate, Residuals, subject_at};
use crate::estimation::fit::{Effort, Fit, fit};
use crate::estimation::linear::normal;
use crate::identification::free_parameter::FreeParameter;
use crate::identification::profile::profile_starts;
use crate::likelihood::loop_noise::heard;
use crate::likelihood::noise::Noise;
use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::Problem;
use crate::likelihood::whitener::independent_share;
use govtwin_model::parameters::Unit;
use govtwin_model::signal::Signal;
use govtwin_model::units::NORMAL_90;

/// Work of each start, before the noise is laid out anew.
const ROUGH: Effort = Effort { rounds: 5, refresh: 2, ..Effort::FULL };
/// Work of a round of the polish, whose slopes are given.
const FINE: Effort = Effort { rounds: 12, refresh: 100, ..Effort::FULL };
/// Most rounds of the polish, each with slopes from both sides.
const POLISH_ROUNDS: i32 = 16;
/// Widths that the polish takes in turn, each half the one before: none sees every way down between small jumps.
const POLISH_WIDTHS: i32 = 5;
/// A round that gains less, in units of cost, gains nothing.
const ENOUGH: f64 = 0.02;
/// Nearer to a bound than this share of the range is at the bound.
const AT_BOUND_SHARE: f64 = 1e-3;
/// How far to either side slopes are taken for the intervals, in units of a free parameter.
const WIDE_STEP: f64 = 0.1;
/// Length over which residuals may go together, s.
const BLOCK_S: f64 = 10.0;
/// Correlations from here on are told.
const STRONG: f64 = 0.7;

/// One free parameter after the fit.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationRow {
    /// Key in parameter files; for effects `id.parameter`.
    pub key: String,
    /// Unit of the values.
    pub unit: &'static str,
    /// Value before the fit, in the parameter's unit.
    pub sheet: f64,
    /// Fitted value, in the parameter's unit.
    pub fitted: f64,
    /// 90 % interval, in the parameter's unit.
    pub ci90: [f64; 2],
    /// Distance from the sheet in standard deviations of its tolerance; none where the sheet gives none.
    pub deviation: Option<f64>,
    /// Whether it ended at a bound.
    pub at_bound: bool,
    /// How much the data said: 1 − posterior over prior variance, 0 nothing, 1 all.
    pub learned: f64,
}

/// Two free parameters that the data tell apart badly.
#[derive(Clone, Debug, PartialEq)]
pub struct Correlation {
    /// Keys of the two.
    pub keys: [String; 2],
    /// Their correlation after the fit, −1 to 1.
    pub coefficient: f64,
}

/// A fit and what it is worth.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// The fitted unit.
    pub unit: Unit,
    /// What was turned.
    pub free_parameters: Vec<FreeParameter>,
    /// The fit itself.
    pub fit: Fit,
    /// Each free parameter, in order.
    pub rows: Vec<CalibrationRow>,
    /// Standard deviation of each free parameter's position, 1.
    pub deviations: Vec<f64>,
    /// Strong correlations, the strongest first.
    pub correlations: Vec<Correlation>,
    /// Cost of each start after its first rounds.
    pub starts: Vec<f64>,
    /// Residuals of the fitted twin over the noise to be expected, for each of [`Signal::ALL`]: 1 where the model is right;
    /// none where a signal was not measured.
    pub leftover: [Option<f64>; Signal::ALL.len()],
}

/// Fits the free parameters from so many of the best sizes of their profiles, and from a usual size; `step` is called as each part of the work ends, [`PARTS`] times in all.
pub fn calibrate(
    recordings: Vec<PreparedRecording>,
    base: &Unit,
    free_parameters: Vec<FreeParameter>,
    noise: &Noise,
    starts: usize,
    step: &dyn Fn(),
) -> (Problem, Calibration) {
    let first = Problem::new(recordings, base, noise);
    step();
    let starts = profile_starts(&first, base, &free_parameters, starts.max(1));
    step();
    let rough = annealed(&first, base, &free_parameters, &starts, ROUGH.rounds);
    step();
    let costs = rough.iter().map(Fit::cost).collect();
    let best = rough.into_iter().min_by(|a, b| a.cost().total_cmp(&b.cost()));
    let positions = best.map(|fit| fit.positions).unwrap_or_default();
    // Chatter depends on the parameters: the noise is laid out along the best start. A signal that leaves more than it
    // should then counts for less, so that neither fit nor intervals trust it beyond what it is worth.
    let unit = subject_at(base, &free_parameters, &positions);
    let problem = heard(first, &unit);
    let expected = fit(&problem, base, &free_parameters, &positions, ROUGH, None);
    let leftover = leftover(&problem, &expected.residuals);
    step();
    let widened: Noise =
        std::array::from_fn(|signal| noise[signal].scaled(leftover[signal].map_or(1.0, |ratio| ratio.max(1.0))));
    let problem = problem.with_noise(widened).laid_along(&unit);
    let found = fit(&problem, base, &free_parameters, &expected.positions, Effort::FULL, None);
    let found = polish(&problem, base, &free_parameters, found);
    let slopes = Slopes::about(&problem, base, &free_parameters, &found, WIDE_STEP);
    step();
    let calibration = judge(&problem, base, free_parameters, found, &slopes, costs, leftover);
    (problem, calibration)
}

/// Root mean square of the residuals of each signal, over the noise to be expected.
fn leftover(problem: &Problem, residuals: &Residuals) -> [Option<f64>; Signal::ALL.len()] {
    let mut sums = [(0.0, 0.0); Signal::ALL.len()];
    for (recording, residuals) in problem.recordings.iter().zip(residuals) {
        for (place, signal) in recording.signals().enumerate() {
            let of_signal = residuals.rows(recording.residual(place, 0), recording.samples.len());
            for residual in of_signal.iter().filter(|residual| **residual != 0.0) {
                sums[signal as usize].0 += residual * residual;
                sums[signal as usize].1 += independent_share(recording.period_s);
            }
        }
    }
    sums.map(|(sum, count)| (count > 0.0).then(|| (sum / count).sqrt()))
}

/// The last way down, by slopes from both sides: one-sided ones end where a jump on their side hides what is left.
fn polish(problem: &Problem, base: &Unit, free_parameters: &[FreeParameter], mut found: Fit) -> Fit {
    let mut idle = 0;
    for round in 0..POLISH_ROUNDS {
        let width = WIDE_STEP * 0.5_f64.powi(round % POLISH_WIDTHS);
        let slopes = Slopes::about(problem, base, free_parameters, &found, width);
        let next = fit(problem, base, free_parameters, &found.positions, FINE, Some(&slopes.slopes));
        let gain = found.cost() - next.cost();
        found = next;
        idle = if gain < ENOUGH { idle + 1 } else { 0 };
        if idle == POLISH_WIDTHS {
            break;
        }
    }
    found
}

/// Slopes of the residuals by every free parameter, and how far they may be wrong.
struct Slopes {
    /// By recording.
    slopes: Vec<DMatrix<f64>>,
    /// Sum of squares of each column's error, over all recordings.
    errors: DVector<f64>,
}

impl Slopes {
    /// From both sides of a fit; where the two sides differ, the slope is in doubt.
    ///
    /// Stops and dead bands put small jumps into the residuals, which over many samples would pass for knowledge of what
    /// the recordings cannot tell apart, such as the factors of a product.
    fn about(problem: &Problem, base: &Unit, free_parameters: &[FreeParameter], fit: &Fit, wide: f64) -> Self {
        let mut errors = DVector::zeros(free_parameters.len());
        let mut columns = vec![Vec::with_capacity(free_parameters.len()); problem.recordings.len()];
        for (k, free_parameter) in free_parameters.iter().enumerate() {
            let (low, high) = free_parameter.range(base);
            let mut places = [-wide, wide].map(|step| (fit.positions[k] + step).clamp(low, high));
            // At a bound both places lie on its one side.
            for place in &mut places {
                if *place == fit.positions[k] {
                    *place = if *place == low { low + 0.5 * wide } else { high - 0.5 * wide };
                }
            }
            let units = places.map(|place| {
                let mut moved = fit.positions.clone();
                moved[k] = place;
                subject_at(base, free_parameters, &moved)
            });
            let residuals = problem.residuals_of(&units);
            for (recording, at) in fit.residuals.iter().enumerate() {
                let side = |end: usize| (&residuals[end][recording] - at) / (places[end] - fit.positions[k]);
                let (one, other) = (side(0), side(1));
                errors[k] += 0.25 * (&one - &other).norm_squared();
                columns[recording].push(0.5 * (one + other));
            }
        }
        Self { slopes: columns.iter().map(|columns| DMatrix::from_columns(columns)).collect(), errors }
    }
}

/// How often [`calibrate`] reports progress.
pub const PARTS: usize = 5;

fn judge(
    problem: &Problem,
    base: &Unit,
    free_parameters: Vec<FreeParameter>,
    fit: Fit,
    slopes: &Slopes,
    starts: Vec<f64>,
    leftover: [Option<f64>; Signal::ALL.len()],
) -> Calibration {
    let covariance = covariance(problem, &free_parameters, &fit, slopes);
    let rows = free_parameters.iter().enumerate().map(|(k, free_parameter)| {
        let (low, high) = free_parameter.range(base);
        let position = fit.positions[k];
        let sd = covariance[(k, k)].max(0.0).sqrt();
        let (key, unit) = free_parameter.key(base);
        let value = |position: f64| free_parameter.value(base, position.clamp(low, high));
        let ends = [value(position - NORMAL_90 * sd), value(position + NORMAL_90 * sd)];
        let prior_variance = if free_parameter.has_prior() { 1.0 } else { (high - low).powi(2) / 12.0 };
        CalibrationRow {
            key,
            unit,
            sheet: free_parameter.value(base, free_parameter.position(base)),
            fitted: value(position),
            ci90: [ends[0].min(ends[1]), ends[0].max(ends[1])],
            deviation: free_parameter.has_prior().then_some(position),
            at_bound: (position - low).min(high - position) <= AT_BOUND_SHARE * (high - low),
            learned: (1.0 - sd * sd / prior_variance).clamp(0.0, 1.0),
        }
    });
    let rows: Vec<CalibrationRow> = rows.collect();
    let mut correlations = Vec::new();
    for i in 0..free_parameters.len() {
        for j in i + 1..free_parameters.len() {
            let coefficient = covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            if coefficient.abs() >= STRONG {
                correlations.push(Correlation { keys: [rows[i].key.clone(), rows[j].key.clone()], coefficient });
            }
        }
    }
    correlations.sort_by(|a, b| b.coefficient.abs().total_cmp(&a.coefficient.abs()));
    let unit = subject_at(base, &free_parameters, &fit.positions);
    let deviations = covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect();
    Calibration { unit, free_parameters, fit, rows, deviations, correlations, starts, leftover }
}

/// Covariance of the positions about the fit, priors included.
///
/// What slopes in doubt seem to know is taken off (errors in variables: Fuller 1987, *Measurement Error Models*,
/// section 2.2). Residuals that lie close together may still go together: scores are summed over blocks before they are
/// squared (Newey & West 1987), and where that says more, intervals widen by it.
fn covariance(problem: &Problem, free_parameters: &[FreeParameter], fit: &Fit, slopes: &Slopes) -> DMatrix<f64> {
    let n = free_parameters.len();
    let (hessian, _) = normal(free_parameters, &fit.positions, &fit.residuals, &slopes.slopes, 1.0);
    let prior = DVector::from_fn(n, |k, _| f64::from(u8::from(free_parameters[k].has_prior())));
    let mut scores = DMatrix::from_diagonal(&prior);
    for ((recording, slopes), residuals) in problem.recordings.iter().zip(&slopes.slopes).zip(&fit.residuals) {
        let count = recording.samples.len();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small count")]
        let block = ((BLOCK_S / recording.period_s.max(1e-3)) as usize).max(1);
        for from in (0..count).step_by(block) {
            let length = block.min(count - from);
            let mut score = DVector::zeros(n);
            for first in (0..recording.signals().count()).map(|place| recording.residual(place, from)) {
                score += slopes.rows(first, length).tr_mul(&residuals.rows(first, length));
            }
            scores += &score * score.transpose();
        }
    }
    let invert = |matrix: DMatrix<f64>| matrix.cholesky().map(|cholesky| cholesky.inverse());
    let tiny = DMatrix::identity(n, n) * 1e-6;
    let known = hessian.clone() - DMatrix::from_diagonal(&prior) - DMatrix::from_diagonal(&slopes.errors);
    let mut parts = known.symmetric_eigen();
    parts.eigenvalues.apply(|value| *value = value.max(0.0));
    let known = parts.recompose() + DMatrix::from_diagonal(&prior);
    let (Some(plain), Some(careful)) = (invert(hessian + &tiny), invert(known + tiny)) else {
        return DMatrix::identity(n, n) * f64::INFINITY;
    };
    let robust = &plain * scores * &plain;
    let widen = DVector::from_fn(n, |k, _| (robust[(k, k)] / plain[(k, k)]).max(1.0).sqrt());
    let widen = DVector::from_fn(n, |k, _| {
        // Recordings never take away what the sheet says.
        if prior[k] > 0.0 { widen[k].min(1.0 / careful[(k, k)].sqrt()) } else { widen[k] }
    });
    DMatrix::from_fn(n, n, |i, j| careful[(i, j)] * widen[i] * widen[j])
}
