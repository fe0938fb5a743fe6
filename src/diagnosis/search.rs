//! Which: every effect of the catalogue tried in turn, nuisance parameters refitted with it.

use nalgebra::{DMatrix, DVector};

use crate::effects::{CATALOGUE, EffectSpec};
use crate::parameters::{EffectSetting, Unit};
use crate::tuning::fit::{Bench, Fit, Misses, fit, normal, square};
use crate::tuning::knob::{Knob, unit_at};
use crate::tuning::noise::Noise;
use crate::tuning::trial::Trial;

/// Sizes at which an effect is tried first, in units of its typical size.
const SIZES: [f64; 4] = [0.3, 1.0, 3.0, -1.0];

/// The nominal model refitted: the zero from which every effect is judged.
#[derive(Clone, Debug)]
pub struct Nominal {
    /// The unit as the sheet has it.
    pub base: Unit,
    /// The sheet's tolerances.
    pub knobs: Vec<Knob>,
    /// The refit.
    pub fit: Fit,
}

/// Refits the nominal model; the noise is laid out anew along the refitted trajectory.
#[must_use]
pub fn nominal(trials: Vec<Trial>, unit: &Unit, noise: &Noise) -> (Bench, Nominal) {
    let knobs = Knob::nuisances(unit);
    let first = Bench::new(trials, unit, noise);
    let rough = fit(&first, unit, &knobs, &vec![0.0; knobs.len()], 5, None);
    let bench = Bench::new(first.trials, &unit_at(unit, &knobs, &rough.positions), noise);
    let fine = fit(&bench, unit, &knobs, &rough.positions, 5, None);
    (bench, Nominal { base: unit.clone(), knobs, fit: fine })
}

/// One or more effects added to the nominal model, with all knobs fitted together.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The effects.
    pub effects: Vec<&'static EffectSpec>,
    /// The unit with the effects in it, neutral.
    pub base: Unit,
    /// The sheet's tolerances, then the effects' parameters.
    pub knobs: Vec<Knob>,
    /// The fit.
    pub fit: Fit,
    /// By how much the cost fell from the model without the last effect.
    pub gain: f64,
}

/// The least cost that refitting the leading knobs alone could reach from these misses, to first order.
fn projected(knobs: &[Knob], positions: &[f64], misses: &Misses, slopes: &[DMatrix<f64>]) -> f64 {
    let n = slopes.first().map_or(0, DMatrix::ncols);
    let (hessian, gradient) = normal(&knobs[..n], &positions[..n], misses, slopes);
    let total = square(misses) + positions[..n].iter().map(|p| p * p).sum::<f64>();
    match (hessian + DMatrix::identity(n, n) * 1e-9).cholesky() {
        Some(cholesky) => total - gradient.dot(&cholesky.solve(&gradient)),
        None => total,
    }
}

/// Adds each effect of the catalogue to a model in turn, screens sizes, refines the best start.
#[must_use]
pub fn extend(bench: &Bench, base: &Unit, knobs: &[Knob], from: &Fit, skip: &[&str], refine: usize) -> Vec<Candidate> {
    let cost = from.square + from.prior;
    let specs: Vec<&EffectSpec> = CATALOGUE.iter().filter(|spec| !skip.contains(&spec.id)).collect();
    let mut starts: Vec<(usize, Unit, Vec<Knob>, Vec<f64>)> = Vec::new();
    for (index, spec) in specs.iter().enumerate() {
        let mut unit = base.clone();
        let effect = unit.effects.len();
        unit.effects.push(EffectSetting {
            id: spec.id.to_owned(),
            values: spec.parameters.iter().map(|p| p.neutral).collect(),
        });
        let mut all = knobs.to_vec();
        for (parameter, spec) in spec.parameters.iter().enumerate() {
            all.push(Knob::Effect { effect, parameter, spec });
        }
        for size in SIZES {
            let mut positions = from.positions.clone();
            for (k, knob) in all[knobs.len()..].iter().enumerate() {
                let (low, high) = knob.range(&unit);
                let wanted = if k == 0 { size } else { 1.0 };
                positions.push(wanted.clamp(low, high));
            }
            if positions[knobs.len()] != 0.0 {
                starts.push((index, unit.clone(), all.clone(), positions));
            }
        }
    }
    let units: Vec<Unit> = starts.iter().map(|(_, unit, all, at)| unit_at(unit, all, at)).collect();
    let screened: Vec<f64> =
        bench.misses_of(&units).iter().map(|misses| projected(knobs, &from.positions, misses, &from.slopes)).collect();
    let mut best: Vec<Option<usize>> = vec![None; specs.len()];
    for (k, (index, ..)) in starts.iter().enumerate() {
        if best[*index].is_none_or(|b| screened[k] < screened[b]) {
            best[*index] = Some(k);
        }
    }
    let mut order: Vec<usize> = best.into_iter().flatten().collect();
    order.sort_by(|&a, &b| screened[a].total_cmp(&screened[b]));
    order
        .into_iter()
        .enumerate()
        .map(|(rank, k)| {
            let (index, unit, all, at) = &starts[k];
            let rounds = if rank < refine { 6 } else { 3 };
            let fit = fit(bench, unit, all, at, rounds, Some(&from.slopes));
            Candidate {
                effects: vec![specs[*index]],
                base: unit.clone(),
                knobs: all.clone(),
                gain: cost - fit.square - fit.prior,
                fit,
            }
        })
        .collect()
}

/// Standard deviations of the knobs about a fit.
#[must_use]
pub fn deviations(knobs: &[Knob], fit: &Fit) -> DVector<f64> {
    let (hessian, _) = normal(knobs, &fit.positions, &fit.misses, &fit.slopes);
    let n = knobs.len();
    match (hessian + DMatrix::identity(n, n) * 1e-9).try_inverse() {
        Some(inverse) => inverse.diagonal().map(|v| v.max(0.0).sqrt()),
        None => DVector::from_element(n, f64::INFINITY),
    }
}
