//! Trips between slow samples: when the ESV really tripped, found from what the unit did.

use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::{Problem, twin_of};
use govtwin_model::frame::EsvState;
use govtwin_model::parameters::Unit;
use govtwin_model::replay::trips::{CommandCourse, cheapest, set_earlier};
use govtwin_model::units::nanos_from_seconds;

/// A problem's recordings as recorded, with their trips where this unit explains them best; none if no recording has a trip whose time is in doubt.
///
/// A trip that a slow recorder writes down with the next sample came up to one sample earlier. A servomotor at full speed makes a
/// hundredth of its stroke in that time: taken at its stamp, the trip would pass for a fault. `recorded` are the recordings before any trip was moved, so that
/// a trip that was moved too far comes back.
pub fn placed(problem: &Problem, recorded: &[PreparedRecording], unit: &Unit) -> Option<Vec<PreparedRecording>> {
    let mut any = false;
    let recordings = recorded
        .iter()
        .enumerate()
        .map(|(index, recording)| match doubt(recording) {
            Some((row, doubt_ns)) => {
                any = true;
                let of = |command| {
                    let price = |early_ns: i64| {
                        let moved = trip_at(recording, row, early_ns, command);
                        problem.residuals_in(&moved, twin_of(unit), index).norm_squared()
                    };
                    let (cost, early_ns) = cheapest(doubt_ns, price);
                    (cost, trip_at(recording, row, early_ns, command))
                };
                let [runs, steps] = CommandCourse::ALL.map(of);
                if steps.0 < runs.0 { steps.1 } else { runs.1 }
            }
            None => recording.clone(),
        })
        .collect();
    any.then_some(recordings)
}

/// The row of the first trip, and by how much it may be late, ns.
fn doubt(recording: &PreparedRecording) -> Option<(usize, i64)> {
    let state = |row: usize| recording.frames[row].inputs.esv;
    let row =
        (1..recording.frames.len()).find(|&row| state(row) == EsvState::Shutdown && state(row - 1) != state(row))?;
    recording.is_slow().then(|| (row, nanos_from_seconds(recording.period_s)))
}

/// The recording with its trip so much earlier.
fn trip_at(recording: &PreparedRecording, row: usize, early_ns: i64, command: CommandCourse) -> PreparedRecording {
    let mut moved = recording.clone();
    let before = recording.samples.iter().rev().copied().find(|&sample| sample < row).unwrap_or(0);
    set_earlier(&mut moved.frames, (before, row), early_ns, command);
    moved
}

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_model::frame::{Frame, Inputs, Signals};
    use govtwin_model::recording::Recording;

    /// Rows every 50 ms, of which every fourth was measured; the trip stands at 1 s, and the command is taken back with it.
    fn slow() -> PreparedRecording {
        let row = |k: i64| Frame {
            time_ns: k * 50_000_000,
            inputs: Inputs {
                opening_command_pu: if k <= 16 { 0.4 } else { (0.4 - 0.1 * (k - 16) as f64).max(0.0) },
                esv: if k >= 20 { EsvState::Shutdown } else { EsvState::Normal },
                tank_pressure_pa: 4e6,
                piston_force_n: 0.0,
            },
            measured: if k % 4 == 0 { Signals { spool_position_pu: 0.0, ..Signals::NONE } } else { Signals::NONE },
        };
        PreparedRecording::new(Recording::new("slow", (0..40).map(row).collect()))
    }

    #[test]
    fn a_command_that_steps_does_so_with_the_trip_and_nowhere_else() {
        let recording = slow();
        let (row, doubt_ns) = doubt(&recording).unwrap();
        assert_eq!((recording.frames[row].time_ns, doubt_ns), (1_000_000_000, 200_000_000));
        let of = |command| -> Vec<(f64, EsvState)> {
            let moved = trip_at(&recording, row, 100_000_000, command);
            moved.frames[14..22].iter().map(|frame| (frame.inputs.opening_command_pu, frame.inputs.esv)).collect()
        };
        let (runs, steps) = (of(CommandCourse::Runs), of(CommandCourse::Steps));
        let tripped = |rows: &[(f64, EsvState)]| rows.iter().position(|(_, esv)| *esv == EsvState::Shutdown);
        assert_eq!((tripped(&runs), tripped(&steps)), (Some(4), Some(4)));
        let commands = |rows: &[(f64, EsvState)]| rows.iter().map(|(command_pu, _)| *command_pu).collect::<Vec<_>>();
        assert_eq!(commands(&steps), [0.4, 0.4, 0.4, 0.4, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(commands(&runs)[..3], [0.4, 0.4, 0.4]);
        assert!(commands(&runs)[3] > commands(&runs)[4] && commands(&runs)[4] > 0.1);
    }

    /// A twin that trips amid two slow samples, with a command that is taken back then: both are found again.
    #[test]
    fn the_time_of_a_trip_and_what_the_command_did_are_found() {
        const TRIP_MS: i64 = 1_130;
        let unit = govtwin_model::params::reference();
        let row = |k: i64, opening_command_pu: f64, trip_ms: i64| Frame {
            time_ns: k * 1_000_000,
            inputs: Inputs {
                opening_command_pu,
                esv: if k >= trip_ms { EsvState::Shutdown } else { EsvState::Normal },
                tank_pressure_pa: unit.parameters.oil.tank_pressure_pa,
                piston_force_n: 0.0,
            },
            measured: Signals::NONE,
        };
        let mut twin = twin_of(&unit);
        let true_rows = (0..4_000).map(|k| row(k, if k < TRIP_MS { 0.4 } else { 0.0 }, TRIP_MS));
        let estimates: Vec<_> = true_rows.map(|frame| twin.step(&frame)).collect();
        let straight = |k: i64| (0.4 * (1_200 - k) as f64 / 200.0).clamp(0.0, 0.4);
        let rows = (0..4_000).map(|k| {
            let measured = if k % 200 == 0 { estimates[usize::try_from(k).unwrap()].signals } else { Signals::NONE };
            Frame { measured, ..row(k, straight(k), 1_200) }
        });
        let recording = PreparedRecording::new(Recording::new("slow", rows.collect()));
        let problem = Problem::new(vec![recording], &unit, &crate::likelihood::noise::expected(&unit.sensors));
        let moved = placed(&problem, &problem.recordings, &unit).unwrap();
        // From a problem whose trip was moved, the same is found: what is moved is the recording.
        let again = problem.anew(moved.clone(), &unit);
        let inputs =
            |recording: &PreparedRecording| recording.frames.iter().map(|frame| frame.inputs).collect::<Vec<_>>();
        assert_eq!(inputs(&placed(&again, &problem.recordings, &unit).unwrap()[0]), inputs(&moved[0]));
        let tripped = moved[0].frames.iter().find(|frame| frame.inputs.esv == EsvState::Shutdown).unwrap();
        assert!((tripped.time_ns / 1_000_000 - TRIP_MS).abs() <= 10, "{} ns", tripped.time_ns);
        let commands: Vec<f64> = moved[0].frames.iter().map(|frame| frame.inputs.opening_command_pu).collect();
        assert_eq!(commands.windows(2).filter(|two| two[0] != two[1]).count(), 1);
        let cost = |recording: &PreparedRecording| problem.residuals_in(recording, twin_of(&unit), 0).norm_squared();
        assert!(cost(&moved[0]) < 0.1 * cost(&problem.recordings[0]));
    }
}
