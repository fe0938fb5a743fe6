//! Closure as it came true: the refitted and the improved twin on recordings that the diagnosis never saw.

use crate::battery::FLOORS;
use crate::parameters::Unit;
use crate::recording::Recording;
use crate::signal::Signal;
use crate::tuning::swing::{Look, swings};
use crate::tuning::trial::Trial;
use crate::twin::Twin;

/// The share of the gap of the refitted twin that the improved one closes; none where there is no gap.
///
/// `(MSE_refit − MSE_improved)/(MSE_refit − noise²)`, each signal over its noise floor, both positions together. As in the claim, the
/// twin is the mean over noise inside the loop: no two regulators chatter alike.
#[must_use]
pub fn closure(recordings: Vec<Recording>, refitted: &Unit, improved: &Unit) -> Option<f64> {
    let mut sums = [(0.0, 0.0, 0_usize); Signal::POSITIONS.len()];
    for trial in recordings.into_iter().map(Trial::new) {
        let simulate = |unit: &Unit| {
            let estimates = trial.run(&mut Twin::new(unit).with_dither(unit.sensors.servomotor_position_pu.noise));
            Signal::POSITIONS.map(|signal| signal.of_estimates(&estimates))
        };
        let (before, after) = (simulate(refitted), simulate(improved));
        let looks: Vec<Look> = Signal::POSITIONS
            .iter()
            .zip(&before)
            .map(|(&signal, reference)| Look {
                measured: trial.measured(signal),
                reference: reference.clone(),
                noise_squares: vec![floor_square(signal); trial.samples.len()],
            })
            .collect();
        let swings = swings(&looks, trial.period_s);
        for (k, (look, swings)) in looks.iter().zip(&swings).enumerate() {
            let [before, after] = [&before[k], &after[k]].map(|simulated| swings.squares(&look.measured, simulated));
            for (before, after) in before.into_iter().zip(after).filter(|(before, _)| before.is_finite()) {
                sums[k] = (sums[k].0 + before, sums[k].1 + after, sums[k].2 + 1);
            }
        }
    }
    let (mut closed, mut gap) = (0.0, 0.0);
    for (&signal, (before, after, count)) in Signal::POSITIONS.iter().zip(sums) {
        let count = count.max(1) as f64;
        closed += (before - after) / count / floor_square(signal);
        gap += before / count / floor_square(signal) - 1.0;
    }
    (gap > 0.0 && closed.is_finite()).then_some(closed / gap)
}

fn floor_square(signal: Signal) -> f64 {
    FLOORS[signal as usize] * FLOORS[signal as usize]
}
