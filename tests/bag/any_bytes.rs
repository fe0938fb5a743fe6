//! Whatever a file holds, reading it ends with a result, never with a panic.

use std::path::Path;

use govtwin_bag::ReadOptions;
use mcap::{Compression, WriteOptions};
use proptest::prelude::{ProptestConfig, any, prop, prop_assert, proptest};
use proptest::sample::Index;

use super::make::{Bag, in_file, read_both_ways, small_chunks};

fn read_all_ways(path: &Path) {
    let _ = read_both_ways(path, &ReadOptions::default());
    let _ = read_both_ways(path, &ReadOptions { required: vec![], ..ReadOptions::default() });
    let _ = govtwin_bag::survey(path);
    if let Ok(messages) = govtwin_bag::messages(path) {
        let _ = messages.count();
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn noise_after_the_magic(noise in prop::collection::vec(any::<u8>(), 0..500)) {
        let (_folder, path) = in_file(&[mcap::MAGIC, &noise].concat());
        read_all_ways(&path);
    }

    #[test]
    fn records_with_noise_inside(records in prop::collection::vec((1..16u8, prop::collection::vec(any::<u8>(), 0..80)), 0..20)) {
        let mut bytes = mcap::MAGIC.to_vec();
        for (opcode, body) in records {
            bytes.push(opcode);
            bytes.extend((body.len() as u64).to_le_bytes());
            bytes.extend(body);
        }
        let (_folder, path) = in_file(&bytes);
        read_all_ways(&path);
    }

    #[test]
    fn sound_bags_with_bytes_overwritten(
        storage in 0..4u8,
        changes in prop::collection::vec((any::<Index>(), any::<u8>()), 1..30),
        end in any::<Index>(),
        cut: bool,
    ) {
        let options = match storage {
            0 => small_chunks(),
            1 => small_chunks().compression(Some(Compression::Lz4)).calculate_chunk_crcs(false),
            2 => small_chunks().compression(None).calculate_chunk_crcs(false),
            _ => WriteOptions::new().use_chunks(false),
        };
        let mut bytes = Bag::standard(1).bytes(options);
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        if cut {
            bytes.truncate(end.index(bytes.len()));
        }
        let (_folder, path) = in_file(&bytes);
        read_all_ways(&path);
    }

    #[test]
    fn numbers_of_any_kind_leave_only_possible_ones(
        stamps in prop::collection::vec(any::<i32>(), 1..40),
        values in prop::collection::vec(any::<f64>(), 40),
    ) {
        let mut bag = Bag::default();
        for (number, (sec, value)) in stamps.iter().zip(values).enumerate() {
            let stamp_ns = i64::from(*sec) * 1_000_000_000;
            bag.command(stamp_ns, value);
            bag.pressure(stamp_ns, value);
            bag.esv(stamp_ns, (value.to_bits() & 1) as u8);
            bag.servo(stamp_ns, value, value);
            for entry in bag.entries.iter_mut().rev().take(4) {
                entry.log_ns = number as i64;
            }
        }
        let (_folder, path) = bag.file(WriteOptions::new());
        let options = ReadOptions { required: vec![], ..ReadOptions::default() };
        if let Ok(loaded) = read_both_ways(&path, &options) {
            let frames = &loaded.recording.frames;
            prop_assert!(frames.windows(2).all(|pair| pair[0].time_ns < pair[1].time_ns));
            for frame in frames {
                let opening = frame.inputs.opening_command_pu;
                prop_assert!(opening.is_nan() || (-0.5..=1.5).contains(&opening));
                let measured = frame.measured.spool_position_pu;
                prop_assert!(measured.is_nan() || measured.abs() <= 10.0);
            }
        }
    }
}
