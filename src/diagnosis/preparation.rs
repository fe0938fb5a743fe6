//! Recordings made ready for a diagnosis: of the whole chain where they hold the command, else of the servomotor stage behind the spool.

pub(crate) mod channels;

use crate::estimation::coordinate::{square, subject_at};
use crate::estimation::fit::Fit;
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::noise::{Noise, expected};
use crate::likelihood::prepared::{PreparedRecording, join_spool};
use crate::likelihood::problem::Problem;
use crate::likelihood::qualification::{QualifiedRecordings, qualify_all};
use crate::model::FittedModel;
use crate::model::search::Turned;
use crate::model::support::Variant;
use crate::result::Setup;
use crate::stage_alone::command::{Deviation, StandIn, command_for_spool};
use crate::stage_alone::competing_laws::{Follows, told_apart};
use crate::stage_alone::flexible::{Flexible, flexible};
use crate::stage_alone::pieces::pieces;
use crate::stage_alone::plain::{Plain, plain};
use crate::stage_alone::run::Run;
use crate::stage_alone::sheetless::{self, sheetless};
use crate::{DiagnosisError, DiagnosisSettings};
use govtwin_model::effects::{EffectSpec, STAGE_ALONE};
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::signal::Signal;
use govtwin_model::twin::Cut;

/// Pieces that recordings are cut into where there is a sheet, at most: few, as play and pressures at the start of each are not measured.
const PIECES: usize = 2;
/// Starts of the fit where no data sheet says where to begin.
const STARTS: usize = 4;

/// What a diagnosis begins with.
#[derive(Clone, Debug)]
pub struct Preparation {
    /// What is fitted to; of a stage alone pieces of the recordings, each to be left out in turn.
    pub recordings: Vec<PreparedRecording>,
    /// The unit to begin from.
    pub unit: Unit,
    /// What is fitted.
    pub turned: Turned,
    /// Noise to expect.
    pub noise: Noise,
    /// The effects to try.
    pub catalogue: Vec<&'static EffectSpec>,
    /// What there is to say of all that.
    pub notes: Vec<String>,
    /// What is judged, and by what.
    pub setup: Setup,
    /// The stage, where it is judged alone.
    pub stage: Option<StageAlone>,
}

/// A servomotor stage, and what laws without physics say of it, in pu.
#[derive(Clone, Debug)]
pub struct StageAlone {
    /// The recordings as a whole.
    pub whole: Vec<Recording>,
    /// The most flexible law of spool and opening.
    pub seen: Flexible,
    /// The plain law: zero, dead band, a gain each way, lag.
    pub law: Plain,
    /// What the position makes of the spool.
    pub follows: Follows,
    /// Share of the squared movement that is left on runs left out, where it sums the spool up, settles to it, or does neither.
    pub left: [f64; 3],
    /// What stands in for a spool that was not recorded.
    pub stands_in: Option<StandIn>,
    /// Half of the time between rows where the spool is held from row to row, s; 0 where it runs straight.
    pub held_s: f64,
}

impl StageAlone {
    /// The deviation that stands in for the spool, where the command is a set point.
    pub(crate) fn deviation(&self) -> Option<Deviation> {
        self.stands_in.as_ref()?.deviation
    }
}

/// Makes recordings ready.
///
/// # Errors
/// Where nothing is left that a diagnosis could go by; each recording's reason is told.
pub fn prepare(
    mut recordings: Vec<Recording>,
    sheet: &Unit,
    settings: &DiagnosisSettings,
) -> Result<Preparation, DiagnosisError> {
    let setup = settings.setup.for_recordings(&recordings);
    let (cut, stands_in) = match setup {
        Setup::Chain | Setup::AssumedSheet => (Cut::None, None),
        Setup::Stage => (Cut::Spool, None),
        Setup::StageFree => (Cut::Spool, command_for_spool(&mut recordings)),
    };
    let QualifiedRecordings { qualified, notes, refused } = qualify_all(recordings, |_| cut);
    if qualified.is_empty() {
        return Err(DiagnosisError::Unusable(refused));
    }
    let qualified: Vec<Recording> = qualified.into_iter().map(|(recording, _)| recording).collect();
    let (qualified, copies) = without_copies(qualified);
    let mut notes: Vec<String> = notes.into_iter().map(|note| format!("{note}.")).collect();
    notes.extend(stands_in.iter().map(|one| one.note.clone()));
    notes.extend(copies);
    notes.extend(refused.into_iter().map(|reason| format!("Left out: {reason}.")));
    if cut == Cut::Spool {
        return servomotor_stage(qualified, sheet, setup, &settings.catalogue, (stands_in, notes));
    }
    if let [only] = qualified.as_slice() {
        notes.push(format!(
            "One recording only ({}, {}): explained fractions are tested on held-out parts of it, not on another recording.",
            only.name,
            only.process.title()
        ));
    }
    Ok(Preparation {
        recordings: qualified.into_iter().map(PreparedRecording::new).collect(),
        unit: sheet.clone(),
        turned: Turned { free_parameters: FreeParameter::nuisances(sheet), starts: 1 },
        noise: expected(&sheet.sensors),
        catalogue: settings.catalogue.iter().copied().filter(|spec| !STAGE_ALONE.contains(&spec.id)).collect(),
        notes,
        setup,
        stage: None,
    })
}

/// Recordings that are not copies of earlier ones, and a sentence for each that is: the same samples are no further evidence.
fn without_copies(recordings: Vec<Recording>) -> (Vec<Recording>, Vec<String>) {
    let (mut kept, mut notes): (Vec<Recording>, Vec<String>) = (Vec::new(), Vec::new());
    for recording in recordings {
        match kept.iter().find(|other| is_copy(other, &recording)) {
            Some(first) => {
                notes.push(format!("{} holds the same samples as {}; the two count once.", recording.name, first.name));
            }
            None => kept.push(recording),
        }
    }
    (kept, notes)
}

/// Whether two recordings hold the same samples at the same distances in time.
fn is_copy(a: &Recording, b: &Recording) -> bool {
    let since = |recording: &Recording, row: usize| recording.frames[row].time_ns - recording.frames[0].time_ns;
    let same = |a: f64, b: f64| a == b || (a.is_nan() && b.is_nan());
    a.frames.len() == b.frames.len()
        && (0..a.frames.len()).all(|row| {
            since(a, row) == since(b, row)
                && Signal::ALL
                    .iter()
                    .all(|signal| same(signal.of(&a.frames[row].measured), signal.of(&b.frames[row].measured)))
        })
}

fn servomotor_stage(
    mut whole: Vec<Recording>,
    sheet: &Unit,
    setup: Setup,
    catalogue: &[&'static EffectSpec],
    (stands_in, mut notes): (Option<StandIn>, Vec<String>),
) -> Result<Preparation, DiagnosisError> {
    let still = || {
        DiagnosisError::Unusable(vec![
            "spool or servomotor stand still, so that neither says what drives what".to_owned(),
        ])
    };
    notes.insert(
        0,
        "Servomotor stage only, driven by the recorded spool position; the chain before it was not diagnosed."
            .to_owned(),
    );
    let (recordings, unit, noise, turned, law, seen, follows, left);
    let mut held_s = 0.0;
    if setup == Setup::StageFree {
        // A deviation is not sent: it follows the position.
        let may_hold = stands_in.as_ref().is_none_or(|one| one.deviation.is_none());
        let prepared = sheetless(whole, sheet, may_hold).ok_or_else(still)?;
        held_s = prepared.held_s;
        notes.extend(prepared.notes);
        (whole, recordings, unit, noise) = (prepared.whole, prepared.pieces, prepared.unit, prepared.noise);
        (law, seen, follows, left) = (prepared.law, prepared.seen, prepared.follows, prepared.left);
        turned = Turned { free_parameters: prepared.free_parameters, starts: STARTS };
    } else {
        for recording in &mut whole {
            join_spool(&mut recording.frames);
        }
        recordings = pieces(&whole, PIECES).into_iter().map(PreparedRecording::servomotor_stage).collect::<Vec<_>>();
        (unit, noise) = (sheet.clone(), expected(&sheet.sensors));
        let mut free_parameters = FreeParameter::nuisances(&unit);
        free_parameters.retain(sheetless::acts_behind_the_spool);
        turned = Turned { free_parameters, starts: 1 };
        let runs = Run::all(&recordings);
        law = plain(&runs).ok_or_else(still)?;
        seen = flexible(&runs, &law).ok_or_else(still)?;
        (follows, left) = told_apart(&whole, &law).ok_or_else(still)?;
    }
    if setup == Setup::Stage && law.above_1_s + law.below_1_s < 0.0 {
        notes.push(
            "The servomotor moves against the sign of the spool; was the spool position recorded with the opposite sign?".into(),
        );
    }
    // In a loop whose valve signal was not recorded, a lag of the valve looks like a delay of the command, which is no fault of the stage.
    let is_loop = stands_in.as_ref().is_some_and(|one| one.deviation.is_some());
    let is_lag = |spec: &EffectSpec| spec.parameters[0].unit == "s";
    let wanted = |spec: &&'static EffectSpec| {
        setup == Setup::Stage || (sheetless::means_something(spec.id) && !(is_loop && is_lag(spec)))
    };
    let catalogue = acting(&recordings, &unit, catalogue.iter().copied().filter(wanted), &noise);
    let mut stage = StageAlone { whole, seen, law, follows, left, stands_in, held_s };
    if stage.deviation().is_some() {
        // What drives it holds the position: that it settles is known.
        stage.follows = Follows::Sum;
    }
    Ok(Preparation { recordings, unit, turned, noise, catalogue, notes, setup, stage: Some(stage) })
}

/// The effects that change the servomotor's position when the spool is given.
fn acting(
    recordings: &[PreparedRecording],
    unit: &Unit,
    wanted: impl Iterator<Item = &'static EffectSpec>,
    noise: &Noise,
) -> Vec<&'static EffectSpec> {
    let problem = Problem::new(recordings.to_vec(), unit, noise);
    let residuals = problem.residuals_of(std::slice::from_ref(unit)).pop().unwrap_or_default();
    let fit = Fit { positions: Vec::new(), square: square(&residuals), prior: 0.0, residuals, slopes: Vec::new() };
    let model = FittedModel::new(Vec::new(), unit.clone(), Vec::new(), fit);
    let acts = |spec: &&'static EffectSpec| {
        let Some((base, free_parameters, positions)) = model.with_effect(spec, Variant { size: 1.0, further: 1.0 })
        else {
            return true;
        };
        problem
            .residuals_of(&[subject_at(&base, &free_parameters, &positions)])
            .pop()
            .is_some_and(|residuals| residuals != model.fit.residuals)
    };
    wanted.filter(acts).collect()
}
