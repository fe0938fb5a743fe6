//! Recordings that cannot be of one machine and its time are named, and sound ones are not: made from shipped recordings.

use govtwin_bag::msg;
use govtwin_bag::{self as bag, Finding, Kind, ReadOptions, Severity, Warning};
use govtwin_model::frame::{EsvState, Frame};
use govtwin_model::signal::Signal;
use mcap::WriteOptions;

use super::defects::{DEFECTS, Defect, Fate, bag_of, frames};
use super::make::{Bag, MS, read_both_ways, shipped};

fn found(rows: &[Frame]) -> Vec<Finding> {
    let (_folder, path) = bag_of(rows).file(WriteOptions::new());
    let health = bag::read(&path, &ReadOptions::default()).unwrap().health;
    let of = |warning: &Warning| match warning {
        Warning::Doubtful(finding) if finding.what == Kind::Impossible => Some(finding.clone()),
        _ => None,
    };
    health.warnings.iter().filter_map(of).collect()
}

#[test]
fn recordings_that_cannot_be_are_named() {
    for name in [
        "practice/case_01/load_rejection.mcap",
        "practice/case_01/load_increase.mcap",
        "practice/case_03/load_rejection.mcap",
        "practice/case_05/startup.mcap",
    ] {
        let rows = frames(name);
        assert!(found(&rows).is_empty(), "{name}: {:?}", found(&rows));
        for Defect { what, change, .. } in DEFECTS.iter().filter(|defect| defect.fate == Fate::Impossible) {
            let mut changed = rows.clone();
            change(&mut changed);
            let named = found(&changed);
            assert!(named.iter().any(|one| one.severity == Severity::Disqualified), "{name}: {what}: {named:?}");
        }
    }
}

#[test]
fn a_spool_that_moves_before_its_command_is_named() {
    for name in ["practice/case_01", "practice/case_03", "practice/case_05"] {
        let rows = frames(&format!("{name}/load_rejection.mcap"));
        for (earlier, named) in [(-10, false), (0, false), (8, true), (10, true), (30, true)] {
            let mut changed = rows.clone();
            for (k, row) in changed.iter_mut().enumerate() {
                row.measured = rows[k.saturating_add_signed(earlier).min(rows.len() - 1)].measured;
            }
            let told = found(&changed);
            let is_told = told.iter().any(|one| one.words.contains("the spool moves before its command does"));
            assert_eq!(is_told, named, "{name}: {earlier}: {told:?}");
            assert!(told.iter().all(|one| one.severity == Severity::Warning), "{name}: {earlier}: {told:?}");
        }
    }
}

/// Without a spool the servomotor tells it, which takes longer to be seen.
#[test]
fn a_servomotor_that_moves_before_its_command_is_named() {
    for name in ["practice/case_01", "practice/case_03", "practice/case_05"] {
        for process in ["load_rejection", "load_increase", "startup"] {
            let rows = frames(&format!("{name}/{process}.mcap"));
            for (earlier, named) in
                [(-10, false), (0, false), (25, process == "load_rejection"), (40, process == "load_rejection")]
            {
                let mut changed = rows.clone();
                for (k, row) in changed.iter_mut().enumerate() {
                    row.measured = rows[k.saturating_add_signed(earlier).min(rows.len() - 1)].measured;
                    row.measured.spool_position_pu = f64::NAN;
                }
                let told = found(&changed);
                let is_told = told.iter().any(|one| one.words.contains("the servomotor moves before its command does"));
                assert!(is_told || !named, "{name} {process}: {earlier}: {told:?}");
                assert!(earlier > 0 || !is_told, "{name} {process}: {earlier}: {told:?}");
            }
        }
    }
}

#[test]
fn a_trip_that_its_stream_does_not_state_is_named() {
    for name in ["practice/case_01", "practice/case_03", "practice/case_05"] {
        let mut rows = frames(&format!("{name}/shutdown.mcap"));
        let trip = rows.iter().position(|row| row.inputs.esv == EsvState::Shutdown).unwrap();
        let asked_pu = rows[trip - 1].inputs.opening_command_pu;
        for row in &mut rows[trip..] {
            (row.inputs.esv, row.inputs.opening_command_pu) = (EsvState::Normal, asked_pu);
        }
        let told = found(&rows);
        let named = told.iter().find(|one| one.words.contains("the ESV has tripped without its state saying so"));
        assert_eq!(named.map(|one| one.severity), Some(Severity::Disqualified), "{name}: {told:?}");
    }
}

#[test]
fn nothing_shipped_is_impossible() {
    for case in 1..=8 {
        for process in ["startup", "load_increase", "load_rejection", "shutdown"] {
            let path = shipped(&format!("practice/case_{case:02}/{process}.mcap"));
            let health = bag::read(&path, &ReadOptions::default()).unwrap().health;
            assert_eq!(health.disqualified(), None, "{}", path.display());
        }
    }
}

#[test]
fn streams_of_two_clocks_are_refused_and_aligned_if_asked() {
    let rows = frames("practice/case_03/load_rejection.mcap");
    let shifted = [(-7200, true), (37, true), (5, true), (-2, true), (0, false)];
    let shifted = shifted.map(|(shift_s, refused)| (1, shift_s * 1000 * MS, refused));
    // Stamps that were never set, and such that stand still.
    for (runs, shift_ns, refused) in shifted.into_iter().chain([(0, 0, false), (0, 7, false)]) {
        let mut bag = Bag::default();
        for (k, row) in rows.iter().enumerate() {
            if k % 100 == 0 {
                bag.esv(row.time_ns, msg::EsvState::NORMAL);
            }
            bag.command(row.time_ns, row.inputs.opening_command_pu);
            bag.pressure(row.time_ns, row.inputs.tank_pressure_pa);
            let [servomotor, spool] = Signal::POSITIONS.map(|signal| signal.of(&row.measured));
            bag.servo(runs * row.time_ns + shift_ns, spool, servomotor);
            bag.entries.last_mut().unwrap().log_ns = row.time_ns + MS;
        }
        let (_folder, path) = bag.file(WriteOptions::new());
        let read = read_both_ways(&path, &ReadOptions::default());
        assert_eq!(read.is_err(), refused, "{runs} {shift_ns}");
        if let Err(error) = read {
            assert!(error.to_string().contains("--stamp log"), "{error}");
        }
        let mut options = ReadOptions::default();
        options.topics.by_log = true;
        let aligned = read_both_ways(&path, &options).unwrap().recording.frames;
        let measured: Vec<&Frame> =
            aligned.iter().filter(|row| row.measured.servomotor_position_pu.is_finite()).collect();
        assert_eq!(measured.len(), rows.len(), "{runs} {shift_ns}");
        for (found, row) in measured.iter().zip(&rows) {
            assert_eq!(found.measured.servomotor_position_pu, row.measured.servomotor_position_pu);
            assert_eq!(found.inputs.opening_command_pu, row.inputs.opening_command_pu);
        }
    }
}

/// Stamps and times of recording agree, so that nothing but the command's own time tells it.
#[test]
fn streams_that_have_no_time_in_common_are_refused() {
    let rows = frames("practice/case_03/load_rejection.mcap");
    for (shift_s, refused) in [(-3600, true), (0, false), (3600, true)] {
        let mut bag = Bag::default();
        for row in &rows {
            bag.esv(row.time_ns, msg::EsvState::NORMAL);
            bag.command(row.time_ns, row.inputs.opening_command_pu);
            bag.pressure(row.time_ns, row.inputs.tank_pressure_pa);
            let [servomotor, spool] = Signal::POSITIONS.map(|signal| signal.of(&row.measured));
            bag.servo(row.time_ns + shift_s * 1000 * MS, spool, servomotor);
        }
        let (_folder, path) = bag.file(WriteOptions::new());
        let read = read_both_ways(&path, &ReadOptions::default());
        let told = read.err().map(|error| error.to_string()).unwrap_or_default();
        assert_eq!(told.contains("no row has both"), refused, "{shift_s}: {told}");
    }
}

/// A state that is sent when it changes is handed to a recorder with the stamp of its last change, or recorded long before all else.
#[test]
fn an_esv_of_long_ago_holds_into_the_recording() {
    let rows = frames("practice/case_03/shutdown.mcap");
    let trip = rows.iter().find(|row| row.inputs.esv == EsvState::Shutdown).unwrap().time_ns;
    let read = |stamped_ns: i64, logged_ns: i64| {
        let mut bag = Bag::default();
        bag.esv(stamped_ns, msg::EsvState::NORMAL);
        bag.entries.last_mut().unwrap().log_ns = logged_ns;
        for row in &rows {
            bag.command(row.time_ns, row.inputs.opening_command_pu);
            bag.pressure(row.time_ns, row.inputs.tank_pressure_pa);
            let [servomotor, spool] = Signal::POSITIONS.map(|signal| signal.of(&row.measured));
            bag.servo(row.time_ns, spool, servomotor);
            if row.time_ns == trip {
                bag.esv(trip, msg::EsvState::SHUTDOWN);
            }
        }
        let (_folder, path) = bag.file(WriteOptions::new());
        let read = read_both_ways(&path, &ReadOptions::default()).unwrap();
        let rows = read.recording.frames.iter().filter(|row| row.inputs.esv == EsvState::Normal).count();
        (rows, read.recording.frames.len())
    };
    let begin_ns = rows[0].time_ns;
    let (normal, all) = read(begin_ns, begin_ns + MS);
    assert!(normal > 300 && all > 3900, "{normal} {all}");
    for (stamped_s, logged_s) in [(-3600, 0), (-700, -700), (-600, -600), (-300, -300)] {
        let found = read(begin_ns + stamped_s * 1000 * MS, begin_ns + logged_s * 1000 * MS + MS);
        assert_eq!(found, (normal, all), "{stamped_s} {logged_s}");
    }
}
