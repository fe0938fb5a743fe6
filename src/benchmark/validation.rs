//! Explained fraction as it came true: the refitted and the improved twin on recordings that the diagnosis never saw.

use crate::diagnosis::summary::explained_fraction::realised_fraction;
use crate::likelihood::event_time::placed;
use crate::likelihood::loop_noise::heard;
use crate::likelihood::noise::expected;
use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::Problem;
use crate::parameters::Unit;
use crate::recording::Recording;

/// The share of the gap of the refitted twin that the improved one closes, counted as the claim is, noise and all; none where there is no gap.
#[must_use]
pub fn explained_fraction(recordings: Vec<Recording>, refitted: &Unit, improved: &Unit) -> Option<f64> {
    let problem = laid_along(recordings, refitted);
    realised_fraction(&problem, &problem.simulate_all(refitted), &problem.simulate_all(improved))
}

/// Recordings with the noise along a refitted unit, and with their trips where it explains them best, as the diagnosis has them.
#[must_use]
pub fn laid_along(recordings: Vec<Recording>, refitted: &Unit) -> Problem {
    let noise = expected(&refitted.sensors);
    let problem =
        heard(Problem::new(recordings.into_iter().map(PreparedRecording::new).collect(), refitted, &noise), refitted);
    match placed(&problem, &problem.recordings, refitted) {
        Some(recordings) => problem.anew(recordings, refitted),
        None => problem,
    }
}
