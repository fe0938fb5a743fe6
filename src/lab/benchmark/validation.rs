//! Explained fraction as it came true: the refitted and the improved twin on recordings that the diagnosis never saw.

use govtwin_diagnosis::estimation::coordinate::square;
use govtwin_diagnosis::likelihood::event_time::placed;
use govtwin_diagnosis::likelihood::loop_noise::heard;
use govtwin_diagnosis::likelihood::noise::expected;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_diagnosis::likelihood::problem::Problem;
use govtwin_diagnosis::summary::explained_fraction::realised_fraction;
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;

/// Share of the least cost by which the improved unit must be likelier with the noise of its own: less is not worth a new search.
const NOTABLE: f64 = 0.1;

/// The same in cost: less may be chance.
const LEAST_GAIN: f64 = 20.0;

/// The share of the gap of the refitted twin that the improved one closes, counted as the claim is, noise and all; none where there is no gap.
pub fn explained_fraction(recordings: Vec<Recording>, refitted: &Unit, improved: &Unit) -> Option<f64> {
    let problem = laid_for(laid_along(recordings, refitted), refitted, improved);
    let twins = problem.simulate_all(&[refitted.clone(), improved.clone()]);
    realised_fraction(&problem, &twins[0], &twins[1])
}

/// Recordings with the noise along a refitted unit, and with their trips where it explains them best, as the diagnosis has them.
pub fn laid_along(recordings: Vec<Recording>, refitted: &Unit) -> Problem {
    let noise = expected(&refitted.sensors);
    let problem =
        heard(Problem::new(recordings.into_iter().map(PreparedRecording::new).collect(), refitted, &noise), refitted);
    match placed(&problem, &problem.recordings, refitted) {
        Some(recordings) => problem.anew(recordings, refitted),
        None => problem,
    }
}

/// The problem with the noise that a diagnosis would count with: along the improved unit where it is notably likelier so, as a unit that chatters louder
/// than the refitted one is. But for a constant the cost is minus twice the logarithm of the likelihood.
fn laid_for(problem: Problem, refitted: &Unit, improved: &Unit) -> Problem {
    let least =
        problem.residuals_of(&[refitted.clone(), improved.clone()]).iter().map(square).fold(f64::INFINITY, f64::min);
    let own = problem.laid_along(improved);
    let residuals: f64 = own.residuals_of(std::slice::from_ref(improved)).iter().map(square).sum();
    let cost = residuals + own.width() - problem.width();
    if cost < (1.0 - NOTABLE) * least - LEAST_GAIN { own } else { problem }
}
