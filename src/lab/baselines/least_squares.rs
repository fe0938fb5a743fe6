//! Least squares and BIC over the catalogue: each effect fitted with the tolerances, the best by Schwarz's criterion is the verdict.
//!
//! `BIC = n ln(S/n) + k ln n` (Schwarz 1978, Annals of Statistics 6(2)).

use crate::baselines::ground::Ground;
use crate::baselines::{EffectFound, report};
use govtwin_diagnosis::estimation::fit::{Effort, fit};
use govtwin_diagnosis::estimation::linear::normal;
use govtwin_diagnosis::result::schema::DiagnosisReport;

/// Rounds of a fit.
const ROUNDS: usize = 3;

/// The rule.
pub(crate) fn judge(ground: &Ground) -> DiagnosisReport {
    let n = ground.count();
    let criterion = |cost: f64, extra: usize| n * (cost / n).ln() + extra as f64 * n.ln();
    let nominal = criterion(ground.fit.cost(), 0);
    let variance = ground.variance();
    let mut found: Vec<EffectFound> = ground
        .best_tries()
        .into_iter()
        .map(|one| {
            let fitted = fit(
                &ground.problem,
                &one.base,
                &one.free_parameters,
                &one.positions,
                Effort { rounds: ROUNDS, ..Effort::SCOUT },
                Some(&ground.fit.slopes),
            );
            let extra = one.free_parameters.len() - ground.free_parameters.len();
            let (hessian, _) = normal(&one.free_parameters, &fitted.positions, &fitted.residuals, &fitted.slopes, 1.0);
            let place = ground.free_parameters.len();
            let deviation = hessian.try_inverse().map(|spread| (variance * spread[(place, place)].max(0.0)).sqrt());
            EffectFound {
                spec: one.spec,
                evidence: 0.5 * (nominal - criterion(fitted.cost(), extra)),
                size: deviation.map(|deviation| (fitted.positions[place], deviation)),
                blamed: false,
            }
        })
        .collect();
    let best = (0..found.len()).max_by(|&a, &b| found[a].evidence.total_cmp(&found[b].evidence));
    if let Some(best) = best.filter(|&k| found[k].evidence > 0.0) {
        found[best].blamed = true;
    }
    report(&found, &ground.base)
}
