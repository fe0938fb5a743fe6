//! The diagnosis on generated units: what is planted is named, what is not is not, and nothing is said on too little.

use govtwin_diagnosis::evidence::distortion::Place;
use govtwin_diagnosis::generate::{Scenario, recording, spread};
use govtwin_diagnosis::hypotheses::explore;
use govtwin_diagnosis::identification::free_parameter::FreeParameter;
use govtwin_diagnosis::likelihood::noise::expected;
use govtwin_diagnosis::likelihood::prepared::PreparedRecording;
use govtwin_diagnosis::likelihood::problem::Problem;
use govtwin_diagnosis::model::FittedModel;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::result::{Diagnosis, Verdict};
use govtwin_diagnosis::{DiagnosisError, DiagnosisSettings, diagnose};
use govtwin_model::effects::find;
use govtwin_model::frame::Frame;
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::params::reference;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// A few effects that resemble each other, so that a test takes seconds.
const TRIED: [&str; 4] = ["backlash", "port_overlap", "lvdt_bias", "feedback_lag"];

fn settings() -> DiagnosisSettings {
    DiagnosisSettings { catalogue: TRIED.iter().filter_map(|id| find(id)).collect(), ..DiagnosisSettings::default() }
}

fn unit(seed: u64, effect: Option<(&str, f64)>) -> Unit {
    let mut unit = spread(&reference(), seed);
    unit.effects.extend(effect.map(|(id, value)| EffectSetting { id: id.to_owned(), values: vec![value] }));
    unit
}

fn recordings(unit: &Unit, processes: &[Process], seed: u64) -> Vec<Recording> {
    let scenario =
        |process| Scenario { unit: unit.clone(), process, rate_hz: 100.0, duration_s: 40.0, rich: false, seed };
    processes.iter().map(|&process| recording(&scenario(process))).collect()
}

fn judged(effect: Option<(&str, f64)>) -> Diagnosis {
    let recordings = recordings(&unit(3, effect), &Process::ALL, 3);
    diagnose(recordings, &reference(), &settings(), &|_, _| ()).unwrap()
}

#[test]
fn a_planted_bias_is_named_with_its_size_and_closes_the_gap() {
    let said = judged(Some(("lvdt_bias", 0.03)));
    assert_eq!(said.verdict, Verdict::Named);
    assert_eq!(said.blamed.len(), 1);
    assert_eq!(said.blamed[0].id, "lvdt_bias");
    let bias = &said.blamed[0].parameters[0];
    assert!((bias.value.value - 0.03).abs() < 3.0e-3, "{bias:?}");
    assert!(said.explained_fraction.value > 0.8, "{:?}", said.explained_fraction);
    assert_eq!(said.fitted.effects.len(), 1);
    // What could not explain a hundredth of it is ranked, far behind.
    assert!(said.ranking.iter().any(|ranked| ranked.id == "feedback_lag" && ranked.probability < 0.1));
    assert_eq!(said.tried[0].ids, ["lvdt_bias"], "{:?}", said.tried);
    assert!(said.refitted.effects.is_empty());
    for breakdown in &said.breakdowns {
        let sum: f64 = breakdown.parts.iter().map(|part| part.refitted).sum();
        assert!((sum - 1.0).abs() < 1e-9, "{} of {}: {sum}", breakdown.by, breakdown.signal.id());
    }
    // The free term that would stand for the named effect is nearly the one that the recordings ask for.
    let curves = &said.discrepancy_terms[0].curves;
    let square = |of: fn(f64, f64) -> f64| -> f64 {
        let points = curves.iter().flat_map(|curve| curve.points.iter().zip(&curve.named));
        points.map(|(free, named)| of(free.1, named.1).powi(2)).sum()
    };
    let (apart, all) = (square(|free, named| free - named), square(|free, _| free));
    assert!(all > 0.0 && apart < 0.1 * all, "{apart} of {all}");
    let json = DiagnosisReport::of(&said, 1.0).json();
    assert_eq!(json["schema"], "govtwin-diagnosis/1");
    assert_eq!(json["effects"][0]["parameters"][0]["name"], "bias_pu");
    let rmse = json["gap"]["signals"][0]["rmse"].as_object().unwrap();
    let mut keys: Vec<&String> = rmse.keys().collect();
    keys.sort();
    assert_eq!(keys, ["delivered", "refitted", "with_effects", "with_residual"]);
    // Effects may be there together, so that their probabilities may exceed 1 in sum; nothing, unknown and any one effect exclude each other.
    let ranking: Vec<f64> =
        json["ranking"].as_array().unwrap().iter().map(|one| one["probability"].as_f64().unwrap()).collect();
    assert!(ranking.iter().all(|p| (0.0..=1.0 + 1e-9).contains(p)) && ranking.iter().sum::<f64>() > 1.0 - 1e-6);
    let of = |id: &str| said.ranking.iter().find(|one| one.id == id).unwrap().probability;
    assert!(of("none") + of("unknown") + of("lvdt_bias") <= 1.0 + 1e-9);
}

/// What is claimed of three effects of which the second has no name: the other two, fitted without it, and each alone.
#[test]
fn what_is_claimed_has_the_named_effects_and_no_others() {
    let planted = [("lvdt_bias", 0.03), ("backlash", 0.003), ("feedback_lag", 0.05)];
    let mut true_unit = unit(3, None);
    let setting = |(id, value): (&str, f64)| EffectSetting { id: id.to_owned(), values: vec![value] };
    true_unit.effects.extend(planted.map(setting));
    let processes = [Process::LoadIncrease, Process::LoadRejection];
    let recordings = recordings(&true_unit, &processes, 3).into_iter().map(PreparedRecording::new).collect();
    let problem = Problem::new(recordings, &reference(), &expected(&reference().sensors));
    let problem = problem.with_loop_noise(1.0).laid_along(&reference());
    let sheet = FittedModel::sheet(&problem, &reference(), &FreeParameter::nuisances(&reference()));
    let catalogue: Vec<_> = planted.iter().filter_map(|(id, _)| find(id)).collect();
    let mut found = explore(&problem, &sheet, &sheet, &catalogue, &|_, _| ());
    found.complete(&problem, &["lvdt_bias", "feedback_lag"], true, &catalogue);
    let claimed = found.with(&["lvdt_bias", "feedback_lag"]).unwrap().unit();
    let mut sizes: Vec<(&str, f64)> = claimed.effects.iter().map(|one| (one.id.as_str(), one.values[0])).collect();
    sizes.sort_by(|a, b| b.0.cmp(a.0));
    assert!(sizes.len() == 2 && sizes[0].0 == "lvdt_bias" && sizes[1].0 == "feedback_lag", "{sizes:?}");
    // The lag takes up some of the play that is not claimed.
    assert!((sizes[0].1 / 0.03 - 1.0).abs() < 0.2 && (sizes[1].1 / 0.05 - 1.0).abs() < 0.7, "{sizes:?}");
    assert_eq!(found.with(&["feedback_lag"]).unwrap().ids(), ["feedback_lag"]);
    // What was fitted with care is not fitted again.
    let before = problem.simulations();
    found.complete(&problem, &["lvdt_bias", "feedback_lag"], true, &catalogue);
    assert_eq!(problem.simulations(), before);
    // All three at once explain the recording best, with the sizes that were planted.
    let leader = found.leader().unit();
    assert_eq!(leader.effects.len(), 3, "{:?}", leader.effects);
    for (id, value) in planted {
        let fitted = leader.effects.iter().find(|one| one.id == id).unwrap().values[0];
        assert!((fitted / value - 1.0).abs() < 0.35, "{id}: {fitted}");
    }
}

/// Nobody keeps step with a limit cycle: the right effect leaves no less of the plain squares than none does.
#[test]
fn a_unit_that_swings_of_itself_is_named_by_its_loudness() {
    let unit = unit(3, Some(("pv_bandwidth", 0.1)));
    let recordings = recordings(&unit, &[Process::LoadIncrease, Process::Shutdown], 3);
    let tried = ["pv_bandwidth", "pv_hysteresis", "lvdt_bias"];
    let settings = DiagnosisSettings {
        catalogue: tried.iter().filter_map(|id| find(id)).collect(),
        ..DiagnosisSettings::default()
    };
    let said = diagnose(recordings, &reference(), &settings, &|_, _| ()).unwrap();
    assert_eq!(said.verdict, Verdict::Named, "{:?}", said.ranking);
    assert_eq!(said.blamed[0].id, "pv_bandwidth");
    let ratio = said.blamed[0].parameters[0].value.value;
    assert!((ratio - 0.1).abs() < 0.02, "{ratio}");
    assert!(said.explained_fraction.value > 0.7, "{:?}", said.explained_fraction);
    assert!(said.notes.iter().any(|note| note.contains("Limit cycles in")), "{:?}", said.notes);
}

/// A leak across the piston lets the spool stand open at rest, as an offset of its transducer does, but not in every movement.
#[test]
fn a_neighbour_of_what_the_catalogue_lacks_is_doubted() {
    let leak = find("servo_leak").unwrap().parameters[0];
    let said = judged(Some(("servo_leak", 1.5 * leak.typical)));
    // It leaves little more than a right equation would, but only with a sheet that is far off: something else is at work, beside it or instead.
    let of = |id: &str| said.ranking.iter().find(|one| one.id == id).unwrap().probability;
    let something_else = said.remainder.as_ref().unwrap().something_else;
    assert!(something_else > 0.3 && something_else >= of("unknown"), "{something_else} {:?}", said.ranking);
    assert!(something_else > 30.0 * of("port_overlap") && something_else > 100.0 * of("none"), "{:?}", said.ranking);
    assert!(said.notes.iter().any(|note| note.contains("tolerances") && note.contains("sheet")), "{:?}", said.notes);
}

/// Wider overlap is a parameter of the sheet, too: the refit follows, but only far outside its tolerance.
#[test]
fn a_sheet_stretched_beyond_belief_is_no_sound_unit() {
    let extra = find("port_overlap").unwrap().parameters[0];
    let recordings = recordings(&unit(3, Some(("port_overlap", 0.8 * extra.typical))), &Process::ALL, 3);
    let tried = ["feedback_lag", "esv_slow"];
    let settings = DiagnosisSettings {
        catalogue: tried.iter().filter_map(|id| find(id)).collect(),
        ..DiagnosisSettings::default()
    };
    let said = diagnose(recordings, &reference(), &settings, &|_, _| ()).unwrap();
    assert_eq!(said.verdict, Verdict::Unknown, "{:?}", said.ranking);
    let words = "follows these recordings only if main_ports.overlap_m is";
    assert!(said.notes.iter().any(|note| note.contains(words)), "{:?}", said.notes);
}

#[test]
fn a_sound_unit_has_no_gap() {
    let said = judged(None);
    assert_eq!(said.verdict, Verdict::NoGap, "{:?}", said.ranking);
    assert!(said.blamed.is_empty());
    assert!(said.stage.is_none());
}

/// What no effect of the catalogue explains shows where it stands out, however small it is in all.
#[test]
fn what_stands_out_somewhere_is_no_sound_unit() {
    let odd = |change: fn(f64, &mut Frame)| {
        let mut recordings = recordings(&unit(3, None), &[Process::Startup, Process::LoadIncrease], 3);
        for recording in &mut recordings {
            let start_ns = recording.frames[0].time_ns;
            recording.frames.iter_mut().for_each(|frame| change(seconds_from_nanos(frame.time_ns - start_ns), frame));
        }
        diagnose(recordings, &reference(), &settings(), &|_, _| ()).unwrap()
    };
    let strongest = |said: &Diagnosis| said.table.rows.iter().find_map(|row| row.distortion.clone()).unwrap();
    let sound = odd(|_, _| ());
    assert_eq!(sound.verdict, Verdict::NoGap);
    assert!(strongest(&sound).p_value > 0.05, "{:?}", strongest(&sound));
    // The spool's transducer sits elsewhere for some seconds.
    let jumped = odd(|time_s, frame| {
        if (12.0..20.0).contains(&time_s) {
            frame.measured.spool_position_pu += 0.02;
        }
    });
    assert_ne!(jumped.verdict, Verdict::NoGap, "{:?}", strongest(&jumped));
    assert_eq!(strongest(&jumped).signal, Signal::SpoolPosition);
    // Something swings the servomotor.
    let swung = odd(|time_s, frame| {
        frame.measured.servomotor_position_pu += 1.0e-3 * (std::f64::consts::TAU * 0.45 * time_s).sin();
    });
    assert_ne!(swung.verdict, Verdict::NoGap, "{:?}", strongest(&swung));
    assert!(matches!(strongest(&swung).place, Place::Frequency { hz, .. } if (hz - 0.45).abs() < 0.05));
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let recordings = recordings(&unit(5, Some(("lvdt_bias", 0.02))), &[Process::Startup, Process::Shutdown], 5);
    let few = DiagnosisSettings { catalogue: settings().catalogue[2..].to_vec(), ..settings() };
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let recordings = recordings.clone();
        let said = pool.install(|| diagnose(recordings, &reference(), &few, &|_, _| ()).unwrap());
        DiagnosisReport::of(&said, 0.0).json().to_string()
    };
    assert_eq!(run(1), run(2));
}

#[test]
fn too_little_is_refused_in_words() {
    let mut recording = recordings(&unit(1, None), &[Process::Startup], 1).remove(0);
    recording.frames.truncate(10);
    let error = diagnose(vec![recording], &reference(), &settings(), &|_, _| ()).unwrap_err();
    assert!(matches!(error, DiagnosisError::Unusable(_)), "{error}");
    assert!(error.to_string().contains("at least 50"), "{error}");
    let none = DiagnosisSettings { catalogue: vec![], ..DiagnosisSettings::default() };
    assert_eq!(diagnose(vec![], &reference(), &none, &|_, _| ()).unwrap_err(), DiagnosisError::NothingToTry);
}
