//! Command and position without a spool: what the command is to the servomotor, and what stands in for the spool.

use crate::likelihood::prepared::join_spool;
use crate::stage_alone::competing_laws::Follows;
use crate::stage_alone::end_stops::between_stops;
use crate::stage_alone::pieces::{PIECES, pieces};
use crate::stage_alone::run::Run;
use crate::stage_alone::set_point::SetPoint;
use govtwin_model::number::significant;
use govtwin_model::recording::Recording;

/// What stands in for the spool.
#[derive(Clone, Debug, PartialEq)]
pub struct StandIn {
    /// A sentence on it.
    pub note: String,
    /// The deviation of the position from its set point, which holds the position itself; none where the command itself stands in.
    pub deviation: Option<Deviation>,
}

/// The deviation of a position from its set point, in the numbers of the recordings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// Position for each unit of the command.
    gain: f64,
    /// Position at the command 0.
    level: f64,
}

impl Deviation {
    /// The deviation at a command and a position.
    pub fn of(self, command: f64, position: f64) -> f64 {
        self.gain * command + self.level - position
    }
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
    let mut sampled = sampled(recordings);
    for recording in &mut sampled {
        join_spool(&mut recording.frames);
    }
    let Follows::Spool { .. } = between_stops(&sampled)?.follows else {
        let note =
            "No spool position was recorded: the command stands in for it, as the command of the valve.".to_owned();
        return Some(StandIn { note, deviation: None });
    };
    // Fitted with its lag: while the position is still on its way, the line over the command is not where it goes.
    let SetPoint { gain, level, .. } = SetPoint::fitted(&Run::of_pieces(pieces(&sampled, PIECES)), true)?;
    let deviation = Deviation { gain, level };
    for frame in recordings.iter_mut().flat_map(|recording| &mut recording.frames) {
        let measured = &mut frame.measured;
        measured.spool_position_pu = deviation.of(measured.spool_position_pu, measured.servomotor_position_pu);
    }
    let [slope, from_zero] = [gain, level.abs()].map(|number| significant(number, 4));
    let sign = if level < 0.0 { "−" } else { "+" };
    let note = format!(
        "No spool position was recorded, and the position settles to the command: the deviation of the position from {slope} × command {sign} {from_zero} \
         stands in for it, as a proportional regulator would move it."
    );
    Some(StandIn { note, deviation: Some(deviation) })
}

/// Recordings without the rows at which the servomotor was not measured.
fn sampled(recordings: &[Recording]) -> Vec<Recording> {
    let of = |recording: &Recording| {
        let frames = recording.frames.iter().filter(|frame| frame.measured.servomotor_position_pu.is_finite());
        Recording { process: recording.process, ..Recording::new(&recording.name, frames.copied().collect()) }
    };
    recordings.iter().map(of).collect()
}
