//! Where: each stage driven by the recorded signals at its input, judged by its own output.

use crate::likelihood::prepared::PreparedRecording;
use crate::likelihood::problem::{Problem, twin_of};
use crate::result::StageTest;
use govtwin_model::parameters::Unit;
use govtwin_model::signal::Signal;
use govtwin_model::twin::Cut;

/// A test: what is driven, where the chain is cut, what it is judged by.
const TESTS: [(&str, Cut, Signal); 4] = [
    ("the whole chain, closed loop", Cut::None, Signal::ServomotorPosition),
    ("the whole chain, closed loop", Cut::None, Signal::SpoolPosition),
    (
        "regulator, pilot valve and spool, driven by the measured servomotor position",
        Cut::Servomotor,
        Signal::SpoolPosition,
    ),
    ("main ports and servomotor, driven by the measured spool position", Cut::Spool, Signal::ServomotorPosition),
];

/// Change of the fed spool for a slope, pu.
const NUDGE_PU: f64 = 1e-4;

/// Steps towards the zero error of the fed spool.
const ROUNDS: usize = 3;

/// The tests on the refitted unit; recordings without the signal that a cut needs take no part.
///
/// A servomotor integrates whatever zero error the fed spool has, a thousandth of its travel over a recording to some hundredths of
/// stroke, which says nothing of the ports: one zero error for all recordings is taken off first.
pub fn tests(problem: &Problem, refitted: &Unit) -> Vec<StageTest> {
    TESTS
        .into_iter()
        .filter_map(|(stage, cut, signal)| {
            let fed = govtwin_model::replay::stands_in(cut);
            let fit = |recording: &PreparedRecording| {
                let fed = recording.cut == cut || fed.is_none_or(|fed| recording.has[fed as usize]);
                (recording.cut == Cut::None || recording.cut == cut) && recording.has[signal as usize] && fed
            };
            let recordings: Vec<usize> =
                (0..problem.recordings.len()).filter(|&index| fit(&problem.recordings[index])).collect();
            let residuals = |zero_pu: f64| -> Vec<Vec<f64>> {
                recordings.iter().map(|&index| residual(problem, refitted, index, (cut, signal), zero_pu)).collect()
            };
            let zero_error_pu =
                if cut == Cut::Spool { zero_error_pu(|zero_pu| residuals(zero_pu).concat()) } else { 0.0 };
            let residuals = residuals(zero_error_pu);
            let count: usize = residuals.iter().map(Vec::len).sum();
            let square: f64 = residuals.iter().flatten().map(|residual| residual * residual).sum();
            let floors = recordings
                .iter()
                .zip(&residuals)
                .map(|(&k, residuals)| problem.floor_square(k, signal) * residuals.len() as f64);
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

/// Residuals of a signal at a cut, the fed spool less a zero error.
fn residual(problem: &Problem, unit: &Unit, index: usize, (cut, signal): (Cut, Signal), zero_pu: f64) -> Vec<f64> {
    let mut recording = problem.recordings[index].clone();
    if zero_pu != 0.0 {
        recording.frames.iter_mut().for_each(|frame| frame.measured.spool_position_pu -= zero_pu);
    }
    let estimates = recording.run(&mut twin_of(unit).with_dither(problem.dither_pu(index)).with_cut(cut));
    let pairs = recording.samples.iter().zip(&estimates);
    pairs
        .map(|(&row, estimate)| signal.of(&recording.frames[row].measured) - signal.of(&estimate.signals))
        .filter(|residual| residual.is_finite())
        .collect()
}

/// The zero error that leaves the least, by Gauss-Newton.
fn zero_error_pu(residuals: impl Fn(f64) -> Vec<f64>) -> f64 {
    let square = |residuals: &[f64]| residuals.iter().map(|residual| residual * residual).sum::<f64>();
    let mut zero_pu = 0.0;
    let mut here = residuals(zero_pu);
    for _ in 0..ROUNDS {
        let nudged = residuals(zero_pu + NUDGE_PU);
        let slopes: Vec<f64> = nudged.iter().zip(&here).map(|(a, b)| (a - b) / NUDGE_PU).collect();
        let along: f64 = slopes.iter().zip(&here).map(|(slope, residual)| slope * residual).sum();
        let next_pu = zero_pu - along / square(&slopes).max(f64::MIN_POSITIVE);
        let there = residuals(next_pu);
        if square(&there) >= square(&here) {
            break;
        }
        (zero_pu, here) = (next_pu, there);
    }
    zero_pu
}
