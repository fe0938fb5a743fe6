//! What a diagnosis said, as far as it is scored: read from a report, or written as one by a baseline.

use serde::{Deserialize, Serialize};

use crate::diagnosis::hypotheses::table::{EvidenceRow, EvidenceTable};
use crate::diagnosis::result::{Interval, Verdict};
use crate::likelihood::problem::SOUND_MEAN_SQUARE;

/// The part of `report.json` that is scored.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReportVerdict {
    /// The verdict's word.
    pub verdict: String,
    /// Where the gap lies.
    #[serde(default)]
    pub location: Location,
    /// What the verdict blames.
    #[serde(default)]
    pub effects: Vec<Blamed>,
    /// The whole catalogue, `unknown` and `none`.
    #[serde(default)]
    pub ranking: Vec<Rank>,
    /// The gap.
    #[serde(default)]
    pub gap: Gap,
    /// Time that it took, s.
    #[serde(default)]
    pub seconds: Option<f64>,
    /// What it rests on.
    #[serde(default)]
    pub evidence: Evidence,
}

/// What a diagnosis rests on, as far as it is scored.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evidence {
    /// The evidence of all fault sets.
    #[serde(default)]
    pub table: EvidenceTable,
    /// By how much intervals of the explained share were widened; none of an older program.
    #[serde(default, rename = "closure_widened_by")]
    pub explained_fraction_widened_by: Option<f64>,
}

/// Where the gap lies.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Location {
    /// Id of the stage; none where there is no gap.
    #[serde(default)]
    pub stage: Option<String>,
}

/// One effect blamed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Blamed {
    /// Its id.
    pub id: String,
    /// Its parameters; the first is its size.
    #[serde(default)]
    pub parameters: Vec<ReportedSize>,
}

/// A parameter with its interval, both in the unit of the effect's parameter.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReportedSize {
    /// Its value; the unit is the parameter's own.
    #[serde(default)]
    pub value: Option<f64>,
    /// The interval that holds the truth nine times in ten.
    #[serde(default)]
    pub ci90: Option<[Option<f64>; 2]>,
}

/// One row of the ranking.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rank {
    /// An effect's id, `unknown` or `none`.
    pub id: String,
    /// Probability.
    #[serde(default)]
    pub probability: Option<f64>,
}

/// The gap as far as it is scored.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Gap {
    /// What the blamed effects close of it.
    #[serde(default, rename = "closure")]
    pub explained_fraction: ReportedSize,
}

/// A report that cannot be scored.
#[derive(Debug, thiserror::Error)]
pub enum ReportVerdictError {
    /// Not JSON, or not of the schema.
    #[error("expected a report of the schema govtwin-diagnosis/1: {0}")]
    Malformed(#[from] serde_json::Error),
    /// A verdict that nobody knows.
    #[error("expected a verdict {words}, found `{0}`", words = Verdict::all_words())]
    Verdict(String),
}

impl ReportVerdict {
    /// Reads a report.
    ///
    /// # Errors
    /// When it is not of the schema.
    pub fn read(json: &str) -> Result<Self, ReportVerdictError> {
        let report: Self = serde_json::from_str(json)?;
        if report.verdict().is_none() {
            return Err(ReportVerdictError::Verdict(report.verdict));
        }
        Ok(report)
    }

    /// As JSON of the schema.
    #[must_use]
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// The verdict.
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        Verdict::ALL.into_iter().find(|verdict| verdict.id() == self.verdict)
    }

    /// Whether it says that something is there.
    #[must_use]
    pub fn detects(&self) -> bool {
        matches!(self.verdict(), Some(Verdict::Named | Verdict::Class | Verdict::Unknown))
    }

    /// Probability given to an id; 0 where the ranking lacks it.
    #[must_use]
    pub fn probability(&self, id: &str) -> f64 {
        self.ranking.iter().find(|rank| rank.id == id).and_then(|rank| rank.probability).unwrap_or(0.0)
    }

    /// The most probable id of all; `none` where the ranking is empty.
    #[must_use]
    pub fn first(&self) -> &str {
        let mut best: Option<&Rank> = None;
        for rank in &self.ranking {
            if best.is_none_or(|best| rank.probability > best.probability) {
                best = Some(rank);
            }
        }
        best.map_or("none", |rank| rank.id.as_str())
    }

    /// The one word that the verdict comes down to: an effect's id, `unknown` or `none`.
    #[must_use]
    pub fn word(&self) -> &str {
        match self.verdict() {
            Some(Verdict::Named | Verdict::Class) => {
                let likelier = |a: &&Blamed, b: &&Blamed| {
                    // Of equals the first, as the report lists them.
                    self.probability(&a.id).total_cmp(&self.probability(&b.id)).then(std::cmp::Ordering::Greater)
                };
                self.effects.iter().max_by(likelier).map_or("unknown", |effect| effect.id.as_str())
            }
            Some(Verdict::Unknown) => "unknown",
            _ => "none",
        }
    }

    /// What the model of the verdict leaves above the cost of a right one, in halves of a log-likelihood; none where the report does not tell.
    #[must_use]
    pub fn leaves(&self) -> Option<f64> {
        let wanted: Vec<&str> = match self.verdict()? {
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

    /// The claimed explained fraction; none where nothing is claimed, or an interval leaves everything open.
    #[must_use]
    pub fn explained_fraction(&self) -> Option<Interval> {
        let ReportedSize { value, ci90: Some([Some(low), Some(high)]) } = self.gap.explained_fraction else {
            return None;
        };
        // What leaves everything open is not given as a figure.
        let claim = Interval { value: value.unwrap_or(f64::NAN), low, high };
        let claims = matches!(self.verdict(), Some(Verdict::Named | Verdict::Class));
        (claims && !claim.leaves_all_open()).then_some(claim)
    }

    /// Whether an effect is blamed.
    #[must_use]
    pub fn blames(&self, id: &str) -> bool {
        self.effects.iter().any(|effect| effect.id == id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_of_the_schema_is_read() {
        let report = r#"{"schema": "govtwin-diagnosis/1", "verdict": "named",
            "location": {"stage": "servomotor", "probability": {"servomotor": 0.97}},
            "effects": [{"id": "port_overlap", "stage": "servomotor", "probability": 0.93,
                "parameters": [{"name": "extra_overlap_m", "value": 3.1e-4, "ci90": [2.8e-4, null], "unit": "m"}],
                "closure": {"value": 0.91, "ci90": [0.87, 0.94]}}],
            "ranking": [{"id": "unknown", "probability": 0.04}, {"id": "port_overlap", "probability": 0.93}],
            "gap": {"signals": [], "closure": {"value": 0.91, "ci90": [0.87, 0.94]}}, "seconds": 41.0,
            "evidence": {"table": {"samples": 1000.0, "slow_share": 0.0, "pilot": false, "unknown": {}, "rows": [
                {"effects": ["port_overlap"], "refined": true, "cost": 950.0, "prior": 0.0, "strain": 0.0, "grid": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
                 "without_each": [], "sizes": [1.0]},
                {"effects": [], "refined": true, "cost": 1420.0, "prior": 0.0, "strain": 0.0, "grid": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
                 "without_each": [], "sizes": []}]}}}"#;
        let report = ReportVerdict::read(report).unwrap();
        assert!(report.detects() && report.first() == "port_overlap" && report.word() == "port_overlap");
        assert_eq!(report.effects[0].parameters[0].ci90, Some([Some(2.8e-4), None]));
        assert_eq!(report.probability("backlash"), 0.0);
        assert_eq!(report.leaves(), Some(30.0));
        assert_eq!(ReportVerdict { verdict: "unknown".into(), ..report.clone() }.leaves(), Some(500.0));
        assert_eq!(ReportVerdict::read(&report.to_json()).unwrap(), report);
        assert!(matches!(ReportVerdict::read(r#"{"verdict": "perhaps"}"#), Err(ReportVerdictError::Verdict(_))));
        assert!(matches!(ReportVerdict::read("{"), Err(ReportVerdictError::Malformed(_))));
        let silent = ReportVerdict::read(r#"{"verdict": "no_gap", "location": {"stage": null}}"#).unwrap();
        assert!(silent.word() == "none" && !silent.detects() && silent.first() == "none" && silent.leaves().is_none());
    }
}
