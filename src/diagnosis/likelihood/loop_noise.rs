//! Noise inside the loop: how much of its transducer's noise a regulator hears, learned from how the spool chatters.
//!
//! A regulator that decides on the mean of n readings hears 1/√n of a reading's noise, and no sheet tells n. Too much noise assumed hides small
//! faults, too little makes every unit strange. The likelihood of the spool's residuals has its maximum at the right amount where the twin is right;
//! where it is not, residuals of a fault must not pass for noise. So each stretch of a recording is either as the noise says or spoiled by some larger
//! factor (a scale mixture of normals; Box & Tiao 1968, *Biometrika* 55(1), 119–129), and only stretches that are not spoiled tell the noise.

use rayon::iter::{IntoParallelIterator, ParallelIterator};

use crate::estimation::coordinate::square;
use crate::likelihood::noise::log_sum;
use crate::likelihood::problem::{Problem, USUAL_LOOP_NOISE};
use govtwin_model::parameters::Unit;
use govtwin_model::signal::Signal;

/// Standard deviation of the ratio's logarithm from unit to unit: means of two to twenty readings are usual.
const SPREAD: f64 = 0.4;

/// Ratios that are tried, up to a regulator that decides on single readings.
const TRIED: [f64; 7] = [0.2, 0.26, 0.34, 0.45, 0.59, 0.77, 1.0];

/// Length of a stretch, s and samples at least.
const STRETCH: (f64, usize) = (1.0, 25);

/// Gain in the logarithm of the likelihood for which fits begin anew.
const LIKELIER: f64 = 20.0;

/// Probabilities that a stretch's squared residuals are so many times what noise makes them.
const SPOILED: [(f64, f64); 5] = [(0.6, 1.0), (0.1, 4.0), (0.1, 16.0), (0.1, 64.0), (0.1, 256.0)];

/// The problem with the noise inside the loop that a unit's spool most probably has, laid out along that unit; as it is where no spool was measured.
pub fn heard(problem: Problem, unit: &Unit) -> Problem {
    likeliest(&problem, unit).unwrap_or(problem)
}

/// The same where the noise laid out along this unit makes its residuals so much likelier that all fits should count by it; else none.
pub fn likelier(problem: &Problem, unit: &Unit) -> Option<Problem> {
    let log_likelihood = |problem: &Problem| {
        let residuals = problem.residuals_of(std::slice::from_ref(unit)).pop().unwrap_or_default();
        -0.5 * (square(&residuals) + problem.width())
    };
    likeliest(problem, unit).filter(|other| log_likelihood(other) > log_likelihood(problem) + LIKELIER)
}

fn likeliest(problem: &Problem, unit: &Unit) -> Option<Problem> {
    if problem
        .recordings
        .iter()
        .all(|recording| recording.place(Signal::SpoolPosition).is_none() || recording.is_driven())
    {
        return None;
    }
    let scored = TRIED.into_par_iter().map(|ratio| {
        let tried = problem.with_loop_noise(ratio).laid_along(unit);
        (log_posterior(&tried, unit, ratio), tried)
    });
    scored.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, likeliest)| likeliest)
}

/// Logarithm of the probability of a ratio, but for a constant.
fn log_posterior(problem: &Problem, unit: &Unit, ratio: f64) -> f64 {
    let residuals = problem.residuals_of(std::slice::from_ref(unit)).pop().unwrap_or_default();
    let of_recording = |(recording, residuals)| {
        let innovations = problem.innovations(recording, Signal::SpoolPosition, residuals);
        let scales = problem.scales(recording, Signal::SpoolPosition);
        let samples = problem.recordings[recording].samples_in(STRETCH.0).max(STRETCH.1);
        let stretches = innovations.chunks(samples).zip(scales.chunks(samples));
        stretches
            .map(|(innovations, scales)| log_likelihood(innovations, scales, problem.share(recording)))
            .sum::<f64>()
    };
    residuals.iter().enumerate().map(of_recording).sum::<f64>()
        - 0.5 * ((ratio / USUAL_LOOP_NOISE).ln() / SPREAD).powi(2)
}

/// Logarithm of the likelihood of a stretch, of whose samples a share is independent.
fn log_likelihood(innovations: &[f64], scales: &[f64], share: f64) -> f64 {
    let square: f64 = innovations.iter().map(|one| one * one).sum();
    let width: f64 = scales.iter().map(|scale| -2.0 * scale.ln()).sum();
    let count = innovations.len() as f64;
    let parts = SPOILED
        .map(|(probability, factor)| probability.ln() - 0.5 * share * (square / factor + width + count * factor.ln()));
    log_sum(parts)
}
