//! What a sound bag is turned into, however it is stored.

use govtwin_bag::{BagError, Interpolation, ReadOptions, Stream, Warning};
use govtwin_model::frame::EsvState;
use mcap::{Compression, WriteOptions};

use super::make::{BEGIN_NS, Bag, MS, read_both_ways, small_chunks};

#[test]
fn every_way_to_store_gives_the_same_recording() {
    let bag = Bag::standard(5);
    let (_folder, path) = bag.file(WriteOptions::new());
    let whole = read_both_ways(&path, &ReadOptions::default()).unwrap();
    assert!(whole.health.is_clean(), "{:?}", whole.health.warnings);
    assert_eq!(whole.recording.frames.len(), 500);
    let plain = || WriteOptions::new().compression(None);
    for (name, options) in [
        ("zstd", small_chunks().compression(Some(Compression::Zstd))),
        ("lz4", small_chunks().compression(Some(Compression::Lz4))),
        ("uncompressed", small_chunks().compression(None)),
        ("no chunks", plain().use_chunks(false)),
        ("no index", small_chunks().emit_message_indexes(false).emit_chunk_indexes(false)),
        ("no summary", small_chunks().emit_summary_records(false).emit_summary_offsets(false)),
        ("no CRC", small_chunks().calculate_chunk_crcs(false).calculate_data_section_crc(false)),
        ("no channels in the summary", small_chunks().repeat_channels(false).repeat_schemas(false)),
    ] {
        let (_folder, path) = bag.file(options);
        let loaded = read_both_ways(&path, &ReadOptions::default()).unwrap();
        assert!(loaded.health.is_clean(), "{name}: {:?}", loaded.health.warnings);
        // NaN is unequal to itself; its text is not.
        assert_eq!(format!("{:?}", loaded.recording), format!("{:?}", whole.recording), "{name}");
        let raw: Vec<_> = govtwin_bag::messages(&path).unwrap().map(|message| message.unwrap().data).collect();
        let mut entries = bag.entries.clone();
        entries.sort_by_key(|entry| entry.log_ns);
        assert_eq!(raw, entries.into_iter().map(|entry| entry.data).collect::<Vec<_>>(), "{name}");
    }
}

#[test]
fn raw_messages_come_in_log_time_order_across_overlapping_chunks() {
    let mut bag = Bag::standard(4);
    // File order as of a recorder with two queues: the second half of the messages first.
    let half = bag.entries.len() / 2;
    bag.entries.rotate_left(half);
    let (_folder, path) = bag.file(small_chunks());
    let messages = govtwin_bag::messages(&path).unwrap();
    assert_eq!(messages.topics().len(), 4);
    let raw: Vec<_> = messages.map(Result::unwrap).collect();
    assert_eq!(raw.len(), bag.entries.len());
    assert!(raw.windows(2).all(|pair| pair[0].log_time_ns <= pair[1].log_time_ns));
    let mut sorted = bag.entries.clone();
    sorted.sort_by_key(|entry| entry.log_ns);
    for (message, entry) in raw.iter().zip(&sorted) {
        assert_eq!((&message.data, &message.topic.name), (&entry.data, &entry.topic));
    }
}

#[test]
fn absent_streams_are_filled_by_constants_only_when_they_are_not_required() {
    let mut bag = Bag::default();
    for step in 0..50 {
        bag.servo(BEGIN_NS + step * 20 * MS, 0.01, 0.5);
    }
    let (_folder, path) = bag.file(WriteOptions::new());
    let Err(BagError::Missing { missing, present, .. }) = read_both_ways(&path, &ReadOptions::default()) else {
        panic!("three inputs are missing");
    };
    assert_eq!(missing.len(), 3);
    assert!(missing[0].contains("/governor/command"), "{missing:?}");
    assert_eq!(present, "/plant/servo_state (governor_msgs/msg/ServoState)");

    let options = ReadOptions { required: vec![Stream::ServoState], ..ReadOptions::default() };
    let loaded = read_both_ways(&path, &options).unwrap();
    assert_eq!(loaded.recording.frames.len(), 50);
    let frame = loaded.recording.frames[7];
    assert!(frame.inputs.opening_command_pu.is_nan() && frame.inputs.tank_pressure_pa.is_nan());
    assert_eq!(frame.inputs.esv, EsvState::Normal);
    assert_eq!(frame.measured.servomotor_position_pu, 0.5);
    let filled = |warning: &Warning| matches!(warning, Warning::Filled { .. });
    assert_eq!(loaded.health.warnings.iter().filter(|warning| filled(warning)).count(), 3);
}

#[test]
fn other_topic_names_can_be_named() {
    let mut bag = Bag::standard(1);
    for entry in &mut bag.entries {
        entry.topic = entry.topic.replace("/plant/", "/unit_3/");
    }
    let (_folder, path) = bag.file(WriteOptions::new());
    let mut options = ReadOptions { required: Stream::ALL.to_vec(), ..ReadOptions::default() };
    let error = read_both_ways(&path, &options).unwrap_err().to_string();
    assert!(error.contains("did you mean `/unit_3/servo_state`?"), "{error}");
    options.topics.servo_state = "/unit_3/servo_state".into();
    assert!(read_both_ways(&path, &options).unwrap().recording.frames[0].measured.servomotor_position_pu.is_finite());
}

#[test]
fn a_grid_of_too_many_rows_is_refused() {
    let (_folder, path) = Bag::standard(3).file(WriteOptions::new());
    let options = ReadOptions { interpolation: Interpolation::Linear { period_ns: 1 }, ..ReadOptions::default() };
    let error = read_both_ways(&path, &options).unwrap_err();
    assert!(matches!(error, BagError::TooManyRows { period_ns: 1, .. }), "{error}");
}
