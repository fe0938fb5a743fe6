//! The diagnosis on plants that share the sheet with the twin and no equation: generated units, and two that others made.
#![cfg(feature = "lab")]

use std::path::Path;

use govtwin_bag::{Interpolation, ReadOptions, Stream};
use govtwin_diagnosis::hypotheses::table::EvidenceRow;
use govtwin_diagnosis::result::{Diagnosis, Verdict};
use govtwin_diagnosis::{DiagnosisSettings, diagnose};
use govtwin_lab::battery::{self, Case, CaseKind};
use govtwin_model::frame::{Frame, Signals};
use govtwin_model::params::reference;
use govtwin_model::recording::Recording;

fn judged(recordings: Vec<Recording>) -> Diagnosis {
    let catalogue = govtwin_model::effects::of_the_chain().collect();
    let settings = DiagnosisSettings { catalogue, ..DiagnosisSettings::default() };
    let said = diagnose(recordings, &reference(), &settings, &|_, _| ()).unwrap();
    // The verdict rests on evidence of fits that ended.
    let odds = |row: &EvidenceRow| -0.5 * row.cost - 5.0 * row.effects.len() as f64;
    let leader = said.table.rows.iter().max_by(|a, b| odds(a).total_cmp(&odds(b))).unwrap();
    assert!(leader.refined, "{leader:?}");
    // With a further effect at nothing a set costs no more than without it.
    for row in &said.table.rows {
        let is_within = |one: &&EvidenceRow| {
            one.effects.len() < row.effects.len() && one.effects.iter().all(|effect| row.effects.contains(effect))
        };
        let within = said.table.rows.iter().filter(is_within).map(|one| one.cost).fold(f64::INFINITY, f64::min);
        assert!(row.cost <= within + 1.0, "{:?} costs {}, what it holds {within}", row.effects, row.cost);
    }
    said
}

fn generated(kind: CaseKind, seed: u64) -> Diagnosis {
    let case = Case { name: "unit".to_owned(), kind, rate_hz: 100.0, rich: false, mismatch: 1.0, seed, alone: None };
    judged(battery::make(&reference(), &case).recordings())
}

/// The same at 5 Hz, its inputs straight between the rows, as a bag at such a rate is read.
fn generated_slow(kind: CaseKind, seed: u64) -> Diagnosis {
    let case = Case { name: "unit".to_owned(), kind, rate_hz: 5.0, rich: false, mismatch: 1.0, seed, alone: None };
    judged(battery::make(&reference(), &case).recordings().into_iter().map(straight).collect())
}

fn straight(recording: Recording) -> Recording {
    const TICK_NS: i64 = 1_000_000;
    let mut frames: Vec<Frame> = Vec::new();
    for pair in recording.frames.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        frames.push(from);
        for time_ns in (from.time_ns + TICK_NS..to.time_ns).step_by(1_000_000) {
            let share = (time_ns - from.time_ns) as f64 / (to.time_ns - from.time_ns) as f64;
            let between = |from: f64, to: f64| from + share * (to - from);
            let mut inputs = from.inputs;
            inputs.opening_command_pu = between(from.inputs.opening_command_pu, to.inputs.opening_command_pu);
            inputs.tank_pressure_pa = between(from.inputs.tank_pressure_pa, to.inputs.tank_pressure_pa);
            frames.push(Frame { time_ns, inputs, measured: Signals::NONE });
        }
    }
    frames.extend(recording.frames.last());
    Recording { frames, ..recording }
}

fn practice(unit: &str) -> Diagnosis {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/practice").join(unit);
    let options = ReadOptions {
        interpolation: Interpolation::Sharp { period_ns: 1_000_000 },
        required: vec![Stream::ServoState],
        ..ReadOptions::default()
    };
    let recordings = ["startup", "load_increase", "shutdown", "load_rejection"]
        .map(|process| govtwin_bag::read(&folder.join(format!("{process}.mcap")), &options).unwrap().recording);
    judged(recordings.to_vec())
}

/// The verdict is these effects, each of them probable, and nothing else.
fn named(said: &Diagnosis, ids: &[&str]) {
    let mut blamed: Vec<&str> = said.blamed.iter().map(|blame| blame.id.as_str()).collect();
    blamed.sort_unstable();
    assert!(said.verdict == Verdict::Named && blamed == ids, "{:?} {blamed:?} {:?}", said.verdict, said.sets);
    assert!(said.blamed.iter().all(|blame| blame.probability > 0.5), "{:?}", said.blamed);
}

/// The same, and it explains most of the gap on data left out.
fn named_and_explained(said: &Diagnosis, ids: &[&str]) {
    named(said, ids);
    assert!(said.explained_fraction.value > 0.5, "{:?}", said.explained_fraction);
}

#[test]
fn a_generated_sound_unit_shows_no_gap() {
    let said = generated(CaseKind::Sound, 11);
    assert!(matches!(said.verdict, Verdict::NoGap | Verdict::NotExcited), "{:?} {:?}", said.verdict, said.sets);
}

/// A regulator's kicks and a command taken back with the trip are noise of slow recordings, and no gap.
#[test]
fn a_generated_sound_unit_at_5_hz_leaves_what_its_noise_says() {
    let said = generated_slow(CaseKind::Sound, 11);
    assert!(matches!(said.verdict, Verdict::NoGap | Verdict::NotExcited), "{:?} {:?}", said.verdict, said.sets);
    for one in &said.consistency[0] {
        assert!((0.4..1.6).contains(&one.mean_square), "{one:?}");
    }
}

/// Its gap is too small beside the noise to say on data left out how much of it is explained.
#[test]
fn a_generated_load_at_5_hz_is_named_alone() {
    named(&generated_slow(CaseKind::Single("load".to_owned()), 17), &["load"]);
}

#[test]
fn a_generated_leak_across_the_piston_is_named() {
    named_and_explained(&generated(CaseKind::Single("servo_leak".to_owned()), 12), &["servo_leak"]);
}

#[test]
fn a_generated_play_is_named() {
    named_and_explained(&generated(CaseKind::Single("backlash".to_owned()), 13), &["backlash"]);
}

#[test]
fn a_generated_late_trip_is_named_or_in_a_class_with_a_slow_one() {
    let said = generated(CaseKind::Single("esv_delay".to_owned()), 14);
    assert!(matches!(said.verdict, Verdict::Named | Verdict::Class), "{:?} {:?}", said.verdict, said.sets);
    assert_eq!(said.blamed[0].id, "esv_delay", "{:?}", said.sets);
}

/// Of all fault sets the right pair leads by far; whether the verdict names it, too, is for the learned doubt that something unknown is there.
#[test]
fn two_effects_at_once_lead_all_other_fault_sets() {
    let said = generated(CaseKind::Pair("backlash".to_owned(), "lvdt_bias".to_owned()), 15);
    assert!(said.verdict != Verdict::NoGap, "{:?}", said.ranking);
    assert_eq!(said.sets[0].0, ["backlash", "lvdt_bias"], "{:?}", said.sets);
    assert!(said.sets.iter().skip(1).all(|(_, probability)| *probability < 0.2 * said.sets[0].1), "{:?}", said.sets);
}

#[test]
fn a_generated_clock_that_is_off_is_named() {
    named_and_explained(&generated(CaseKind::Single("clock_offset".to_owned()), 16), &["clock_offset"]);
}

#[test]
fn practice_units_are_judged_as_their_labels_say() {
    let sound = practice("case_01");
    assert!(matches!(sound.verdict, Verdict::NoGap | Verdict::NotExcited), "{:?} {:?}", sound.verdict, sound.sets);
    let played = practice("case_03");
    named_and_explained(&played, &["backlash"]);
    let play = &played.blamed[0].parameters[0].value;
    assert!((play.low..=play.high).contains(&2.12e-3), "{play:?}");
}
