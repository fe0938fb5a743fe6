//! Plain ways to find the effect, against which the diagnosis must prove itself.
//!
//! All get what the diagnosis gets: simulator, tolerances, noise model, the nominal model refitted. They differ in the rule that
//! turns residuals into a verdict. None reports `unknown` unless it finds nothing.

pub(crate) mod bank;
pub(crate) mod free;
pub mod ground;
pub(crate) mod least_squares;
pub(crate) mod sparse;

use crate::baselines::ground::Ground;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::result::{Blame, Fitted, Interval, Ranked, Verdict};
use govtwin_model::effects::EffectSpec;
use govtwin_model::parameters::Unit;
use govtwin_model::units::NORMAL_90;

/// A baseline: a name and a rule.
#[derive(Clone, Copy, Debug)]
pub struct Baseline {
    /// Its key in files.
    pub id: &'static str,
    /// What it does.
    pub name: &'static str,
    /// Its rule.
    pub judge: fn(&Ground) -> DiagnosisReport,
}

/// All baselines.
pub const BASELINES: &[Baseline] = &[
    Baseline { id: "least_squares", name: "least squares and BIC over the catalogue", judge: least_squares::judge },
    Baseline { id: "bank", name: "nearest residual in a bank of models", judge: bank::judge },
    Baseline { id: "sparse", name: "sparse regression on the discrepancy", judge: sparse::judge },
    Baseline { id: "free", name: "everything fitted freely", judge: free::judge },
];

/// What a rule found of one effect.
#[derive(Clone, Debug)]
struct EffectFound {
    spec: &'static EffectSpec,
    /// Logarithm of how much better the effect explains the residuals than nothing does, whatever the rule counts, 1.
    evidence: f64,
    /// Position of its size and the standard deviation of it, in typical sizes.
    size: Option<(f64, f64)>,
    blamed: bool,
}

/// A verdict on a unit: probabilities in proportion to `exp(evidence)`, with nothing at evidence 0.
fn report(found: &[EffectFound], unit: &Unit) -> DiagnosisReport {
    let highest = found.iter().map(|one| one.evidence).fold(0.0, f64::max);
    let weight = |evidence: f64| (evidence - highest).exp();
    let sum: f64 = weight(0.0) + found.iter().map(|one| weight(one.evidence)).sum::<f64>();
    let rank = |id: &str, evidence: f64| Ranked { id: id.to_owned(), probability: weight(evidence) / sum };
    let mut ranking: Vec<Ranked> = found.iter().map(|one| rank(one.spec.id, one.evidence)).collect();
    ranking.push(rank("none", 0.0));
    ranking.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    let mut blamed: Vec<&EffectFound> = found.iter().filter(|one| one.blamed).collect();
    blamed.sort_by(|a, b| b.evidence.total_cmp(&a.evidence));
    let mut report = DiagnosisReport::of_verdict(if blamed.is_empty() { Verdict::NoGap } else { Verdict::Named });
    report.location.stage = blamed.first().map(|one| one.spec.stage);
    report.effects = blamed.iter().map(|one| blame(one, weight(one.evidence) / sum, unit)).collect();
    report.ranking = ranking;
    report
}

fn blame(found: &EffectFound, probability: f64, unit: &Unit) -> Blame {
    let first = found.spec.parameters.first().map(|parameter| parameter.on(&unit.parameters));
    let size = first.zip(found.size).map(|(parameter, (position, deviation))| {
        let at = |position: f64| parameter.neutral + (parameter.typical - parameter.neutral) * position;
        let (a, b) = (at(position - NORMAL_90 * deviation), at(position + NORMAL_90 * deviation));
        Fitted {
            name: parameter.name.to_owned(),
            unit: parameter.unit,
            value: Interval { value: at(position), low: a.min(b), high: a.max(b) },
            sheet: parameter.neutral,
            position,
            information: f64::NAN,
            at_bound: false,
        }
    });
    Blame { parameters: size.into_iter().collect(), ..Blame::unsized_effect(found.spec, probability) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::benchmark::scored_report::ScoredReport as _;
    use govtwin_model::effects::{Stage, find};

    #[test]
    fn evidence_becomes_probabilities_and_a_verdict() {
        let unit = govtwin_model::params::reference();
        let found = |id: &str, evidence, blamed| EffectFound {
            spec: find(id).unwrap(),
            evidence,
            size: Some((2.0, 0.1)),
            blamed,
        };
        let verdict = report(&[found("backlash", 2.0_f64.ln(), true), found("pv_bandwidth", 0.0, false)], &unit);
        assert!(verdict.word() == "backlash" && verdict.location.stage == Some(Stage::Servomotor));
        assert!((verdict.probability("backlash") - 0.5).abs() < 1e-12);
        assert!((verdict.probability("none") - 0.25).abs() < 1e-12);
        let Interval { low, high, .. } = verdict.effects[0].parameters[0].value;
        assert!(low < 4.0e-3 && high > 4.0e-3);
        assert_eq!(report(&[found("backlash", -1.0, false)], &unit).word(), "none");
    }
}
