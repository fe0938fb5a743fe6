//! Everything fitted freely: all effects and tolerances in one linear fit, with a weak pull to nothing; what is significant is blamed.

use nalgebra::DMatrix;

use crate::baselines::ground::Ground;
use crate::baselines::{EffectFound, report};
use govtwin_diagnosis::result::schema::DiagnosisReport;

/// Standard deviations from nothing at which an effect is blamed.
const SIGNIFICANT: f64 = 3.0;

/// The rule.
pub(crate) fn judge(ground: &Ground) -> DiagnosisReport {
    let tries = ground.best_tries();
    let (gram, product) = ground.projected(&tries);
    let variance = ground.variance();
    let pulled = gram / variance + DMatrix::identity(tries.len(), tries.len());
    let Some(spread) = pulled.try_inverse() else { return report(&[], &ground.base) };
    let sizes = -(&spread * product) / variance;
    let found: Vec<EffectFound> = tries
        .iter()
        .enumerate()
        .map(|(k, one)| {
            let deviation = spread[(k, k)].max(1e-18).sqrt();
            let z = sizes[k] / deviation;
            EffectFound {
                spec: one.spec,
                evidence: 0.5 * (z * z - SIGNIFICANT * SIGNIFICANT),
                size: Some((sizes[k], deviation)),
                blamed: z.abs() > SIGNIFICANT,
            }
        })
        .collect();
    report(&found, &ground.base)
}
