//! Noise inside the loop: how much of its transducer's noise a regulator hears, learned from how the spool chatters.
//!
//! A regulator that decides on the mean of n readings hears 1/√n of a reading's noise, and no sheet tells n. Too much noise assumed hides small
//! faults, too little makes every unit strange. The likelihood of the spool's residuals has its maximum at the right amount where the twin is right;
//! where it is not, residuals of a fault must not pass for noise. So each stretch of a recording is either as the noise says or spoiled by some larger
//! factor (a scale mixture of normals; Box & Tiao 1968, *Biometrika* 55(1), 119–129), and only stretches that are not spoiled tell the noise.

use crate::estimation::coordinate::{Residuals, square};
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
    likeliest(&problem, unit).map_or(problem, |(likeliest, _)| likeliest)
}

/// The same where the noise laid out along this unit makes its residuals so much likelier that all fits should count by it; else none.
pub fn likelier(problem: &Problem, unit: &Unit) -> Option<Problem> {
    let log_likelihood = |problem: &Problem, residuals: &Residuals| -0.5 * (square(residuals) + problem.width());
    let (other, left) = likeliest(problem, unit)?;
    let residuals = problem.residuals_of(std::slice::from_ref(unit)).pop()?;
    (log_likelihood(&other, &left) > log_likelihood(problem, &residuals) + LIKELIER).then_some(other)
}

/// The likeliest problem, and what the unit leaves there.
fn likeliest(problem: &Problem, unit: &Unit) -> Option<(Problem, Residuals)> {
    if problem
        .recordings
        .iter()
        .all(|recording| recording.place(Signal::SpoolPosition).is_none() || recording.is_driven())
    {
        return None;
    }
    let tried = problem.laid_along_each(unit, &TRIED).into_iter().zip(TRIED);
    let scored = tried.map(|((tried, left), ratio)| (log_posterior(&tried, &left, ratio), (tried, left)));
    scored.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, likeliest)| likeliest)
}

/// Logarithm of the probability of a ratio that leaves these residuals, but for a constant.
fn log_posterior(problem: &Problem, residuals: &Residuals, ratio: f64) -> f64 {
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

#[cfg(test)]
mod tests {
    use super::TRIED;
    use crate::likelihood::noise::expected;
    use crate::likelihood::prepared::PreparedRecording;
    use crate::likelihood::problem::Problem;
    use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
    use govtwin_model::params::reference;
    use govtwin_model::recording::Recording;

    /// All amounts are simulated side by side; each comes out as it would alone.
    #[test]
    fn each_amount_is_laid_out_as_it_would_be_alone() {
        let unit = reference();
        let row = |k: i64| Frame {
            time_ns: k * 10_000_000,
            inputs: Inputs {
                opening_command_pu: if k < 50 { 0.4 } else { 0.5 },
                esv: EsvState::Normal,
                tank_pressure_pa: unit.parameters.oil.tank_pressure_pa,
                piston_force_n: 0.0,
            },
            measured: Signals { spool_position_pu: 0.01, servomotor_position_pu: 0.45, ..Signals::NONE },
        };
        let recording = PreparedRecording::new(Recording::new("step", (0..300).map(row).collect()));
        let problem = Problem::new(vec![recording], &unit, &expected(&unit.sensors));
        let each = problem.laid_along_each(&unit, &TRIED);
        assert_eq!(each.len(), TRIED.len());
        for ((together, left), ratio) in each.into_iter().zip(TRIED) {
            let alone = problem.with_loop_noise(ratio).laid_along(&unit);
            assert_eq!(together.width(), alone.width(), "{ratio}");
            assert_eq!(left, vec![alone.residuals(&unit, 0)], "{ratio}");
        }
    }
}
