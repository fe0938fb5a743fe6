//! Nearest residual in a bank of simulated models: whichever model leaves least is the verdict.
//!
//! A bank of fault models with the smallest residual as verdict is the oldest form of model-based isolation (Willsky 1976,
//! Automatica 12(6)). Models stand at fixed sizes; nothing is refitted.

use crate::baselines::ground::Ground;
use crate::baselines::{EffectFound, report};
use govtwin_diagnosis::estimation::coordinate::square;
use govtwin_diagnosis::result::schema::DiagnosisReport;

/// The rule.
pub(crate) fn judge(ground: &Ground) -> DiagnosisReport {
    let nominal = square(&ground.fit.residuals);
    let best = ground.best_tries();
    let least = best.iter().map(|one| square(&one.residuals)).fold(nominal, f64::min);
    let variance = (least / ground.count()).max(1e-9);
    let found: Vec<EffectFound> = best
        .into_iter()
        .map(|one| {
            let residual = square(&one.residuals);
            EffectFound {
                spec: one.spec,
                evidence: 0.5 * (nominal - residual) / variance,
                size: None,
                blamed: residual == least && residual < nominal,
            }
        })
        .collect();
    report(&found, &ground.base)
}
