//! Where: each stage driven by the recorded signals at its input, judged by its own output.

use crate::diagnosis::outcome::StageTest;
use crate::parameters::Unit;
use crate::signal::Signal;
use crate::tuning::bench::{Bench, twin_of};
use crate::tuning::trial::Trial;
use crate::twin::Cut;

/// A test: what is driven, where the chain is cut, what it is judged by.
const TESTS: [(&str, Cut, Signal); 4] = [
    ("the whole chain, closed loop", Cut::None, Signal::ServomotorPosition),
    ("the whole chain, closed loop", Cut::None, Signal::SpoolPosition),
    ("regulator, pilot valve and spool, fed the measured servomotor", Cut::Servomotor, Signal::SpoolPosition),
    ("main ports and servomotor, fed the measured spool", Cut::Spool, Signal::ServomotorPosition),
];

/// Change of the fed spool for a slope, pu.
const NUDGE_PU: f64 = 1e-4;

/// Steps towards the zero error of the fed spool.
const ROUNDS: usize = 3;

/// The tests on the refitted unit; recordings without the signal that a cut needs take no part.
///
/// A servomotor integrates whatever zero error the fed spool has, a thousandth of its travel over a recording to some hundredths of
/// stroke, which says nothing of the ports: one zero error for all recordings is taken off first.
#[must_use]
pub fn tests(bench: &Bench, refitted: &Unit) -> Vec<StageTest> {
    TESTS
        .into_iter()
        .filter_map(|(stage, cut, signal)| {
            let fed = crate::replay::stands_in(cut);
            let fit = |trial: &Trial| {
                let fed = trial.cut == cut || fed.is_none_or(|fed| trial.has[fed as usize]);
                (trial.cut == Cut::None || trial.cut == cut) && trial.has[signal as usize] && fed
            };
            let trials: Vec<usize> = (0..bench.trials.len()).filter(|&index| fit(&bench.trials[index])).collect();
            let misses = |zero_pu: f64| -> Vec<Vec<f64>> {
                trials.iter().map(|&index| miss(bench, refitted, index, (cut, signal), zero_pu)).collect()
            };
            let zero_error_pu = if cut == Cut::Spool { zero_error_pu(|zero_pu| misses(zero_pu).concat()) } else { 0.0 };
            let misses = misses(zero_error_pu);
            let count: usize = misses.iter().map(Vec::len).sum();
            let square: f64 = misses.iter().flatten().map(|miss| miss * miss).sum();
            let floors =
                trials.iter().zip(&misses).map(|(&k, misses)| bench.floor_square(k, signal) * misses.len() as f64);
            let floor: f64 = floors.sum();
            (count > 0).then(|| StageTest {
                stage,
                signal,
                zero_error_pu,
                rmse: (square / count as f64).sqrt(),
                excess: if floor > 0.0 { square / floor } else { f64::NAN },
            })
        })
        .collect()
}

/// What the unit misses of a signal at a cut, the fed spool less a zero error.
fn miss(bench: &Bench, unit: &Unit, index: usize, (cut, signal): (Cut, Signal), zero_pu: f64) -> Vec<f64> {
    let mut trial = bench.trials[index].clone();
    if zero_pu != 0.0 {
        trial.frames.iter_mut().for_each(|frame| frame.measured.spool_position_pu -= zero_pu);
    }
    let estimates = trial.run(&mut twin_of(unit).with_dither(bench.dither_pu(index)).with_cut(cut));
    let pairs = trial.samples.iter().zip(&estimates);
    pairs
        .map(|(&row, estimate)| signal.of(&trial.frames[row].measured) - signal.of(&estimate.signals))
        .filter(|miss| miss.is_finite())
        .collect()
}

/// The zero error that leaves the least, by Gauss-Newton.
fn zero_error_pu(misses: impl Fn(f64) -> Vec<f64>) -> f64 {
    let square = |misses: &[f64]| misses.iter().map(|miss| miss * miss).sum::<f64>();
    let mut zero_pu = 0.0;
    let mut here = misses(zero_pu);
    for _ in 0..ROUNDS {
        let nudged = misses(zero_pu + NUDGE_PU);
        let slopes: Vec<f64> = nudged.iter().zip(&here).map(|(a, b)| (a - b) / NUDGE_PU).collect();
        let along: f64 = slopes.iter().zip(&here).map(|(slope, miss)| slope * miss).sum();
        let next_pu = zero_pu - along / square(&slopes).max(f64::MIN_POSITIVE);
        let there = misses(next_pu);
        if square(&there) >= square(&here) {
            break;
        }
        (zero_pu, here) = (next_pu, there);
    }
    zero_pu
}
