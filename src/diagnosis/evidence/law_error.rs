//! Error of an effect's own law: what the effect does to the residuals, modulated over process, position, speed and time.
//!
//! The law of a true effect is never the catalogue's. Its error is a share of what the effect does, and it varies slowly: a transducer's offset
//! drifts, a leak depends on where the spool stands. To first order the true residuals are those of the fit plus `Σ v_k m_k ∘ s ∂r/∂s`, with s the
//! fitted size, m_k a few modulations of unit size, and `v ~ N(0, ρ²)`: model discrepancy as a multiplicative term (Kennedy & O'Hagan 2001, *J. R.
//! Stat. Soc. B* 63(3); a constant modulation is the size itself). With v integrated out, what a law's error leaves does not stand out.

use nalgebra::DMatrix;

use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use govtwin_model::recording::Process;
use govtwin_model::signal::Signal;

/// A law's error that is usual, as a share of what the effect does.
pub const LAW_ERROR: f64 = 0.05;

/// A law's error that is none, as a share of what the effect does.
pub const NO_LAW_ERROR: f64 = 1e-3;

/// Speed of the servomotor at which a modulation by speed saturates, pu/s.
const FAST_PU_S: f64 = 0.1;

/// Time over which a law may drift, s.
const DRIFT_S: f64 = 20.0;

/// What an effect may gain by chance, in cost.
const CHANCE: f64 = 10.0;

/// Modulations besides those by process.
const SHAPES: usize = 3;

/// Modulations of each recording, one row for each residual.
#[derive(Clone, Debug)]
pub struct Modulations {
    by_recording: Vec<DMatrix<f64>>,
}

impl Modulations {
    /// Those of a problem's recordings: one for each process, then servomotor position, its speed, and time.
    pub fn new(problem: &Problem, rows: &[usize]) -> Self {
        let processes: Vec<Process> = Process::ALL
            .into_iter()
            .filter(|process| problem.recordings.iter().any(|recording| recording.process == *process))
            .collect();
        let of = |(recording, &rows): (&PreparedRecording, &usize)| {
            let shapes = shapes(recording);
            let mut all = DMatrix::zeros(rows, processes.len() + SHAPES);
            for row in 0..rows {
                if let Some(process) = processes.iter().position(|process| *process == recording.process) {
                    all[(row, process)] = 1.0;
                }
                // Rows beyond the samples compare limit cycles, whose time is a block's.
                if row < recording.samples.len() * recording.signals().count() {
                    for (k, value) in shapes[row % recording.samples.len()].iter().enumerate() {
                        all[(row, processes.len() + k)] = *value;
                    }
                }
            }
            all
        };
        Self { by_recording: problem.recordings.iter().zip(rows).map(of).collect() }
    }

    /// How many columns the law errors of a model have.
    pub fn count(&self, model: &FittedModel) -> usize {
        sizes(model).len() * self.by_recording.first().map_or(0, DMatrix::ncols)
    }

    /// Marks of the law errors of a model's effects in one recording, a column for each effect and modulation; `limits` are those of [`limits`].
    pub fn marks(&self, model: &FittedModel, recording: usize, limits: &[f64]) -> DMatrix<f64> {
        let modulations = &self.by_recording[recording];
        let slopes = &model.fit.slopes[recording];
        let sizes = sizes(model);
        let mut marks = DMatrix::zeros(modulations.nrows(), sizes.len() * modulations.ncols());
        for (effect, (&free_parameter, limit)) in sizes.iter().zip(limits).enumerate() {
            let does = slopes.column(free_parameter) * (model.fit.positions[free_parameter] * limit);
            for k in 0..modulations.ncols() {
                let mark = does.component_mul(&modulations.column(k));
                marks.set_column(effect * modulations.ncols() + k, &mark);
            }
        }
        marks
    }
}

/// Free parameters of a model that are sizes of effects.
fn sizes(model: &FittedModel) -> Vec<usize> {
    (0..model.free_parameters.len())
        .filter(|&k| matches!(model.free_parameters[k], FreeParameter::Effect { parameter: 0, .. }))
        .collect()
}

/// Factor of each effect of a model that keeps what it does to the residuals within what the model gained over the one without effects, in cost:
/// near a threshold the slope by the size promises far more than the effect does.
pub fn limits(model: &FittedModel, without_effects: f64) -> Vec<f64> {
    let most = 2.0 * (without_effects - model.fit.cost()).max(0.0) + CHANCE;
    let of = |&free_parameter: &usize| {
        let squares: f64 = model.fit.slopes.iter().map(|slopes| slopes.column(free_parameter).norm_squared()).sum();
        (most / (squares * model.fit.positions[free_parameter].powi(2)).max(1e-12)).sqrt().min(1.0)
    };
    sizes(model).iter().map(of).collect()
}

/// Position, speed and time at each sample, each about from −1 to 1.
fn shapes(recording: &PreparedRecording) -> Vec<[f64; SHAPES]> {
    let measured = recording.measured(Signal::ServomotorPosition);
    let speeds_pu_s = recording.speeds(Signal::ServomotorPosition, 0.25);
    let of = |sample: usize| {
        let finite = |value: f64| if value.is_finite() { value } else { 0.0 };
        [
            finite(2.0 * measured[sample] - 1.0),
            finite((speeds_pu_s[sample] / FAST_PU_S).tanh()),
            2.0 * (-recording.time_s(sample) / DRIFT_S).exp() - 1.0,
        ]
    };
    (0..measured.len()).map(of).collect()
}
