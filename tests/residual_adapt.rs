//! Adaptation: clean recordings are left as they are, a unit that ages is followed, and the node adapts as a replay does.

#[path = "support/residual.rs"]
mod residual;

use govtwin_correction::adapt::Adaptation;
use govtwin_correction::band::Band;
use govtwin_correction::corrector::{Corrector, motion};
use govtwin_correction::model::Model;
use govtwin_diagnosis::generate::{self, Scenario};
use govtwin_model::effects;
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::params;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::twin::Twin;

/// A residual that says nothing, with the band that clean recordings of other seeds ask for, and bounds of ±0.15 pu.
fn silent(unit: &Unit) -> Model {
    let mut model = residual::model(unit);
    model.trees[0].leaf = vec![0.0, 0.0];
    model.guard.range = [-0.15, 0.15];
    let mut twin = Twin::new(unit);
    let mut residuals = vec![];
    for (visit, process) in (100..).zip(Process::ALL) {
        twin.reset();
        let mut said = vec![];
        for frame in &recording(unit, process, visit, "lvdt_bias", 0.0).frames {
            said.push(twin.step(frame).signals.spool_position_pu);
            let residual_pu = frame.measured.spool_position_pu - said[said.len() - 1];
            if residual_pu.is_finite() {
                residuals.push((motion(said.iter().rev().take(5).copied()), residual_pu));
            }
        }
    }
    model.band = Band::of(&residuals, 0.9);
    model
}

/// The unit in its `visit`-th recording, with one effect's first parameter at `value`.
fn recording(unit: &Unit, process: Process, visit: u32, effect: &str, value: f64) -> Recording {
    let mut aged = unit.clone();
    let spec = effects::find(effect).unwrap();
    let mut values: Vec<f64> = spec.parameters.iter().map(|parameter| parameter.neutral).collect();
    values[0] = value;
    aged.effects.push(EffectSetting { id: effect.into(), values });
    let (rate_hz, duration_s, seed) = (5.0, 120.0, u64::from(visit) + 1);
    generate::recording(&Scenario { unit: aged, process, rate_hz, duration_s, rich: false, seed })
}

/// Mean absolute error of the spool in each recording, and what the adaptation did.
fn follow(recordings: &[Recording], adapts: bool) -> (Vec<f64>, Option<Adaptation>) {
    let unit = params::reference();
    let model = silent(&unit);
    let mut corrector = Corrector::new(&model).unwrap();
    if adapts {
        corrector = corrector.adapting(&model).unwrap();
    }
    let mut twin = Twin::new(&unit);
    let of = |recording: &Recording| {
        twin.reset();
        corrector.reset();
        let (mut sum, mut count) = (0.0, 0.0);
        for frame in &recording.frames {
            let corrected = corrector.step(frame, &twin.step(frame)).corrected;
            let measured = frame.measured.spool_position_pu;
            if measured.is_finite() {
                sum += (measured - corrected).abs();
                count += 1.0;
            }
        }
        sum / count
    };
    let errors = recordings.iter().map(of).collect();
    (errors, corrector.adaptation())
}

/// Twelve visits to a unit, three of each process; from the fourth on the effect grows away from its neutral value.
fn ageing(effect: &str, neutral: f64, grown: f64) -> Vec<Recording> {
    let unit = params::reference();
    let at = |visit: u32| {
        let process = Process::ALL[visit as usize % 4];
        let age_share = (f64::from(visit) - 3.0).max(0.0) / 8.0;
        recording(&unit, process, visit, effect, neutral + age_share * (grown - neutral))
    };
    (0..12).map(at).collect()
}

fn mean(errors: &[f64]) -> f64 {
    errors.iter().sum::<f64>() / errors.len() as f64
}

#[test]
fn clean_recordings_are_left_as_they_are_to_the_bit() {
    let clean = ageing("lvdt_bias", 0.0, 0.0);
    let ((plain, _), (adapted, adaptation)) = (follow(&clean, false), follow(&clean, true));
    let adaptation = adaptation.unwrap();
    assert!(adaptation.samples > 6000);
    assert_eq!((adaptation.alarms, adaptation.adapted), (0, 0));
    assert!(plain.iter().zip(&adapted).all(|(plain, adapted)| plain.to_bits() == adapted.to_bits()));
}

#[test]
fn a_unit_that_ages_is_followed_and_never_made_worse() {
    // What a bias or a gain can follow is halved or nearly so in the last four visits; a wider dead band is neither, and is left alone.
    for (effect, neutral, grown, least_share) in
        [("lvdt_bias", 0.0, 0.03, 0.75), ("lvdt_gain", 1.0, 1.08, 0.85), ("port_overlap", 0.0, 1.5e-3, 1.001)]
    {
        let recordings = ageing(effect, neutral, grown);
        let ((plain, _), (adapted, adaptation)) = (follow(&recordings, false), follow(&recordings, true));
        let adaptation = adaptation.unwrap();
        println!("{effect}: {plain:.4?}\n{adapted:.4?}\n{}", adaptation.words());
        assert!(adaptation.alarms > 0, "{effect}");
        assert!(adaptation.bias.abs() <= 0.15 && adaptation.gain_ratio.abs() <= 0.1);
        // The unit is sound in the first four visits.
        assert_eq!(plain[..4], adapted[..4], "{effect}");
        assert!(mean(&adapted[8..]) <= least_share * mean(&plain[8..]), "{effect}");
        assert!(mean(&adapted) <= 1.001 * mean(&plain), "{effect}");
    }
}
