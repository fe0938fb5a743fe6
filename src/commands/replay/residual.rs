//! `replay --residual`: the same recordings with a learned residual on top of the twin.

use std::path::Path;

use anyhow::Context;
use govtwin_correction::adapt::Adaptation;
use govtwin_correction::corrector::Corrector;
use govtwin_correction::guard::GuardCounts;
use govtwin_correction::model::Model;
use govtwin_correction::rate;
use govtwin_correction::row::Opening;
use govtwin_diagnosis::replay_summary::{RecordingSource, ReplaySummary, Residual, summarise};
use govtwin_model::parameters::Unit;
use govtwin_model::replay::Replayed;
use govtwin_model::twin::Cut;

use super::Result as Outcome;
use crate::commands::usage;

/// A model that fits the unit and the cut, ready to run.
pub fn ready(model: &Model, unit: &Unit, cut: Cut) -> anyhow::Result<Corrector> {
    let opening = match cut {
        Cut::None => Opening::Simulated,
        Cut::Servomotor => Opening::Measured,
        Cut::Spool => return Err(usage("--residual with --cut spool: the measured spool leaves nothing to correct")),
    };
    model.check(unit, opening)?;
    Ok(Corrector::new(model)?)
}

/// Refuses models whose past cannot be taken from these recordings; what the others assume becomes a warning of the recording.
pub fn check_rates(models: &[(&Path, Model)], results: &mut [Outcome]) -> anyhow::Result<()> {
    for (path, model) in models {
        for one in results.iter_mut() {
            let recording = &one.replayed.recording;
            let said =
                rate::check(model, recording).with_context(|| format!("{} on {}", path.display(), recording.name))?;
            one.source.warnings.extend(said);
        }
    }
    Ok(())
}

/// The same recording with corrected estimates, and what the guard did.
pub fn correct(corrector: &Corrector, replayed: &Replayed) -> (Replayed, GuardCounts) {
    follow(&mut corrector.clone(), replayed)
}

/// The same for all recordings in the order of time, so that what the adaptation learned of one helps with the next.
pub fn adapt(mut corrector: Corrector, results: &mut [Outcome]) -> Option<Adaptation> {
    let mut order: Vec<usize> = (0..results.len()).collect();
    order.sort_by_key(|&at| results[at].replayed.recording.frames.first().map_or(i64::MAX, |frame| frame.time_ns));
    for at in order {
        let before = *corrector.counts();
        corrector.reset();
        let (corrected, counts) = follow(&mut corrector, &results[at].replayed);
        results[at].corrected = Some((corrected, counts.since(&before)));
    }
    corrector.adaptation()
}

fn follow(corrector: &mut Corrector, replayed: &Replayed) -> (Replayed, GuardCounts) {
    let signal = corrector.signal();
    let mut estimates = replayed.estimates.clone();
    for (frame, estimate) in replayed.recording.frames.iter().zip(&mut estimates) {
        let corrected = corrector.step(frame, estimate).corrected;
        estimate.signals = signal.with(estimate.signals, corrected);
    }
    (replayed.with_estimates(estimates), *corrector.counts())
}

/// The summary of the corrected recordings, for the figures of the whole replay.
pub fn summary(
    path: &Path,
    corrected: &[(&(Replayed, GuardCounts), &RecordingSource)],
    plain: &ReplaySummary,
    cut: Cut,
) -> ReplaySummary {
    let together: Vec<_> = corrected.iter().map(|((replayed, _), source)| (replayed, *source)).collect();
    let mut summary = summarise(plain.parameters.clone(), cut, plain.inputs_between_samples, &together);
    let mut guard = GuardCounts::default();
    for ((_, counts), _) in corrected {
        guard.add(counts);
    }
    summary.residual = Some(Residual {
        model: path.display().to_string(),
        guard,
        adaptation: None,
        processes: summary.processes.clone(),
        overall: summary.overall.clone(),
    });
    summary
}
