//! Where: each stage driven by the recorded signals at its input, judged by its own output.

use crate::diagnosis::outcome::StageTest;
use crate::parameters::Unit;
use crate::signal::Signal;
use crate::tuning::fit::Bench;
use crate::twin::{Cut, Twin};

/// A test: what is driven, where the chain is cut, what it is judged by.
const TESTS: [(&str, Cut, Signal); 4] = [
    ("the whole chain, closed loop", Cut::None, Signal::ServomotorPosition),
    ("the whole chain, closed loop", Cut::None, Signal::SpoolPosition),
    ("regulator, pilot valve and spool, fed the measured servomotor", Cut::Servomotor, Signal::SpoolPosition),
    ("main ports and servomotor, fed the measured spool", Cut::Spool, Signal::ServomotorPosition),
];

/// The tests on the refitted unit; recordings without the signal that a cut needs take no part.
#[must_use]
pub fn tests(bench: &Bench, refitted: &Unit) -> Vec<StageTest> {
    TESTS
        .into_iter()
        .filter_map(|(stage, cut, signal)| {
            let (mut square, mut floor, mut count) = (0.0, 0.0, 0_usize);
            for (index, trial) in bench.trials.iter().enumerate() {
                if trial.cut != Cut::None && trial.cut != cut {
                    continue;
                }
                let fed = crate::replay::stands_in(cut);
                if !trial.has[signal as usize] || fed.is_some_and(|fed| trial.cut != cut && !trial.has[fed as usize]) {
                    continue;
                }
                let mut twin = Twin::new(refitted).with_dither(bench.dither_pu()).with_cut(cut);
                let estimates = trial.run(&mut twin);
                for (&row, estimate) in trial.samples.iter().zip(&estimates) {
                    let miss = signal.of(&trial.frames[row].measured) - signal.of(&estimate.signals);
                    if miss.is_finite() {
                        square += miss * miss;
                        count += 1;
                    }
                }
                floor += bench.floor_square(index, signal) * trial.samples.len() as f64;
            }
            (count > 0).then(|| StageTest {
                stage,
                signal,
                rmse: (square / count as f64).sqrt(),
                excess: if floor > 0.0 { square / floor } else { f64::NAN },
            })
        })
        .collect()
}
