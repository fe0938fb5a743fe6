//! Writing: what is written comes back, a crash loses little, and nothing half-written stays behind.

use std::fs;
use std::path::Path;

use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Header, JointState, ServoState, type_hash};
use govtwin_bag::{BagError, Qos, ReadOptions, Warning, Writer, WriterOptions};

use super::make::{BEGIN_NS, Bag, MS, shipped, small_chunks};

/// Writes rows of all four topics.
fn write_rows(writer: &mut Writer, steps: std::ops::Range<i64>) {
    let command = writer.topic::<GovernorCommand>("/governor/command", Qos::SENSOR).unwrap();
    let esv = writer.topic::<EsvState>("/governor/esv", Qos::DEFAULT).unwrap();
    let pressure = writer.topic::<FluidPressure>("/governor/tank_pressure", Qos::SENSOR).unwrap();
    let servo = writer.topic::<ServoState>("/plant/servo_state", Qos::SENSOR).unwrap();
    for step in steps {
        let time_ns = BEGIN_NS + step * 10 * MS;
        let header = Header::at(time_ns);
        let opening = opening(step);
        writer.write(command, time_ns, &GovernorCommand { header: header.clone(), opening }).unwrap();
        writer.write(esv, time_ns, &EsvState { header: header.clone(), state: EsvState::NORMAL }).unwrap();
        let message = FluidPressure { header: header.clone(), fluid_pressure: 4.0e6, variance: 0.0 };
        writer.write(pressure, time_ns, &message).unwrap();
        let message = ServoState {
            header,
            spool_position: 0.01,
            servomotor_position: opening / 2.0,
            pilot_valve_position: f64::NAN,
            control_pressure: f64::NAN,
        };
        writer.write(servo, time_ns, &message).unwrap();
    }
}

fn opening(step: i64) -> f64 {
    0.1 + step as f64 / 1e5
}

fn names_in(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_written_bag_reads_back_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let mut writer = Writer::create(&path, WriterOptions::default()).unwrap();
    write_rows(&mut writer, 0..100);
    assert!(!path.exists());
    assert_eq!(writer.finish().unwrap(), path);
    let loaded = govtwin_bag::read(&path, &ReadOptions::default()).unwrap();
    assert!(loaded.health.is_clean(), "{:?}", loaded.health.warnings);
    assert_eq!(loaded.recording.frames.len(), 100);
    for (step, frame) in (0..).zip(&loaded.recording.frames) {
        assert_eq!(frame.time_ns, BEGIN_NS + step * 10 * MS);
        assert_eq!(frame.inputs.opening_command_pu.to_bits(), opening(step).to_bits());
        assert_eq!(frame.measured.servomotor_position_pu.to_bits(), (opening(step) / 2.0).to_bits());
        assert!(frame.measured.control_pressure_pa.is_nan());
    }
    assert_eq!(names_in(folder.path()), ["run"], "only the bag stays");
    assert_eq!(names_in(&path), ["metadata.yaml", "run_0.mcap"]);
}

#[test]
fn the_bag_says_what_rosbag2_wants_to_know() {
    let folder = tempfile::tempdir().unwrap();
    let mut writer = Writer::create(&folder.path().join("deep/down/run"), WriterOptions::default()).unwrap();
    write_rows(&mut writer, 0..10);
    let joints = writer.topic::<JointState>("/joint_states", Qos { transient_local: true, ..Qos::DEFAULT }).unwrap();
    writer.write(joints, BEGIN_NS, &JointState::default()).unwrap();
    let path = writer.finish().unwrap();

    let yaml: serde_yaml::Value =
        serde_yaml::from_str(&fs::read_to_string(path.join("metadata.yaml")).unwrap()).unwrap();
    let information = &yaml["rosbag2_bagfile_information"];
    assert_eq!(information["version"], 9);
    assert_eq!(information["message_count"], 41);
    assert_eq!(information["starting_time"]["nanoseconds_since_epoch"], BEGIN_NS);
    assert_eq!(information["duration"]["nanoseconds"], 90 * MS);
    assert_eq!(information["relative_file_paths"][0], "run_0.mcap");
    let topic = &information["topics_with_message_count"][4]["topic_metadata"];
    assert_eq!(topic["type"], "sensor_msgs/msg/JointState");
    assert_eq!(topic["offered_qos_profiles"][0]["durability"], "transient_local");
    assert_eq!(topic["offered_qos_profiles"][0]["reliability"], "reliable");

    let survey = govtwin_bag::survey(&path).unwrap();
    assert_eq!(survey.files[0].profile, "ros2");
    assert_eq!(survey.files[0].metadata, ["rosbag2"]);
    assert_eq!(survey.files[0].compressions, ["zstd"]);
    for topic in &survey.topics {
        assert_eq!(topic.type_hash, type_hash::type_hash(&topic.type_name).unwrap());
        assert_eq!(topic.type_hash_fits, Some(true));
    }
}

#[test]
fn copies_are_equal_in_every_byte_and_time() {
    let source = shipped("reference/shutdown_02.mcap");
    let folder = tempfile::tempdir().unwrap();
    let mut writer = Writer::create(&folder.path().join("copy"), WriterOptions::default()).unwrap();
    let extra = writer.topic::<ServoState>("/sim/servo_state", Qos::SENSOR).unwrap();
    for message in govtwin_bag::messages(&source).unwrap() {
        let message = message.unwrap();
        writer.copy(&message).unwrap();
        writer.write(extra, message.log_time_ns, &ServoState::default()).unwrap();
    }
    let path = writer.finish().unwrap();
    let original: Vec<_> = govtwin_bag::messages(&source).unwrap().map(Result::unwrap).collect();
    let copies: Vec<_> = govtwin_bag::messages(&path).unwrap().map(Result::unwrap).collect();
    assert_eq!(copies.len(), 2 * original.len());
    let copies: Vec<_> = copies.into_iter().filter(|message| message.topic.name != "/sim/servo_state").collect();
    assert_eq!(copies, original);
}

#[test]
fn after_a_crash_all_that_was_flushed_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let options = WriterOptions { keep_unfinished: true, ..WriterOptions::default() };
    let mut writer = Writer::create(&folder.path().join("run"), options).unwrap();
    write_rows(&mut writer, 0..500);
    writer.flush().unwrap();
    write_rows(&mut writer, 500..700);
    // A process that is killed runs no destructor.
    std::mem::forget(writer);
    assert_eq!(names_in(folder.path()), [".govtwin-run.lock", ".run.unfinished"]);
    let loaded = govtwin_bag::read(&folder.path().join(".run.unfinished"), &ReadOptions::default()).unwrap();
    assert!(loaded.recording.frames.len() >= 500, "{}", loaded.recording.frames.len());
    assert!(matches!(&loaded.health.warnings[..], [Warning::Damaged { .. }]), "{:?}", loaded.health.warnings);
    // The next recording of that name does not run over it; this process, which lives on, still holds it.
    let error = Writer::create(&folder.path().join("run"), options).unwrap_err();
    assert!(matches!(&error, BagError::Busy { held, .. } if held.ends_with(".govtwin-run.lock")), "{error}");
}

#[test]
fn what_is_given_up_leaves_nothing_unless_it_is_to_be_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let mut writer = Writer::create(&path, WriterOptions::default()).unwrap();
    write_rows(&mut writer, 0..50);
    drop(writer);
    assert!(names_in(folder.path()).is_empty());
    let options = WriterOptions { keep_unfinished: true, ..WriterOptions::default() };
    let mut writer = Writer::create(&path, options).unwrap();
    write_rows(&mut writer, 0..50);
    drop(writer);
    let loaded = govtwin_bag::read(&folder.path().join(".run.unfinished"), &ReadOptions::default()).unwrap();
    assert_eq!(loaded.recording.frames.len(), 50);
}

#[test]
fn only_bags_are_replaced_and_only_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run");
    let replace = WriterOptions { mark: Some("test"), ..WriterOptions::default() };
    for steps in [10, 20] {
        let mut writer = Writer::create(&path, replace).unwrap();
        write_rows(&mut writer, 0..steps);
        writer.finish().unwrap();
        assert_eq!(govtwin_bag::read(&path, &ReadOptions::default()).unwrap().recording.frames.len(), steps as usize);
    }
    assert_eq!(names_in(folder.path()), ["run"]);
    assert!(matches!(Writer::create(&path, WriterOptions::default()), Err(BagError::InTheWay { .. })));
    let papers = folder.path().join("papers");
    fs::create_dir(&papers).unwrap();
    fs::write(papers.join("thesis.txt"), "words").unwrap();
    assert!(matches!(Writer::create(&papers, replace), Err(BagError::InTheWay { .. })));
    assert!(matches!(Writer::create(&papers.join("thesis.txt"), replace), Err(BagError::InTheWay { .. })));
    assert_eq!(names_in(&papers), ["thesis.txt"]);

    // A bag without the mark stays, and so does one with the mark to which somebody has added a file.
    let other = WriterOptions { mark: Some("other"), ..WriterOptions::default() };
    for (name, options) in [("measured", WriterOptions::default()), ("others", other), ("noted", replace)] {
        let path = folder.path().join(name);
        let mut writer = Writer::create(&path, options).unwrap();
        write_rows(&mut writer, 0..10);
        writer.finish().unwrap();
        if name == "noted" {
            fs::write(path.join("notes.txt"), "words").unwrap();
        }
        let there = names_in(&path);
        assert!(matches!(Writer::create(&path, replace), Err(BagError::InTheWay { .. })), "{name}");
        assert_eq!(names_in(&path), there);
    }
}

#[test]
fn what_appeared_while_a_bag_was_written_stays_and_so_does_the_bag() {
    for keep_unfinished in [true, false] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        let mut writer = Writer::create(&path, WriterOptions { keep_unfinished, mark: Some("test") }).unwrap();
        write_rows(&mut writer, 0..50);
        fs::create_dir(&path).unwrap();
        fs::write(path.join("thesis.txt"), "words").unwrap();
        let error = writer.finish().unwrap_err();
        assert_eq!(names_in(&path), ["thesis.txt"], "{error}");
        let kept = folder.path().join(".run.unfinished");
        if keep_unfinished {
            assert!(
                matches!(error, BagError::PlaceTaken { .. }) && error.to_string().contains(".run.unfinished"),
                "{error}"
            );
            assert_eq!(govtwin_bag::read(&kept, &ReadOptions::default()).unwrap().recording.frames.len(), 50);
        } else {
            assert!(matches!(error, BagError::InTheWay { .. }), "{error}");
            assert!(!kept.exists(), "what can be made again leaves nothing");
        }
    }
}

#[test]
fn foreign_topics_without_schema_are_copied_as_well() {
    let mut bag = Bag::standard(1);
    for entry in bag.entries.iter_mut().step_by(7) {
        entry.topic = "/elsewhere".into();
        entry.type_name = "elsewhere_msgs/msg/Thing".into();
        entry.data = vec![1, 2, 3];
    }
    let (_source, source) = bag.file(small_chunks());
    let folder = tempfile::tempdir().unwrap();
    let mut writer = Writer::create(&folder.path().join("copy"), WriterOptions::default()).unwrap();
    for message in govtwin_bag::messages(&source).unwrap() {
        writer.copy(&message.unwrap()).unwrap();
    }
    let copy = writer.finish().unwrap();
    let all = |path: &Path| govtwin_bag::messages(path).unwrap().map(Result::unwrap).collect::<Vec<_>>();
    assert_eq!(all(&copy), all(&source));
}
