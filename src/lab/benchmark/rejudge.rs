//! What would have been said of a judged unit by other weights: read off its evidence table, without a simulation.

use crate::benchmark::scored_report::ScoredReport as _;
use govtwin_diagnosis::decision::Decision;
use govtwin_diagnosis::decision::posterior::Posterior;
use govtwin_diagnosis::decision::weights::Weights;
use govtwin_diagnosis::evidence::KAPPAS;
use govtwin_diagnosis::evidence::law_error::LAW_ERRORS;
use govtwin_diagnosis::hypotheses::table::EvidenceTable;
use govtwin_diagnosis::result::schema::{DiagnosisReport, GapLocation, ReportedGap};
use govtwin_diagnosis::result::{Blame, Interval, Ranked, Verdict};
use govtwin_model::effects::{EffectSpec, find};

/// What is left out of the evidence, to see what it is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EvidenceLeftOut {
    /// Nothing.
    Nothing,
    /// The error of equations: evidence as if every equation were exact.
    ModelError,
    /// Sets of two and three effects.
    SeveralEffects,
    /// Something unknown.
    Unknown,
}

impl EvidenceLeftOut {
    /// The table without it.
    #[must_use]
    pub fn of(self, table: &EvidenceTable) -> EvidenceTable {
        let mut table = table.clone();
        match self {
            Self::Nothing => {}
            Self::ModelError => {
                for row in &mut table.rows {
                    row.grid = [[row.grid[0][0]; LAW_ERRORS.len()]; KAPPAS.len()];
                }
            }
            Self::SeveralEffects => table.rows.retain(|row| row.effects.len() < 2),
            Self::Unknown => table.unknown.clear(),
        }
        table
    }
}

/// The verdict on a unit by these weights and this table; sizes and explained fraction stay those of the report where it blames the same.
#[must_use]
pub fn rejudged(report: &DiagnosisReport, table: &EvidenceTable, weights: &Weights) -> DiagnosisReport {
    let mut ids: Vec<&str> = table.rows.iter().flat_map(|row| &row.effects).map(String::as_str).collect();
    ids.sort_unstable();
    ids.dedup();
    let catalogue: Vec<&'static EffectSpec> = ids.into_iter().filter_map(find).collect();
    let decision = Decision::new(table, &Posterior::new(table, weights, &[]), &catalogue);
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
        // What moves too little to tell is told by the recordings, not by the weights.
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
        ..report.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_diagnosis::decision::weights::CHAIN;
    use govtwin_diagnosis::hypotheses::table::EvidenceRow;

    fn table() -> EvidenceTable {
        let row = |effects: &[&str], evidence: f64| EvidenceRow {
            effects: effects.iter().map(|id| (*id).to_owned()).collect(),
            refined: true,
            // As much as a right model leaves of the likeliest set.
            cost: 64.0 - 2.0 * (evidence + 100.0),
            sizes: vec![1.1; effects.len()],
            grid: [[evidence - 40.0; 3], [evidence; 3], [evidence; 3], [evidence; 3]],
            ..EvidenceRow::default()
        };
        EvidenceTable {
            samples: 100.0,
            rows: vec![row(&["backlash", "load"], -100.0), row(&["load"], -112.0), row(&[], -400.0)],
            unknown: [("spool".to_owned(), -390.0)].into(),
            ..EvidenceTable::default()
        }
    }

    #[test]
    fn what_is_left_out_is_gone_and_the_rest_is_judged() {
        let report = DiagnosisReport::of_verdict(Verdict::Unknown);
        let judged = |left_out: EvidenceLeftOut| rejudged(&report, &left_out.of(&table()), &CHAIN.bayes());
        let whole = judged(EvidenceLeftOut::Nothing);
        assert_eq!(whole.verdict, Verdict::Named);
        assert!(whole.blames("backlash") && whole.blames("load"));
        let alone = judged(EvidenceLeftOut::SeveralEffects);
        assert!(alone.blames("load") && !alone.blames("backlash"), "{alone:?}");
        assert_eq!(judged(EvidenceLeftOut::Unknown).probability("unknown"), 0.0);
        assert_eq!(EvidenceLeftOut::ModelError.of(&table()).rows[0].grid, [[-140.0; 3]; 4]);
        let sum: f64 = whole.ranking.iter().map(|rank| rank.probability).sum();
        assert!(sum > 1.0 && whole.probability("none") < 1e-9);
    }
}
