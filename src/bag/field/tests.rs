//! Fields of messages by their paths, tried.

use super::*;
use crate::cdr;

fn reader(type_name: &str, schema: &str) -> FieldReader {
    FieldReader::new(&TopicInfo {
        type_name: type_name.into(),
        encoding: "cdr".into(),
        schema_encoding: "ros2msg".into(),
        schema: schema.as_bytes().into(),
        ..TopicInfo::default()
    })
    .unwrap()
}

#[test]
fn paths_are_read_and_refused() {
    let path = FieldPath::parse("/a/b.state.position[servo.main].x").unwrap();
    assert_eq!((path.topic.as_str(), path.steps.len()), ("/a/b", 3));
    assert_eq!(path.steps[1].index, Some(Index::Name("servo.main".into())));
    for text in ["a.b", "/a", "/a.", "/a.b[0", "/a.b]0[", "/.b", "/a..b"] {
        assert!(FieldPath::parse(text).is_err(), "{text}");
    }
}

#[test]
fn numbers_of_every_kind_are_found_by_index_and_by_name() {
    let schema = "string[] joint_names\nV[] values\nuint8 mode\nint16[3] raw\nbool trip\nfloat32 p\nstring word\n===\nMSG: \
                  p/V\nstring[] interface_names\nfloat64[] values\n";
    let reader = reader("p/msg/A", schema);
    let mut body: Vec<u8> = vec![];
    let pad = |body: &mut Vec<u8>, size: usize| body.resize(body.len().next_multiple_of(size), 0);
    let word = |body: &mut Vec<u8>, value: u32| {
        pad(body, 4);
        body.extend(value.to_le_bytes());
    };
    let text = |body: &mut Vec<u8>, text: &str| {
        word(body, u32::try_from(text.len()).unwrap() + 1);
        body.extend(text.as_bytes());
        body.push(0);
    };
    word(&mut body, 2);
    text(&mut body, "spool");
    text(&mut body, "servomotor");
    word(&mut body, 2);
    for values in [[0.25_f64, 1.0], [0.5, 2.0]] {
        word(&mut body, 2);
        text(&mut body, "position");
        text(&mut body, "velocity");
        word(&mut body, 2);
        pad(&mut body, 8);
        values.iter().for_each(|value| body.extend(value.to_le_bytes()));
    }
    body.push(7);
    pad(&mut body, 2);
    [-1_i16, 2, -300].iter().for_each(|value| body.extend(value.to_le_bytes()));
    body.push(1);
    pad(&mut body, 4);
    body.extend(6.5_f32.to_le_bytes());
    text(&mut body, "TRIP");
    let message = [&[0, 1, 0, 0][..], &body].concat();
    let number = |path: &str| reader.value(&FieldPath::parse(path).unwrap(), &message);
    for (path, value) in [
        ("/a.values[servomotor].values[position]", 0.5),
        ("/a.values[0].values[velocity]", 1.0),
        ("/a.values[1].values[1]", 2.0),
        ("/a.mode", 7.0),
        ("/a.raw[2]", -300.0),
        ("/a.trip", 1.0),
        ("/a.p", 6.5),
    ] {
        reader.check(&FieldPath::parse(path).unwrap()).unwrap();
        assert_eq!(number(path), Some(FieldValue::Number(value)), "{path}");
    }
    assert_eq!(number("/a.word"), Some(FieldValue::Text("TRIP".into())));
    assert_eq!(number("/a.values[absent].values[0]"), None);
    assert_eq!(number("/a.raw[9]"), None);
    assert_eq!(reader.value(&FieldPath::parse("/a.p").unwrap(), &message[..60]), None, "cut short");
    let leaves: Vec<String> = reader.leaves(&message).into_iter().map(|(path, _)| path).collect();
    assert!(leaves.contains(&"values[servomotor].values[position]".to_owned()), "{leaves:?}");
    assert!(leaves.contains(&"raw[2]".to_owned()) && leaves.contains(&"word".to_owned()), "{leaves:?}");
    for (path, words) in [
        ("/a.value", "has no field `value`; it has joint_names, values, mode"),
        ("/a.raw", "`raw` is an array; name an element"),
        ("/a.mode[0]", "is no array"),
        ("/a.values[0]", "is a structure; go on with one of interface_names, values"),
        ("/a.mode.x", "has no fields"),
    ] {
        let error = reader.check(&FieldPath::parse(path).unwrap()).unwrap_err();
        assert!(error.contains(words), "{error}");
    }
}

#[test]
fn a_name_that_stands_twice_gives_no_value() {
    let reader = reader("sensor_msgs/msg/JointState", "string[] name\nfloat64[] position\n");
    let message = cdr::encode(&(["gate", "spool", "gate"].map(str::to_owned).to_vec(), vec![1.0, 2.0, 3.0])).unwrap();
    let element = |path: &str| reader.element(&FieldPath::parse(path).unwrap(), &message);
    assert_eq!(element("/a.position[gate]"), (None, Some("gate".into())));
    assert_eq!(element("/a.position[spool]"), (Some(FieldValue::Number(2.0)), None));
    assert_eq!(element("/a.position[2]"), (Some(FieldValue::Number(3.0)), Some("gate".into())));
    let leaves: Vec<String> = reader.leaves(&message).into_iter().map(|(path, _)| path).collect();
    assert_eq!(leaves, ["position[0]", "position[spool]", "position[2]"]);
}

#[test]
fn crafted_lengths_cost_no_more_than_the_message_has_bytes() {
    let reader = reader("p/msg/A", "E[] a\nfloat64 x\n===\nMSG: p/E\nuint8[0] x\n");
    let message = [&[0, 1, 0, 0][..], &[0xff; 12]].concat();
    assert_eq!(reader.value(&FieldPath::parse("/a.x").unwrap(), &message), None);
    assert!(reader.leaves(&message).is_empty());
}
