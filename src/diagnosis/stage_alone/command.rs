//! Command and position without a spool: what the command is to the servomotor, and what stands in for the spool.

use crate::likelihood::prepared::PreparedRecording;
use crate::stage_alone::competing_laws::{Follows, follows};
use crate::stage_alone::pieces::pieces;
use crate::stage_alone::plain::plain;
use crate::stage_alone::run::{Lag, Run, SpoolLaw, solved};
use govtwin_model::recording::Recording;

/// Pieces that the recordings are cut into, at most.
const PIECES: usize = 6;

/// What stands in for the spool.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StandIn {
    /// A sentence on it.
    pub note: String,
    /// Whether it is the deviation of the position from its set point, which holds the position itself.
    pub is_deviation: bool,
}

/// Puts the command, or its deviation from the position, in the place of a spool that no recording holds; says which.
///
/// A command that the position sums up is a valve's. One that the position settles to is a set point; its loop's deviation then drives the valve,
/// as a proportional regulator has it.
pub fn command_for_spool(recordings: &mut [Recording]) -> Option<StandIn> {
    let has_spool =
        |recording: &Recording| recording.frames.iter().any(|frame| frame.measured.spool_position_pu.is_finite());
    if recordings.iter().any(has_spool) || !recordings.iter().any(Recording::has_command) {
        return None;
    }
    // Rows between samples of the servomotor say nothing of it.
    let measured = recordings.iter_mut().flat_map(|recording| &mut recording.frames);
    for frame in measured.filter(|frame| frame.measured.servomotor_position_pu.is_finite()) {
        frame.measured.spool_position_pu = frame.inputs.opening_command_pu;
    }
    let prepared: Vec<PreparedRecording> =
        pieces(&sampled(recordings), PIECES).into_iter().map(PreparedRecording::servomotor_stage).collect();
    let runs = Run::all(&prepared);
    let (what, _) = follows(&runs, &plain(&runs)?)?;
    let Follows::Spool { settles_s } = what else {
        let note =
            "No spool position was recorded: the command stands in for it, as the command of the valve.".to_owned();
        return Some(StandIn { note, is_deviation: false });
    };
    let (slope, level) = settled(&runs, settles_s)?;
    for frame in recordings.iter_mut().flat_map(|recording| &mut recording.frames) {
        let measured = &mut frame.measured;
        measured.spool_position_pu = level + slope * measured.spool_position_pu - measured.servomotor_position_pu;
    }
    let note = format!(
        "No spool position was recorded, and the position settles to the command: the deviation {slope:.4} × command {level:+.4} − position stands in \
         for it, as a proportional regulator would move it."
    );
    Some(StandIn { note, is_deviation: true })
}

/// Recordings without the rows at which the servomotor was not measured.
fn sampled(recordings: &[Recording]) -> Vec<Recording> {
    let of = |recording: &Recording| {
        let frames = recording.frames.iter().filter(|frame| frame.measured.servomotor_position_pu.is_finite());
        Recording { name: recording.name.clone(), process: recording.process, frames: frames.copied().collect() }
    };
    recordings.iter().map(of).collect()
}

/// The straight line over the command to which the position settles, by least squares: slope and level.
fn settled(runs: &[Run], settles_s: f64) -> Option<(f64, f64)> {
    let line = SpoolLaw { lag: Lag::Dead(0.0), settles_s: Some(settles_s), shapes: &|command, _| vec![command, 1.0] };
    let best = solved(line.normals(runs).iter())?;
    (best[0].is_finite() && best[0] != 0.0).then(|| (best[0], best[1]))
}
