//! Late, doubled, impossible and misdated samples: each counted, placed, and kept from the rows.

use govtwin_bag::msg::{EsvState, GovernorCommand, Header, Time};
use govtwin_bag::{BagError, Health, Interpolation, ReadOptions, StreamHealth, Warning};
use mcap::WriteOptions;

use super::make::{BEGIN_NS, Bag, MS, read_both_ways};

const COMMAND: usize = 0;
const ESV: usize = 1;
const PRESSURE: usize = 2;
const SERVO: usize = 3;

fn read(bag: &Bag) -> govtwin_bag::Loaded {
    let (_folder, path) = bag.file(WriteOptions::new());
    read_both_ways(&path, &ReadOptions::default()).unwrap()
}

fn stream(health: &Health, number: usize) -> &StreamHealth {
    &health.streams[number]
}

/// All warnings in one text.
fn said(health: &Health) -> String {
    health.warnings.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

#[test]
fn late_samples_go_to_their_place() {
    let sound = read(&Bag::standard(3));
    let mut bag = Bag::standard(3);
    // Every tenth message is recorded 35 ms late: three samples of its own stream overtake it.
    for entry in bag.entries.iter_mut().step_by(10) {
        entry.log_ns += 35 * MS;
    }
    let late = read(&bag);
    assert_eq!(format!("{:?}", late.recording), format!("{:?}", sound.recording));
    assert!(stream(&late.health, COMMAND).late > 0 && stream(&late.health, SERVO).late > 0);
    assert!(said(&late.health).contains("arrived after later ones"));
}

#[test]
fn doubled_samples_are_dropped_and_of_two_values_the_last_logged_stays() {
    let mut bag = Bag::standard(2);
    bag.command(BEGIN_NS + 500 * MS, 0.3 + 0.01 * 0.5_f64.sin());
    bag.servo(BEGIN_NS + 700 * MS, 0.5, 0.75);
    if let Some(entry) = bag.entries.last_mut() {
        entry.log_ns += 3 * MS;
    }
    let loaded = read(&bag);
    let [command, servo] = [stream(&loaded.health, COMMAND), stream(&loaded.health, SERVO)];
    assert_eq!((command.messages, command.kept, command.duplicates, command.conflicts), (201, 200, 1, 0));
    assert_eq!((servo.messages, servo.kept, servo.duplicates, servo.conflicts), (201, 200, 0, 1));
    assert_eq!(loaded.recording.frames.len(), 200);
    assert_eq!(loaded.recording.frames[70].measured.servomotor_position_pu, 0.75);
    assert!(said(&loaded.health).contains("a second value for stamp 1700000000700000000 ns"));
}

#[test]
fn impossible_inputs_are_dropped_with_unit_and_place() {
    let mut bag = Bag::standard(2);
    bag.entries.retain(|entry| entry.log_ns != BEGIN_NS + 300 * MS + MS);
    bag.command(BEGIN_NS + 300 * MS, f64::NAN);
    bag.command(BEGIN_NS + 305 * MS, 12.0);
    bag.pressure(BEGIN_NS + 300 * MS, f64::INFINITY);
    bag.esv(BEGIN_NS + 300 * MS, 7);
    bag.servo(BEGIN_NS + 300 * MS, f64::NEG_INFINITY, 0.25);
    bag.servo(BEGIN_NS + 305 * MS, 99.0, 99.0);
    let loaded = read(&bag);
    let bad: Vec<u64> = loaded.health.streams.iter().map(|stream| stream.bad_values).collect();
    assert_eq!(bad, [2, 1, 1, 3]);
    let said = said(&loaded.health);
    for part in [
        "/governor/command: dropped from 2 of 201 messages; first: opening is NaN pu, expected -0.5 to 1.5 pu (logged at \
         1700000000301000000 ns)",
        "pressure is inf Pa, expected -110000 to 100000000 Pa",
        "ESV state is 7, expected 0 (shutdown) or 1 (normal)",
        "/plant/servo_state: dropped from 2 of 201 messages; first: position is -inf pu, expected -10 to 10 pu",
    ] {
        assert!(said.contains(part), "{part:?} not in\n{said}");
    }
    let frames = &loaded.recording.frames;
    assert!(frames.iter().all(|frame| (0.2..0.4).contains(&frame.inputs.opening_command_pu)));
    let frame = frames.iter().find(|frame| frame.time_ns == BEGIN_NS + 300 * MS).unwrap();
    assert!(frame.measured.spool_position_pu.is_nan(), "the bad signal only");
    assert_eq!(frame.measured.servomotor_position_pu, 0.25);
}

#[test]
fn a_stream_without_one_usable_value_says_why() {
    let mut bag = Bag::standard(1);
    bag.entries.retain(|entry| entry.topic != "/governor/esv");
    bag.esv(BEGIN_NS, 2);
    let (_folder, path) = bag.file(WriteOptions::new());
    let error = read_both_ways(&path, &ReadOptions::default()).unwrap_err();
    assert!(matches!(error, BagError::Unusable { messages: 1, .. }), "{error}");
    assert!(error.to_string().contains("ESV state is 2"), "{error}");
}

#[test]
fn a_stray_stamp_is_dropped() {
    let mut bag = Bag::standard(3);
    for (at_ns, stamp_ns) in [(500, 1_000_000 * MS), (900, BEGIN_NS + 86_400_000 * MS), (1300, BEGIN_NS - 5000 * MS)] {
        let message = GovernorCommand { header: Header::at(stamp_ns), opening: 0.9 };
        bag.put("/governor/command", BEGIN_NS + at_ns * MS + 2 * MS, &message);
    }
    let message = GovernorCommand {
        header: Header { stamp: Time { sec: 1_700_000_001, nanosec: 2_000_000_000 }, frame_id: String::new() },
        opening: 0.9,
    };
    bag.put("/governor/command", BEGIN_NS + 1700 * MS, &message);
    let loaded = read(&bag);
    assert_eq!(stream(&loaded.health, COMMAND).bad_stamps, 4, "{}", said(&loaded.health));
    assert_eq!(loaded.recording.frames.len(), 300);
    assert!(loaded.recording.frames.iter().all(|frame| frame.inputs.opening_command_pu < 0.5));
}

/// A standard recording whose commands have stamp 0.
fn without_clock(seconds: i64) -> Bag {
    let mut bag = Bag::standard(seconds);
    for (step, entry) in (0..).zip(bag.entries.iter_mut().filter(|entry| entry.topic == "/governor/command")) {
        let opening = 0.3 + 1e-4 * f64::from(step);
        entry.data = govtwin_bag::cdr::encode(&GovernorCommand { header: Header::at(0), opening }).unwrap();
    }
    bag
}

#[test]
fn samples_of_a_sender_without_a_clock_get_the_time_of_recording() {
    let loaded = read(&without_clock(2));
    assert_eq!((stream(&loaded.health, COMMAND).kept, stream(&loaded.health, COMMAND).unstamped), (200, 200));
    assert!(
        said(&loaded.health).contains("/governor/command: 200 of 200 samples have stamp 0"),
        "{}",
        said(&loaded.health)
    );
    // The command of 10 ms lies 1 ms later, when it was recorded.
    let at = |ms: i64| loaded.recording.frames.iter().find(|frame| frame.time_ns == BEGIN_NS + ms * MS).unwrap();
    assert_eq!(at(11).inputs.opening_command_pu, 0.3 + 1e-4);
    assert_eq!(at(20).inputs.opening_command_pu, 0.3 + 1e-4);
    // A simulation's clock begins at 0, and its first sample is as good as any other.
    let mut bag = shifted(2, -BEGIN_NS);
    bag.entries.iter_mut().for_each(|entry| entry.log_ns += BEGIN_NS);
    let loaded = read(&bag);
    assert_eq!(stream(&loaded.health, COMMAND).unstamped, 0);
    assert_eq!((loaded.recording.frames[0].time_ns, loaded.recording.frames.len()), (0, 200));
}

#[test]
fn when_time_runs_backwards_the_longer_run_is_read() {
    // A simulation of 2 s, reset, and run again for 3 s: the stamps repeat, the log times go on.
    let mut bag = Bag::standard(2);
    let mut second = Bag::standard(3);
    for entry in &mut second.entries {
        entry.log_ns += 2100 * MS;
    }
    let first_len = bag.entries.len() as u64;
    bag.entries.append(&mut second.entries);
    let loaded = read(&bag);
    assert_eq!(format!("{:?}", loaded.recording), format!("{:?}", read(&Bag::standard(3)).recording));
    let jump = loaded.health.warnings.iter().find(|warning| matches!(warning, Warning::ClockJump { .. }));
    let Some(Warning::ClockJump { from_ns, to_ns, jumps, left_out, .. }) = jump else {
        panic!("{}", said(&loaded.health));
    };
    assert!(to_ns < from_ns);
    assert_eq!((*jumps, *left_out), (1, first_len));
    assert!(said(&loaded.health).contains("time jumps backwards"));
}

#[test]
fn a_clock_set_forward_during_a_recording_splits_it() {
    let mut bag = Bag::standard(1);
    let log_ns: Vec<i64> = Bag::standard(5).entries.iter().map(|entry| entry.log_ns).collect();
    let day_ns = 86_400_000 * MS;
    for (later, log_ns) in shifted(5, day_ns).entries.into_iter().zip(log_ns).skip(bag.entries.len()) {
        bag.entries.push(super::make::Entry { log_ns, ..later });
    }
    let loaded = read(&bag);
    assert_eq!(loaded.recording.frames.len(), 400, "{}", said(&loaded.health));
    assert!(loaded.recording.frames[0].time_ns > day_ns);
    assert!(said(&loaded.health).contains("time jumps forwards"));
}

#[test]
fn a_leap_in_which_nothing_is_recorded_splits_the_recording() {
    // A clock that begins near 1970 and is then set, by which the recorder stamps too; and a pause of an hour.
    for (from_ns, to_ns) in [(10_000 * MS - BEGIN_NS, 0), (0, 3_600_000 * MS)] {
        let mut bag = shifted(3, from_ns);
        bag.entries.append(&mut shifted(5, to_ns).entries);
        // The first word of the ESV comes late after the leap.
        bag.entries.retain(|entry| {
            entry.topic != "/governor/esv"
                || entry.log_ns < BEGIN_NS + to_ns
                || entry.log_ns > BEGIN_NS + to_ns + 2900 * MS
        });
        let loaded = read(&bag);
        assert_eq!(stream(&loaded.health, COMMAND).kept, 500, "{}", said(&loaded.health));
        assert_eq!(stream(&loaded.health, COMMAND).other_run, 300);
        assert!(loaded.recording.frames[0].time_ns >= BEGIN_NS + to_ns);
        assert!(loaded.recording.duration_s() < 5.0);
        let by = if to_ns > 0 {
            ["nothing is recorded for 3597.0 s, from", "(pauses in all: 1)"]
        } else {
            ["time jumps forwards by 1699999987.0 s, from", "(jumps in all: 1)"]
        };
        for part in by {
            assert!(said(&loaded.health).contains(part), "{}", said(&loaded.health));
        }
    }
}

#[test]
fn a_stream_that_is_silent_while_others_speak_and_a_short_pause_are_no_leap() {
    let mut bag = Bag::default();
    for second in (0..900).filter(|second| !(400..700).contains(second) && !(890..895).contains(second)) {
        bag.command(BEGIN_NS + second * 1000 * MS, 0.3);
        bag.pressure(BEGIN_NS + second * 1000 * MS, 4e6);
    }
    bag.esv(BEGIN_NS, EsvState::NORMAL);
    bag.esv(BEGIN_NS + 899_000 * MS, EsvState::SHUTDOWN);
    let loaded = read(&bag);
    assert!(loaded.health.streams.iter().all(|stream| stream.other_run == 0), "{}", said(&loaded.health));
    assert!(loaded.recording.duration_s() > 898.0);
}

/// A standard recording whose stamps are later.
fn shifted(seconds: i64, by_ns: i64) -> Bag {
    let mut bag = Bag::default();
    for step in 0..seconds * 100 {
        let time_ns = BEGIN_NS + by_ns + step * 10 * MS;
        if step % 100 == 0 {
            bag.esv(time_ns, EsvState::NORMAL);
        }
        if step % 5 == 0 {
            bag.pressure(time_ns, 4e6);
        }
        bag.command(time_ns, 0.3);
        bag.servo(time_ns, 0.0, 0.3);
    }
    bag
}

#[test]
fn streams_of_clocks_that_differ_are_refused() {
    let mut bag = Bag::standard(2);
    // The plant's clock is 40 s behind: no stream runs backwards by itself.
    bag.entries.retain(|entry| entry.topic != "/plant/servo_state");
    for step in 0..200 {
        bag.servo(BEGIN_NS - 40_000 * MS + step * 10 * MS, 0.0, 0.3);
        if let Some(entry) = bag.entries.last_mut() {
            entry.log_ns += 40_000 * MS;
        }
    }
    let (_folder, path) = bag.file(WriteOptions::new());
    let error = read_both_ways(&path, &ReadOptions::default()).unwrap_err();
    assert!(matches!(error, BagError::Clocks { .. }), "{error}");
}

#[test]
fn streams_of_clocks_that_differ_by_years_are_refused() {
    // The plant's clock is the wall's, the governor's begins at power-up; time of recording goes on evenly.
    let mut bag = shifted(2, 1_000_000 * MS - BEGIN_NS);
    bag.entries.retain(|entry| entry.topic != "/plant/servo_state");
    bag.entries.iter_mut().for_each(|entry| entry.log_ns += BEGIN_NS - 1_000_000 * MS);
    (0..200).for_each(|step| bag.servo(BEGIN_NS + step * 10 * MS, 0.0, 0.3));
    let (_folder, path) = bag.file(WriteOptions::new());
    let error = read_both_ways(&path, &ReadOptions::default()).unwrap_err();
    assert!(matches!(error, BagError::Clocks { .. }), "{error}");
}

#[test]
fn inputs_that_begin_late_or_end_early_are_told() {
    let mut bag = Bag::standard(20);
    bag.entries.retain(|entry| match entry.topic.as_str() {
        "/governor/command" => entry.log_ns < BEGIN_NS + 5000 * MS,
        "/governor/tank_pressure" => entry.log_ns > BEGIN_NS + 3000 * MS && entry.log_ns < BEGIN_NS + 19_100 * MS,
        // An ESV that speaks when it changes.
        "/governor/esv" => entry.log_ns < BEGIN_NS + 900 * MS,
        _ => true,
    });
    let loaded = read(&bag);
    assert_eq!(loaded.recording.frames.len(), 1700);
    assert_eq!(
        said(&loaded.health),
        "/governor/command: ends 15.0 s before the recording: its last value holds\n\
         /governor/tank_pressure: begins 3.0 s after the recording: 300 rows left out"
    );
    // A slow stream begins and ends when it can.
    let mut slow = Bag::standard(20);
    slow.entries.retain(|entry| {
        entry.topic != "/governor/tank_pressure" || (entry.log_ns - BEGIN_NS - 1500 * MS) % (4000 * MS) == MS
    });
    assert_eq!(said(&read(&slow).health), "");
}

#[test]
fn gaps_are_told() {
    let mut bag = Bag::standard(4);
    bag.entries.retain(|entry| !(entry.log_ns > BEGIN_NS + 1000 * MS && entry.log_ns < BEGIN_NS + 1800 * MS));
    let loaded = read(&bag);
    let command = &stream(&loaded.health, COMMAND).pace;
    assert_eq!((command.gaps, command.rate_hz), (1, 100.0));
    assert!((command.longest_gap_s - 0.8).abs() < 0.011, "{}", command.longest_gap_s);
    assert!(said(&loaded.health).contains("/governor/command: 1 gaps, the longest 0.8"), "{}", said(&loaded.health));
    assert_eq!(stream(&loaded.health, PRESSURE).pace.gaps, 1);
    assert_eq!(stream(&loaded.health, ESV).pace.gaps, 0);
}

#[test]
fn linear_inputs_meet_their_samples_and_the_esv_holds() {
    let mut bag = Bag::default();
    for step in 0..5 {
        bag.command(BEGIN_NS + step * 200 * MS, 0.1 * step as f64);
        bag.pressure(BEGIN_NS + step * 200 * MS, 4e6);
        bag.esv(BEGIN_NS + step * 200 * MS, u8::from(step < 2));
    }
    let (_folder, path) = bag.file(WriteOptions::new());
    let interpolation = Interpolation::Linear { period_ns: 50 * MS };
    let frames =
        read_both_ways(&path, &ReadOptions { interpolation, ..ReadOptions::default() }).unwrap().recording.frames;
    assert_eq!(frames.len(), 17);
    for (step, frame) in frames.iter().enumerate() {
        assert!((frame.inputs.opening_command_pu - 0.025 * step as f64).abs() < 1e-12);
        assert_eq!(frame.inputs.esv == govtwin_model::frame::EsvState::Normal, step < 8);
    }
}
