//! The fuzz targets without a fuzzer: over their corpora and regressions, and over seeded mutations of both.
//!
//! A promise that is broken names the input, which then stands in `fuzz/regressions/TARGET`, to be kept there once it is mended.
//! `scripts/fuzz` runs the same for as long as asked, or under libFuzzer where it is installed.
#![cfg(feature = "lab")]

#[path = "support/residual.rs"]
mod residual;
#[path = "../fuzz/targets.rs"]
mod targets;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use govtwin_files::digest::sha256;
use targets::Target;

/// Mutations of each target in the ordinary tests.
const ROUNDS: u64 = 300;

/// Inputs do not grow beyond this, bytes.
const LONGEST: usize = 1 << 16;

/// The most that an input may take for each MB of it, s of processor; inputs below a megabyte count as one.
const S_FOR_EACH_MB: f64 = 2.0;

/// One that took longer is tried so often, and its shortest time counts.
const TRIES_OF_SLOW: usize = 5;

/// Nothing here waits for anything: so many times the allowed time on the clock is too long however busy the machine is.
const BUSY: f64 = 100.0;

/// Words that the formats know, beside those that the seeds hold.
const WORDS: &[&[u8]] = &[
    b"\xff\xff\xff\xff",
    b"\xff\xff\xff\xff\xff\xff\xff\xff",
    b"\0\0\0\x80",
    b"\x01\0\0\0",
    b"\0",
    b"zstd",
    b"lz4",
    b"NaN",
    b"1e999",
    b"-1",
    b"&a ",
    b"*a",
    b"{",
    b"[",
    b"(",
    b"\"",
    b"null",
    b"base: ",
    b"\n",
    b"\n===\nMSG: p/B\n",
    b"float64[] x\n",
    b"p/B[4000000000] y\n",
    b"string s\n",
    b"../",
    b"0.0",
    b"18446744073709551615",
    b"sin(",
    b"if(x,",
    b"^",
    b"\xc2\x80",
    b"\\u0000",
    b"- ",
];

/// xorshift*, seeded: the same in every run.
struct RandomStreams(u64);

impl RandomStreams {
    fn draw(&mut self, below: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % below.max(1)
    }
}

fn mutate(random: &mut RandomStreams, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = seeds[random.draw(seeds.len())].clone();
    for _ in 0..=random.draw(8) {
        let at = random.draw(bytes.len() + 1);
        let most = 1 << random.draw(9);
        let len = random.draw(most).min(bytes.len() - at);
        match random.draw(8) {
            0 | 1 if at < bytes.len() => bytes[at] ^= 1 << random.draw(8),
            2 if at < bytes.len() => bytes[at] = random.draw(256) as u8,
            3 => drop(bytes.drain(at..at + len)),
            4 => {
                let again = bytes[at..at + len].to_vec();
                let to = random.draw(bytes.len() + 1);
                bytes.splice(to..to, again);
            }
            5 => {
                let word = WORDS[random.draw(WORDS.len())];
                let end = if random.draw(2) == 0 { at } else { (at + word.len()).min(bytes.len()) };
                bytes.splice(at..end, word.iter().copied());
            }
            6 => {
                let other = &seeds[random.draw(seeds.len())];
                let from = random.draw(other.len() + 1);
                bytes.truncate(at);
                bytes.extend(&other[from..]);
            }
            7 if random.draw(4) == 0 => bytes.truncate(at),
            _ => {}
        }
    }
    bytes.truncate(LONGEST);
    bytes
}

fn folder(kind: &str, target: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz").join(kind).join(target)
}

fn inputs(target: &str) -> Vec<Vec<u8>> {
    let mut found = vec![];
    for kind in ["corpus", "regressions"] {
        let mut paths: Vec<PathBuf> =
            fs::read_dir(folder(kind, target)).into_iter().flatten().map(|entry| entry.unwrap().path()).collect();
        paths.sort();
        found.extend(paths.iter().map(|path| fs::read(path).unwrap()));
    }
    assert!(!found.is_empty(), "fuzz/corpus/{target} is empty");
    found
}

/// What this thread took of a processor, s: where others want it as well the clock says nothing of the program.
#[cfg(target_os = "linux")]
fn taken_s(_since: Instant) -> f64 {
    use rustix::time::{ClockId, clock_gettime};
    let now = clock_gettime(ClockId::ThreadCPUTime);
    now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9
}

/// Elsewhere the clock has to do.
#[cfg(not(target_os = "linux"))]
fn taken_s(since: Instant) -> f64 {
    since.elapsed().as_secs_f64()
}

/// Runs one input; a broken promise is kept.
fn run(name: &str, target: Target, bytes: &[u8]) {
    let most_s = S_FOR_EACH_MB * (bytes.len() as f64 / 1e6).max(1.0);
    let mut shortest_s = f64::INFINITY;
    let mut panicked = false;
    for _ in 0..TRIES_OF_SLOW {
        let start = Instant::now();
        let before_s = taken_s(start);
        panicked = catch_unwind(AssertUnwindSafe(|| target(bytes))).is_err();
        let took_s = (taken_s(start) - before_s).max(start.elapsed().as_secs_f64() / BUSY);
        shortest_s = took_s.min(shortest_s);
        if panicked || shortest_s <= most_s {
            break;
        }
    }
    if panicked || shortest_s > most_s {
        let place = folder("regressions", name);
        let path = place.join(&sha256(bytes)[..16]);
        fs::create_dir_all(&place).and_then(|()| fs::write(&path, bytes)).unwrap();
        let what = if panicked { "panicked" } else { "hung" };
        panic!("{name}: {what} after {shortest_s} s, at most {most_s} s; the input is {}", path.display());
    }
}

fn rounds(name: &str, target: Target, seed: u64, mut go_on: impl FnMut(u64) -> bool) -> u64 {
    let seeds = inputs(name);
    for bytes in &seeds {
        run(name, target, bytes);
    }
    let mut random = RandomStreams(seed | 1);
    let mut round = 0;
    while go_on(round) {
        run(name, target, &mutate(&mut random, &seeds));
        round += 1;
    }
    round
}

/// One test for each target, so that they run side by side.
macro_rules! targets {
    ($($name:ident)+) => {$(
        #[test]
        fn $name() {
            let (_, target) = targets::ALL.into_iter().find(|(name, _)| *name == stringify!($name)).unwrap();
            rounds(stringify!($name), target, 0x9e37_79b9_7f4a_7c15, |round| round < ROUNDS);
        }
    )+

        #[test]
        fn every_target_is_run() {
            assert_eq!(targets::ALL.map(|(name, _)| name).to_vec(), [$(stringify!($name)),+]);
        }
    };
}

targets!(bag layout metadata cdr definition yaml expression model report journal import);

/// For `scripts/fuzz`: the targets named in FUZZ_TARGETS, each for FUZZ_S seconds, other mutations every time unless FUZZ_SEED says which;
/// the same seed gives the same inputs in the same order.
#[test]
#[ignore = "runs for as long as FUZZ_S says"]
fn for_as_long_as_asked() {
    let seconds = std::env::var("FUZZ_S").unwrap().parse().unwrap();
    let wanted = std::env::var("FUZZ_TARGETS").unwrap_or_default();
    let drawn = std::time::UNIX_EPOCH.elapsed().unwrap().as_nanos() as u64 ^ u64::from(std::process::id()) << 32;
    let seed = std::env::var("FUZZ_SEED").map_or(drawn, |seed| seed.parse().unwrap());
    for (name, target) in targets::ALL {
        if wanted.is_empty() || wanted.split(' ').any(|one| one == name) {
            let start = Instant::now();
            let count = rounds(name, target, seed, |_| start.elapsed() < Duration::from_secs(seconds));
            println!("{name}: {count} inputs in {seconds} s with seed {seed}, no promise broken");
        }
    }
}

/// Makes the model of the corpus anew: two small trees.
#[test]
#[ignore = "writes fuzz/corpus/model"]
fn write_the_model() {
    use govtwin_correction::forest::Tree;
    use govtwin_correction::guard::Guard;
    use govtwin_correction::model::Model;
    let model = residual::model(&govtwin_model::params::reference());
    let stump = Tree { threshold: vec![0.5], ..model.trees[0].clone() };
    let (feature, threshold) = (vec![1, 2], vec![0.1, -0.1]);
    let deeper = Tree { feature, threshold, left: vec![1, -1], right: vec![-2, -3], leaf: vec![0.0, 0.001, 0.002] };
    let model = Model {
        program: "govtwin 0.1.0".into(),
        guard: Guard { support: vec![[-1e9, 1e9]; model.features.len()], range: [-0.02, 0.02], reach: None },
        band: None,
        booster: "by hand".into(),
        hyperparameters: [("leaves".to_owned(), 31.0)].into(),
        training: [("rows".to_owned(), "23293".to_owned())].into(),
        trees: vec![stump, deeper],
        ..model
    };
    fs::create_dir_all(folder("corpus", "model")).unwrap();
    fs::write(folder("corpus", "model").join("trees"), model.to_text().unwrap()).unwrap();
}

/// Makes the bags of the corpus anew: each way to store one, small.
#[test]
#[ignore = "writes fuzz/corpus/bag"]
fn write_the_bags() {
    use govtwin_bag::cdr;
    use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Header, Interface, ServoState, definition};
    use mcap::records::MessageHeader;
    use mcap::{Compression, WriteOptions};
    let place = folder("corpus", "bag");
    fs::create_dir_all(&place).unwrap();
    let small = || WriteOptions::new().chunk_size(Some(600)).profile("ros2");
    for (name, options) in [
        ("zstd", small()),
        ("lz4", small().compression(Some(Compression::Lz4))),
        ("plain", small().compression(None)),
        ("no_crc", small().compression(None).calculate_chunk_crcs(false)),
        ("no_chunks", small().use_chunks(false)),
        ("no_summary", small().use_chunks(false).emit_summary_records(false)),
    ] {
        let mut file = std::io::Cursor::new(vec![]);
        let mut writer = options.create(&mut file).unwrap();
        let mut channel = |topic: &str, type_name: &str| {
            let schema = definition::schema_of(type_name).unwrap();
            let schema = writer.add_schema(type_name, "ros2msg", schema.as_bytes()).unwrap();
            writer.add_channel(schema, topic, "cdr", &Default::default()).unwrap()
        };
        let command = channel("/governor/command", GovernorCommand::TYPE_NAME);
        let esv = channel("/governor/esv", EsvState::TYPE_NAME);
        let pressure = channel("/governor/tank_pressure", FluidPressure::TYPE_NAME);
        let servo = channel("/plant/servo_state", ServoState::TYPE_NAME);
        for step in 0..8_i64 {
            let header = Header::at(1_700_000_000_000_000_000 + step * 10_000_000);
            let messages = [
                (command, cdr::encode(&GovernorCommand { header: header.clone(), opening: 0.5 })),
                (esv, cdr::encode(&EsvState { header: header.clone(), state: EsvState::NORMAL })),
                (
                    pressure,
                    cdr::encode(&FluidPressure { header: header.clone(), fluid_pressure: 6.3e6, variance: 0.0 }),
                ),
                (servo, cdr::encode(&ServoState { header, servomotor_position: 0.5, ..ServoState::default() })),
            ];
            for (channel_id, data) in messages {
                let log_time = (1_700_000_000_000_000_000 + step * 10_000_000 + 500_000) as u64;
                let header = MessageHeader { channel_id, sequence: step as u32, log_time, publish_time: log_time };
                writer.write_to_known_channel(&header, &data.unwrap()).unwrap();
            }
        }
        writer.finish().unwrap();
        drop(writer);
        fs::write(place.join(name), &file.into_inner()[8..]).unwrap();
    }
}
