//! `govtwin recover` saves what can be read, `govtwin doctor` says what is wrong.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use govtwin_bag::msg::EsvState;
use govtwin_bag::{Qos, RawMessage, Writer, WriterOptions};
use mcap::WriteOptions;
use mcap::records::op;

use super::make::{Bag, in_file, shipped, small_chunks};

fn govtwin(arguments: &[&Path]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_govtwin")).args(arguments).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

fn all(path: &Path) -> Vec<RawMessage> {
    govtwin_bag::messages(path).unwrap().map(Result::unwrap).collect()
}

#[test]
fn every_message_that_can_be_read_stands_in_a_new_bag_and_the_old_one_as_it_was() {
    let bytes = Bag::standard(20).bytes(small_chunks());
    let cut = &bytes[..bytes.len() * 2 / 3];
    let (folder, path) = in_file(cut);
    let run = govtwin(&["recover".as_ref(), &path]);
    assert_eq!(run.status.code(), Some(3), "something was lost: {}", text(&run.stderr));
    let new = folder.path().join("bag_recovered");
    assert_eq!(all(&new), all(&path));
    assert!(all(&new).len() > 2000, "{}", all(&new).len());
    assert_eq!(fs::read(&path).unwrap(), cut);
    let survey = govtwin_bag::survey(&new).unwrap();
    assert_eq!((survey.warnings, survey.notes), (vec![], vec![]), "whole, checked, counted");
    for words in ["messages saved; ", "bytes could not be read", "bag_recovered"] {
        assert!(text(&run.stdout).contains(words), "{}", text(&run.stdout));
    }
    // What is there is not overwritten.
    let again = govtwin(&["recover".as_ref(), &path]);
    assert_eq!(again.status.code(), Some(1));
    assert!(text(&again.stderr).contains("--out"), "{}", text(&again.stderr));
}

#[test]
fn a_recording_that_was_broken_off_gets_the_name_it_would_have_had() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("run");
    let options = WriterOptions { keep_unfinished: true, ..WriterOptions::default() };
    let mut writer = Writer::create(&place, options).unwrap();
    let topic = writer.topic::<EsvState>("/esv", Qos::SENSOR).unwrap();
    for time_ns in 0..100 {
        writer.write(topic, time_ns, &EsvState::default()).unwrap();
    }
    writer.flush().unwrap();
    // As a kill leaves it: without a footer.
    let kept = folder.path().join(".run.unfinished");
    let killed = folder.path().join("copy");
    fs::create_dir(&killed).unwrap();
    fs::copy(kept.join("run_0.mcap"), killed.join("run_0.mcap")).unwrap();
    drop(writer);
    fs::remove_dir_all(&kept).unwrap();
    fs::rename(&killed, &kept).unwrap();

    let words = Writer::create(&place, options).unwrap_err().to_string();
    assert!(words.contains("govtwin recover"), "{words}");
    let run = govtwin(&["recover".as_ref(), &place]);
    assert_eq!(run.status.code(), Some(0), "all of it was flushed: {}", text(&run.stderr));
    let messages = all(&place);
    assert_eq!(messages.len(), 100);
    assert!(messages[0].topic.offered_qos_profiles.contains("best_effort") && !messages[0].topic.type_hash.is_empty());
    assert!(kept.is_dir(), "what it was saved from is left to its user");
    let doctor = govtwin(&["doctor".as_ref(), &place]);
    assert_eq!(doctor.status.code(), Some(0), "{}", text(&doctor.stdout));
}

#[test]
fn what_was_broken_off_without_a_message_blocks_nobody() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("run");
    let options = WriterOptions { keep_unfinished: true, ..WriterOptions::default() };
    drop(Writer::create(&place, options).unwrap());
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "refused before its first message");
    // Killed before it.
    let kept = folder.path().join(".run.unfinished");
    fs::create_dir(&kept).unwrap();
    fs::write(kept.join("run_0.mcap"), mcap::MAGIC).unwrap();
    fs::write(kept.join(".room"), [0; 10]).unwrap();
    Writer::check(&place, options).unwrap();
    Writer::create(&place, options).unwrap().finish().unwrap();
    assert!(!kept.exists());
    // A stranger's file is something.
    let other = folder.path().join("other");
    let kept = folder.path().join(".other.unfinished");
    fs::create_dir(&kept).unwrap();
    fs::write(kept.join("thesis.txt"), "words").unwrap();
    assert!(Writer::create(&other, options).is_err());
    assert!(kept.join("thesis.txt").exists());
}

/// The places of all records with this opcode, behind their heads.
fn places(bytes: &[u8], opcode: u8) -> Vec<usize> {
    let (mut at, mut found) = (mcap::MAGIC.len(), vec![]);
    while at + 9 <= bytes.len() - mcap::MAGIC.len() {
        let len = u64::from_le_bytes(bytes[at + 1..at + 9].try_into().unwrap()) as usize;
        if bytes[at] == opcode {
            found.push(at + 9);
        }
        at += 9 + len;
    }
    found
}

fn doctor_of(bytes: &[u8]) -> (i32, String) {
    let (_folder, path) = in_file(bytes);
    let run = govtwin(&["doctor".as_ref(), &path]);
    (run.status.code().unwrap(), text(&run.stdout))
}

#[test]
fn an_index_or_a_count_that_is_not_that_of_the_messages_is_found() {
    let bag = Bag::standard(5);
    let mut sound = bag.bytes(small_chunks().compression(None).calculate_chunk_crcs(false));
    // No checksum over the summary, so that nothing but its content tells.
    let crc = sound.len() - mcap::MAGIC.len() - 4;
    sound[crc..crc + 4].fill(0);
    let (code, said) = doctor_of(&sound);
    assert!(code == 0 && said.contains("  sound") && said.contains("no checksum protects"), "{said}");

    let chunk_index = places(&sound, op::CHUNK_INDEX);
    let chunk = places(&sound, op::CHUNK)[1];
    let statistics = places(&sound, op::STATISTICS)[0];
    let message_index = places(&sound, op::MESSAGE_INDEX)[0];
    assert!(chunk_index.len() > 3);
    for (at, finding) in [
        (chunk_index[1], "the index states other times of the chunk"),
        (chunk_index[1] + 16, "the index names 1 chunks that are not there"),
        (chunk_index[1] + 16, "the index leaves out 1 of"),
        (chunk_index[1] + 24, "the index states another length of the chunk"),
        (chunk, "states times"),
        (statistics + 8 + 2 + 4 + 4 + 4, "the summary counts"),
        (statistics + 8 + 2 + 4 + 4 + 4 + 4, "ns, the messages were recorded from"),
        (message_index, "an index of messages counts others"),
    ] {
        let mut changed = sound.clone();
        changed[at] ^= 0x04;
        let (code, said) = doctor_of(&changed);
        assert!(code == 3 && said.contains(finding) && said.contains("govtwin recover"), "{finding}: {said}");
    }
}

#[test]
fn the_doctor_finds_what_metadata_counts_otherwise_and_all_shipped_bags_sound() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("run");
    let (_source, source) = Bag::standard(2).file(WriteOptions::new());
    govtwin_bag::recover(&source, &place).unwrap();
    let yaml = place.join("metadata.yaml");
    let words = fs::read_to_string(&yaml).unwrap();
    // The first of the counts is that of the bag, the second that of a topic.
    let at = words.match_indices("message_count: ").nth(1).unwrap().0 + "message_count: ".len();
    fs::write(&yaml, format!("{}9{}", &words[..at], &words[at..])).unwrap();
    let run = govtwin(&["doctor".as_ref(), &place]);
    assert_eq!(run.status.code(), Some(3));
    assert!(text(&run.stdout).contains("metadata.yaml: counts 9"), "{}", text(&run.stdout));

    let run = govtwin(&["doctor".as_ref(), "--json".as_ref(), &shipped("reference")]);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    let bags: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(bags.as_array().unwrap().len(), 16);
    assert!(bags.as_array().unwrap().iter().all(|one| one["sound"] == true));
    let nowhere = PathBuf::from("/nowhere/a.mcap");
    assert_eq!(govtwin(&["doctor".as_ref(), &nowhere]).status.code(), Some(1));
}
