//! Data that can be read and looks plausible, and is wrong: each kind is found and named, and sound data is not accused.

use std::process::Command;
use std::sync::Arc;

use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Header, ServoState};
use govtwin_bag::{
    self, BagError, Finding, Health, Kind, ReadOptions, Severity, Stream, Warning, Writer, WriterOptions,
};
use mcap::WriteOptions;

use super::make::{BEGIN_NS, Bag, Entry, MS, in_file, read_both_ways, small_chunks};

fn read(bag: &Bag) -> Health {
    let (_folder, path) = bag.file(WriteOptions::new());
    read_both_ways(&path, &ReadOptions::default()).unwrap().health
}

/// What is found, warnings first.
fn found(health: &Health) -> Vec<Finding> {
    let doubtful = |warning: &Warning| match warning {
        Warning::Doubtful(finding) => Some(finding.clone()),
        _ => None,
    };
    health.warnings.iter().filter_map(doubtful).chain(health.notes.iter().cloned()).collect()
}

/// Fails unless this and nothing else but absent signals is found.
#[track_caller]
fn only(health: &Health, what: Kind, severity: Severity, words: &[&str]) {
    let all = found(health);
    let rest: Vec<&Finding> = all.iter().filter(|finding| finding.what != Kind::NotMeasured).collect();
    assert!(rest.len() == 1 && (rest[0].what, rest[0].severity) == (what, severity), "{all:#?}");
    let said = rest[0].to_string();
    for part in words {
        assert!(said.contains(part), "{part:?} not in {said}");
    }
}

/// Noise of some thousandths, the same in every run.
fn noise(step: i64) -> f64 {
    let mixed = (step as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(31).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    (mixed >> 40) as f64 / (1_u64 << 24) as f64 * 0.004 - 0.002
}

/// A plant that follows slow ramps of its command a tenth of a second behind, with noise; each row may be spoilt.
pub fn plant(seconds: i64, spoil: impl Fn(i64, &mut Row)) -> Bag {
    let mut bag = Bag::default();
    for step in 0..seconds * 100 {
        let time_ns = BEGIN_NS + step * 10 * MS;
        let opening = 0.5 + 0.3 * (step as f64 * 2e-3).sin();
        let mut row = Row {
            stamps_ns: [time_ns; 3],
            log_ns: time_ns + 300_000 + (step * 7919 % 1009) * 500,
            opening,
            pressure_pa: 6.3e6 + 2e5 * noise(step + 7),
            spool: 0.02 * (step as f64 * 2e-3).cos() + noise(step),
            servomotor: 0.5 + 0.3 * ((step - 10) as f64 * 2e-3).sin() + noise(step + 3),
            frame_id: "plant",
        };
        spoil(step, &mut row);
        let header = |k: usize| Header { frame_id: row.frame_id.into(), ..Header::at(row.stamps_ns[k]) };
        if step % 100 == 0 {
            bag.put("/governor/esv", row.log_ns, &EsvState { header: Header::at(time_ns), state: EsvState::NORMAL });
        }
        let message = FluidPressure { header: header(1), fluid_pressure: row.pressure_pa, variance: 0.0 };
        bag.put("/governor/tank_pressure", row.log_ns, &message);
        bag.put("/governor/command", row.log_ns, &GovernorCommand { header: header(0), opening: row.opening });
        let state = ServoState {
            header: header(2),
            spool_position: row.spool,
            servomotor_position: row.servomotor,
            pilot_valve_position: f64::NAN,
            control_pressure: f64::NAN,
        };
        bag.put("/plant/servo_state", row.log_ns, &state);
    }
    bag
}

/// One row of all streams; the stamps are of command, pressure and servo state.
pub struct Row {
    pub stamps_ns: [i64; 3],
    pub log_ns: i64,
    pub opening: f64,
    pub pressure_pa: f64,
    pub spool: f64,
    pub servomotor: f64,
    pub frame_id: &'static str,
}

#[test]
fn sound_data_is_not_accused() {
    let health = read(&plant(60, |_, _| {}));
    assert!(health.is_clean(), "{:?}", health.warnings);
    let said: Vec<String> = health.notes.iter().map(ToString::to_string).collect();
    assert_eq!(said.len(), 2, "{said:?}");
    assert_eq!(said[0], "/plant/servo_state: pilot_valve_position_pu is NaN throughout: not measured");
}

#[test]
fn two_senders_show_by_name_values_count_and_stamps() {
    let by_name = read(&plant(5, |step, row| row.frame_id = if step % 7 < 5 { "bench" } else { "simulator" }));
    let senders =
        found(&by_name).into_iter().filter(|finding| finding.what == Kind::SeveralSenders).collect::<Vec<_>>();
    assert_eq!(senders.len(), 3, "{senders:?}");
    assert!(
        senders[0].to_string().contains("frame_id changes 142 times between `bench` and `simulator`"),
        "{senders:?}"
    );
    let by_value = read(&plant(5, |step, row| row.opening += if step % 2 == 0 { 0.0 } else { 0.1 }));
    only(&by_value, Kind::SeveralSenders, Severity::Warning, &["/governor/command: more than one sender", "alternate"]);
    let mut bag = plant(5, |_, _| {});
    for (step, entry) in (1..).zip(bag.entries.iter_mut().filter(|entry| entry.topic == "/governor/command")) {
        entry.sequence = if step % 2 == 0 { 1000 + step } else { step };
    }
    only(&read(&bag), Kind::SeveralSenders, Severity::Warning, &["the messages' own count goes back 249 times"]);
    let mut bag = plant(5, |_, _| {});
    let again: Vec<Entry> = bag.entries.iter().filter(|entry| entry.topic == "/governor/command").cloned().collect();
    for (k, entry) in again.into_iter().enumerate().filter(|(k, _)| k % 3 == 0) {
        let stamp = Header::at(BEGIN_NS + k as i64 * 10 * MS);
        let data = govtwin_bag::cdr::encode(&GovernorCommand {
            header: Header { frame_id: "plant".into(), ..stamp },
            opening: 0.3,
        });
        bag.entries.push(Entry { data: data.unwrap(), ..entry });
    }
    let health = read(&bag);
    let all = found(&health);
    assert!(all.iter().any(|one| one.to_string().contains("167 stamps have two values")), "{all:?}");
}

#[test]
fn senders_that_the_recorder_saw_are_noted() {
    let (folder, path) = plant(5, |_, _| {}).file(WriteOptions::new());
    let mut writer = Writer::create(&folder.path().join("two"), WriterOptions::default()).unwrap();
    let mut topic = None;
    for message in govtwin_bag::messages(&path).unwrap() {
        let mut message = message.unwrap();
        if message.topic.name == "/governor/command" {
            let topic = topic.get_or_insert_with(|| {
                let one = govtwin_bag::Qos::DEFAULT.to_yaml();
                Arc::new(govtwin_bag::TopicInfo {
                    offered_qos_profiles: format!("{one}\n{one}"),
                    ..(*message.topic).clone()
                })
            });
            message.topic = Arc::clone(topic);
        }
        writer.copy(&message).unwrap();
    }
    let health = read_both_ways(&writer.finish().unwrap(), &ReadOptions::default()).unwrap().health;
    only(&health, Kind::SeveralSenders, Severity::Note, &["the recorder saw 2 senders"]);
}

#[test]
fn lost_messages_are_counted() {
    let mut bag = plant(5, |_, _| {});
    let mut sequence = 0;
    for entry in bag.entries.iter_mut().filter(|entry| entry.topic == "/governor/command") {
        sequence += if sequence == 100 { 8 } else { 1 };
        entry.sequence = sequence;
    }
    only(&read(&bag), Kind::Lost, Severity::Warning, &["7 messages are missing by the sender's own count"]);
}

#[test]
fn stamps_after_the_time_of_recording_are_told() {
    let ahead = |_, row: &mut Row| row.stamps_ns[2] += 250 * MS;
    let health = read(&plant(5, ahead));
    only(&health, Kind::StampsAhead, Severity::Warning, &["/plant/servo_state: 500 stamps lie after", "up to 0.250 s"]);
}

#[test]
fn clocks_that_drift_apart_are_warned_of_and_a_common_drift_is_noted() {
    let drift_ns = |step: i64| step * 10 * MS / 10_000;
    let health = read(&plant(300, |step, row| row.stamps_ns[2] -= drift_ns(step)));
    let words = ["/plant/servo_state: its clock and that of /governor/", "by 0.030 s from begin to end (100 parts"];
    only(&health, Kind::ClockDrift, Severity::Warning, &words);
    let all = |step: i64, row: &mut Row| row.log_ns += drift_ns(step);
    only(&read(&plant(300, all)), Kind::ClockDrift, Severity::Note, &["the streams do not differ"]);
    // Half a minute shows nothing of it.
    assert!(read(&plant(30, all)).notes.len() == 2);
    let played = read(&plant(30, |step, row| row.log_ns += step * 10 * MS));
    let notes: Vec<_> = found(&played).into_iter().filter(|finding| finding.what == Kind::Played).collect();
    assert!(notes.len() >= 3 && played.is_clean(), "{:?}", found(&played));
    assert!(notes[0].to_string().contains("run 0.50 times as fast"), "{}", notes[0]);
}

#[test]
fn single_samples_far_from_their_neighbours_are_told() {
    let health = read(&plant(20, |step, row| row.servomotor = if step % 500 == 250 { 0.0 } else { row.servomotor }));
    let words = ["servomotor_position_pu 4 of 2000 samples lie alone", "the farthest is 0 at"];
    only(&health, Kind::Outliers, Severity::Warning, &words);
    let health = read(&plant(20, |step, row| row.pressure_pa *= if step == 777 { 0.5 } else { 1.0 }));
    only(&health, Kind::Outliers, Severity::Warning, &["/governor/tank_pressure: 1 of 2000 samples"]);
    let health = read(&plant(20, |step, row| row.opening += if step == 777 { 0.2 } else { 0.0 }));
    only(&health, Kind::Outliers, Severity::Warning, &["/governor/command: 1 of 2000 samples"]);
    // A step is none, nor is a pulse that lasts.
    let health = read(&plant(20, |step, row| row.opening += if step > 777 && step < 800 { 0.2 } else { 0.0 }));
    assert!(health.is_clean(), "{:?}", health.warnings);
}

#[test]
fn frozen_and_saturated_signals_are_told() {
    let health = read(&plant(60, |step, row| row.spool = if step > 3000 { 0.0123 } else { row.spool }));
    let words = ["spool_position_pu stays at 0.0123 pu to the last bit for 30.0 s", "of the stroke: frozen?"];
    only(&health, Kind::Frozen, Severity::Warning, &words);
    let health = read(&plant(60, |_, row| row.servomotor = 0.4));
    only(&health, Kind::Impossible, Severity::Disqualified, &["rests at 40.0 %", "a channel is stuck"]);
    let health = read(&plant(60, |_, row| row.servomotor = row.servomotor.min(0.77)));
    only(&health, Kind::Saturated, Severity::Warning, &["samples are 0.77 pu exactly, the end of its range"]);
    // The end of the stroke may be the plant's own.
    let opened = |_, row: &mut Row| (row.opening, row.servomotor) = (1.0, (0.9995 + noise(row.log_ns)).min(1.0));
    let health = read(&plant(60, opened));
    only(&health, Kind::Saturated, Severity::Note, &["samples are 1 pu exactly"]);
    let health = read(&plant(5, |_, row| row.pressure_pa = 6.3e6));
    only(&health, Kind::Constant, Severity::Note, &["/governor/tank_pressure: is 6300000 Pa in every sample"]);
}

#[test]
fn nothing_measured_is_told_and_refused_where_it_is_needed() {
    let bag = plant(5, |_, row| (row.spool, row.servomotor) = (f64::NAN, f64::NAN));
    only(
        &read(&bag),
        Kind::NothingMeasured,
        Severity::Warning,
        &["500 samples, and no number in any of the four signals"],
    );
    let (_folder, path) = bag.file(WriteOptions::new());
    let options = ReadOptions { required: vec![Stream::ServoState], ..ReadOptions::default() };
    let error = read_both_ways(&path, &options).unwrap_err();
    assert!(matches!(error, BagError::Unusable { .. }) && error.to_string().contains("no number"), "{error}");
}

#[test]
fn a_tank_without_pressure_is_disqualified() {
    let bag = plant(5, |_, row| row.pressure_pa = 0.0);
    let (_folder, path) = bag.file(WriteOptions::new());
    let error = read_both_ways(&path, &ReadOptions::default()).unwrap_err();
    assert!(matches!(error, BagError::Unusable { messages: 500, .. }), "{error}");
    assert!(error.to_string().contains("pressure is 0 Pa, which moves nothing"), "{error}");
    let health = read(&plant(5, |step, row| row.pressure_pa *= if step % 100 == 50 { 0.0 } else { 1.0 }));
    let said = health.warnings[0].to_string();
    assert!(
        said.contains("/governor/tank_pressure: dropped from 5 of 500 messages; first: pressure is 0 Pa"),
        "{said}"
    );
}

#[test]
fn commands_beyond_the_stroke_are_told() {
    let stretched = |by: f64| {
        read(&plant(40, |step, row| {
            let stretch = |opening: f64| (opening - 0.5) * by + 0.5;
            row.opening = stretch(row.opening);
            row.servomotor = stretch(row.servomotor - noise(step + 3)).clamp(0.0, 1.0) + noise(step + 3);
        }))
    };
    let health = stretched(2.0);
    let words = ["/governor/command: commands from -0.1 to 1.1 pu; the stroke is 0 to 1 pu"];
    only(&health, Kind::BeyondStroke, Severity::Warning, &words);
    let health = stretched(1.73);
    only(&health, Kind::BeyondStroke, Severity::Note, &["to 1.019 pu"]);
    let (_folder, path) = plant(5, |_, row| row.opening *= 100.0).file(WriteOptions::new());
    let error = read_both_ways(&path, &ReadOptions::default()).unwrap_err().to_string();
    assert!(error.contains("opening is 50 pu, expected -0.5 to 1.5 pu; was it sent in percent?"), "{error}");
}

#[test]
fn files_without_checksums_or_counts_are_noted() {
    let bag = plant(5, |_, _| {});
    let notes = |options| {
        let (_folder, path) = in_file(&bag.bytes(options));
        let survey = govtwin_bag::survey(&path).unwrap();
        assert_eq!(survey.warnings, []);
        survey.notes.into_iter().map(|note| note.what).collect::<Vec<_>>()
    };
    assert_eq!(notes(small_chunks()), []);
    assert_eq!(notes(small_chunks().calculate_chunk_crcs(false)), [Kind::NoChecksum]);
    let bare = WriteOptions::new().use_chunks(false).emit_statistics(false);
    assert_eq!(notes(bare), [Kind::NoChecksum, Kind::NoCount]);
}

#[test]
fn a_damaged_summary_is_told_and_done_without() {
    let bag = plant(5, |_, _| {});
    let bytes = bag.bytes(small_chunks());
    let footer = bytes.len() - 8 - 20;
    let start = u64::from_le_bytes(bytes[footer..footer + 8].try_into().unwrap()) as usize;
    for at in (start..footer + 16).step_by(23) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x20;
        let (_folder, path) = in_file(&damaged);
        let loaded = read_both_ways(&path, &ReadOptions::default()).unwrap();
        let said: Vec<String> = loaded.health.warnings.iter().map(ToString::to_string).collect();
        assert!(said.iter().any(|line| line.contains("summary") || line.contains("footer")), "byte {at}: {said:?}");
        assert_eq!(loaded.recording.frames.len(), 500, "byte {at}");
    }
}

#[test]
fn notes_change_no_exit_code_and_stand_in_text_and_json() {
    let (_folder, path) = plant(5, |_, _| {}).file(WriteOptions::new());
    let run =
        |json: &[&str]| Command::new(env!("CARGO_BIN_EXE_govtwin")).arg("info").args(json).arg(&path).output().unwrap();
    let text = run(&[]);
    assert_eq!(text.status.code(), Some(0));
    let said = String::from_utf8(text.stdout).unwrap();
    assert!(said.contains("  note       /plant/servo_state: control_pressure_pa is NaN throughout"), "{said}");
    let json: serde_json::Value = serde_json::from_slice(&run(&["--json"]).stdout).unwrap();
    assert_eq!(json[0]["notes"][0]["what"], "not_measured");
    assert_eq!(json[0]["notes"][0]["severity"], "note");
    assert_eq!(json[0]["notes_in_words"].as_array().unwrap().len(), 2);
}
