//! Bags that rosbag2 compressed, as files or message by message, made by an independent writer.

use std::fs;
use std::path::{Path, PathBuf};

use govtwin_bag::msg::type_hash::type_hash;
use govtwin_bag::{BagError, ReadOptions, Warning};
use mcap::WriteOptions;

use super::make::{BEGIN_NS, Bag, MS, in_file, read_both_ways};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/compressed").join(name)
}

fn reads_like_any_other(name: &str, packed: &str) {
    let loaded = read_both_ways(&fixture(name), &ReadOptions::default()).unwrap();
    assert!(loaded.health.is_clean(), "{name}: {:?}", loaded.health.warnings);
    let file = &loaded.health.files[0];
    assert_eq!((file.packed, file.messages), (packed, 45), "{name}");
    assert!(file.path.starts_with(fixture(name)), "{name}: the file that the user knows: {:?}", file.path);
    assert_eq!(loaded.recording.frames.len(), 20);
    for (step, frame) in loaded.recording.frames.iter().enumerate() {
        assert_eq!(frame.time_ns, BEGIN_NS + step as i64 * 50 * MS);
        assert_eq!(frame.inputs.opening_command_pu, 0.2 + step as f64 / 1000.0);
        assert_eq!(frame.measured.control_pressure_pa, 2.0e6);
    }
    // One by one and unpacked, with their types.
    let messages: Vec<_> = govtwin_bag::messages(&fixture(name)).unwrap().map(Result::unwrap).collect();
    assert_eq!(messages.len(), 45);
    assert!(messages.iter().all(|message| message.data[..4] == [0, 1, 0, 0]), "{name}: CDR, little endian");
    let survey = govtwin_bag::survey(&fixture(name)).unwrap();
    assert!(survey.topics.iter().all(|topic| topic.type_hash_fits != Some(false)), "{:?}", survey.topics);
}

#[test]
fn compressed_mcap_bags_read_like_any_other() {
    reads_like_any_other("mcap_file", "file");
    reads_like_any_other("mcap_message", "message");
}

#[cfg(feature = "sqlite")]
#[test]
fn compressed_sqlite_bags_read_like_any_other() {
    reads_like_any_other("sqlite3_file", "file");
    reads_like_any_other("sqlite3_message", "message");
}

#[test]
fn hashes_and_qualities_of_service_that_only_the_metadata_tells_are_kept_by_a_copy() {
    for name in ["mcap_message", "mcap_file"] {
        let folder = tempfile::tempdir().unwrap();
        let copy = govtwin_bag::recover(&fixture(name), &folder.path().join("copy")).unwrap();
        assert_eq!(copy.messages.values().sum::<u64>(), 45);
        for topic in govtwin_bag::messages(&copy.bag).unwrap().topics() {
            assert_eq!(topic.type_hash, type_hash(&topic.type_name).unwrap(), "{name}: {}", topic.name);
            let is_servo = topic.name == "/plant/servo_state";
            assert_eq!(topic.offered_qos_profiles.contains("durability: transient_local"), is_servo, "{topic:?}");
        }
        let survey = govtwin_bag::survey(&copy.bag).unwrap();
        assert!(survey.warnings.is_empty(), "{:?}", survey.warnings);
    }
}

#[test]
fn a_compressed_file_alone_and_one_whose_metadata_names_it_otherwise_are_found() {
    let packed = fixture("mcap_file/mcap_file.mcap.zstd");
    assert_eq!(govtwin_bag::survey(&packed).unwrap().messages, 45);
    let folder = tempfile::tempdir().unwrap();
    let bag = folder.path().join("run");
    fs::create_dir(&bag).unwrap();
    fs::copy(&packed, bag.join("run_0.mcap.zstd")).unwrap();
    assert_eq!(govtwin_bag::survey(&bag).unwrap().messages, 45, "without metadata.yaml");
    // Version 4 of the metadata was written with the folder's name before the file's.
    let yaml = "rosbag2_bagfile_information:\n  version: 4\n  relative_file_paths:\n  - run/run_0.mcap.zstd\n  \
                compression_mode: FILE\n  compression_format: zstd\n";
    fs::write(bag.join("metadata.yaml"), yaml).unwrap();
    assert_eq!(govtwin_bag::survey(&bag).unwrap().warnings, []);
    // Unpacked by hand, with metadata that still names the compressed file.
    let plain = zstd::decode_all(&fs::read(&packed).unwrap()[..]).unwrap();
    fs::remove_file(bag.join("run_0.mcap.zstd")).unwrap();
    fs::write(bag.join("run_0.mcap"), plain).unwrap();
    assert_eq!(govtwin_bag::survey(&bag).unwrap().warnings, []);
}

#[test]
fn what_is_damaged_is_read_as_far_as_it_goes_and_told() {
    let plain = Bag::standard(10).bytes(WriteOptions::new().compression(None).chunk_size(Some(1 << 12)));
    let packed = zstd::encode_all(&plain[..], 1).unwrap();
    let (_folder, path) = in_file(&packed[..packed.len() * 3 / 4]);
    let loaded = read_both_ways(&path, &ReadOptions::default()).unwrap();
    let said: Vec<String> = loaded.health.warnings.iter().map(ToString::to_string).collect();
    assert!(said.iter().any(|words| words.contains("the compressed file cannot be unpacked further")), "{said:?}");
    assert!(loaded.recording.frames.len() > 300, "{}", loaded.recording.frames.len());

    // One of the messages is no frame of zstd any more.
    let bytes = fs::read(fixture("mcap_message/mcap_message.mcap")).unwrap();
    let place = bytes.windows(4).rposition(|four| four == [0x28, 0xb5, 0x2f, 0xfd]).unwrap();
    let mut changed = bytes.clone();
    changed[place + 5..place + 9].fill(0xff);
    let (_folder, path) = in_file(&changed);
    let warnings = govtwin_bag::survey(&path).unwrap().warnings;
    assert!(warnings.iter().any(|warning| matches!(warning, Warning::Damaged { .. })), "{warnings:?}");
}

#[test]
fn a_compressed_file_of_something_else_and_one_that_unpacks_to_too_much_are_refused() {
    let (_folder, path) = in_file(&zstd::encode_all(&b"words"[..], 1).unwrap());
    let error = govtwin_bag::survey(&path).unwrap_err();
    let text = error.to_string();
    assert!(matches!(error, BagError::NotABag { .. }), "{text}");
    assert!(text.contains("\"words\", compressed with zstd"), "{text}");

    // 256 MiB of zeros in some kilobytes.
    let zeros = [mcap::MAGIC, &vec![0; 1 << 28]].concat();
    let (_folder, path) = in_file(&zstd::encode_all(&zeros[..], 1).unwrap());
    let warnings = govtwin_bag::survey(&path).unwrap().warnings;
    let said = warnings.iter().any(|warning| warning.to_string().contains("may unpack to 256 times its size"));
    assert!(said, "{warnings:?}");
}
