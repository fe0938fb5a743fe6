//! What a report of a diagnosis, or of a baseline, comes down to where it is scored.

use govtwin_diagnosis::hypotheses::table::EvidenceRow;
use govtwin_diagnosis::likelihood::problem::SOUND_MEAN_SQUARE;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::result::{Blame, Interval, Verdict};

/// The questions that a score asks of a report.
pub trait ScoredReport {
    /// Whether it reports a fault.
    fn detects(&self) -> bool;

    /// Probability given to an id; 0 where the ranking lacks it.
    fn probability(&self, id: &str) -> f64;

    /// The one word that the verdict comes down to: an effect's id, `unknown` or `none`.
    fn word(&self) -> &str;

    /// What the model of the verdict leaves above the cost of a right one, in halves of a log-likelihood; none where the report does not tell.
    fn leaves(&self) -> Option<f64>;

    /// The claimed explained fraction; none where nothing is claimed, or an interval leaves everything open.
    fn explained_fraction(&self) -> Option<Interval>;

    /// Whether an effect is blamed.
    fn blames(&self, id: &str) -> bool;
}

impl ScoredReport for DiagnosisReport {
    fn detects(&self) -> bool {
        matches!(self.verdict, Verdict::Named | Verdict::Class | Verdict::Unknown)
    }

    fn probability(&self, id: &str) -> f64 {
        let rank = self.ranking.iter().find(|rank| rank.id == id);
        rank.map(|rank| rank.probability).filter(|probability| !probability.is_nan()).unwrap_or(0.0)
    }

    fn word(&self) -> &str {
        match self.verdict {
            Verdict::Named | Verdict::Class => {
                let likelier = |a: &&Blame, b: &&Blame| {
                    // Of equals the first, as the report lists them.
                    self.probability(&a.id).total_cmp(&self.probability(&b.id)).then(std::cmp::Ordering::Greater)
                };
                self.effects.iter().max_by(likelier).map_or("unknown", |effect| effect.id.as_str())
            }
            Verdict::Unknown => "unknown",
            _ => "none",
        }
    }

    fn leaves(&self) -> Option<f64> {
        let wanted: Vec<&str> = match self.verdict {
            Verdict::Named => self.effects.iter().map(|effect| effect.id.as_str()).collect(),
            Verdict::Class => vec![self.word()],
            _ => Vec::new(),
        };
        let table = &self.evidence.table;
        let is_it = |row: &&EvidenceRow| {
            row.effects.len() == wanted.len() && wanted.iter().all(|id| row.effects.iter().any(|effect| effect == id))
        };
        Some(table.rows.iter().find(is_it)?.cost - SOUND_MEAN_SQUARE * table.samples)
    }

    fn explained_fraction(&self) -> Option<Interval> {
        // What leaves everything open is not given as a figure.
        let claim = self.gap.explained_fraction;
        let claims = matches!(self.verdict, Verdict::Named | Verdict::Class) && claim.is_bounded();
        (claims && !claim.leaves_all_open()).then_some(claim)
    }

    fn blames(&self, id: &str) -> bool {
        self.effects.iter().any(|effect| effect.id == id)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use govtwin_diagnosis::hypotheses::table::EvidenceTable;
    use govtwin_diagnosis::result::Ranked;
    use govtwin_model::effects::find;

    /// A fitted set of these effects that costs so much.
    pub(in super::super) fn row(effects: &[&str], cost: f64) -> EvidenceRow {
        let effects = effects.iter().map(|id| (*id).to_owned()).collect();
        EvidenceRow { effects, cost, ..EvidenceRow::default() }
    }

    #[test]
    fn a_report_comes_down_to_a_word_and_to_what_its_model_leaves() {
        let mut report = DiagnosisReport::of_verdict(Verdict::Named);
        report.effects = vec![Blame::unsized_effect(find("port_overlap").unwrap(), 0.93)];
        report.ranking = [("unknown", 0.04), ("port_overlap", 0.93), ("load", f64::NAN)]
            .map(|(id, probability)| Ranked { id: id.into(), probability })
            .into();
        report.evidence.table = EvidenceTable {
            samples: 1000.0,
            rows: vec![row(&["port_overlap"], 950.0), row(&[], 1420.0)],
            ..EvidenceTable::default()
        };
        report.ranking.rotate_right(1);
        assert!(report.detects() && report.word() == "port_overlap");
        assert!(report.blames("port_overlap") && !report.blames("load"));
        assert_eq!(["backlash", "load"].map(|id| report.probability(id)), [0.0; 2]);
        assert_eq!((report.leaves(), report.explained_fraction()), (Some(30.0), None));
        report.gap.explained_fraction = Interval { value: 0.91, low: 0.87, high: 0.94 };
        assert_eq!(report.explained_fraction(), Some(report.gap.explained_fraction));
        assert_eq!(DiagnosisReport { verdict: Verdict::Unknown, ..report }.leaves(), Some(500.0));
        let silent = DiagnosisReport::of_verdict(Verdict::NoGap);
        assert!(silent.word() == "none" && !silent.detects() && silent.leaves().is_none());
    }
}
