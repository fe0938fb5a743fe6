//! What `govtwin info` says, and its exit codes.

use mcap::WriteOptions;
use std::path::Path;
use std::process::{Command, Output};

use super::make::{Bag, in_file, shipped, small_chunks};

fn info(arguments: &[&Path], json: bool) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_govtwin"));
    command.arg("info").args(json.then_some("--json")).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn a_reference_recording_is_described() {
    let output = info(&[&shipped("reference/shutdown_01.mcap")], false);
    assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    for part in ["zstd", "indexed", "shutdown, ", "/governor/tank_pressure  sensor_msgs/msg/FluidPressure", "5.000"] {
        assert!(said.contains(part), "{part:?} not in\n{said}");
    }
}

#[test]
fn json_says_the_same_and_more() {
    let output = info(&[&shipped("reference/startup_01.mcap")], true);
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let entry = &json[0];
    assert_eq!(entry["recording"]["process"], "startup");
    assert_eq!(entry["messages"], 4160);
    let servo = entry["topics"].as_array().unwrap().iter().find(|topic| topic["name"] == "/plant/servo_state").unwrap();
    assert_eq!(servo["messages"], 1300);
    assert_eq!(servo["nan"], 2600, "two pilot signals that this plant does not measure");
    let field = &servo["fields"][1];
    assert_eq!(field["name"], "servomotor_position");
    assert!(field["most"].as_f64().unwrap() < 1.0 && field["least"].as_f64().unwrap() > -0.01);
    assert_eq!(entry["warnings_in_words"], serde_json::json!([]));
}

#[test]
fn warnings_end_with_three_and_errors_with_one() {
    let bytes = Bag::standard(2).bytes(small_chunks());
    let (_folder, cut) = in_file(&bytes[..bytes.len() / 2]);
    let output = info(&[&cut], false);
    assert_eq!(output.status.code(), Some(3));
    assert!(text(&output.stdout).contains("the file ends inside a chunk"), "{}", text(&output.stdout));

    let (_other, words) = in_file(b"words");
    let output = info(&[&words, &cut], false);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stderr).contains("not a bag"), "{}", text(&output.stderr));
    assert!(text(&output.stdout).contains("load increase"), "the bag that can be read is still described");
}

#[test]
fn a_foreign_bag_is_surveyed_without_judging_it() {
    let mut bag = Bag::default();
    for step in 0..40_i64 {
        let header = govtwin_bag::msg::Header::at(step * 25_000_000);
        let message = govtwin_bag::msg::JointState {
            header,
            name: vec!["a".into()],
            position: vec![f64::NAN, step as f64],
            velocity: vec![f64::INFINITY],
            effort: vec![],
        };
        bag.put("/joint_states", step * 25_000_000 + 3_000_000, &message);
    }
    let (_folder, path) = bag.file(WriteOptions::new());
    let survey = govtwin_bag::survey(&path).unwrap();
    let topic = &survey.topics[0];
    assert_eq!((topic.messages, topic.nan, topic.infinite, topic.undecodable), (40, 40, 40, 0));
    let stamps = topic.stamps.unwrap();
    assert_eq!((stamps.rate_hz, stamps.gaps, stamps.backwards), (40.0, 0, 0));
    assert_eq!(topic.delay_s.unwrap().median, 0.003);
    assert_eq!((topic.fields[0].least, topic.fields[0].most), (Some(0.0), Some(39.0)));
    let output = info(&[&path], false);
    assert_eq!(output.status.code(), Some(0));
    assert!(text(&output.stdout).contains("not of the servo system"));
}

#[test]
fn types_that_contain_themselves_are_not_walked() {
    let text = "A a\nB b\n===\nMSG: a_msgs/A\nA a\nB b\n===\nMSG: a_msgs/B\nA a\nB b\nfloat64 x\n";
    let mut file = std::io::Cursor::new(vec![]);
    let mut writer = mcap::Writer::new(&mut file).unwrap();
    let schema = writer.add_schema("a_msgs/msg/A", "ros2msg", text.as_bytes()).unwrap();
    let id = writer.add_channel(schema, "/a", "cdr", &std::collections::BTreeMap::new()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: id, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, &[0, 1, 0, 0, 1, 2, 3, 4]).unwrap();
    writer.finish().unwrap();
    drop(writer);
    let (_folder, path) = in_file(&file.into_inner());
    let topic = &govtwin_bag::survey(&path).unwrap().topics[0];
    assert_eq!((topic.readable, topic.messages), (false, 1));
}
