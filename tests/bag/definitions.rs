//! Messages are read by the definition of their own channel, and senders on one topic are told apart.

use std::collections::BTreeMap;
use std::io::Cursor;

use govtwin_bag::import::{Import, ImportError, Map, Target};
use govtwin_bag::msg::{EsvState, definition};
use govtwin_bag::{self as bag, BagError, Kind, ReadOptions};
use mcap::WriteOptions;
use mcap::records::MessageHeader;

use super::make::{BEGIN_NS, Bag, MS, in_file, read_both_ways};

const SERVO: &str = "governor_msgs/msg/ServoState";

/// A schema of the servo state with these fields behind the header.
fn schema(fields: &str) -> String {
    let text = definition::schema_of(SERVO).unwrap();
    let rest = text.find("====").unwrap();
    format!("std_msgs/Header header\n{fields}\n{}", &text[rest..])
}

/// A message with these values behind the header, each as a 64-bit or 32-bit number.
fn message(time_ns: i64, values: &[(f64, usize)]) -> Vec<u8> {
    let mut body = vec![];
    let nanos = u32::try_from(time_ns % 1_000_000_000).unwrap();
    body.extend(i32::try_from(time_ns / 1_000_000_000).unwrap().to_le_bytes());
    body.extend(nanos.to_le_bytes());
    body.extend([1, 0, 0, 0, 0]);
    for (value, size) in values {
        body.resize(body.len().next_multiple_of(*size), 0);
        match size {
            8 => body.extend(value.to_le_bytes()),
            _ => body.extend((*value as f32).to_le_bytes()),
        }
    }
    [&[0, 1, 0, 0][..], &body].concat()
}

/// A bag whose servo states follow one definition in the first half and another in the second.
fn two_definitions(first: &str, second: &str, types: [&str; 2]) -> Vec<u8> {
    let mut inputs = Bag::default();
    for step in 0..400 {
        let time_ns = BEGIN_NS + step * 10 * MS;
        inputs.command(time_ns, 0.3);
        inputs.esv(time_ns, EsvState::NORMAL);
        inputs.pressure(time_ns, 6.3e6);
    }
    let mut file = Cursor::new(vec![]);
    let mut writer = WriteOptions::new().profile("ros2").create(&mut file).unwrap();
    let mut known: BTreeMap<String, u16> = BTreeMap::new();
    for entry in &inputs.entries {
        let id = *known.entry(entry.topic.clone()).or_insert_with(|| {
            let text = definition::schema_of(&entry.type_name).unwrap();
            let schema = writer.add_schema(&entry.type_name, "ros2msg", text.as_bytes()).unwrap();
            writer.add_channel(schema, &entry.topic, "cdr", &BTreeMap::new()).unwrap()
        });
        let time = entry.log_ns as u64;
        let header = MessageHeader { channel_id: id, sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, &entry.data).unwrap();
    }
    let ids = [(first, types[0]), (second, types[1])].map(|(fields, type_name)| {
        let schema = writer.add_schema(type_name, "ros2msg", schema(fields).as_bytes()).unwrap();
        let metadata = BTreeMap::from([("fields".to_owned(), fields.to_owned())]);
        writer.add_channel(schema, "/plant/servo_state", "cdr", &metadata).unwrap()
    });
    for step in 0..400_i64 {
        let time_ns = BEGIN_NS + step * 10 * MS;
        let half = usize::from(step >= 200);
        let fields = [first, second][half];
        let values: Vec<(f64, usize)> = fields.lines().map(|line| value(line, step)).collect();
        let time = (time_ns + MS) as u64;
        let header = MessageHeader { channel_id: ids[half], sequence: 0, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, &message(time_ns, &values)).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

fn value(line: &str, step: i64) -> (f64, usize) {
    let size = if line.starts_with("float32") { 4 } else { 8 };
    let share = step as f64 / 400.0;
    let value = match line.split(' ').next_back().unwrap() {
        "spool_position" | "a" => 0.25 - share / 64.0,
        "servomotor_position" | "b" => 0.5 + share / 64.0,
        "pilot_valve_position" => 0.125,
        "control_pressure" => 3.0e6,
        _ => -7.0,
    };
    (value, size)
}

const KNOWN: &str =
    "float64 spool_position\nfloat64 servomotor_position\nfloat64 pilot_valve_position\nfloat64 control_pressure";
const OTHERS: [&str; 5] = [
    "float64 servomotor_position\nfloat64 spool_position\nfloat64 pilot_valve_position\nfloat64 control_pressure",
    "float64 control_pressure\nfloat64 pilot_valve_position\nfloat64 servomotor_position\nfloat64 spool_position",
    "float32 spool_position\nfloat32 servomotor_position\nfloat32 pilot_valve_position\nfloat32 control_pressure",
    "float64 temperature\nfloat64 spool_position\nfloat64 servomotor_position\nfloat64 pilot_valve_position\nfloat64 control_pressure",
    "float64 spool_position\nfloat64 servomotor_position\nfloat64 pilot_valve_position\nfloat64 control_pressure\nfloat64 extra",
];

#[test]
fn messages_of_two_definitions_are_read_each_by_its_own() {
    for other in OTHERS {
        for [first, second] in [[KNOWN, other], [other, KNOWN], [other, other]] {
            let (_folder, path) = in_file(&two_definitions(first, second, [SERVO; 2]));
            let loaded =
                read_both_ways(&path, &ReadOptions::default()).unwrap_or_else(|error| panic!("{other}: {error}"));
            let rows = loaded.recording.frames.iter().filter(|row| row.measured.servomotor_position_pu.is_finite());
            for (step, row) in (0..).zip(rows) {
                let near = |found: f64, name: &str| (found - value(name, step).0).abs() < 1e-6 * found.abs().max(1.0);
                let measured = row.measured;
                let right = near(measured.spool_position_pu, "float64 spool_position")
                    && near(measured.servomotor_position_pu, "float64 servomotor_position")
                    && near(measured.control_pressure_pa, "float64 control_pressure");
                assert!(right, "{other}: {measured:?} at {step}");
            }
            assert!(loaded.health.is_clean(), "{:?}", loaded.health.warnings);
            assert!(loaded.health.notes.iter().any(|note| note.what == Kind::OtherDefinition));
        }
    }
}

#[test]
fn a_definition_without_a_needed_field_is_refused_by_name() {
    for other in [
        "float64 spool_position\nfloat64 pilot_valve_position\nfloat64 control_pressure",
        "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    ] {
        for [first, second] in [[KNOWN, other], [other, KNOWN]] {
            let (_folder, path) = in_file(&two_definitions(first, second, [SERVO; 2]));
            let error = bag::read(&path, &ReadOptions::default()).unwrap_err();
            assert!(matches!(error, BagError::Type { .. }) && error.to_string().contains("is missing"), "{error}");
        }
    }
}

#[test]
fn a_map_reads_each_channel_by_its_own_definition() {
    let own = "plant_msgs/msg/Gate";
    let rows = |bytes: &[u8]| -> Result<Vec<(f64, f64)>, ImportError> {
        let (_folder, path) = in_file(bytes);
        let map = "signals: {spool_position: /plant/servo_state.a, servomotor_position: /plant/servo_state.b}\n";
        let map = Map::parse(map, std::path::Path::new("map.yaml"))?;
        let mut found = vec![];
        Import::open(&[path], &map)?.run(
            &mut |row| {
                found.extend(row.value(Target::SpoolPosition).zip(row.value(Target::ServomotorPosition)));
                Ok::<(), ImportError>(())
            },
            &mut |_| (),
        )?;
        Ok(found)
    };
    for [first, second] in
        [["float64 a\nfloat64 b", "float64 b\nfloat64 a"], ["float64 b\nfloat64 a", "float32 x\nfloat32 a\nfloat32 b"]]
    {
        let found = rows(&two_definitions(first, second, [own; 2])).unwrap();
        assert_eq!(found.len(), 400);
        for (step, (spool, servomotor)) in (0..).zip(found) {
            assert!(
                (spool - value("float64 a", step).0).abs() < 1e-6
                    && (servomotor - value("float64 b", step).0).abs() < 1e-6
            );
        }
    }
    let error =
        rows(&two_definitions("float64 a\nfloat64 b", "float64 a\nfloat64 c", [own; 2])).unwrap_err().to_string();
    assert!(error.contains("two definitions") && error.contains("no field `b`"), "{error}");
}
