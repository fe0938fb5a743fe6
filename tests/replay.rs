//! Replay through the library: what is compared, and that nothing but time and inputs decides.

use govtwin::frame::{EsvState, Frame, Inputs, Signals};
use govtwin::parameters::Unit;
use govtwin::recording::Recording;
use govtwin::replay::{Replayed, Scores};
use govtwin::signal::Signal;
use govtwin::twin::Twin;

fn recording(unit: &Unit) -> Recording {
    let frame = |i: i32| Frame {
        time_ns: i64::from(i) * 10_000_000,
        inputs: Inputs {
            opening_command_pu: if i < 20 { 0.3 } else { 0.4 },
            esv: EsvState::Normal,
            tank_pressure_pa: unit.parameters.oil.tank_pressure_pa,
        },
        measured: Signals { servomotor_position_pu: if i % 2 == 0 { 0.3 } else { f64::NAN }, ..Signals::NONE },
    };
    Recording::new("steps", (0..100).map(frame).collect())
}

#[test]
fn a_replay_starts_anew_each_time() {
    let unit = govtwin::params::reference();
    let mut twin = Twin::new(&unit);
    let first = Replayed::new(&mut twin, recording(&unit));
    let second = Replayed::new(&mut twin, recording(&unit));
    assert_eq!(first.estimates, second.estimates);
}

#[test]
fn only_rows_that_were_measured_count() {
    let unit = govtwin::params::reference();
    let replayed = Replayed::new(&mut Twin::new(&unit), recording(&unit));
    assert_eq!(replayed.scores.figures(Signal::ServomotorPosition).count, 50);
    assert_eq!(replayed.scores.figures(Signal::SpoolPosition).count, 0);
    let mut twice = replayed.scores;
    twice.merge(&replayed.scores);
    assert_eq!(twice.figures(Signal::ServomotorPosition).count, 100);
    assert_eq!(Scores::of(&replayed.recording, &[]), Scores::default());
}
