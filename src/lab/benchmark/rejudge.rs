//! What would have been said of a judged unit by other numbers: read off its evidence table, without a simulation.

use crate::benchmark::scored_report::ScoredReport as _;
use govtwin_diagnosis::decision::Decision;
use govtwin_diagnosis::decision::hyperparameters::Hyperparameters;
use govtwin_diagnosis::decision::posterior::Posterior;
use govtwin_diagnosis::hypotheses::table::EvidenceTable;
use govtwin_diagnosis::result::schema::{DiagnosisReport, GapLocation, ReportedGap};
use govtwin_diagnosis::result::{Blame, Interval, Ranked, Remainder, Verdict};
use govtwin_model::effects::{EffectSpec, find};

/// The verdict on a unit by these numbers and this table; sizes and explained fraction stay those of the report where it blames the same.
pub fn rejudged(report: &DiagnosisReport, table: &EvidenceTable, numbers: &Hyperparameters) -> DiagnosisReport {
    let mut ids: Vec<&str> = table.rows.iter().flat_map(|row| &row.effects).map(String::as_str).collect();
    ids.sort_unstable();
    ids.dedup();
    let catalogue: Vec<&'static EffectSpec> = ids.into_iter().filter_map(find).collect();
    let decision = Decision::new(table, &Posterior::new(table, numbers, &[]), &catalogue);
    let rank = |id: &str, p: f64| Ranked { id: id.to_owned(), probability: p };
    let mut ranking: Vec<Ranked> = decision.effects.iter().map(|(spec, p)| rank(spec.id, *p)).collect();
    ranking.extend([rank("unknown", decision.unknown), rank("none", decision.none)]);
    let stages = decision.stages();
    let likeliest = stages.iter().copied().reduce(|a, b| if b.1 > a.1 { b } else { a });
    let has_gap = decision.verdict != Verdict::NoGap;
    let blamed = decision.blamed.iter().filter_map(|id| {
        let known = report.effects.iter().find(|effect| effect.id == *id).cloned();
        known.or_else(|| {
            decision.effects.iter().find(|(spec, _)| spec.id == *id).map(|(spec, p)| Blame::unsized_effect(spec, *p))
        })
    });
    let effects: Vec<Blame> = blamed.collect();
    let same = report.effects.len() == effects.len() && effects.iter().all(|effect| report.blames(&effect.id));
    let explained_fraction = if same { report.gap.explained_fraction } else { Interval::default() };
    DiagnosisReport {
        // What moves too little to tell is told by the recordings, not by the numbers.
        verdict: if decision.verdict == Verdict::NoGap && report.verdict == Verdict::NotExcited {
            report.verdict
        } else {
            decision.verdict
        },
        location: GapLocation {
            stage: likeliest.filter(|_| has_gap).map(|(stage, _)| stage),
            probability: stages.into_iter().map(|(stage, share)| (stage, Some(share))).collect(),
        },
        effects,
        ranking,
        gap: ReportedGap { explained_fraction, ..report.gap.clone() },
        remainder: report.remainder.clone().map(|one| Remainder { something_else: decision.something_else, ..one }),
        ..report.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::benchmark::scored_report::tests::row;

    #[test]
    fn a_unit_is_judged_by_its_table() {
        let rows = vec![row(&["backlash", "load"], 70.0), row(&["load"], 130.0), row(&[], 900.0)];
        let table = EvidenceTable { samples: 100.0, rows, ..EvidenceTable::default() };
        let report = DiagnosisReport::of_verdict(Verdict::Unknown);
        let judged = rejudged(&report, &table, &Hyperparameters::usual());
        assert!(judged.verdict == Verdict::Named && judged.blames("backlash") && judged.blames("load"), "{judged:?}");
        let sum: f64 = judged.ranking.iter().map(|rank| rank.probability).sum();
        assert!(sum > 1.0 && judged.probability("none") < 1e-3);
    }
}
