//! Misses of many units at once: those of each by itself, whoever else is asked for.

use govtwin::parameters::Unit;
use govtwin::params;
use govtwin::recording::Process;
use govtwin::signal::Signal;
use govtwin::tuning::bench::{Bench, twin_of};
use govtwin::tuning::noise;
use govtwin::tuning::trial::Trial;
use govtwin::twin::Twin;

use super::{trial, units};

fn bench() -> Bench {
    let mut trials: Vec<Trial> = [Process::Startup, Process::Shutdown].into_iter().map(trial).collect();
    let mut stage = trials[0].clone();
    stage.cut = govtwin::twin::Cut::Spool;
    for signal in Signal::ALL {
        stage.has[signal as usize] = signal == Signal::ServomotorPosition;
    }
    trials.push(stage);
    let unit = params::reference();
    Bench::new(trials, &unit, &noise::expected(&unit.sensors))
}

#[test]
fn misses_do_not_depend_on_who_else_is_simulated() {
    let bench = bench();
    let units: Vec<Unit> = units().into_iter().step_by(4).collect();
    let before = bench.simulations();
    let all = bench.misses_of(&units);
    assert_eq!(bench.simulations() - before, units.len() * bench.trials.len());
    for (unit, misses) in units.iter().zip(&all) {
        assert_eq!(misses.len(), bench.trials.len());
        assert_eq!(bench.misses_of(std::slice::from_ref(unit))[0], *misses);
        for (trial, misses) in misses.iter().enumerate() {
            assert_eq!(bench.misses(unit, trial), *misses);
        }
    }
    let twins: Vec<Twin> = units.iter().rev().map(twin_of).collect();
    let mut reversed = bench.misses_of_twins(&twins);
    reversed.reverse();
    assert_eq!(reversed, all);
    assert!(bench.misses_of(&[]).is_empty());
}

#[test]
fn a_lane_without_numbers_spoils_no_other() {
    let bench = bench();
    let unit = params::reference();
    let mut broken = unit.clone();
    broken.parameters.servomotor.load_closed_n = f64::NAN;
    let alone = [&unit, &broken].map(|unit| bench.misses_of(std::slice::from_ref(unit)).remove(0));
    assert!(alone[1][0].norm() > 1e3 * alone[0][0].norm() && alone[1][0].iter().all(|miss| miss.is_finite()));
    for count in [2, 3, 6, 12] {
        let mut units = vec![unit.clone(); count];
        units[1] = broken.clone();
        for (k, misses) in bench.misses_of(&units).iter().enumerate() {
            assert_eq!(*misses, alone[usize::from(k == 1)], "unit {k} of {count}");
        }
    }
}
