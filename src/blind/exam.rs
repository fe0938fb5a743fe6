//! Closure as it came true: the refitted and the improved twin on recordings that the diagnosis never saw.

use crate::diagnosis::closure::share;
use crate::diagnosis::own_noise;
use crate::parameters::Unit;
use crate::recording::Recording;
use crate::tuning::bench::Bench;
use crate::tuning::loop_noise::heard;
use crate::tuning::noise::expected;
use crate::tuning::trial::Trial;
use crate::tuning::trips::placed;

/// The share of the gap of the refitted twin that the improved one closes, counted as the claim is, noise and all; none where there is no gap.
#[must_use]
pub fn closure(recordings: Vec<Recording>, refitted: &Unit, improved: &Unit) -> Option<f64> {
    let bench = own_noise::laid_for(laid_along(recordings, refitted), refitted, improved);
    share(&bench, &bench.simulate_all(refitted), &bench.simulate_all(improved))
}

/// Recordings with the noise along a refitted unit, and with their trips where it explains them best, as the diagnosis has them.
#[must_use]
pub fn laid_along(recordings: Vec<Recording>, refitted: &Unit) -> Bench {
    let noise = expected(&refitted.sensors);
    let bench = heard(Bench::new(recordings.into_iter().map(Trial::new).collect(), refitted, &noise), refitted);
    match placed(&bench, refitted) {
        Some(trials) => bench.anew(trials, refitted),
        None => bench,
    }
}
