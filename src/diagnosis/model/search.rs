//! The nominal model: the sheet's parameters refitted within their tolerances, event times between slow samples with them.

use crate::estimation::annealing::annealed;
use crate::estimation::coordinate::subject_at;
use crate::estimation::fit::{Effort, fit};
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::event_time::placed;
use crate::likelihood::loop_noise::heard;
use crate::likelihood::noise::Noise;
use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use govtwin_model::parameters::Unit;

/// What a nominal fit turns, and from how many starts.
#[derive(Clone, Debug)]
pub struct Turned {
    /// The free parameters.
    pub free_parameters: Vec<FreeParameter>,
    /// Starts: the sheet, and places scattered around it, the same each time.
    pub starts: usize,
}

/// Turns in which trips between slow samples and parameters are fitted to each other.
const TURNS: usize = 3;

/// Work of a fit in such a turn.
const TURN: Effort = Effort { rounds: 4, refresh: 100, ..Effort::FULL };

/// How far further starts lie from the sheet, in standard deviations.
const SCATTER: f64 = 1.0;

/// Refits the model of the sheet; the noise is laid out anew along the refitted trajectory.
///
/// Returns the problem, the refitted model, and the same model unfitted.
pub fn nominal(
    recordings: Vec<PreparedRecording>,
    unit: &Unit,
    turned: Turned,
    noise: &Noise,
) -> (Problem, FittedModel, FittedModel) {
    let Turned { free_parameters, starts } = turned;
    let zeros: Vec<f64> = free_parameters.iter().map(|free_parameter| free_parameter.start(unit)).collect();
    let recorded = recordings.clone();
    let first = Problem::new(recordings, unit, noise);
    // A fit that begins with a trip far off makes up for it by parameters, and then stays there.
    let first = match placed(&first, &recorded, unit) {
        Some(recordings) => first.anew(recordings, unit),
        None => first,
    };
    let scattered = |number: usize| -> Vec<f64> {
        // Additive recurrence with the golden section: even, and without a generator.
        let off = |k: usize| SCATTER * (2.0 * ((k * 7 + number * 3) as f64 * 0.618_033_988_75).fract() - 1.0);
        zeros.iter().enumerate().map(|(k, zero)| if number == 0 { *zero } else { zero + off(k) }).collect()
    };
    let scattered: Vec<Vec<f64>> = (0..starts.max(1)).map(scattered).collect();
    let start = annealed(&first, unit, &free_parameters, &scattered, 3)
        .into_iter()
        .min_by(|a, b| a.cost().total_cmp(&b.cost()))
        .map_or_else(|| zeros.clone(), |fit| fit.positions);
    let mut problem = heard(first, &subject_at(unit, &free_parameters, &start));
    let mut fine = fit(&problem, unit, &free_parameters, &start, Effort::FULL, None);
    let mut settled = true;
    // The unit that explains the trips best and the trips that suit it best are found in turns.
    for _ in 0..TURNS {
        let now = subject_at(unit, &free_parameters, &fine.positions);
        let Some(recordings) = placed(&problem, &recorded, &now) else { break };
        problem = problem.anew(recordings, &now);
        fine = fit(&problem, unit, &free_parameters, &fine.positions, TURN, Some(&fine.slopes));
        settled = false;
    }
    if !settled {
        fine = fit(&problem, unit, &free_parameters, &fine.positions, Effort::FULL, None);
    }
    let sheet = FittedModel::sheet(&problem, unit, &free_parameters);
    let refitted = FittedModel::new(Vec::new(), unit.clone(), free_parameters, fine);
    (problem, refitted, sheet)
}

/// The same on a problem whose noise was laid out anew, from where the refitted model stands.
pub fn renewed(problem: Problem, refitted: &FittedModel) -> (Problem, FittedModel, FittedModel) {
    let FittedModel { base, free_parameters, .. } = refitted;
    let fine = fit(&problem, base, free_parameters, &refitted.fit.positions, Effort::FULL, None);
    let sheet = FittedModel::sheet(&problem, base, free_parameters);
    let refitted = FittedModel::new(Vec::new(), base.clone(), free_parameters.clone(), fine);
    (problem, refitted, sheet)
}
