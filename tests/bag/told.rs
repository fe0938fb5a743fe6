//! Wrong but plausible data is named wherever somebody looks: by `info` in words and JSON, by `replay` on standard error, on its page and in its
//! JSON. Where it is refused, the words say the same. One bag stands for each way of telling; the kinds are in `qualification`.

use std::path::Path;
use std::process::{Command, Output};

use mcap::WriteOptions;

use super::make::{BEGIN_NS, Bag, MS, in_file, small_chunks};
use super::qualification::{Row, plant};

/// How a kind is told.
enum Told {
    /// With exit code 3.
    Warned,
    /// With exit code 0.
    Noted,
    /// By `replay`, which has nothing to drive the twin with; `info` says why, and that it is no recording of the whole system.
    Refused,
}

fn govtwin(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_govtwin")).args(arguments).output().unwrap()
}

/// Fails unless a bag of these bytes is told as it should be, in words that hold each of these.
#[track_caller]
fn told(bytes: &[u8], how: &Told, words: &[&str]) {
    let (folder, path) = in_file(bytes);
    let path = path.to_str().unwrap();
    let code = if matches!(how, Told::Warned) { 3 } else { 0 };
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    for (what, run) in [("info", govtwin(&["info", path])), ("info --json", govtwin(&["info", "--json", path]))] {
        let said = text(&run.stdout);
        assert_eq!(run.status.code(), Some(code), "{what}: {said}");
        words.iter().for_each(|part| assert!(said.contains(part), "{what}: {part:?} not in {said}"));
    }
    let out = folder.path().join("out");
    let run = govtwin(&["replay", path, "--out", out.to_str().unwrap()]);
    let errors = text(&run.stderr);
    if matches!(how, Told::Refused) {
        assert_eq!(run.status.code(), Some(1), "{errors}");
        words.iter().for_each(|part| assert!(errors.contains(part), "{part:?} not in {errors}"));
        assert!(!out.exists());
        return;
    }
    assert_eq!(run.status.code(), Some(code), "{errors}");
    if matches!(how, Told::Warned) {
        words.iter().for_each(|part| assert!(errors.contains(part), "{part:?} not in {errors}"));
    }
    let read = |name: &str| std::fs::read_to_string(Path::new(&out).join(name)).unwrap();
    for name in ["replay.json", "replay.html"] {
        let said = read(name).replace("&#x2F;", "/");
        words.iter().for_each(|part| assert!(said.contains(part), "{part:?} not in {name}"));
    }
}

/// A short recording, each row spoilt.
fn spoilt(seconds: i64, spoil: impl Fn(i64, &mut Row)) -> Vec<u8> {
    plant(seconds, spoil).bytes(WriteOptions::new())
}

#[test]
fn two_publishers_on_one_topic() {
    let bytes = spoilt(5, |step, row| row.opening += if step % 2 == 0 { 0.0 } else { 0.1 });
    told(&bytes, &Told::Warned, &["/governor/command: more than one sender", "alternate"]);
}

#[test]
fn zero_pressure() {
    let bytes = spoilt(5, |step, row| row.pressure_pa *= if step % 100 == 50 { 0.0 } else { 1.0 });
    told(&bytes, &Told::Warned, &["/governor/tank_pressure: dropped from 5 of 500 messages; first: pressure is 0 Pa"]);
    let bytes = spoilt(5, |_, row| row.pressure_pa = 0.0);
    told(&bytes, &Told::Refused, &["pressure is 0 Pa, which moves nothing"]);
}

#[test]
fn bags_without_checksums() {
    let bytes = plant(5, |_, _| {}).bytes(small_chunks().calculate_chunk_crcs(false));
    told(&bytes, &Told::Noted, &["no checksum"]);
}

#[test]
fn a_damaged_summary() {
    let mut bytes = plant(5, |_, _| {}).bytes(small_chunks());
    let footer = bytes.len() - 8 - 20;
    let start = u64::from_le_bytes(bytes[footer..footer + 8].try_into().unwrap()) as usize;
    bytes[start + 23] ^= 0x20;
    told(&bytes, &Told::Warned, &["summary"]);
}

#[test]
fn a_real_pause_is_no_jump_of_time() {
    // Everybody is silent for 20 minutes; no clock does anything.
    let pause = |step: i64, row: &mut Row| {
        let later_ns = if step < 500 { 0 } else { 1_200_000 * MS };
        row.stamps_ns = row.stamps_ns.map(|stamp_ns| stamp_ns + later_ns);
        row.log_ns += later_ns;
    };
    let mut bag = plant(12, pause);
    // The ESV's stamps are not a row's.
    bag.entries.retain(|entry| entry.topic != "/governor/esv");
    for second in 0..12 {
        let later_ns = if second < 5 { 0 } else { 1_200_000 * MS };
        bag.esv(BEGIN_NS + second * 1000 * MS + later_ns, govtwin_bag::msg::EsvState::NORMAL);
    }
    bag.entries.sort_by_key(|entry| entry.log_ns);
    told(&in_order(&bag), &Told::Warned, &["nothing is recorded for 1200.0 s", "(pauses in all: 1)"]);
}

/// A bag's bytes, of which none says that time jumps.
#[track_caller]
fn in_order(bag: &Bag) -> Vec<u8> {
    let bytes = bag.bytes(WriteOptions::new());
    let (_folder, path) = in_file(&bytes);
    let said = govtwin(&["info", path.to_str().unwrap()]).stdout;
    assert!(!String::from_utf8_lossy(&said).contains("time jumps"));
    bytes
}
