//! What proposed tests brought: how often a verdict became right, and bits promised beside bits gained.

use serde::Serialize;

use crate::benchmark::scored::ScoredUnit;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::result::{Experiment, Verdict};

/// The test that a report proposes first, of those that can be sent to a governor.
pub fn proposed(report: &DiagnosisReport) -> Option<&Experiment> {
    report.experiments.iter().find(|one| one.script.is_some())
}

/// Tests of some units, counted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct NextTestScore {
    /// Units that were tested.
    pub units: usize,
    /// Verdicts that were right before and after.
    pub stayed_right: usize,
    /// Verdicts that became right.
    pub became_right: usize,
    /// Verdicts that became wrong.
    pub became_wrong: usize,
    /// Verdicts `unknown` or `class` before.
    pub open: usize,
    /// Of these, those that became `named`, rightly.
    pub settled: usize,
    /// Entropy that the tests promised to take off, bits, mean.
    pub promised_bits: f64,
    /// Entropy that they took off, bits, mean; below 0 where they opened a question.
    pub gained_bits: f64,
}

impl NextTestScore {
    /// Of units as judged before and after.
    pub fn new(tested: &[(ScoredUnit, ScoredUnit)]) -> Self {
        let count = |holds: &dyn Fn(&ScoredUnit, &ScoredUnit) -> bool| {
            tested.iter().filter(|(before, after)| holds(before, after)).count()
        };
        let mean = |bits: &dyn Fn(&ScoredUnit, &ScoredUnit) -> f64| {
            tested.iter().map(|(before, after)| bits(before, after)).sum::<f64>() / tested.len().max(1) as f64
        };
        let is_open = |unit: &ScoredUnit| matches!(unit.report.verdict, Verdict::Unknown | Verdict::Class);
        let is_named = |unit: &ScoredUnit| unit.report.verdict == Verdict::Named && !unit.missed();
        let entropy = |unit: &ScoredUnit| unit.report.evidence.entropy_bits;
        Self {
            units: tested.len(),
            stayed_right: count(&|before, after| !before.missed() && !after.missed()),
            became_right: count(&|before, after| before.missed() && !after.missed()),
            became_wrong: count(&|before, after| !before.missed() && after.missed()),
            open: count(&|before, _| is_open(before)),
            settled: count(&|before, after| is_open(before) && is_named(after)),
            promised_bits: mean(&|before, _| proposed(&before.report).map_or(0.0, |test| test.expected_drop_bits)),
            gained_bits: mean(&|before, after| entropy(before) - entropy(after)),
        }
    }

    /// In words; none where nothing was tested.
    pub fn in_words(&self) -> Option<String> {
        let Self { units, stayed_right, became_right, became_wrong, open, settled, promised_bits, gained_bits } = self;
        (*units > 0).then(|| {
            format!(
                "Next tests: {units} units were tested as their reports propose and diagnosed again. Right before: {}, after: {} ({became_right} became \
                 right, {became_wrong} wrong). Of {open} verdicts unknown or class, {settled} became named and right. Bits promised: \
                 {promised_bits:.2} a test; gained: {gained_bits:.2}.",
                stayed_right + became_wrong,
                stayed_right + became_right,
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::{Label, TrueFault};
    use govtwin_diagnosis::result::Blame;
    use govtwin_model::effects::{Stage, find};

    fn unit(verdict: Verdict, blamed: &[&str], entropy_bits: f64) -> ScoredUnit {
        let mut report = DiagnosisReport::of_verdict(verdict);
        report.effects = blamed.iter().map(|id| Blame::unsized_effect(find(id).unwrap(), 0.9)).collect();
        report.evidence.entropy_bits = entropy_bits;
        let load = TrueFault {
            id: "load".into(),
            stage: Stage::Servomotor,
            size: 1.0,
            unit: "1".into(),
            meaning: String::new(),
        };
        let label = Label {
            name: String::new(),
            effects: vec![load],
            listed: true,
            strength_ratio: 9.0,
            rate_hz: 100.0,
            mismatch: 1.0,
        };
        ScoredUnit { report, label, realised_fraction: None, expected_log_bayes_factor: None }
    }

    #[test]
    fn tests_are_counted_by_what_they_changed() {
        let tested = [
            (unit(Verdict::Unknown, &[], 2.0), unit(Verdict::Named, &["load"], 0.5)),
            (unit(Verdict::Class, &["load", "backlash"], 1.0), unit(Verdict::Named, &["load"], 0.0)),
            (unit(Verdict::Named, &["load"], 0.5), unit(Verdict::Named, &["backlash"], 1.0)),
            (unit(Verdict::Unknown, &[], 1.0), unit(Verdict::Unknown, &[], 1.0)),
        ];
        let score = NextTestScore::new(&tested);
        assert_eq!((score.units, score.stayed_right, score.became_right, score.became_wrong), (4, 1, 1, 1));
        assert_eq!((score.open, score.settled), (3, 2));
        assert!((score.gained_bits - 0.5).abs() < 1e-12 && score.promised_bits == 0.0);
        let words = score.in_words().unwrap();
        assert!(words.contains("Right before: 2, after: 2 (1 became right, 1 wrong)"), "{words}");
        assert_eq!(NextTestScore::new(&[]).in_words(), None);
    }
}
