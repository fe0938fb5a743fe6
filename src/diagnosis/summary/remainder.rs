//! What the nearest causes leave: how much, at which stage, and where it is largest.

use crate::evidence::law_error::NO_LAW_ERROR;
use crate::evidence::{ExtendedEquations, KAPPAS};
use crate::hypotheses::Explored;
use crate::hypotheses::explorer::is_stage_alone;
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use crate::result::{Interval, LargestError, Remainder};
use govtwin_model::effects::Stage;
use govtwin_model::frame::Estimate;
use govtwin_model::signal::Signal;

/// Length of the stretch in which an error is largest, s.
const STRETCH_S: f64 = 2.0;

/// Nats by which something at a stage must explain more than errors of equations everywhere.
const LEAST_GAIN: f64 = 5.0;

/// What a model leaves that explains such a share, with the probability of something else; `estimates` are its own, by recording.
pub fn remainder(
    problem: &Problem,
    explored: &Explored,
    (model, estimates): (&FittedModel, &[Vec<Estimate>]),
    (explained, something_else): (Interval, f64),
) -> Remainder {
    let residuals = model.fit.cost() - model.fit.prior;
    let has_slopes = !model.fit.slopes.is_empty() && !is_stage_alone(problem);
    Remainder {
        beside: model.ids().into_iter().map(str::to_owned).collect(),
        explained,
        share: (1.0 - explained.value).clamp(0.0, 1.0),
        something_else,
        chi_square: residuals / problem.independent_samples().max(1.0),
        stage: has_slopes.then(|| explored.shared(problem).extended(model)).as_ref().and_then(stage),
        largest: largest(problem, estimates),
    }
}

/// The stage at which something else explains most of what is left.
fn stage(equations: &ExtendedEquations) -> Option<Stage> {
    let everywhere =
        KAPPAS[1..].iter().map(|&kappa| equations.at(kappa, NO_LAW_ERROR)).fold(f64::NEG_INFINITY, f64::max);
    let all = Stage::ALL.into_iter().map(|stage| (stage, equations.unknown_at(stage) - everywhere));
    all.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, gained)| *gained > LEAST_GAIN).map(|(stage, _)| stage)
}

/// Squares of the error of every signal beyond noise, in squares of the noise, by sample of one recording.
fn excess(problem: &Problem, recording: usize, estimates: &[Estimate]) -> Vec<(Signal, Vec<f64>)> {
    let of = |signal: Signal| {
        let floor = problem.floor_square(recording, signal);
        let squares = problem.squares(recording, signal, estimates).filter(|_| floor > 0.0)?;
        let beyond = |square: f64| if square.is_finite() { square / floor - 1.0 } else { 0.0 };
        Some((signal, squares.into_iter().map(beyond).collect()))
    };
    Signal::ALL.into_iter().filter_map(of).collect()
}

/// The stretch of all recordings with most of the error beyond noise; none where nothing is left.
fn largest(problem: &Problem, estimates: &[Vec<Estimate>]) -> Option<LargestError> {
    let all: Vec<Vec<(Signal, Vec<f64>)>> =
        estimates.iter().enumerate().map(|(recording, estimates)| excess(problem, recording, estimates)).collect();
    let total: f64 = all.iter().flatten().flat_map(|(_, excess)| excess).sum();
    let stretches = all.iter().enumerate().filter_map(|(recording, signals)| {
        let samples = problem.recordings[recording].samples.len();
        let length = problem.recordings[recording].samples_in(STRETCH_S).clamp(1, samples.max(1));
        let together: Vec<f64> = (0..samples).map(|k| signals.iter().map(|(_, excess)| excess[k]).sum()).collect();
        let (start, sum) = fullest(&together, length)?;
        Some((recording, start..(start + length).min(samples), sum))
    });
    let (recording, rows, sum) = stretches.max_by(|a, b| a.2.total_cmp(&b.2)).filter(|(.., sum)| *sum > 0.0)?;
    let inside = |(_, excess): &&(Signal, Vec<f64>)| excess[rows.clone()].iter().sum::<f64>();
    let (signal, excess) = all[recording].iter().max_by(|a, b| inside(a).total_cmp(&inside(b)))?;
    let mean = excess[rows.clone()].iter().sum::<f64>() / rows.len() as f64 + 1.0;
    let data = &problem.recordings[recording];
    Some(LargestError {
        recording: data.name.clone(),
        signal: *signal,
        from_s: data.time_s(rows.start),
        to_s: data.time_s(rows.end - 1),
        rms: (mean.max(0.0) * problem.floor_square(recording, *signal)).sqrt(),
        share: if total > 0.0 { (sum / total).min(1.0) } else { f64::NAN },
    })
}

/// Where so many neighbours sum up to most, and to how much; none of nothing.
fn fullest(values: &[f64], length: usize) -> Option<(usize, f64)> {
    let mut sum: f64 = values.get(..length)?.iter().sum();
    let mut best = (0, sum);
    for start in 1..=values.len() - length {
        sum += values[start + length - 1] - values[start - 1];
        if sum > best.1 {
            best = (start, sum);
        }
    }
    Some(best)
}

#[cfg(test)]
mod tests {
    use super::fullest;

    #[test]
    fn the_fullest_stretch_is_found() {
        assert_eq!(fullest(&[0.0, 1.0, 5.0, 2.0, 0.0, 6.0], 2), Some((2, 7.0)));
        assert_eq!(fullest(&[3.0], 1), Some((0, 3.0)));
        assert_eq!(fullest(&[], 1), None);
    }
}
