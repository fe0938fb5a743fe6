//! The battery: its plants are the twin's kind, not the twin; its faults show; its seeds decide everything.
#![cfg(feature = "lab")]

use govtwin_diagnosis::generate::spread;
use govtwin_diagnosis::likelihood::loop_noise::heard;
use govtwin_diagnosis::likelihood::noise::expected;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_diagnosis::likelihood::problem::Problem;
use govtwin_lab::battery::{Case, CaseKind, fresh_recordings, make, readings, strength};
use govtwin_lab::benchmark::validation::explained_fraction;
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::params;
use govtwin_model::recording::Recording;
use govtwin_model::signal::Signal;
use govtwin_model::twin::Twin;

fn case(kind: CaseKind, seed: u64) -> Case {
    Case { name: "case".into(), kind, rate_hz: 100.0, rich: false, mismatch: 1.0, seed, alone: None }
}

/// RMS error of a signal by a twin.
fn rms(twin: &mut Twin, recording: &Recording, signal: Signal) -> f64 {
    twin.reset();
    let (mut sum, mut count) = (0.0, 0);
    for frame in &recording.frames {
        let residual = signal.of(&frame.measured) - signal.of(&twin.step(frame).signals);
        if residual.is_finite() {
            sum += residual * residual;
            count += 1;
        }
    }
    (sum / f64::from(count)).sqrt()
}

/// Recordings of the same plant that no diagnosis has seen.
fn another_day(unit: &Unit, case: &Case) -> Vec<Recording> {
    let streams = fresh_recordings(unit, case).into_iter();
    streams.map(|(process, streams)| Recording::new(process.id(), streams.rows())).collect()
}

#[test]
fn a_sound_plant_is_the_twins_kind_but_not_the_twin() {
    let unit = params::reference();
    for seed in [2, 3] {
        let made = make(&unit, &case(CaseKind::Sound, seed));
        let mut twin = Twin::new(&spread(&unit, seed));
        for recording in made.recordings() {
            let residual = rms(&mut twin, &recording, Signal::ServomotorPosition);
            // The transducer's noise alone is 1.5e-4.
            assert!((1.5e-4..3e-4).contains(&residual), "{}: {residual}", recording.name);
            assert!(rms(&mut twin, &recording, Signal::SpoolPosition) < 8e-3);
        }
    }
}

#[test]
fn a_seed_decides_everything_and_a_fault_shows() {
    let unit = params::reference();
    let backlash = case(CaseKind::Single("backlash".into()), 5);
    let made = make(&unit, &backlash);
    // As text, since a signal that is not recorded is NaN.
    let again = make(&unit, &backlash);
    assert_eq!(format!("{:?}", made.streams), format!("{:?}", again.streams));
    let truth = &made.label.effects[0];
    assert!(truth.id == "backlash" && truth.stage.id() == "servomotor" && truth.unit == "pu");
    let strength_ratio = strength(&unit, &backlash);
    assert!(made.label.listed && strength_ratio > 1.0, "{strength_ratio}");
    assert!(!make(&unit, &case(CaseKind::LeftOut("backlash".into()), 5)).label.listed);

    // The contact gap is the play operator's kind: with it the twin comes close, without it it does not.
    let mut spread_unit = spread(&unit, 5);
    let recording = &made.recordings()[1];
    let without = rms(&mut Twin::new(&spread_unit), recording, Signal::ServomotorPosition);
    spread_unit.effects = vec![EffectSetting { id: "backlash".into(), values: vec![truth.size] }];
    let with = rms(&mut Twin::new(&spread_unit), recording, Signal::ServomotorPosition);
    assert!(with < 0.7 * without, "{with} {without}");

    // Another day of the same plant: other commands, the same play; the twin that has it closes most of the gap.
    let another = another_day(&unit, &backlash);
    assert!(another.len() == 4 && another[1].frames != recording.frames);
    let sound = Unit { effects: vec![], ..spread_unit.clone() };
    let closed = explained_fraction(another.clone(), &sound, &spread_unit).unwrap();
    assert!((0.6..1.2).contains(&closed), "{closed}");
    assert_eq!(explained_fraction(another, &sound, &sound), Some(0.0));
}

#[test]
fn what_chatters_louder_is_examined_with_the_noise_of_its_own() {
    let unit = params::reference();
    let slow = case(CaseKind::Single("regulator_cycle".into()), 5);
    let truth = make(&unit, &slow).label.effects[0].clone();
    assert!(truth.size > 0.01, "{truth:?}: too short a cycle to chatter");
    let sound = spread(&unit, 5);
    let setting = EffectSetting { id: "regulator_cycle".into(), values: vec![truth.size] };
    let slowed = Unit { effects: vec![setting], ..sound.clone() };
    let closed = explained_fraction(another_day(&unit, &slow), &sound, &slowed).unwrap();
    assert!((0.8..1.2).contains(&closed), "{closed}");
}

/// Sound plants with other equations than the twin's, that differ in the mean their regulators take, each at its true parameters' sheet.
#[test]
fn the_ratio_follows_the_readings_of_which_the_regulator_takes_the_mean() {
    let unit = params::reference();
    let ratio_of = |seed: u64| {
        let kind = CaseKind::Sound;
        let case = Case { name: "sound".into(), kind, rate_hz: 100.0, rich: false, mismatch: 1.0, seed, alone: None };
        let recordings = make(&unit, &case).recordings().into_iter().map(PreparedRecording::new).collect();
        let problem = Problem::new(recordings, &unit, &expected(&unit.sensors));
        heard(problem, &unit).loop_noise_ratio()
    };
    let told = |seed: u64| readings(seed);
    let mut seeds: Vec<u64> = (0..24).collect();
    seeds.sort_by_key(|seed| told(*seed));
    let (fewest, most) = (seeds[0], seeds[seeds.len() - 1]);
    assert!(told(fewest) <= 4 && told(most) >= 10, "{} {}", told(fewest), told(most));
    let (loud, quiet) = (ratio_of(fewest), ratio_of(most));
    assert!(loud > 1.3 * quiet && (0.3..0.9).contains(&loud) && quiet < 0.45, "{loud} {quiet}");
}
