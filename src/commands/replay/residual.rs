//! `replay --residual`: the same recordings with a learned residual on top of the twin.

use std::path::Path;

use anyhow::bail;
use govtwin::parameters::Unit;
use govtwin::replay::summary::{Provenance, Residual, Summary, summarise};
use govtwin::replay::{Replayed, Scores};
use govtwin::residual::corrector::Corrector;
use govtwin::residual::guard::Counts;
use govtwin::residual::row::Opening;
use govtwin::twin::Cut;

use crate::commands::model;

/// A model that fits the unit and the cut, ready to run.
pub fn load(path: &Path, unit: &Unit, cut: Cut) -> anyhow::Result<Corrector> {
    let opening = match cut {
        Cut::None => Opening::Simulated,
        Cut::Servomotor => Opening::Measured,
        Cut::Spool => bail!("--residual with --cut spool: the measured spool leaves nothing to correct"),
    };
    let model = model::load(path)?;
    model.check(unit, opening)?;
    Ok(Corrector::new(&model)?)
}

/// The same recording with corrected estimates, and what the guard did.
pub fn correct(corrector: &Corrector, replayed: &Replayed) -> (Replayed, Counts) {
    let mut corrector = corrector.clone();
    let signal = corrector.signal();
    let mut estimates = replayed.estimates.clone();
    for (frame, estimate) in replayed.recording.frames.iter().zip(&mut estimates) {
        let corrected = corrector.step(frame, estimate).corrected;
        estimate.signals = signal.with(estimate.signals, corrected);
    }
    let recording = replayed.recording.clone();
    let scores = Scores::of(&recording, &estimates);
    (Replayed { recording, estimates, scores }, *corrector.counts())
}

/// The summary of the corrected recordings, for the figures of the whole replay.
pub fn summary(path: &Path, corrected: &[(&(Replayed, Counts), &Provenance)], plain: &Summary, cut: Cut) -> Summary {
    let together: Vec<_> = corrected.iter().map(|((replayed, _), provenance)| (replayed, *provenance)).collect();
    let mut summary = summarise(plain.parameters.clone(), cut, plain.inputs_between_samples, &together);
    let mut guard = Counts::default();
    for ((_, counts), _) in corrected {
        guard.add(counts);
    }
    summary.residual = Some(Residual {
        model: path.display().to_string(),
        guard,
        processes: summary.processes.clone(),
        overall: summary.overall.clone(),
    });
    summary
}
