//! A part of the chain: how well its models predict free runs, and how much of the verdict they bear.

use crate::diagnosis::decision::Decision;
use crate::diagnosis::explore::Explored;
use crate::diagnosis::model::Model;
use crate::diagnosis::outcome::{FreeRun, StageOnly, Verdict};
use crate::diagnosis::ready::Ready;
use crate::frame::Frame;
use crate::parameters::Unit;
use crate::recording::Recording;
use crate::tuning::bench::Bench;
use crate::tuning::fit::{Effort, fit};
use crate::tuning::knob::unit_at;
use crate::tuning::noise::Noise;
use crate::tuning::trial::Trial;
use crate::units::seconds_from_nanos;

/// Length of a free run, samples.
pub const FREE_RUN_SAMPLES: usize = 100;
/// Effects on top of the first must all be this probable to be named: with a sheet, and where everything is fitted freely.
const SURE: (f64, f64) = (0.6, 0.95);
/// Without a sheet an effect that explains this share of what the best one does cannot be told from it.
const CLOSE: f64 = 0.9;
/// A stage that misses no more than this, in squares of what the most flexible law misses, shows no gap.
const CALM_ENOUGH: f64 = 3.0;
/// Gain in cost that may be chance.
const LEAST_GAIN: f64 = 8.0;
/// Share of the movement that some law of the spool must explain, or there is too little to go by.
const DRIVEN: f64 = 0.9;

/// The decision as far as a stage on its own bears it; what was taken back is said.
///
/// Without a sheet everything is fitted freely, and a piece of a recording starts in a state that nobody measured: a second effect, or the
/// better of two alike, is then easily had.
#[must_use]
pub fn modest(bench: &Bench, found: &Explored, ready: &Ready, decision: Decision) -> (Decision, Option<String>) {
    let mut decision = decision;
    if !ready.sheet && found.refitted().cost() < CALM_ENOUGH * bench.independent_samples() + LEAST_GAIN {
        let blamed = decision.verdict != Verdict::NoGap;
        let mut said =
            blamed.then(|| "What the fitted stage misses, the most flexible law misses as well: no gap.".to_owned());
        let mut verdict = Verdict::NoGap;
        if ready.explained < DRIVEN {
            verdict = Verdict::NotExcited;
            said = Some(format!(
                "No law of the spool's position explains more than {:.0} % of the servomotor's movement: too little to tell anything; are both \
                 of one unit?",
                100.0 * ready.explained
            ));
        }
        return (decision.forced(verdict), said);
    }
    let probability = |id: &str| decision.effects.iter().find(|(spec, _)| spec.id == id).map_or(0.0, |(_, p)| *p);
    let sure = if ready.sheet { SURE.0 } else { SURE.1 };
    let sure_of = |(place, id): &(usize, &&'static str)| *place == 0 || probability(id) >= sure;
    let (kept, doubtful): (Vec<_>, Vec<_>) = decision.blamed.iter().enumerate().partition(sure_of);
    let ids = |some: Vec<(usize, &&'static str)>| some.into_iter().map(|(_, id)| *id).collect::<Vec<_>>();
    let (kept, doubtful) = (ids(kept), ids(doubtful));
    let mut said = None;
    if decision.verdict == Verdict::Named && !doubtful.is_empty() {
        said = Some(format!(
            "On top of {} something like {} would fit somewhat better, but too little for a second name.",
            kept.join(", "),
            doubtful.join(" or ")
        ));
        decision.blamed = kept;
    }
    let names = matches!(decision.verdict, Verdict::Named | Verdict::Class);
    if !ready.sheet && names && decision.blamed.len() == 1 {
        let rivals = near(found);
        if rivals.len() > 1 {
            decision.verdict = Verdict::Class;
            decision.blamed = rivals;
        }
    }
    (decision, said)
}

/// The single effects that explain nearly as much as the best one, best first.
fn near(found: &Explored) -> Vec<&'static str> {
    let before = found.refitted().cost();
    let mut gains: Vec<(&'static str, f64)> = found
        .hypotheses
        .iter()
        .filter_map(|one| match one.model.effects.as_slice() {
            [only] => Some((only.id, before - one.model.cost())),
            _ => None,
        })
        .collect();
    gains.sort_by(|a, b| b.1.total_cmp(&a.1));
    let best = gains.first().map_or(0.0, |(_, gain)| *gain);
    gains.into_iter().filter(|(_, gain)| *gain >= CLOSE * best).take(3).map(|(id, _)| id).collect()
}

/// Errors of free runs: each half fitted, the other predicted.
fn free_runs(ready: &Ready, models: &[&Model]) -> Vec<FreeRun> {
    let halves = match ready.whole.as_slice() {
        [one] => {
            let (first, second) = one.frames.split_at(one.frames.len() / 2);
            [windows([first].into_iter()), windows([second].into_iter())]
        }
        several => {
            let (first, second) = several.split_at(several.len() / 2);
            [first, second].map(|half| windows(half.iter().map(|recording| recording.frames.as_slice())))
        }
    };
    if halves.iter().any(Vec::is_empty) {
        return Vec::new();
    }
    models
        .iter()
        .flat_map(|model| {
            [(0, "first half"), (1, "second half")].map(|(half, fitted_on)| {
                let bench = Bench::new(halves[half].clone(), &model.unit(), &ready.noise);
                let found = fit(&bench, &model.base, &model.knobs, &model.fit.positions, Effort::FULL, None);
                let unit = unit_at(&model.base, &model.knobs, &found.positions);
                let [seen, held_out] = [half, 1 - half].map(|half| error(&halves[half], &unit, &ready.noise));
                FreeRun { model: model.ids().join(" + "), fitted_on, seen, held_out }
            })
        })
        .collect()
}

/// Free runs of a fixed number of samples one behind another, each from its own measured start.
fn windows<'a>(halves: impl Iterator<Item = &'a [Frame]>) -> Vec<Trial> {
    halves
        .flat_map(|frames| frames.chunks_exact(FREE_RUN_SAMPLES))
        .map(|frames| Trial::servomotor_stage(Recording::new("free run", frames.to_vec())))
        .filter(|trial| trial.samples.len() > 2)
        .collect()
}

/// RMS miss of the servomotor position, pu.
fn error(trials: &[Trial], unit: &Unit, noise: &Noise) -> f64 {
    let bench = Bench::new(trials.to_vec(), unit, noise);
    let (mut sum, mut count) = (0.0, 0_usize);
    for (index, trial) in bench.trials.iter().enumerate() {
        for (&row, estimate) in trial.samples.iter().zip(bench.simulate(unit, index)) {
            let miss = trial.frames[row].measured.servomotor_position_pu - estimate.signals.servomotor_position_pu;
            if miss.is_finite() {
                sum += miss * miss;
                count += 1;
            }
        }
    }
    (sum / count.max(1) as f64).sqrt()
}

/// What a report says of the part.
#[must_use]
pub fn describe(ready: &Ready, found: &Explored, decision: &Decision) -> StageOnly {
    let blamed = decision.blamed.iter().filter_map(|id| found.with(&[id]));
    let mut models: Vec<&Model> = std::iter::once(found.refitted()).chain(blamed).collect();
    if decision.blamed.len() > 1 {
        models.extend(found.with(&decision.blamed));
    }
    let length_ns = ready.trials.first().map_or(0, |trial| match (trial.frames.first(), trial.frames.last()) {
        (Some(first), Some(last)) => last.time_ns - first.time_ns,
        _ => 0,
    });
    StageOnly {
        sheet: ready.sheet,
        pieces: ready.trials.len(),
        piece_s: seconds_from_nanos(length_ns),
        free_runs: free_runs(ready, &models),
    }
}
