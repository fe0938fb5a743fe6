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
use govtwin_model::signal::Signal;
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

/// A recording with corrected estimates.
pub struct Corrected {
    pub replayed: Replayed,
    /// The signal that was corrected.
    pub signal: Signal,
    /// Half the width of the band row by row, in the signal's unit.
    pub half_width: Vec<f64>,
    /// Share of the measured values that the band is to hold; none where the model has no band.
    pub coverage_share: Option<f64>,
    /// What the guard did.
    pub guard: GuardCounts,
}

/// The same recording with corrected estimates.
pub fn correct(corrector: &Corrector, replayed: &Replayed) -> Corrected {
    follow(&mut corrector.clone(), replayed)
}

/// The same for all recordings in the order of time, so that what the adaptation learned of one helps with the next.
pub fn adapt(mut corrector: Corrector, results: &mut [Outcome]) -> Option<Adaptation> {
    let mut order: Vec<usize> = (0..results.len()).collect();
    order.sort_by_key(|&at| results[at].replayed.recording.frames.first().map_or(i64::MAX, |frame| frame.time_ns));
    for at in order {
        let before = *corrector.counts();
        corrector.reset();
        let corrected = follow(&mut corrector, &results[at].replayed);
        results[at].corrected = Some(Corrected { guard: corrected.guard.since(&before), ..corrected });
    }
    corrector.adaptation()
}

fn follow(corrector: &mut Corrector, replayed: &Replayed) -> Corrected {
    let signal = corrector.signal();
    let mut estimates = replayed.estimates.clone();
    let mut half_width = Vec::with_capacity(estimates.len());
    for (frame, estimate) in replayed.recording.frames.iter().zip(&mut estimates) {
        let correction = corrector.step(frame, estimate);
        estimate.signals = signal.with(estimate.signals, correction.corrected);
        half_width.push(correction.half_width);
    }
    Corrected {
        replayed: replayed.with_estimates(estimates),
        signal,
        half_width,
        coverage_share: corrector.coverage_share(),
        guard: *corrector.counts(),
    }
}

/// The summary of the corrected recordings, for the figures of the whole replay.
pub fn summary(
    path: &Path,
    corrected: &[(&Corrected, &RecordingSource)],
    plain: &ReplaySummary,
    cut: Cut,
) -> ReplaySummary {
    let together: Vec<_> = corrected.iter().map(|(one, source)| (&one.replayed, *source)).collect();
    let mut summary = summarise(plain.parameters.clone(), cut, plain.inputs_between_samples, &together);
    let mut guard = GuardCounts::default();
    for (one, _) in corrected {
        guard.add(&one.guard);
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
