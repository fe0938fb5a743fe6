//! What is no usable bag: each error says path, expected, found and the way out.

use std::fs;
use std::path::Path;

use govtwin_bag::msg::{FluidPressure, Header, JointState};
use govtwin_bag::{BagError, ReadOptions, Warning};
use mcap::WriteOptions;

use super::make::{BEGIN_NS, Bag, in_file, read_both_ways, small_chunks};

fn error_of(path: &Path) -> (BagError, String) {
    let error = read_both_ways(path, &ReadOptions::default()).map(|_| ()).unwrap_err();
    let text = error.to_string();
    assert!(text.starts_with(&path.display().to_string()), "the path comes first: {text}");
    (error, text)
}

#[test]
fn what_is_not_there() {
    let (error, text) = error_of(Path::new("/nowhere/run.mcap"));
    assert!(matches!(error, BagError::Io { action: "open", .. }), "{text}");
}

#[test]
fn what_is_something_else() {
    for (bytes, found) in [
        (&b"time,value\n1,2\n"[..], "text that begins with \"time,value\""),
        (&[], "an empty file"),
        (b"#ROSBAG V2.0\n\0\0", "ROS 1 bag"),
        (&[0x28, 0xb5, 0x2f, 0xfd, 0, 1, 2], "an empty file, compressed with zstd"),
        (&[0xff, 0xd8, 0xff, 0xe0, 1, 2, 3, 4], "ff, d8, ff, e0"),
    ] {
        let (_folder, path) = in_file(bytes);
        let (error, text) = error_of(&path);
        assert!(matches!(error, BagError::NotABag { .. }), "{text}");
        assert!(text.contains(found) && text.contains("expected an MCAP file"), "{text}");
    }
}

#[test]
fn folders_without_a_bag() {
    let folder = tempfile::tempdir().unwrap();
    let (_, text) = error_of(folder.path());
    assert!(text.contains("found an empty folder"), "{text}");
    for number in 0..7 {
        fs::write(folder.path().join(format!("note_{number}.txt")), "words").unwrap();
    }
    let (_, text) = error_of(folder.path());
    assert!(text.contains("note_4.txt and 2 more") && text.contains("metadata.yaml"), "{text}");
}

#[test]
fn a_type_that_is_not_the_streams() {
    let mut bag = Bag::standard(1);
    bag.entries.retain(|entry| entry.topic != "/governor/command");
    bag.put("/governor/command", BEGIN_NS, &JointState { header: Header::at(BEGIN_NS), ..JointState::default() });
    let (_folder, path) = bag.file(WriteOptions::new());
    let (error, text) = error_of(&path);
    assert!(matches!(error, BagError::Type { .. }), "{text}");
    for part in ["topic `/governor/command`", "governor_msgs/msg/GovernorCommand`, found `sensor_msgs/msg/JointState`"]
    {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn a_type_of_the_right_name_with_other_fields() {
    let mut bytes = Bag::standard(1).bytes(WriteOptions::new().compression(None).calculate_chunk_crcs(false));
    // The definition calls the field otherwise, and says so in the same number of letters.
    let (old, new) = (b"float64 opening", b"float64 openinq");
    let places: Vec<usize> = (0..bytes.len() - old.len()).filter(|at| bytes[*at..].starts_with(old)).collect();
    for at in places {
        bytes[at..at + new.len()].copy_from_slice(new);
    }
    let (_folder, path) = in_file(&bytes);
    let (_, text) = error_of(&path);
    assert!(
        text.contains("another version of it") && text.contains("`float64 openinq`, expected `float64 opening`"),
        "{text}"
    );
}

#[test]
fn one_topic_with_two_types() {
    let mut bag = Bag::standard(1);
    let message = FluidPressure { header: Header::at(BEGIN_NS), fluid_pressure: 1.0, variance: 0.0 };
    bag.put("/governor/command", BEGIN_NS, &message);
    let (_folder, path) = bag.file(WriteOptions::new());
    let (error, text) = error_of(&path);
    assert!(matches!(error, BagError::Type { .. }), "{text}");
}

#[test]
fn a_missing_topic_names_the_nearest() {
    let mut bag = Bag::standard(1);
    for entry in &mut bag.entries {
        entry.topic = entry.topic.replace("/governor/esv", "/gov/esv");
    }
    let (_folder, path) = bag.file(WriteOptions::new());
    let (_, text) = error_of(&path);
    for part in [
        "topic `/governor/esv` (governor_msgs/msg/EsvState) is missing; did you mean `/gov/esv`? then give \
         `--topic esv=/gov/esv`",
        "topics present: /gov/esv (governor_msgs/msg/EsvState), /governor/command",
    ] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn split_bags_are_read_in_the_order_of_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let bag = Bag::standard(12);
    let part = bag.entries.len().div_ceil(12);
    for (number, entries) in bag.entries.chunks(part).enumerate() {
        let bytes = Bag { entries: entries.to_vec() }.bytes(small_chunks());
        fs::write(folder.path().join(format!("run_{number}.mcap")), bytes).unwrap();
    }
    let (_single, path) = bag.file(WriteOptions::new());
    let whole = read_both_ways(&path, &ReadOptions::default()).unwrap().recording.frames;
    let split = read_both_ways(folder.path(), &ReadOptions::default()).unwrap();
    assert_eq!(format!("{:?}", split.recording.frames), format!("{whole:?}"));
    let numbers: Vec<String> =
        split.health.files.iter().map(|file| file.path.file_stem().unwrap().to_string_lossy().into_owned()).collect();
    assert_eq!(numbers[1..3], ["run_1", "run_2"]);
    assert_eq!(numbers[11], "run_11");

    // With metadata.yaml its order counts, and a part that is gone is told.
    let names = (0..12).map(|number| format!("    - run_{number}.mcap\n")).collect::<String>();
    let yaml = format!(
        "rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: mcap\n  message_count: {}\n  \
         relative_file_paths:\n{names}",
        bag.entries.len()
    );
    fs::write(folder.path().join("metadata.yaml"), yaml).unwrap();
    assert!(read_both_ways(folder.path(), &ReadOptions::default()).unwrap().health.is_clean());
    fs::remove_file(folder.path().join("run_4.mcap")).unwrap();
    let warnings = read_both_ways(folder.path(), &ReadOptions::default()).unwrap().health.warnings;
    let gone = |warning: &Warning| matches!(warning, Warning::FileMissing { path } if path.ends_with("run_4.mcap"));
    assert!(warnings.iter().any(gone), "{warnings:?}");
    let counted = |warning: &Warning| warning.to_string().contains(&format!("counts {} messages", bag.entries.len()));
    assert!(warnings.iter().any(counted), "{warnings:?}");
}

#[test]
fn metadata_that_cannot_be_read_is_told_and_done_without() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("a.mcap"), Bag::standard(1).bytes(WriteOptions::new())).unwrap();
    fs::write(folder.path().join("metadata.yaml"), "rosbag2_bagfile_information: [1, 2").unwrap();
    let loaded = read_both_ways(folder.path(), &ReadOptions::default()).unwrap();
    assert!(matches!(&loaded.health.warnings[..], [Warning::Metadata { .. }]), "{:?}", loaded.health.warnings);
    let yaml = "rosbag2_bagfile_information:\n  version: 9\n  compression_mode: MESSAGE\n  compression_format: lz4\n";
    fs::write(folder.path().join("metadata.yaml"), yaml).unwrap();
    let (error, text) = error_of(folder.path());
    assert!(matches!(error, BagError::Compressed { .. }), "{text}");
    assert!(text.contains("`lz4`, expected `zstd`") && text.contains("ros2 bag convert"), "{text}");
}

#[cfg(not(feature = "sqlite"))]
#[test]
fn a_sqlite_bag_names_the_feature() {
    let (_folder, path) = in_file(b"SQLite format 3\0 and so on");
    let (error, text) = error_of(&path);
    assert!(matches!(error, BagError::Sqlite { .. }) && text.contains("--features sqlite"), "{text}");
}
