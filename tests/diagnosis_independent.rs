//! The diagnosis on plants that share the sheet with the twin and no equation: generated units, and two that others made.
#![cfg(feature = "lab")]

use std::path::Path;

use govtwin::bag::{self, Interpolation, ReadOptions, Stream};
use govtwin::battery::{self, Case, Kind};
use govtwin::diagnosis::result::{Diagnosis, Verdict};
use govtwin::diagnosis::{Settings, diagnose};
use govtwin::params::reference;
use govtwin::recording::Recording;

fn judged(recordings: Vec<Recording>) -> Diagnosis {
    let catalogue = govtwin::effects::of_the_chain().collect();
    diagnose(recordings, &reference(), &Settings { catalogue, ..Settings::default() }, &|_, _| ()).unwrap()
}

fn generated(kind: Kind, seed: u64) -> Diagnosis {
    let case = Case { name: "unit".to_owned(), kind, rate_hz: 100.0, rich: false, seed };
    judged(battery::make(&reference(), &case).recordings())
}

fn practice(unit: &str) -> Diagnosis {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/practice").join(unit);
    let options = ReadOptions {
        interpolation: Interpolation::Sharp { period_ns: 1_000_000 },
        required: vec![Stream::ServoState],
        ..ReadOptions::default()
    };
    let recordings = ["startup", "load_increase", "shutdown", "load_rejection"]
        .map(|process| bag::read(&folder.join(format!("{process}.mcap")), &options).unwrap().recording);
    judged(recordings.to_vec())
}

/// The verdict is these effects, each of them probable, and nothing else.
fn named(said: &Diagnosis, ids: &[&str]) {
    let mut blamed: Vec<&str> = said.blamed.iter().map(|blame| blame.id.as_str()).collect();
    blamed.sort_unstable();
    assert!(said.verdict == Verdict::Named && blamed == ids, "{:?} {blamed:?} {:?}", said.verdict, said.sets);
    assert!(said.blamed.iter().all(|blame| blame.probability > 0.5), "{:?}", said.blamed);
    assert!(said.closure.value > 0.5, "{:?}", said.closure);
}

#[test]
fn a_generated_sound_unit_shows_no_gap() {
    let said = generated(Kind::Sound, 11);
    assert!(matches!(said.verdict, Verdict::NoGap | Verdict::NotExcited), "{:?} {:?}", said.verdict, said.sets);
}

#[test]
fn a_generated_leak_across_the_piston_is_named() {
    named(&generated(Kind::Single("servo_leak".to_owned()), 12), &["servo_leak"]);
}

#[test]
fn a_generated_play_is_named() {
    named(&generated(Kind::Single("backlash".to_owned()), 13), &["backlash"]);
}

#[test]
fn a_generated_late_trip_is_named_or_in_a_class_with_a_slow_one() {
    let said = generated(Kind::Single("esv_delay".to_owned()), 14);
    assert!(matches!(said.verdict, Verdict::Named | Verdict::Class), "{:?} {:?}", said.verdict, said.sets);
    assert_eq!(said.blamed[0].id, "esv_delay", "{:?}", said.sets);
}

/// Of all fault sets the right pair leads by far; whether the verdict names it, too, is for the learned doubt that something unknown is there.
#[test]
fn two_effects_at_once_lead_all_other_fault_sets() {
    let said = generated(Kind::Pair("backlash".to_owned(), "lvdt_bias".to_owned()), 15);
    assert!(said.verdict != Verdict::NoGap, "{:?}", said.ranking);
    assert_eq!(said.sets[0].0, ["backlash", "lvdt_bias"], "{:?}", said.sets);
    assert!(said.sets.iter().skip(1).all(|(_, probability)| *probability < 0.2 * said.sets[0].1), "{:?}", said.sets);
}

#[test]
fn a_generated_clock_that_is_off_is_named() {
    named(&generated(Kind::Single("clock_offset".to_owned()), 16), &["clock_offset"]);
}

#[test]
fn practice_units_are_judged_as_their_labels_say() {
    let sound = practice("case_01");
    assert!(matches!(sound.verdict, Verdict::NoGap | Verdict::NotExcited), "{:?} {:?}", sound.verdict, sound.sets);
    let played = practice("case_03");
    named(&played, &["backlash"]);
    let play = &played.blamed[0].parameters[0].value;
    assert!((play.low..=play.high).contains(&2.12e-3), "{play:?}");
}
