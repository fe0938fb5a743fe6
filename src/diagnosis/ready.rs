//! Recordings made ready for a diagnosis: of the whole chain where they hold the command, else of the servomotor stage behind the spool.

use crate::diagnosis::model::Model;
use crate::diagnosis::search::Turned;
use crate::diagnosis::support::Variant;
use crate::diagnosis::{DiagnosisError, Settings};
use crate::effects::{EffectSpec, STAGE_ALONE};
use crate::parameters::Unit;
use crate::recording::Recording;
use crate::signal::Signal;
use crate::tuning::admission::{Intake, admit_all};
use crate::tuning::bench::{Bench, square};
use crate::tuning::fit::Fit;
use crate::tuning::flexible::flexible;
use crate::tuning::knob::{Knob, unit_at};
use crate::tuning::noise::{Noise, expected};
use crate::tuning::sheetless;
use crate::tuning::trial::Trial;
use crate::twin::Cut;

/// Fewest samples of a piece of a recording.
const PIECE_SAMPLES: usize = 100;
/// Pieces that all recordings together are cut into, at most: with a sheet few, as play and pressures at the start of each are not measured.
const PIECES: (usize, usize) = (6, 2);
/// Starts of the fit where no data sheet says where to begin.
const STARTS: usize = 4;
/// Share of the movement that any law of the spool must explain, or the spool does not drive this servomotor.
const DRIVES: f64 = 0.3;

/// What a diagnosis begins with.
#[derive(Clone, Debug)]
pub struct Ready {
    /// What is fitted to; of a stage alone pieces of the recordings, each to be left out in turn.
    pub trials: Vec<Trial>,
    /// Of a stage alone the recordings as a whole, in pu; else empty.
    pub whole: Vec<Recording>,
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
    /// Whether the sheet is believed.
    pub sheet: bool,
    /// Share of the squared movement that the most flexible law of the spool explains; 1 of a whole chain.
    pub explained: f64,
}

/// Makes recordings ready.
///
/// # Errors
/// Where nothing is left that a diagnosis could go by; each recording's reason is told.
pub fn ready(recordings: Vec<Recording>, sheet: &Unit, settings: &Settings) -> Result<Ready, DiagnosisError> {
    let stage_only = settings.free || !recordings.iter().any(Recording::has_command);
    let cut = if stage_only { Cut::Spool } else { Cut::None };
    let Intake { admitted, notes, refused } = admit_all(recordings, |_| cut);
    if admitted.is_empty() {
        return Err(DiagnosisError::Unusable(refused.join("\n  ")));
    }
    let admitted: Vec<Recording> = admitted.into_iter().map(|(recording, _)| recording).collect();
    let (admitted, copies) = without_copies(admitted);
    let mut notes: Vec<String> = notes.into_iter().map(|note| format!("{note}.")).collect();
    notes.extend(copies);
    notes.extend(refused.into_iter().map(|reason| format!("Left out: {reason}.")));
    if stage_only {
        return servomotor_stage(admitted, sheet, settings, notes);
    }
    if let [only] = admitted.as_slice() {
        notes.push(format!(
            "One recording only ({}, {}): nothing could be left out of the fit, so closures are not tested on anything new.",
            only.name,
            only.process.title()
        ));
    }
    Ok(Ready {
        trials: admitted.into_iter().map(Trial::new).collect(),
        whole: Vec::new(),
        unit: sheet.clone(),
        turned: Turned { knobs: Knob::nuisances(sheet), starts: 1 },
        noise: expected(&sheet.sensors),
        catalogue: settings.catalogue.iter().copied().filter(|spec| !STAGE_ALONE.contains(&spec.id)).collect(),
        notes,
        sheet: true,
        explained: 1.0,
    })
}

/// Recordings that are not copies of earlier ones, and a sentence for each that is: the same samples are no further evidence.
fn without_copies(recordings: Vec<Recording>) -> (Vec<Recording>, Vec<String>) {
    let (mut kept, mut notes): (Vec<Recording>, Vec<String>) = (Vec::new(), Vec::new());
    for recording in recordings {
        match kept.iter().find(|other| is_copy(other, &recording)) {
            Some(first) => notes
                .push(format!("{} holds the same samples as {} and counts once with it.", recording.name, first.name)),
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
    settings: &Settings,
    mut notes: Vec<String>,
) -> Result<Ready, DiagnosisError> {
    let still =
        || DiagnosisError::Unusable("spool or servomotor stand still, so that neither says what drives what".into());
    for recording in &mut whole {
        // Rows between samples are of no use behind the spool.
        recording.frames.retain(|frame| frame.measured.spool_position_pu.is_finite());
    }
    let first = flexible(&trials(&whole)).ok_or_else(still)?;
    notes.insert(
        0,
        "Servomotor stage only, driven by the recorded spool; the chain before it was not recorded.".to_owned(),
    );
    if first.explained < DRIVES {
        return Err(DiagnosisError::Unusable(format!(
            "no law of the spool's position explains more than {:.0} % of the servomotor's movement; are both of one unit, and is the \
             spool's the main distributing valve's?",
            100.0 * first.explained.max(0.0)
        )));
    }
    let mut noise = expected(&sheet.sensors);
    let (unit, turned);
    if settings.free {
        notes.extend(sheetless::into_pu(&mut whole, first.gain_1_s));
    } else if first.gain_1_s < 0.0 {
        notes.push(
            "The servomotor moves against the spool's sign; is the spool position recorded the other way round?".into(),
        );
    }
    let cut = trials(&pieces(&whole, !settings.free));
    if settings.free {
        let seen = flexible(&cut).ok_or_else(still)?;
        noise[Signal::ServomotorPosition as usize] = seen.noise;
        unit = sheetless::unit(sheet, &seen, cut.first().map_or(0.1, |trial| trial.period_s));
        turned = Turned { knobs: sheetless::knobs(&unit), starts: STARTS };
        notes.push(
            "No data sheet: speed, overlap, damping, friction, mass and the spool's zero are fitted freely, about a stage that is alike in both \
             directions. Sizes are those of a servomotor with the reference unit's geometry; only ratios carry over."
                .to_owned(),
        );
        notes.push(format!(
            "No transducer is known: noise is taken as what the most flexible law of spool and opening leaves, {:.2} % of stroke.",
            100.0 * seen.noise.wander.hypot(seen.noise.white)
        ));
    } else {
        unit = sheet.clone();
        let mut knobs = Knob::nuisances(&unit);
        knobs.retain(sheetless::acts_behind_the_spool);
        turned = Turned { knobs, starts: 1 };
    }
    let catalogue = acting(&cut, &unit, settings, &noise);
    Ok(Ready {
        trials: cut,
        whole,
        unit,
        turned,
        noise,
        catalogue,
        notes,
        sheet: !settings.free,
        explained: first.explained,
    })
}

/// Cuts recordings into pieces, so that there is something to leave out.
fn pieces(recordings: &[Recording], sheet: bool) -> Vec<Recording> {
    let most = if sheet { PIECES.1 } else { PIECES.0 };
    let most = (most / recordings.len().max(1)).max(1);
    let mut all = Vec::new();
    for recording in recordings {
        let count = (recording.frames.len() / PIECE_SAMPLES).clamp(1, most);
        let size = recording.frames.len().div_ceil(count).max(1);
        for (k, frames) in recording.frames.chunks(size).enumerate() {
            let name = match count {
                1 => recording.name.clone(),
                _ => format!("{}, part {} of {count}", recording.name, k + 1),
            };
            all.push(Recording { name, process: recording.process, frames: frames.to_vec() });
        }
    }
    all
}

fn trials(recordings: &[Recording]) -> Vec<Trial> {
    recordings.iter().cloned().map(Trial::servomotor_stage).collect()
}

/// The effects that change the servomotor's position when the spool is given.
fn acting(trials: &[Trial], unit: &Unit, settings: &Settings, noise: &Noise) -> Vec<&'static EffectSpec> {
    let bench = Bench::new(trials.to_vec(), unit, noise);
    let misses = bench.misses_of(std::slice::from_ref(unit)).pop().unwrap_or_default();
    let fit = Fit { positions: Vec::new(), square: square(&misses), prior: 0.0, misses, slopes: Vec::new() };
    let model = Model::new(Vec::new(), unit.clone(), Vec::new(), fit);
    let acts = |spec: &&'static EffectSpec| {
        let Some((base, knobs, positions)) = model.with_effect(spec, Variant { size: 1.0, further: 1.0 }) else {
            return true;
        };
        bench.misses_of(&[unit_at(&base, &knobs, &positions)]).pop().is_some_and(|misses| misses != model.fit.misses)
    };
    let wanted = |spec: &&'static EffectSpec| !settings.free || sheetless::means_something(spec.id);
    settings.catalogue.iter().copied().filter(wanted).filter(acts).collect()
}
