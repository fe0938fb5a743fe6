//! The sim-to-real diagnosis: where the gap lies, which effect causes it, how far it shrinks.
//!
//! [`diagnose`] is the whole of it, a pure function of recordings and the sheet. It refits the sheet's parameters within their
//! tolerances, tries every effect of the catalogue on top ([`search`]), weighs what was found ([`decide`]), and
//! gathers the evidence that a reader needs to believe it: [`ledger`], [`stages`], [`latent`], [`visible`], [`closure`].

pub mod agreement;
pub mod channels;
pub mod closure;
pub mod contract;
pub mod decide;
pub mod experiment;
pub mod floor;
pub mod latent;
pub mod ledger;
pub mod model;
pub mod next;
pub mod outcome;
pub mod own_noise;
pub mod part;
pub mod ready;
pub mod rivals;
pub mod search;
pub mod stage_experiment;
pub mod stages;
pub mod summary;
pub mod traces;
pub mod visible;

use crate::diagnosis::decide::Decision;
use crate::diagnosis::outcome::{Diagnosis, Verdict};
use crate::diagnosis::rivals::Found;
use crate::diagnosis::summary::Seen;
use crate::effects::{CATALOGUE, EffectSpec};
use crate::parameters::Unit;
use crate::recording::Recording;
use crate::tuning::bench::Bench;

/// Where no effect gains anything, a refitted sheet that leaves so many times what a right model may leave lacks something that the catalogue does
/// not have. At 100 Hz generated sound units leave 1.19 times at most, a command that drops out now and then 5 times, a filter of the pilot
/// valve that the catalogue was made to lack 1.55 times.
const FOREIGN: f64 = 1.4;

/// What to try.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The effects to try, in the order of reports.
    pub catalogue: Vec<&'static EffectSpec>,
    /// Seed of the resampling behind intervals of closures.
    pub seed: u64,
    /// No data sheet is known: the servomotor stage alone is judged, and fitted freely.
    pub free: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { catalogue: CATALOGUE.iter().collect(), seed: 1, free: false }
    }
}

/// Why there can be no diagnosis.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DiagnosisError {
    /// Nothing to go by; each recording with its reason.
    #[error("no recording can be used for a diagnosis:\n  {0}")]
    Unusable(String),
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
    let ready = ready::ready(recordings, unit, settings)?;
    let stage_only = !ready.whole.is_empty();
    progress("refitting the sheet's parameters within their tolerances", 0.02);
    let settings = &Settings { catalogue: ready.catalogue.clone(), ..settings.clone() };
    let (bench, refitted, sheet) =
        search::nominal(ready.trials.clone(), &ready.unit, ready.turned.clone(), &ready.noise);
    let (bench, mut found): (Bench, Found) = rivals::find(bench, refitted, sheet, &settings.catalogue, progress);
    progress("placing free terms", 0.85);
    let floor = floor::floor(&bench, &found);
    let latents = latent::latents(&bench, &found.refitted, found.refitted.cost() - floor);
    let explained = latents.first().map_or(0.0, |latent| latent.explains);
    let mut decision = decide::decide(&found, &settings.catalogue, floor, explained);
    let mut notes = ready.notes.clone();
    if stage_only {
        let (modest, dropped) = part::modest(&bench, &mut found, &ready, decision, explained);
        decision = modest;
        notes.extend(dropped);
    }
    if decision.verdict == Verdict::Named {
        found.complete(&bench, &decision.blamed);
    }
    if !stage_only {
        let strange = agreement::disagreement(&bench, &found, floor);
        if strange.is_some() || untouched(&bench, &found, &decision) {
            decision = decision.forced(Verdict::Unknown);
        }
        let (doubted, reason) = doubts(&bench, &found, decision);
        decision = doubted;
        notes.extend(reason);
        notes.extend(
            decision.besides.iter().map(|rivals| {
                format!("Something acts besides what is named; {} would explain it.", rivals.join(" or "))
            }),
        );
        notes.extend(strange);
    }
    progress("gathering what the report shows", 0.9);
    let mut said = summary::gather(&bench, &found, &decision, &ready.unit, settings, Seen { latents, channels, notes });
    if stage_only {
        said.part = Some(part::describe(&ready, &found));
    }
    Ok(said)
}

/// Doubts what is named, or that there is nothing, by what it leaves and by how far it stretches the sheet; with the reason where the verdict turns.
fn doubts(bench: &Bench, found: &Found, decision: Decision) -> (Decision, Option<String>) {
    let named = decision.blamed.join(if decision.verdict == Verdict::Class { " or " } else { " and " });
    if named.is_empty() && decision.verdict != Verdict::NoGap {
        return (decision, None);
    }
    let whole = decision.whole(found);
    let left = if named.is_empty() { 0.0 } else { closure::share_left(bench, &found.refitted, whole) };
    let (by_left, by_strain) = (decide::odds_of_left(left), decide::odds_of_strain(whole.strain()));
    let doubted = decision.clone().doubted(by_left + by_strain);
    if doubted.verdict == decision.verdict {
        return (doubted, None);
    }
    let nearest = if named.is_empty() { String::new() } else { format!("Nearest in the catalogue: {named}. ") };
    let reason = if by_left > by_strain {
        format!(
            "With that {:.0} % of the squared gap of the positions stays beyond what a right model may leave: it resembles the cause, or \
             something acts besides.",
            100.0 * left
        )
    } else {
        format!(
            "The twin follows these recordings only if {}: the sheet is wrong there, or something acts that has nearly the same mark. \
             Correct the sheet or widen its tolerances if you know better.",
            whole.stretched().join(" and ")
        )
    };
    (doubted, Some(nearest + &reason))
}

/// Whether nothing gains and yet much is left, so that the unit is not sound; between slow samples nobody knows what drives it.
fn untouched(bench: &Bench, found: &Found, decision: &Decision) -> bool {
    decision.verdict == Verdict::NoGap && !bench.is_slow() && found.refitted.cost() > FOREIGN * decision.floor
}
