//! What becomes of damaged bags, by kind of damage: the same, warned of, refused; silently other only where nothing could know.
//!
//! `cargo test --test product -- --nocapture outcomes` prints the table of `docs/robustness.md`; OUTCOMES sets how many of each kind are tried.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::Instant;

use govtwin_bag::ReadOptions;
use mcap::{Compression, WriteOptions};

use super::make::{Bag, in_file, read_both_ways, small_chunks};

/// Tries of each kind.
const TRIES: u64 = 150;

/// Nothing may take longer for so small a bag, s: 2 s for each MB begun.
const HUNG_S: f64 = 2.0;

/// On a busy machine one that took longer is read so often, and its shortest time counts.
const TRIES_OF_SLOW: usize = 5;

struct RandomStreams(u64);

impl RandomStreams {
    fn draw(&mut self, below: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % below.max(1)
    }
}

/// Where the records of a file begin and end, with their opcodes.
fn records(bytes: &[u8]) -> Vec<(u8, usize, usize)> {
    let (mut at, mut found) = (8, vec![]);
    while at + 9 <= bytes.len() - 8 {
        let len = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        found.push((bytes[at], at, at + 9 + len));
        at += 9 + len;
    }
    found
}

fn chunks(bytes: &[u8]) -> Vec<(usize, usize)> {
    records(bytes).into_iter().filter(|(opcode, ..)| *opcode == 6).map(|(_, from, to)| (from, to)).collect()
}

type Damage = fn(&mut RandomStreams, &[u8]) -> Vec<u8>;

fn flip(random: &mut RandomStreams, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let at = 8 + random.draw(bytes.len() - 8);
    bytes[at] ^= 1 << random.draw(8);
    bytes
}

fn overwrite(random: &mut RandomStreams, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=random.draw(30) {
        let at = 8 + random.draw(bytes.len() - 8);
        bytes[at] = random.draw(256) as u8;
    }
    bytes
}

fn cut(random: &mut RandomStreams, bytes: &[u8]) -> Vec<u8> {
    bytes[..8 + random.draw(bytes.len() - 8)].to_vec()
}

fn zeros(random: &mut RandomStreams, bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let at = 8 + random.draw(bytes.len() - 8);
    let to = (at + 1 + random.draw(4096)).min(bytes.len());
    bytes[at..to].fill(0);
    bytes
}

fn without_a_chunk(random: &mut RandomStreams, bytes: &[u8]) -> Vec<u8> {
    let chunks = chunks(bytes);
    let (from, to) = chunks[random.draw(chunks.len())];
    // Where the summary begins stands in the footer; as a whole file it is found all the same.
    [&bytes[..from], &bytes[to..]].concat()
}

fn with_a_chunk_twice(random: &mut RandomStreams, bytes: &[u8]) -> Vec<u8> {
    let chunks = chunks(bytes);
    let (from, to) = chunks[random.draw(chunks.len())];
    [&bytes[..to], &bytes[from..to], &bytes[to..]].concat()
}

fn with_chunks_exchanged(random: &mut RandomStreams, bytes: &[u8]) -> Vec<u8> {
    let chunks = chunks(bytes);
    let at = 1 + random.draw(chunks.len() - 2);
    let ((a, b), (c, d)) = (chunks[at], chunks[at + 1]);
    [&bytes[..a], &bytes[c..d], &bytes[b..c], &bytes[a..b], &bytes[d..]].concat()
}

#[derive(Clone, Copy, Default)]
struct Outcomes {
    same: u64,
    warned: u64,
    refused: u64,
    silent: u64,
    hung: u64,
    panicked: u64,
}

fn outcome(path: &Path, sound: &str, so_far: &mut Outcomes) {
    let read = || {
        let start = Instant::now();
        let result = catch_unwind(AssertUnwindSafe(|| read_both_ways(path, &ReadOptions::default())));
        (result, start.elapsed().as_secs_f64())
    };
    let (result, mut shortest_s) = read();
    for _ in 1..TRIES_OF_SLOW {
        if shortest_s <= HUNG_S || result.is_err() {
            break;
        }
        shortest_s = read().1.min(shortest_s);
    }
    match result {
        Err(_) => so_far.panicked += 1,
        Ok(_) if shortest_s > HUNG_S => so_far.hung += 1,
        Ok(Err(_)) => so_far.refused += 1,
        Ok(Ok(loaded)) if !loaded.health.warnings.is_empty() => so_far.warned += 1,
        Ok(Ok(loaded)) if format!("{:?}", loaded.recording.frames) == sound => so_far.same += 1,
        Ok(Ok(_)) => so_far.silent += 1,
    }
}

#[test]
fn damage_of_every_kind_ends_in_a_word() {
    let tries = std::env::var("OUTCOMES").ok().and_then(|text| text.parse().ok()).unwrap_or(TRIES);
    let bag = Bag::standard(2);
    let unchecked = || small_chunks().compression(None).calculate_chunk_crcs(false);
    let kinds: [(&str, bool, WriteOptions, Damage); 10] = [
        ("one bit, zstd", true, small_chunks(), flip),
        ("one bit, lz4", true, small_chunks().compression(Some(Compression::Lz4)), flip),
        ("one bit, plain", true, small_chunks().compression(None), flip),
        ("1 to 31 bytes, zstd", true, small_chunks(), overwrite),
        ("cut off anywhere", true, small_chunks(), cut),
        ("1 to 4096 bytes of zeros", true, small_chunks(), zeros),
        ("a chunk is missing", true, small_chunks(), without_a_chunk),
        ("a chunk stands twice", true, small_chunks(), with_a_chunk_twice),
        ("two chunks exchanged", true, small_chunks(), with_chunks_exchanged),
        ("one bit, plain, without CRC", false, unchecked(), flip),
    ];
    let mut table =
        "| damage | tried | same | warned | refused | silent | hung | panicked |\n|---|--:|--:|--:|--:|--:|--:|--:|\n"
            .to_owned();
    for (number, (name, checked, options, damage)) in kinds.into_iter().enumerate() {
        let bytes = bag.bytes(options);
        let (_folder, path) = in_file(&bytes);
        let sound = format!("{:?}", read_both_ways(&path, &ReadOptions::default()).unwrap().recording.frames);
        let mut random = RandomStreams(0x1234_5678_9abc_def1 + number as u64);
        let mut outcomes = Outcomes::default();
        for _ in 0..tries {
            std::fs::write(&path, damage(&mut random, &bytes)).unwrap();
            outcome(&path, &sound, &mut outcomes);
        }
        let Outcomes { same, warned, refused, silent, hung, panicked } = outcomes;
        table += &format!("| {name} | {tries} | {same} | {warned} | {refused} | {silent} | {hung} | {panicked} |\n");
        assert_eq!((hung, panicked), (0, 0), "{name}");
        assert!(!checked || silent == 0, "{name}: {silent} silent of {tries}");
    }
    println!("{table}");
}
