//! A unit that ages over a year under a residual trained when it was commissioned: its leaves are retrained, in bounds and never for the worse.
#![cfg(all(feature = "cli", feature = "residual"))]

use std::process::Command;

use govtwin_correction::adapt::Adaptation;
use govtwin_correction::corrector::Corrector;
use govtwin_correction::model::Model;
use govtwin_diagnosis::generate::{self, Scenario};
use govtwin_model::parameters::EffectSetting;
use govtwin_model::params;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::twin::Twin;

const BIN: &str = env!("CARGO_BIN_EXE_govtwin");
const MONTHS: u32 = 12;

fn run(args: &[&str]) {
    let output = Command::new(BIN).args(args).env("RAYON_NUM_THREADS", "1").output().unwrap();
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// A residual of the unit as it was commissioned, whose ports overlap by 1 mm more than the sheet says.
fn commissioned() -> Model {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    for seed in ["1", "2", "3"] {
        let out = at(&format!("unit/visit_{seed}"));
        let flags = ["--rate", "5", "--duration", "120", "--spread", "off", "--seed", seed];
        run(&[&["generate", "--out", &out, "--effect", "port_overlap=0.001"], &flags[..]].concat());
    }
    run(&["train", &at("unit"), "--manual", "--rate-of-inputs", "hold", "--out", &at("model")]);
    Model::from_text(&std::fs::read_to_string(dir.path().join("model/model.residual")).unwrap()).unwrap()
}

/// The four processes of a month, the ports' overlap being `overlap_m` more than the sheet says.
fn month(number: u32, overlap_m: f64) -> Vec<Recording> {
    let mut unit = params::reference();
    unit.effects.push(EffectSetting { id: "port_overlap".into(), values: vec![overlap_m] });
    let seed = u64::from(number) + 100;
    let of = |process| {
        let (unit, rate_hz, duration_s) = (unit.clone(), 5.0, 120.0);
        generate::recording(&Scenario { unit, process, rate_hz, duration_s, rich: false, seed })
    };
    Process::ALL.map(of).to_vec()
}

/// Mean absolute error of the spool in each month, pu, and what the adaptation did.
fn follow(model: &Model, months: &[Vec<Recording>], adapts: bool) -> (Vec<f64>, Option<Adaptation>) {
    let mut corrector = Corrector::new(model).unwrap();
    if adapts {
        corrector = corrector.adapting(model).unwrap();
    }
    let mut twin = Twin::new(&params::reference());
    let mut errors = vec![];
    for recordings in months {
        let (mut sum, mut count) = (0.0, 0.0);
        for recording in recordings {
            twin.reset();
            corrector.reset();
            for frame in &recording.frames {
                let corrected = corrector.step(frame, &twin.step(frame)).corrected;
                let measured = frame.measured.spool_position_pu;
                if measured.is_finite() {
                    sum += (measured - corrected).abs();
                    count += 1.0;
                }
            }
        }
        errors.push(sum / count);
    }
    (errors, corrector.adaptation())
}

fn mean(errors: &[f64]) -> f64 {
    errors.iter().sum::<f64>() / errors.len() as f64
}

#[test]
fn leaves_are_retrained_on_a_unit_that_ages_and_left_alone_on_one_that_does_not() {
    let model = commissioned();
    let year = |growth_m: f64| -> Vec<Vec<Recording>> {
        (0..MONTHS).map(|number| month(number, 1e-3 + growth_m * f64::from(number) / f64::from(MONTHS - 1))).collect()
    };
    for growth_m in [0.0, 1e-3, 2e-3] {
        let months = year(growth_m);
        let ((plain, _), (adapted, adaptation)) = (follow(&model, &months, false), follow(&model, &months, true));
        let adaptation = adaptation.unwrap();
        println!("{growth_m}: {plain:.5?}\n{adapted:.5?}\n{}", adaptation.words());
        assert!(mean(&adapted) <= mean(&plain), "{growth_m}");
        if growth_m == 0.0 {
            // A month is never worse by more than its chance.
            assert!(plain.iter().zip(&adapted).all(|(plain, adapted)| *adapted <= 1.01 * plain));
        } else {
            // In the last four months; what is missed depends on where the spool stands and goes, which a bias and a gain cannot say.
            assert!(mean(&adapted[8..]) < 0.85 * mean(&plain[8..]), "{growth_m}");
            assert!(adaptation.by_leaves > 9 * (adaptation.adapted - adaptation.by_leaves));
        }
    }
}
