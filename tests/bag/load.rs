//! A force on the piston, recorded as the joint command that asks for it: an input like the others.

use govtwin_bag::msg::{Header, JointState};
use govtwin_bag::{ReadOptions, Stream, Warning};
use mcap::WriteOptions;

use super::make::{BEGIN_NS, Bag, MS, read_both_ways};

const TOPIC: &str = "/sim/joint_commands";

fn ask(bag: &mut Bag, topic: &str, stamp_ns: i64, position_m: f64, effort_n: f64) {
    let message = JointState {
        header: Header::at(stamp_ns),
        name: vec!["spool".to_owned(), "servomotor".to_owned()],
        position: vec![f64::NAN, position_m],
        effort: vec![f64::NAN, effort_n],
        ..JointState::default()
    };
    bag.put(topic, stamp_ns + MS, &message);
}

#[test]
fn a_force_holds_from_its_stamp_until_the_next_one_and_is_none_before_the_first() {
    for topic in [TOPIC, "/bench/joint_commands"] {
        let mut bag = Bag::standard(20);
        let [first_ns, second_ns] = [5005, 12_000].map(|ms| BEGIN_NS + ms * MS);
        ask(&mut bag, topic, first_ns, f64::NAN, 2e5);
        ask(&mut bag, topic, first_ns + 500 * MS, f64::NAN, f64::NAN);
        ask(&mut bag, topic, second_ns, f64::NAN, -1e5);
        bag.entries.sort_by_key(|entry| entry.log_ns);
        let (_folder, path) = bag.file(WriteOptions::new());
        let mut options = ReadOptions::default();
        options.topics.set(Stream::Load, topic);
        let loaded = read_both_ways(&path, &options).unwrap();
        let mut force_n = 0.0;
        for frame in &loaded.recording.frames {
            if frame.inputs.piston_force_n.is_finite() {
                force_n = frame.inputs.piston_force_n;
            }
            let expected_n = if frame.time_ns < first_ns {
                0.0
            } else if frame.time_ns < second_ns {
                2e5
            } else {
                -1e5
            };
            assert_eq!(force_n, expected_n, "{} ms", (frame.time_ns - BEGIN_NS) / MS);
        }
        assert!(loaded.recording.frames.iter().any(|frame| frame.time_ns == first_ns), "a row where it begins");
        let load = loaded.health.streams.last().unwrap();
        assert_eq!((load.topic.as_str(), load.messages, load.kept), (topic, 3, 3));
        assert!(loaded.health.is_clean(), "{:?}", loaded.health.warnings);
    }
}

#[test]
fn what_a_joint_command_asks_for_besides_a_force_is_reported_as_not_taken() {
    let mut bag = Bag::standard(10);
    ask(&mut bag, TOPIC, BEGIN_NS + 3000 * MS, 0.3, 1e5);
    ask(&mut bag, TOPIC, BEGIN_NS + 4000 * MS, f64::NAN, f64::INFINITY);
    let header = Header::at(BEGIN_NS + 5000 * MS);
    let name = vec!["servomotor".to_owned(), "servomotor".to_owned()];
    bag.put(TOPIC, BEGIN_NS + 5001 * MS, &JointState { header, name, effort: vec![1e5, 2e5], ..JointState::default() });
    bag.entries.sort_by_key(|entry| entry.log_ns);
    let (_folder, path) = bag.file(WriteOptions::new());
    let loaded = read_both_ways(&path, &ReadOptions::default()).unwrap();
    let told: Vec<String> = loaded.health.warnings.iter().map(ToString::to_string).collect();
    assert!(matches!(&loaded.health.warnings[..], [Warning::Dropped { count: 3, of: 3, .. }]), "{told:?}");
    assert!(told[0].contains(TOPIC) && told[0].contains("a joint command for a position"), "{told:?}");
    assert_eq!(loaded.recording.frames.last().unwrap().inputs.piston_force_n.to_bits(), f64::NAN.to_bits());
}

#[test]
fn a_bag_without_one_has_no_such_stream_and_a_topic_of_another_type_is_refused() {
    let (_folder, path) = Bag::standard(5).file(WriteOptions::new());
    let health = read_both_ways(&path, &ReadOptions::default()).unwrap().health;
    assert_eq!(health.streams.len(), Stream::ALL.len());
    let mut options = ReadOptions::default();
    options.topics.set(Stream::Load, "/governor/tank_pressure2");
    let mut bag = Bag::standard(5);
    bag.put(
        "/governor/tank_pressure2",
        BEGIN_NS + MS,
        &govtwin_bag::msg::EsvState { header: Header::at(BEGIN_NS), state: 1 },
    );
    let (_folder, path) = bag.file(WriteOptions::new());
    let error = read_both_ways(&path, &options).unwrap_err().to_string();
    assert!(error.contains("load") && error.contains("sensor_msgs/msg/JointState"), "{error}");
}
