//! The nominal model: the sheet's parameters refitted within their tolerances, event times between slow samples with them.

use crate::diagnosis::model::Model;
use crate::parameters::Unit;
use crate::tuning::bench::Bench;
use crate::tuning::cooling::cooled;
use crate::tuning::fit::{Effort, fit};
use crate::tuning::knob::{Knob, unit_at};
use crate::tuning::loop_noise::heard;
use crate::tuning::noise::Noise;
use crate::tuning::trial::Trial;
use crate::tuning::trips::placed;

/// What a nominal fit turns, and from how many starts.
#[derive(Clone, Debug)]
pub struct Turned {
    /// The knobs.
    pub knobs: Vec<Knob>,
    /// Starts: the sheet, and places scattered around it, the same each time.
    pub starts: usize,
}

/// Turns in which trips between slow samples and parameters are fitted to each other.
const TURNS: usize = 3;

/// Work of a fit in such a turn.
const TURN: Effort = Effort { rounds: 4, refresh: 100, temperature: 1.0 };

/// How far further starts lie from the sheet, in standard deviations.
const SCATTER: f64 = 1.0;

/// Refits the model of the sheet; the noise is laid out anew along the refitted trajectory.
///
/// Returns the bench, the refitted model, and the same model unfitted.
#[must_use]
pub fn nominal(trials: Vec<Trial>, unit: &Unit, turned: Turned, noise: &Noise) -> (Bench, Model, Model) {
    let Turned { knobs, starts } = turned;
    let zeros: Vec<f64> = knobs.iter().map(|knob| knob.start(unit)).collect();
    let first = Bench::new(trials, unit, noise);
    let scattered = |number: usize| -> Vec<f64> {
        // Additive recurrence with the golden section: even, and without a generator.
        let off = |k: usize| SCATTER * (2.0 * ((k * 7 + number * 3) as f64 * 0.618_033_988_75).fract() - 1.0);
        zeros.iter().enumerate().map(|(k, zero)| if number == 0 { *zero } else { zero + off(k) }).collect()
    };
    let scattered: Vec<Vec<f64>> = (0..starts.max(1)).map(scattered).collect();
    let start = cooled(&first, unit, &knobs, &scattered, 3)
        .into_iter()
        .min_by(|a, b| a.cost().total_cmp(&b.cost()))
        .map_or_else(|| zeros.clone(), |fit| fit.positions);
    let mut bench = heard(first, &unit_at(unit, &knobs, &start));
    let mut fine = fit(&bench, unit, &knobs, &start, Effort::FULL, None);
    let mut settled = true;
    // The unit that explains the trips best and the trips that suit it best are found in turns.
    for _ in 0..TURNS {
        let Some(trials) = placed(&bench, &unit_at(unit, &knobs, &fine.positions)) else { break };
        bench = bench.anew(trials, &unit_at(unit, &knobs, &fine.positions));
        fine = fit(&bench, unit, &knobs, &fine.positions, TURN, Some(&fine.slopes));
        settled = false;
    }
    if !settled {
        fine = fit(&bench, unit, &knobs, &fine.positions, Effort::FULL, None);
    }
    let sheet = Model::sheet(&bench, unit, &knobs);
    let refitted = Model::new(Vec::new(), unit.clone(), knobs, fine);
    (bench, refitted, sheet)
}

/// The same on a bench whose noise was learned anew, from where the refitted model stands.
#[must_use]
pub fn renewed(bench: &Bench, refitted: &Model) -> (Bench, Model, Model) {
    let bench = bench.laid_along(&refitted.unit());
    let Model { base, knobs, .. } = refitted;
    let fine = fit(&bench, base, knobs, &refitted.fit.positions, Effort::FULL, None);
    let sheet = Model::sheet(&bench, base, knobs);
    let refitted = Model::new(Vec::new(), base.clone(), knobs.clone(), fine);
    (bench, refitted, sheet)
}
