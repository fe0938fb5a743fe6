//! Damaged bags: everything whole is recovered, what is lost is said, nothing panics.

use govtwin_bag::{BagError, ReadOptions, Warning};
use mcap::{Compression, WriteOptions};

use super::make::{Bag, in_file, read_both_ways, small_chunks};

/// Whether the messages are the first ones of the bag, in file order.
fn is_prefix(messages: &[Vec<u8>], bag: &Bag) -> bool {
    messages.len() <= bag.entries.len() && messages.iter().zip(&bag.entries).all(|(found, entry)| *found == entry.data)
}

fn messages_in(bytes: &[u8]) -> Result<(Vec<Vec<u8>>, Vec<Warning>), BagError> {
    let (_folder, path) = in_file(bytes);
    let messages = govtwin_bag::messages(&path)?;
    let warnings = messages.warnings().to_vec();
    Ok((messages.map(|message| message.unwrap().data).collect(), warnings))
}

#[test]
fn a_file_cut_anywhere_gives_all_that_is_whole() {
    let bag = Bag::standard(2);
    for (name, options) in [
        ("zstd", small_chunks()),
        ("lz4", small_chunks().compression(Some(Compression::Lz4))),
        ("uncompressed", small_chunks().compression(None)),
        ("no chunks", WriteOptions::new().use_chunks(false)),
    ] {
        let bytes = bag.bytes(options);
        let mut before = 0;
        for len in (mcap::MAGIC.len()..bytes.len()).step_by(97) {
            let (messages, warnings) = messages_in(&bytes[..len]).unwrap();
            assert!(is_prefix(&messages, &bag), "{name} cut at {len}");
            assert!(messages.len() >= before, "{name} cut at {len}: a longer file gives no fewer messages");
            before = messages.len();
            let [Warning::Damaged { damage, .. }] = &warnings[..] else { panic!("{name} {len}: {warnings:?}") };
            assert!(damage.at_byte + damage.lost_bytes <= len as u64, "{name} {len}: {damage:?}");
            if let Some(last_good_ns) = damage.last_good_ns {
                let near = bag.entries.iter().any(|entry| entry.log_ns == last_good_ns);
                assert!(near, "{name} cut at {len}: the last good time is that of a message");
            }
        }
        assert_eq!(before, bag.entries.len(), "{name}: a file cut in its index still has all");
    }
}

#[test]
fn most_of_a_chunk_that_is_cut_off_is_recovered() {
    let bag = Bag::standard(60);
    // One chunk; cut at two thirds of the first chunk. Zstd blocks of 128 kB are whole or lost.
    let bytes = bag.bytes(WriteOptions::new());
    let (messages, warnings) = messages_in(&bytes[..bytes.len() / 3]).unwrap();
    assert!(messages.len() > bag.entries.len() / 4, "{} of {}", messages.len(), bag.entries.len());
    assert!(is_prefix(&messages, &bag));
    let said = warnings[0].to_string();
    assert!(said.contains("the file ends inside a chunk") && said.contains("recovered"), "{said}");
}

#[test]
fn a_flipped_bit_costs_its_chunk_and_no_more() {
    let bag = Bag::standard(3);
    let sound = bag.bytes(small_chunks());
    let chunks = bag.entries.len() / 20;
    for at in (20..sound.len()).step_by(61) {
        let mut bytes = sound.clone();
        bytes[at] ^= 0x10;
        match messages_in(&bytes) {
            Ok((messages, warnings)) => {
                let mut rest = bag.entries.iter();
                let in_order = messages.iter().all(|found| rest.any(|entry| entry.data == *found));
                assert!(in_order, "byte {at}: a message that is not in the bag, or out of order");
                // A chunk has some 60 messages; its neighbours stay.
                assert!(messages.len() + 200 > bag.entries.len(), "byte {at}: {} of {chunks}", messages.len());
                let lost = messages.len() < bag.entries.len();
                assert!(!lost || !warnings.is_empty(), "byte {at}: lost without a word");
            }
            Err(error) => panic!("byte {at}: {error}"),
        }
    }
}

#[test]
fn a_hole_in_the_middle_is_bridged() {
    let bag = Bag::standard(4);
    let mut bytes = bag.bytes(small_chunks());
    let (from, to) = (bytes.len() / 3, bytes.len() / 3 + 2000);
    bytes[from..to].fill(0);
    let (_folder, path) = in_file(&bytes);
    let loaded = read_both_ways(&path, &ReadOptions::default()).unwrap();
    let read: u64 = loaded.health.streams.iter().map(|stream| stream.kept).sum();
    assert!(read > bag.entries.len() as u64 * 2 / 3, "{read} of {}", bag.entries.len());
    let last = loaded.recording.frames.last().unwrap().time_ns;
    assert_eq!(last, super::make::BEGIN_NS + 3990 * super::make::MS, "the end is there");
    let said: Vec<String> = loaded.health.warnings.iter().map(ToString::to_string).collect();
    assert!(said.iter().any(|line| line.contains("its summary counts 884 messages")), "{said:?}");
    assert!(said.iter().any(|line| line.contains("bytes lost")), "{said:?}");
}

#[test]
fn damage_is_summed_up_not_listed_without_end() {
    let mut bag = Bag::standard(1);
    bag.entries.truncate(1);
    let mut bytes = bag.bytes(WriteOptions::new().use_chunks(false).emit_summary_records(false));
    // Ten thousand messages on a channel that nobody announced, between data and end.
    let end = bytes.len() - 8 - 29 - 13;
    let tail = bytes.split_off(end);
    let mut record = vec![5_u8];
    record.extend(22_u64.to_le_bytes());
    record.extend([9; 22]);
    for _ in 0..10_000 {
        bytes.extend(&record);
    }
    bytes.extend(tail);
    let (messages, warnings) = messages_in(&bytes).unwrap();
    assert_eq!((messages.len(), warnings.len()), (1, 1), "{warnings:?}");
    assert!(warnings[0].to_string().contains("in 10000 places"), "{}", warnings[0]);
}

#[test]
fn a_finished_file_without_messages_is_empty_not_damaged() {
    let bytes = Bag::default().bytes(WriteOptions::new());
    let (_folder, path) = in_file(&bytes);
    assert_eq!(govtwin_bag::messages(&path).unwrap().count(), 0);
    let error = read_both_ways(&path, &ReadOptions::default()).unwrap_err();
    assert!(matches!(&error, BagError::Empty { lost, .. } if lost.is_empty()), "{error}");
    let error = {
        let (_folder, path) = in_file(&bytes[..20]);
        read_both_ways(&path, &ReadOptions::default()).unwrap_err().to_string()
    };
    assert!(error.contains("holds no message; ") && error.contains("bytes lost"), "{error}");
}
