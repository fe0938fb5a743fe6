//! Replaying a node's own bag, for tests.

use govtwin_bag::{Kind, ReadOptions, Topics, Warning};
use govtwin_model::frame::{Frame, Signals};
use govtwin_model::params;
use govtwin_model::twin::Twin;

/// Replays a journal as `govtwin replay` would, and compares each estimate's bits with the recorded ones.
pub fn assert_replays(folder: &std::path::Path, at_least: usize) {
    let topics = Topics { servo_state: "/sim/servo_state".to_owned(), ..Topics::default() };
    let loaded = govtwin_bag::read(folder, &ReadOptions { topics, ..ReadOptions::default() }).unwrap();
    let mut twin = Twin::new(&params::reference());
    let mut compared = 0;
    for row in &loaded.recording.frames {
        let estimate = twin.step(&Frame { measured: Signals::NONE, ..*row }).signals;
        let bits = |signals: &Signals| {
            [
                signals.spool_position_pu,
                signals.servomotor_position_pu,
                signals.pilot_valve_position_pu,
                signals.control_pressure_pa,
            ]
            .map(f64::to_bits)
        };
        assert_eq!(bits(&estimate), bits(&row.measured), "at {} ns", row.time_ns);
        compared += 1;
    }
    assert!(compared >= at_least, "only {compared} rows");
    // As `govtwin info` reads it: a leap of the clock apart, there is nothing to warn of, and a note that nothing was measured.
    let health = govtwin_bag::read(folder, &ReadOptions::default()).unwrap().health;
    let told: Vec<_> = health.warnings.iter().filter(|warning| !matches!(warning, Warning::Gap { .. })).collect();
    assert!(told.is_empty(), "{told:?}");
    assert!(health.notes.iter().any(|note| note.what == Kind::NotMeasured), "{:?}", health.notes);
}
