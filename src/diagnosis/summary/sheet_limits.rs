//! How much the sheet's tolerances limit a verdict, and which value to look up next.
//!
//! Fault sets want different values of the sheet's parameters. A set h of probability `p_h` holds a parameter to be N(m_h, s_h²), so that its true
//! value tells `I = Σ p_h ∫ N(x; m_h, s_h²) log₂ (N(x; m_h, s_h²) / Σ p_k N(x; m_k, s_k²)) dx` bits of which set it is (mutual information; Cover &
//! Thomas 2006, section 2.4): the same bits in which tests are weighed. What the recordings say of a parameter is divided by what nats are divided
//! by in the posterior. Which effects a tolerance hides is read off the linear picture at the refitted sheet.

use crate::decision::posterior::{CountedNats, Posterior};
use crate::detectability::STANDS_OUT;
use crate::experiment::LEAST_BITS;
use crate::hypotheses::Explored;
use crate::hypotheses::table::EvidenceTable;
use crate::identification::free_parameter::FreeParameter;
use crate::model::FittedModel;
use crate::result::{HiddenEffect, SheetLimits, SheetValue};
use govtwin_model::effects::EffectSpec;

/// Points of the integral over one set's density, and how far they reach in its deviations.
const POINTS: u32 = 33;
const REACH: f64 = 4.0;
/// Least deviation that a set leaves to a parameter, in tolerances: no sheet is that exact.
const LEAST_DEVIATION: f64 = 1e-4;
/// Effects that are named for each value.
const NAMED: usize = 3;

/// A set's probability, and mean and deviation of a parameter under it.
type MeanUnderSet = (f64, f64, f64);

/// How much the sheet limits the verdict.
pub fn sheet_limits(
    explored: &Explored,
    (table, posterior): (&EvidenceTable, &Posterior),
    counted: CountedNats,
    catalogue: &[&'static EffectSpec],
) -> SheetLimits {
    let known: f64 = posterior.sets.iter().map(|(_, probability)| probability).sum();
    let sets: Vec<(f64, &FittedModel)> = posterior
        .sets
        .iter()
        .filter_map(|(row, probability)| Some((probability / known, model(explored, &table.rows.get(*row)?.effects)?)))
        .filter(|(probability, _)| *probability > 0.0)
        .collect();
    let refitted = explored.refitted();
    let value = |(k, free_parameter): (usize, &FreeParameter)| {
        let held: Vec<MeanUnderSet> =
            sets.iter().map(|(probability, model)| held(model, k, *probability, counted)).collect();
        let (key, unit) = free_parameter.key(&refitted.base);
        let at = |position: f64| free_parameter.value(&refitted.base, position);
        let ratio = |effect: usize, spec: &&'static EffectSpec| {
            let sharper = explored.linearisation.sharper_ratio(effect, STANDS_OUT, k);
            HiddenEffect { id: spec.id.to_owned(), sharper }
        };
        let mut hides: Vec<HiddenEffect> =
            catalogue.iter().enumerate().map(|(effect, spec)| ratio(effect, spec)).collect();
        hides.sort_by(|a, b| b.sharper.total_cmp(&a.sharper));
        let sharper: f64 = hides.iter().map(|one| one.sharper.ln()).sum();
        hides.truncate(NAMED);
        let tolerance = (at(-1.0).min(at(1.0)), at(-1.0).max(at(1.0)));
        let information = refitted.information(k);
        (SheetValue { key, unit, sheet: at(0.0), tolerance, information, bits: bits(&held), hides }, sharper)
    };
    let mut values: Vec<(SheetValue, f64)> = refitted
        .free_parameters
        .iter()
        .enumerate()
        .filter(|(_, free_parameter)| free_parameter.has_prior())
        .map(value)
        .collect();
    values.sort_by(|a, b| b.0.bits.total_cmp(&a.0.bits).then(b.1.total_cmp(&a.1)));
    let values: Vec<SheetValue> = values.into_iter().map(|(value, _)| value).collect();
    SheetLimits {
        open_bits: sets.iter().map(|(probability, _)| -probability * probability.log2()).sum(),
        look_up: values.first().filter(|first| first.bits >= LEAST_BITS).map(|first| first.key.clone()),
        values,
    }
}

/// The fitted model with just these effects.
fn model<'a>(explored: &'a Explored, ids: &[String]) -> Option<&'a FittedModel> {
    let is_it = |model: &FittedModel| model.effects.len() == ids.len() && ids.iter().all(|id| model.has(id));
    explored.hypotheses.iter().map(|one| &one.model).find(|model| is_it(model))
}

/// What a set holds of a parameter of the sheet, which all sets have at the same place.
fn held(model: &FittedModel, k: usize, probability: f64, counted: CountedNats) -> MeanUnderSet {
    let mean = model.fit.positions.get(k).copied().unwrap_or(0.0);
    let variance = if k < model.spread.nrows() { model.spread[(k, k)] } else { 1.0 };
    // The tolerance is 1; the rest is what the recordings said.
    let said = (1.0 / variance.clamp(LEAST_DEVIATION.powi(2), 1.0) - 1.0) / counted.scale();
    (probability, mean, (1.0 / (1.0 + said)).sqrt())
}

/// Bits that the true value tells of the set.
fn bits(held: &[MeanUnderSet]) -> f64 {
    let log_density = |x: f64, mean: f64, deviation: f64| -0.5 * ((x - mean) / deviation).powi(2) - deviation.ln();
    let step = 2.0 * REACH / f64::from(POINTS - 1);
    let points = || (0..POINTS).map(|k| f64::from(k) * step - REACH);
    let all: f64 = points().map(|z| (-0.5 * z * z).exp()).sum();
    let of = |&(probability, mean, deviation): &MeanUnderSet| {
        let at = |z: f64| {
            let x = mean + z * deviation;
            let own = log_density(x, mean, deviation);
            let others = held.iter().map(|&(p, m, s)| p * (log_density(x, m, s) - own).exp());
            (-0.5 * z * z).exp() / all * -others.sum::<f64>().ln()
        };
        probability * points().map(at).sum::<f64>()
    };
    (held.iter().map(of).sum::<f64>() / std::f64::consts::LN_2).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_tells_as_much_as_the_sets_want_it_different() {
        assert!(bits(&[(0.5, 0.0, 1.0), (0.5, 0.0, 1.0)]) < 1e-9);
        let apart = bits(&[(0.5, 0.0, 0.1), (0.5, 3.0, 0.1)]);
        assert!((apart - 1.0).abs() < 1e-6, "{apart}");
        let odds = bits(&[(0.9, 0.0, 0.1), (0.1, 3.0, 0.1)]);
        assert!((odds - 0.469).abs() < 1e-3, "{odds}");
        // Two unit Gaussians two deviations apart: 0.4858 bits by quadrature.
        let some = bits(&[(0.5, -1.0, 1.0), (0.5, 1.0, 1.0)]);
        assert!((some - 0.4858).abs() < 1e-3, "{some}");
    }
}
