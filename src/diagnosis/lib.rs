//! The sim-to-real diagnosis: where the gap lies, which effect causes it, how far it shrinks.
//!
//! The verdict is the most probable set of faults given all recordings, with model error and tolerances integrated out. [`diagnose`] is the whole
//! of it, a pure function of recordings and the sheet: `preparation` makes recordings ready; [`model`] refits the sheet and puts effects and discrepancy
//! terms onto a unit; [`evidence`] weighs one fitted set; [`hypotheses`] finds and fits the sets that are worth it and tabulates their evidence; [`decision`] makes
//! that a posterior and reads the verdict off it; [`experiment`] proposes the next test; [`summary`] gathers what a reader needs to believe it, in the
//! types of [`result`]. No room uses one that uses it.

pub mod acceptance;
pub mod decision;
pub(crate) mod detectability;
pub mod estimation;
pub mod evidence;
pub mod experiment;
pub mod fleet;
pub mod generate;
pub(crate) mod homogeneity;
pub mod hypotheses;
pub mod identification;
pub mod likelihood;
pub mod model;
pub(crate) mod preparation;
pub(crate) mod regret;
pub mod replay_summary;
pub mod replay_validation;
pub mod result;
pub mod sheet;
pub mod stage_alone;
pub mod stage_only;
pub(crate) mod stamps;
pub mod summary;
pub mod trend;
pub mod watch;
pub mod words;

use crate::decision::Decision;
use crate::decision::hyperparameters::Hyperparameters;
use crate::decision::posterior::{Posterior, leaders};
use crate::hypotheses::table::EvidenceTable;
use crate::hypotheses::{Exploration, Explored, Singles};
use crate::likelihood::loop_noise::likelier;
use crate::preparation::channels::{averaged, survey};
use crate::result::{Diagnosis, Interval, Setup, Verdict};
use crate::stage_only::free_runs::Compared;
use crate::stamps::late_stamps;
use crate::summary::explained_fraction::ExplainedFractions;
use crate::summary::{BeforeVerdict, Judged, claimed};
use crate::words::WRONG_DATA;
use govtwin_model::effects::{CATALOGUE, EffectSpec, id_words};
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::signal::Signal;

/// What to try.
///
/// ```
/// use govtwin_diagnosis::DiagnosisSettings;
///
/// let mut settings = DiagnosisSettings::default();
/// settings.catalogue.retain(|effect| effect.id != "backlash"); // the owner knows that there is none
/// ```
#[derive(Clone, Debug)]
pub struct DiagnosisSettings {
    /// The effects to try, in the order of reports.
    pub catalogue: Vec<&'static EffectSpec>,
    /// Seed of the resampling behind intervals of explained fractions.
    pub seed: u64,
    /// What is judged, and by what. Of a chain whose command no recording holds the stage alone is judged.
    pub setup: Setup,
    /// True values of the unit with its effects, where they are known: the regret of the search is measured by them after the verdict, and nothing
    /// else follows from them.
    pub true_values: Option<Unit>,
}

impl Default for DiagnosisSettings {
    fn default() -> Self {
        Self { catalogue: CATALOGUE.iter().collect(), seed: 1, setup: Setup::Chain, true_values: None }
    }
}

/// Why there can be no diagnosis.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DiagnosisError {
    /// Nothing to go by; each recording with its reason, or what is wrong with all of them.
    #[error("no recording can be used for a diagnosis:\n  {}", .0.join("\n  "))]
    Unusable(Vec<String>),
    /// No effect to try.
    #[error("the catalogue to try is empty; leave at least one effect in it")]
    NothingToTry,
}

/// Diagnoses a unit from its recordings.
///
/// `progress` hears what goes on and the share of the work that is done, 0 to 1. The result depends on recordings, unit and settings
/// alone, not on the number of threads.
///
/// It takes seconds to minutes: about 20 s for four recordings of 40 s on two cores. `examples/diagnose_unit.rs` runs it on shipped recordings.
///
/// # Errors
/// With too few samples, or nothing to try.
///
/// Recordings that say nothing are refused:
///
/// ```
/// use govtwin_diagnosis::{DiagnosisError, DiagnosisSettings, diagnose};
/// use govtwin_model::{params::reference, recording::Recording};
///
/// let empty = vec![Recording::new("empty", vec![])];
/// let error = diagnose(empty, &reference(), &DiagnosisSettings::default(), &|_, _| ()).unwrap_err();
/// assert!(matches!(error, DiagnosisError::Unusable(_)));
/// ```
pub fn diagnose(
    recordings: Vec<Recording>,
    unit: &Unit,
    settings: &DiagnosisSettings,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Diagnosis, DiagnosisError> {
    if settings.catalogue.is_empty() {
        return Err(DiagnosisError::NothingToTry);
    }
    progress("reading the channels", 0.0);
    let channels = survey(&recordings);
    let ready = preparation::prepare(recordings, unit, settings)?;
    progress("refitting the sheet's parameters within their tolerances", 0.02);
    let settings = &DiagnosisSettings { catalogue: ready.catalogue.clone(), setup: ready.setup, ..settings.clone() };
    let (problem, refitted, sheet) =
        model::search::nominal(ready.recordings.clone(), &ready.unit, ready.turned.clone(), &ready.noise);
    let catalogue = &settings.catalogue;
    let left = refitted.cost() / problem.expected_cost().max(1.0);
    progress(&format!("recalibrated, the twin leaves {left:.1} times what noise would: profiling every effect"), 0.1);
    let singles = Singles::profiled(&problem, &refitted, &sheet, catalogue);
    // The likeliest effect tells the noise, and all fits count by that: where the unit chatters depends on what is wrong with it.
    let relaid = singles.leading().and_then(|unit| likelier(&problem, unit));
    let (mut problem, refitted, sheet) = match relaid {
        Some(relaid) => model::search::renewed(relaid, &refitted),
        None => (problem, refitted, sheet),
    };
    let exploration = Exploration::begin(&problem, &refitted, &sheet, &singles, catalogue, progress);
    let relaid = exploration.leading_unit().and_then(|unit| likelier(&problem, &unit));
    let mut explored = if let Some(relaid) = relaid {
        progress("starting again with the noise that the likeliest set leaves", 0.2);
        // Slopes are nearly all of the memory: what it found keeps none.
        let found = exploration.found();
        let (relaid, refitted, sheet) = model::search::renewed(relaid, &refitted);
        let explored =
            Exploration::begin_again(&relaid, &refitted, &sheet, found, catalogue, progress).finish(progress);
        problem = relaid;
        explored
    } else {
        exploration.finish(progress)
    };
    progress("tabulating the evidence", 0.85);
    let mut table = EvidenceTable::new(&problem, &explored, &settings.catalogue);
    table.assumed_sheet = ready.setup == Setup::AssumedSheet;
    if ready.stage.is_some() {
        stage_only::left_out::add(&mut table, &problem, &explored, ready.setup);
    }
    let numbers = Hyperparameters::shipped();
    let leading = leaders(&table, &numbers);
    table.look_for_distortions(&problem, &explored, &leading);
    let posterior = Posterior::new(&table, &numbers, &[]);
    let mut decision = Decision::new(&table, &posterior, &settings.catalogue);
    let mut notes = ready.notes.clone();
    let mut compared = Compared::default();
    if let Some(stage) = &ready.stage {
        let dropped;
        (decision, dropped, compared) = stage_only::modest(&problem, &explored, (&ready, stage), decision);
        notes.extend(dropped);
    } else if let Some(untrue) = homogeneity::disagreement(&problem, &explored, catalogue) {
        decision = decision.forced(Verdict::Unknown);
        notes.push(untrue);
    } else if let Some(untrue) =
        averaged(&channels, &ready.unit.sensors, ready.setup).or_else(|| late_stamps(&explored, &decision))
    {
        if !decision.blamed.is_empty() {
            decision = decision.forced(Verdict::Unknown);
        }
        notes.push(untrue);
    }
    explored.complete(&problem, &decision.blamed, decision.verdict == Verdict::Named, &settings.catalogue);
    let fractions = ExplainedFractions::new(&problem, explored.refitted(), settings.seed);
    let mut whole = fractions.of(claimed(&explored, &decision));
    if decision.claims_too_much(whole) {
        notes.push(too_little(&decision, whole));
        decision = decision.forced(Verdict::Unknown);
        whole = fractions.of(claimed(&explored, &decision));
    }
    notes.extend(rests_on(
        &table,
        &numbers,
        &decision,
        &problem.recordings.iter().map(|recording| recording.name.clone()).collect::<Vec<_>>(),
    ));
    let nearest = stretched(&explored, &decision, &notes);
    notes.extend(nearest);
    notes.extend(stands_out(&table, &decision));
    progress("gathering what the report shows", 0.9);
    let judged = Judged {
        problem: &problem,
        explored: &explored,
        table,
        posterior: &posterior,
        decision: &decision,
        numbers: &numbers,
        fractions,
        whole,
    };
    let mut diagnosis = summary::gather(judged, &ready.unit, settings, BeforeVerdict { channels, notes });
    // The stage alone is fitted to pieces of recordings, by parameters of its own.
    let true_values = settings.true_values.as_ref().filter(|_| ready.stage.is_none());
    diagnosis.regret = true_values.and_then(|unit| regret::regret(&problem, &explored, &settings.catalogue, unit));
    if let Some(stage) = &ready.stage {
        diagnosis.part = Some(stage_only::describe((&ready, stage), &explored, &decision, compared));
        if ready.setup == Setup::StageFree {
            diagnosis.sheet_limits = None;
            // What the most flexible law leaves is the error of equations, no transducer's noise.
            let judged = diagnosis.gap.iter_mut().filter(|gap| gap.signal == Signal::ServomotorPosition);
            judged.for_each(|gap| gap.noise_floor = stage.seen.transducers);
        }
    }
    Ok(diagnosis)
}

/// Why what is likeliest has no name.
fn too_little(decision: &Decision, explained: Interval) -> String {
    let names: Vec<String> = decision.blamed.iter().map(|id| id_words(id)).collect();
    let joined = names.join(if decision.verdict == Verdict::Class { " or " } else { " and " });
    let [value, high] = [explained.value, explained.high].map(|share| share * 100.0);
    format!("Likeliest: {joined}. It explains {value:.0} % of the gap, at most {high:.0} %: too little for a name.")
}

/// Distance from the sheet, in tolerances, that a reader should hear of: by chance one sheet in a thousand is so far off anywhere.
const FAR_FROM_SHEET: f64 = 4.0;

/// What is nearest where nothing has a name, unless the recordings are what is wrong, and how far the sheet must be wrong for it.
fn stretched(explored: &Explored, decision: &Decision, notes: &[String]) -> Option<String> {
    let nearest = explored.nearest(&decision.sets);
    let far = nearest.stretched(FAR_FROM_SHEET);
    let is_wrong_data = notes.iter().any(|note| note.contains(WRONG_DATA));
    let unknown = decision.verdict == Verdict::Unknown && !is_wrong_data;
    let names: Vec<String> = nearest.ids().iter().map(|id| id_words(id)).collect();
    let name = match names.join(" and ") {
        name if unknown && !name.is_empty() => format!("Nearest in the catalogue: {name}. "),
        _ => String::new(),
    };
    if far.is_empty() {
        return (!name.is_empty()).then(|| format!("{name}It leaves more of the error than the right effect would."));
    }
    Some(format!(
        "{name}The twin follows these recordings only if {}: the sheet is wrong there, or an effect with nearly the same signature acts. Correct \
         the sheet or widen its tolerances if you know better.",
        far.join(" and ")
    ))
}

/// A reader hears of a distortion that is less likely by chance than this.
const RARE: f64 = 0.01;
/// A smaller probability is not told.
const LEAST_SHOWN: f64 = 1e-99;

/// Where what the claimed twin leaves stands out.
fn stands_out(table: &EvidenceTable, decision: &Decision) -> Option<String> {
    let is_claimed = |effects: &[String]| {
        effects.len() == decision.blamed.len() && decision.blamed.iter().all(|id| effects.iter().any(|one| one == id))
    };
    let distortion = table.rows.iter().find(|row| is_claimed(&row.effects))?.distortion.as_ref()?;
    (distortion.p_value < RARE).then(|| {
        let p_value = distortion.p_value.max(LEAST_SHOWN);
        let below = if p_value > distortion.p_value { "below" } else { "of" };
        format!(
            "What the twin leaves stands out in the {}: by chance that happens with a probability {below} {p_value:.0e}.",
            distortion.words(),
        )
    })
}

/// Which recording a name rests on: without it the posterior would name something else, or nothing.
fn rests_on(
    table: &EvidenceTable,
    numbers: &Hyperparameters,
    decision: &Decision,
    recordings: &[String],
) -> Option<String> {
    if decision.verdict != Verdict::Named {
        return None;
    }
    if recordings.len() < 2 {
        return Some(
            "One recording alone: this is its best explanation, not confirmed by another recording.".to_owned(),
        );
    }
    let without = |left: usize| Posterior::new(&table.without(left), numbers, &[]);
    let kept = |left: usize| {
        let posterior = without(left);
        decision.blamed.iter().all(|id| posterior.inclusion(table, id) > 0.5)
    };
    let needed: Vec<&str> =
        (0..recordings.len()).filter(|&left| !kept(left)).map(|left| recordings[left].as_str()).collect();
    (!needed.is_empty()).then(|| {
        format!("Without {}, the other recordings would not name the same cause.", needed.join(", or without "))
    })
}
