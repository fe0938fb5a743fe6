//! Which hypotheses are left of a posterior, each as a twin that can be put through a test that nobody has run yet.

use nalgebra::{DMatrix, SymmetricEigen};

use crate::decision::Decision;
use crate::decision::posterior::Posterior;
use crate::evidence::UNKNOWN_SIZES;
use crate::hypotheses::Explored;
use crate::hypotheses::explorer::{Hypothesis, KAPPA};
use crate::hypotheses::table::EvidenceTable;
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::problem::{Problem, twin_of};
use crate::model::FittedModel;
use crate::model::discrepancy;
use crate::model::support::SIZE_PRIOR;
use govtwin_model::effects::Stage;
use govtwin_model::twin::Twin;

/// Probability that the survivors hold together, of all.
const HELD: f64 = 0.99;

/// Survivors at most.
const MOST: usize = 8;

/// A hypothesis that is left.
#[derive(Debug)]
pub struct Survivor<'a> {
    /// Ids of its effects joined by `+`, `none` for the sheet alone, `unknown:STAGE` for something unknown there.
    pub name: String,
    /// Probability, all of them together 1.
    pub probability: f64,
    /// The fitted model; of something unknown the refitted sheet, on which it stands.
    pub model: &'a FittedModel,
    /// The twin with its parameters as fitted, and of something unknown with its most probable term.
    pub twin: Twin,
    /// Whether it is something unknown.
    pub unknown: bool,
}

/// The likeliest hypotheses that hold 99 % of the probability, at most eight; what the verdict forced upon the posterior holds here too.
///
/// Something unknown at a stage is the refitted sheet with a discrepancy term at the place of that stage that explains most of the recordings, in
/// its most probable shape.
pub fn survivors<'a>(
    problem: &Problem,
    found: &'a Explored,
    table: &EvidenceTable,
    posterior: &Posterior,
    decision: &Decision,
) -> Vec<Survivor<'a>> {
    let (known, none) = (1.0 - posterior.unknown() - posterior.nothing(table), posterior.nothing(table));
    let forced = |before: f64, now: f64| if before > 1e-12 { now / before } else { 0.0 };
    let of_effects = forced(known, (1.0 - decision.unknown - decision.none).max(0.0));
    let of_nothing = forced(none, decision.none);
    let sets = posterior.sets.iter().filter_map(|&(row, probability)| {
        // By its effects: what a verdict claims was fitted again since the table was made, and stands at another place.
        let effects = &table.rows.get(row)?.effects;
        let is_it =
            |one: &&Hypothesis| one.effects.len() == effects.len() && effects.iter().all(|id| one.model.has(id));
        let hypothesis = found.hypotheses.iter().find(is_it)?;
        let empty = hypothesis.effects.is_empty();
        let name = if empty { "none".to_owned() } else { hypothesis.model.ids().join("+") };
        Some((name, probability * if empty { of_nothing } else { of_effects }, Ok(&hypothesis.model)))
    });
    let unknown = decision.unknown_at.iter().map(|&(stage, p)| (format!("unknown:{}", stage.id()), p, Err(stage)));
    let mut all: Vec<(String, f64, Result<&FittedModel, Stage>)> =
        sets.chain(unknown).filter(|(_, probability, _)| *probability > 0.0).collect();
    all.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut held = 0.0;
    let kept = all.into_iter().take(MOST).take_while(|(_, probability, _)| {
        let wanted = held < HELD;
        held += probability;
        wanted
    });
    let mut left: Vec<Survivor<'a>> = kept
        .filter_map(|(name, probability, of)| {
            let unknown = of.is_err();
            let (model, twin) = match of {
                Ok(model) => (model, twin_of(&model.unit())),
                Err(stage) => (found.refitted(), with_unknown(problem, found, stage)?),
            };
            Some(Survivor { name, probability, model, twin, unknown })
        })
        .collect();
    let total: f64 = left.iter().map(|one| one.probability).sum();
    for one in &mut left {
        one.probability /= total.max(1e-12);
    }
    left
}

/// The refitted sheet with something unknown at a stage.
fn with_unknown(problem: &Problem, found: &Explored, stage: Stage) -> Option<Twin> {
    let equations = found.extended(problem);
    let at = |(_, place): &(usize, &discrepancy::DiscrepancyPoint)| place.stage == stage;
    let terms = |(index, place)| {
        let (gain, sizes) = equations.terms(index, (UNKNOWN_SIZES[1], KAPPA), None);
        (place, gain, sizes)
    };
    let all = discrepancy::PLACES.iter().enumerate().filter(at).map(terms);
    let (place, _, sizes) = all.max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(discrepancy::twin_with(&found.refitted().unit(), place, &sizes))
}

/// A root of the covariance of a model's free parameters, sizes of effects with their prior: one deviation a column.
pub fn deviations(model: &FittedModel) -> DMatrix<f64> {
    let n = model.free_parameters.len();
    let mut covariance = model.spread.clone();
    if covariance.iter().any(|value| !value.is_finite()) {
        covariance = DMatrix::identity(n, n);
    }
    for (k, free_parameter) in model.free_parameters.iter().enumerate() {
        if matches!(free_parameter, FreeParameter::Effect { parameter: 0, .. }) {
            // One more observation of the size, whose variance is that of the prior.
            let variance = (SIZE_PRIOR.1 * model.fit.positions[k].abs().max(1e-3)).powi(2);
            let column = covariance.column(k).into_owned();
            covariance -= &column * column.transpose() / (column[k] + variance);
        }
    }
    let mut eigen = SymmetricEigen::new(covariance);
    for (k, value) in eigen.eigenvalues.iter().enumerate() {
        eigen.eigenvectors.column_mut(k).scale_mut(value.max(0.0).sqrt());
    }
    eigen.eigenvectors
}
