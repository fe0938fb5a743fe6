//! A residual inside the loop, on a generated unit whose pilot valve has a shifted null: what it learned helps in free run, where nothing measured enters.
#![cfg(all(feature = "lab", feature = "residual"))]

use govtwin_correction::booster::{Hyperparameters, grow};
use govtwin_correction::forest::Forest;
use govtwin_correction::guard::Guard;
use govtwin_diagnosis::generate::{self, Scenario};
use govtwin_lab::comparison::closed::{pull, twin};
use govtwin_lab::comparison::inloop::FEATURES;
use govtwin_model::parameters::{EffectSetting, Unit};
use govtwin_model::params;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::replay::{Scores, simulate};
use govtwin_model::signal::Signal;
use govtwin_model::twin::Twin;

fn recordings(real: &Unit, seed: u64) -> Vec<Recording> {
    let of = |process| Scenario { unit: real.clone(), process, rate_hz: 100.0, duration_s: 60.0, rich: false, seed };
    Process::ALL.map(|process| generate::recording(&of(process))).to_vec()
}

/// Mean absolute error of the spool.
fn mae(twin: &Twin, judges: &[Recording]) -> f64 {
    let mut scores = Scores::default();
    for recording in judges {
        scores.merge(&Scores::of(recording, &simulate(&mut twin.clone(), recording)));
    }
    scores.figures(Signal::SpoolPosition).mae
}

#[test]
fn what_was_learned_inside_the_loop_helps_in_free_run() {
    let unit = params::reference();
    let mut real = unit.clone();
    real.effects.push(EffectSetting { id: "pv_null_shift".into(), values: vec![0.05] });
    let (mut values, mut targets) = (vec![], vec![]);
    for recording in [1, 2].iter().flat_map(|seed| recordings(&real, *seed)) {
        let pulled = pull(&unit, &recording);
        values.extend(pulled.values);
        targets.extend(pulled.targets);
    }
    let grown = grow(&values, FEATURES, &targets, &Hyperparameters::MANUAL, 1).unwrap();
    let forest = Forest::new(&grown.trees, FEATURES).unwrap();
    let inside = twin(&unit, forest, Guard::of(&values, FEATURES, &targets));
    let judges = recordings(&real, 9);
    let [delivered, inside, truth] = [&Twin::new(&unit), &inside, &Twin::new(&real)].map(|one| mae(one, &judges));
    println!("MBM {delivered:.5}, inside {inside:.5}, the effect itself {truth:.5}");
    assert!(inside < 0.93 * delivered && truth < inside, "{delivered}, {inside}, {truth}");
}
