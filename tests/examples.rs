//! The examples do what they say; that of a diagnosis takes too long here and is compiled only.

#[path = "../examples/own_effect.rs"]
mod own_effect;
#[path = "../examples/replay_bag.rs"]
mod replay_bag;
#[path = "../examples/step_in_loop.rs"]
mod step_in_loop;

use std::path::Path;

use govtwin::{Signal, reference_unit};

#[test]
fn a_shipped_bag_is_replayed() {
    let bag = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/reference/load_increase_01.mcap");
    let replayed = replay_bag::replay_bag(&bag, &reference_unit()).unwrap();
    let servomotor = replayed.scores.figures(Signal::ServomotorPosition);
    assert!(servomotor.count > 100 && servomotor.mae < 2e-3, "{servomotor:?}");
    let error = replay_bag::replay_bag(Path::new("no/such.mcap"), &reference_unit()).unwrap_err().to_string();
    assert!(error.contains("no/such.mcap"), "{error}");
}

#[test]
fn the_governor_brings_the_speed_back() {
    let course = step_in_loop::load_step(90.0);
    let before = course.iter().filter(|row| row.time_s < 5.0);
    assert!(before.clone().count() == 500 && before.into_iter().all(|row| (row.speed_pu - 1.0).abs() < 2e-3));
    let lowest = course.iter().map(|row| row.speed_pu).fold(f64::INFINITY, f64::min);
    assert!((0.90..0.998).contains(&lowest), "{lowest}");
    let last = course.last().unwrap();
    assert!((last.speed_pu - 1.0).abs() < 5e-3 && (last.opening_pu - 0.55).abs() < 0.01, "{last:?}");
}

#[test]
fn an_effect_of_ones_own_is_one_more_switch() {
    own_effect::main().unwrap();
    let nominal = reference_unit();
    let sticky = nominal.clone().with_own_effect(own_effect::stiction()).unwrap();
    let at = |height_n: f64| {
        let unit = sticky.clone().with_effect("dry_bushings", &[("height_n", height_n)]).unwrap();
        own_effect::farthest_pu(&unit, &nominal)
    };
    assert_eq!(at(0.0), 0.0);
    assert!(at(3.0e4) > at(1.0e4) && at(1.0e4) > 1e-6, "{} {}", at(1.0e4), at(3.0e4));
}
