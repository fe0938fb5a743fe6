//! The sim-to-real diagnosis: where the gap lies, which effect causes it, how far it shrinks.
//!
//! [`diagnose`] is the whole of it, a pure function of recordings and the sheet. It refits the sheet's parameters within their
//! tolerances, tries every effect of the catalogue on top ([`search`]), weighs what was found ([`decide`]), and
//! gathers the evidence that a reader needs to believe it: [`ledger`], [`stages`], [`latent`], [`visible`], [`closure`].

pub mod channels;
pub mod closure;
pub mod contract;
pub mod decide;
pub mod experiment;
pub mod latent;
pub mod ledger;
pub mod outcome;
pub mod rivals;
pub mod search;
pub mod stages;
pub mod summary;
pub mod visible;

use crate::diagnosis::outcome::Diagnosis;
use crate::diagnosis::rivals::Found;
use crate::diagnosis::search::Turned;
use crate::diagnosis::summary::Seen;
use crate::effects::{CATALOGUE, EffectSpec};
use crate::parameters::Unit;
use crate::recording::Recording;
use crate::tuning::knob::Knob;
use crate::tuning::noise::expected;
use crate::tuning::trial::Trial;

/// Fewest samples that a recording must have to be of use.
pub const FEWEST_SAMPLES: usize = 50;

/// What to try.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The effects to try, in the order of reports.
    pub catalogue: Vec<&'static EffectSpec>,
    /// Seed of the resampling behind intervals of closures.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self { catalogue: CATALOGUE.iter().collect(), seed: 1 }
    }
}

/// Why there can be no diagnosis.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DiagnosisError {
    /// Nothing to go by.
    #[error(
        "none of the {recordings} recordings has {FEWEST_SAMPLES} samples of servomotor or spool position; the longest has {longest}; \
         record a process of some seconds"
    )]
    TooLittle {
        /// Recordings given.
        recordings: usize,
        /// Samples of the longest.
        longest: usize,
    },
    /// No effect to try.
    #[error("the catalogue to try is empty; leave at least one effect in it")]
    NothingToTry,
}

/// Diagnoses a unit from its recordings.
///
/// `progress` hears what goes on and the share of the work that is done, 0 to 1. The result depends on recordings, unit and settings
/// alone, not on the number of threads.
///
/// # Errors
/// With too few samples, or nothing to try.
pub fn diagnose(
    recordings: Vec<Recording>,
    unit: &Unit,
    settings: &Settings,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Diagnosis, DiagnosisError> {
    if settings.catalogue.is_empty() {
        return Err(DiagnosisError::NothingToTry);
    }
    progress("reading the channels", 0.0);
    let channels = channels::survey(&recordings);
    let count = recordings.len();
    let trials: Vec<Trial> = recordings.into_iter().map(Trial::new).collect();
    let longest = trials.iter().map(|trial| trial.samples.len()).max().unwrap_or(0);
    let mut notes = Vec::new();
    let (usable, short): (Vec<Trial>, Vec<Trial>) =
        trials.into_iter().partition(|trial| trial.samples.len() >= FEWEST_SAMPLES);
    for trial in &short {
        notes.push(format!(
            "{} has only {} samples and was left out; {FEWEST_SAMPLES} are needed.",
            trial.name,
            trial.samples.len()
        ));
    }
    if usable.is_empty() {
        return Err(DiagnosisError::TooLittle { recordings: count, longest });
    }
    let noise = expected(&unit.sensors);
    progress("refitting the sheet's parameters within their tolerances", 0.02);
    let (bench, refitted, sheet) =
        search::nominal(usable, unit, Turned { knobs: Knob::nuisances(unit), starts: 1 }, &noise);
    let found: Found = rivals::find(&bench, refitted, &sheet, &settings.catalogue, progress);
    progress("placing free terms", 0.85);
    let floor = decide::floor(&bench, &found);
    let latents = latent::latents(&bench, &found.refitted, found.refitted.cost() - floor);
    let explained = latents.first().map_or(0.0, |latent| latent.explains);
    let decision = decide::decide(&found, &settings.catalogue, floor, explained);
    progress("gathering what the report shows", 0.9);
    Ok(summary::gather(&bench, &found, &decision, unit, settings, Seen { latents, channels, notes }))
}
