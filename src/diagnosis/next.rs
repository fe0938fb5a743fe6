//! What to try next: for the pairs that a verdict leaves open, the test that would tell them apart.

use crate::diagnosis::explore::Explored;
use crate::diagnosis::model::Model;
use crate::diagnosis::outcome::{Blame, Experiment, Verdict};
use crate::diagnosis::{experiment, stage_experiment};
use crate::signal::Signal;
use crate::tuning::bench::Bench;
use crate::twin::Cut;

/// For a class, a test for each pair of rivals; for one named effect, a test against the runner-up.
#[must_use]
pub fn experiments(bench: &Bench, found: &Explored, blamed: &[Blame], verdict: Verdict) -> Vec<Experiment> {
    // The best fitted set that holds an effect stands for it.
    let tried: Vec<&Model> =
        found.hypotheses.iter().map(|one| &one.model).filter(|model| !model.effects.is_empty()).collect();
    let model = |id: &str| tried.iter().copied().find(|model| model.has(id));
    let mut pairs: Vec<(String, String)> = Vec::new();
    match verdict {
        Verdict::Class => {
            for (k, one) in blamed.iter().enumerate() {
                pairs.extend(blamed[k + 1..].iter().map(|other| (one.id.clone(), other.id.clone())));
            }
        }
        Verdict::Named if blamed.len() == 1 => {
            if let Some(other) = tried.iter().find(|model| !model.has(&blamed[0].id)) {
                pairs.push((blamed[0].id.clone(), other.effects[0].id.to_owned()));
            }
        }
        _ => {}
    }
    let stage_only = bench.trials.first().is_some_and(|trial| trial.cut == Cut::Spool);
    let pilot = [Signal::PilotValvePosition, Signal::ControlPressure];
    let pilot_recorded = bench.trials.iter().any(|trial| pilot.iter().all(|&signal| trial.has[signal as usize]));
    let noise_pu = bench.floor_square(0, Signal::ServomotorPosition).sqrt();
    let test = |(a, b): &(String, String)| {
        let units = [&model(a)?.unit(), &model(b)?.unit()];
        if stage_only {
            stage_experiment::between([a, b], units, noise_pu)
        } else {
            experiment::between([a, b], units, pilot_recorded)
        }
    };
    pairs.iter().filter_map(test).collect()
}
