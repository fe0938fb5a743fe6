//! Sparse regression on the discrepancy: the residuals of the refit explained by as few effects as the BIC allows.
//!
//! Orthogonal matching pursuit over the effects' linear responses (Pati, Rezaiifar & Krishnaprasad 1993, 27th Asilomar Conference), the stand-in for
//! sparse identification of a discrepancy (Kaheman et al. 2019, arXiv 1909.08574): its library holds the catalogue's responses.

use nalgebra::{DMatrix, DVector};

use crate::baselines::ground::Ground;
use crate::baselines::{EffectFound, report};
use govtwin_diagnosis::result::schema::DiagnosisReport;

/// Most effects at once.
const MOST: usize = 3;

/// The rule.
pub(crate) fn judge(ground: &Ground) -> DiagnosisReport {
    let tries = ground.best_tries();
    let (gram, product) = ground.projected(&tries);
    let (variance, price) = (ground.variance(), ground.count().ln());
    let mut chosen: Vec<usize> = Vec::new();
    let mut gained = 0.0;
    while chosen.len() < MOST {
        let with = |k: usize| {
            let mut places = chosen.clone();
            places.push(k);
            explained(&gram, &product, &places)
        };
        let next = (0..tries.len()).filter(|k| !chosen.contains(k)).max_by(|&a, &b| with(a).total_cmp(&with(b)));
        let Some(next) = next.filter(|&k| (with(k) - gained) / variance > price) else { break };
        gained = with(next);
        chosen.push(next);
    }
    let found: Vec<EffectFound> = tries
        .iter()
        .enumerate()
        .map(|(k, one)| {
            let alone = (explained(&gram, &product, &[k]) / variance - price) / 2.0;
            let size = -product[k] / gram[(k, k)].max(1e-12);
            let deviation = (variance / gram[(k, k)].max(1e-12)).sqrt();
            EffectFound { spec: one.spec, evidence: alone, size: Some((size, deviation)), blamed: chosen.contains(&k) }
        })
        .collect();
    report(&found, &ground.base)
}

/// By how much the sum of squares falls with these effects.
fn explained(gram: &DMatrix<f64>, product: &DVector<f64>, places: &[usize]) -> f64 {
    let m = places.len();
    let g = DMatrix::from_fn(m, m, |i, j| gram[(places[i], places[j])] + if i == j { 1e-6 } else { 0.0 });
    let b = DVector::from_fn(m, |i, _| product[places[i]]);
    g.cholesky().map_or(0.0, |cholesky| b.dot(&cholesky.solve(&b)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_explained_is_the_fall_of_the_sum() {
        let gram = DMatrix::from_row_slice(2, 2, &[4.0, 0.0, 0.0, 9.0]);
        let product = DVector::from_vec(vec![8.0, 9.0]);
        assert!((explained(&gram, &product, &[0]) - 16.0).abs() < 1e-4);
        assert!((explained(&gram, &product, &[0, 1]) - 25.0).abs() < 1e-4);
    }
}
