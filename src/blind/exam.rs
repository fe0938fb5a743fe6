//! Closure as it came true: the refitted and the improved twin on recordings that the diagnosis never saw.

use crate::battery::FLOORS;
use crate::parameters::Unit;
use crate::recording::Recording;
use crate::signal::Signal;
use crate::tuning::trial::Trial;
use crate::twin::Twin;

/// The share of the gap of the refitted twin that the improved one closes; none where there is no gap.
///
/// `(MSE_refit − MSE_improved)/(MSE_refit − noise²)`, each signal over its noise floor, both positions together. As in the claim, the
/// twin is the mean over noise inside the loop: no two regulators chatter alike.
#[must_use]
pub fn closure(recordings: Vec<Recording>, refitted: &Unit, improved: &Unit) -> Option<f64> {
    let (mut closed, mut gap) = (0.0, 0.0);
    let trials: Vec<Trial> = recordings.into_iter().map(Trial::new).collect();
    for signal in [Signal::ServomotorPosition, Signal::SpoolPosition] {
        let floor = FLOORS[signal as usize];
        let (before, after) = (mean_square(&trials, refitted, signal), mean_square(&trials, improved, signal));
        closed += (before - after) / (floor * floor);
        gap += (before - floor * floor) / (floor * floor);
    }
    (gap > 0.0 && closed.is_finite()).then_some(closed / gap)
}

fn mean_square(trials: &[Trial], unit: &Unit, signal: Signal) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for trial in trials {
        let estimates = trial.run(&mut Twin::new(unit).with_dither(unit.sensors.servomotor_position_pu.noise));
        for (&row, estimate) in trial.samples.iter().zip(&estimates) {
            let miss = signal.of(&trial.frames[row].measured) - signal.of(&estimate.signals);
            if miss.is_finite() {
                sum += miss * miss;
                count += 1;
            }
        }
    }
    sum / f64::from(count.max(1))
}
