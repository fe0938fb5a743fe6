//! One unit before the scorer: what verdict beside what is in it.

use crate::battery::{Label, TrueFault};
use crate::benchmark::score::SMALL_REGRET;
use crate::benchmark::scored_report::ScoredReport as _;
use govtwin_diagnosis::decision::hyperparameters::Hyperparameters;
use govtwin_diagnosis::decision::posterior::likeliest;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_diagnosis::result::{Regret, Remainder, Verdict};
use govtwin_model::stored::with_words;

/// Gain in likelihood, as −2 ln, from which something can be told: a log Bayes factor of 10, of which the odds against any effect take half.
pub const SEEN: f64 = 20.0;

/// Strength from which an effect must be seen, over the noise floor.
const VISIBLE_RATIO: f64 = 3.0;
/// A class with more members is no answer.
const LARGEST_CLASS: usize = 3;

with_words! {
    /// What a miss lies with: the first that holds.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum MissedBy: id {
        /// What was left out gains less than an effect must ([`SEEN`]) once sheet and answer are fitted against it
        /// ([`expected_log_bayes_factor`](crate::benchmark::isolability::expected_log_bayes_factor)); or, if it is not the search, the answer leaves hardly
        /// more than a right model ([`DiagnosisReport::leaves`]).
        Information = "information",
        /// No set with the true faults was fitted, or one that costs more, by [`SMALL_REGRET`] and by [`SEEN`], than a fit which begins at the true values.
        Search = "search",
        /// The true set leads by the evidence of the report, and the verdict is another.
        Verdict = "verdict",
        /// Another set leads by the evidence: with the twin's equations it fits the recordings better than the truth does.
        Model = "model",
    }
}

/// One unit: its report, and the truth.
#[derive(Clone, Debug)]
pub struct ScoredUnit {
    /// The report.
    pub report: DiagnosisReport,
    /// What is so.
    pub label: Label,
    /// Explained fraction on recordings that the diagnosis never saw; none if it was not validated.
    pub realised_fraction: Option<f64>,
    /// Of a missed answer, the information of the recordings about what it left out ([`crate::benchmark::isolability::expected_log_bayes_factor`]); none if it was not computed.
    pub expected_log_bayes_factor: Option<f64>,
}

impl ScoredUnit {
    pub(super) fn sound(&self) -> bool {
        self.label.effects.is_empty()
    }

    pub(super) fn single(&self) -> bool {
        self.label.listed && self.label.effects.len() == 1
    }

    pub(super) fn pair(&self) -> bool {
        self.label.listed && self.label.effects.len() == 2
    }

    pub(super) fn triple(&self) -> bool {
        self.label.listed && self.label.effects.len() > 2
    }

    /// Strong enough to be seen; if the strength was not measured, every effect counts.
    pub(super) fn visible(&self) -> bool {
        let strength = self.label.strength_ratio;
        !self.sound() && (strength.is_nan() || strength >= VISIBLE_RATIO)
    }

    pub(super) fn says(&self, verdict: Verdict) -> bool {
        self.report.verdict == verdict
    }

    /// Whether the report says that something outside the catalogue is at work: instead of known causes, or beside them.
    pub(super) fn says_something_else(&self) -> bool {
        let beside = self.report.remainder.as_ref().is_some_and(Remainder::says_something_else);
        self.says(Verdict::Unknown) || self.report.detects() && beside
    }

    pub(super) fn stage_is_right(&self) -> bool {
        let stage = self.report.location.stage;
        self.label.effects.iter().any(|truth| Some(truth.stage) == stage)
    }

    /// Whether the verdict leaves out or makes up anything: a class is one effect, and right where it holds what is there.
    pub fn missed(&self) -> bool {
        match self.label.listed {
            false => !self.says_something_else(),
            true if self.sound() => self.report.detects(),
            true => self.says(Verdict::Unknown) || self.makes_up() || self.hidden().next().is_some(),
        }
    }

    /// True effects that the verdict does not name: of a class one effect at most counts as named.
    pub fn hidden(&self) -> impl Iterator<Item = &TrueFault> {
        let blamed = |truth: &&TrueFault| self.report.blames(&truth.id);
        let most = if self.says(Verdict::Class) { 1 } else { usize::MAX };
        let report: Vec<&str> =
            self.label.effects.iter().filter(blamed).take(most).map(|truth| truth.id.as_str()).collect();
        self.label.effects.iter().filter(move |truth| !report.contains(&truth.id.as_str()))
    }

    /// Whether the verdict names an effect that is not there; a class only claims that one of several is.
    pub(crate) fn makes_up(&self) -> bool {
        let there = |id: &str| self.label.effects.iter().any(|truth| truth.id == id);
        self.names() && self.report.effects.iter().any(|blamed| !there(&blamed.id))
    }

    /// Whether the verdict names effects, all of them at once.
    pub(super) fn names(&self) -> bool {
        self.says(Verdict::Named)
    }

    /// What a miss lies with; none where nothing was missed, or nothing is known of it.
    pub fn missed_by(&self) -> Option<MissedBy> {
        if !self.missed() {
            return None;
        }
        let below = |figure: Option<f64>| figure.is_some_and(|figure| figure < SEEN);
        let is_hidden = self.hidden().next().is_some();
        if is_hidden && below(self.expected_log_bayes_factor) {
            return Some(MissedBy::Information);
        }
        let regret = self.report.evidence.regret.as_ref();
        if regret.is_some_and(|one| one.share() > SMALL_REGRET && one.share() * one.reached > SEEN) {
            return Some(MissedBy::Search);
        }
        if is_hidden && below(self.report.leaves()) {
            return Some(MissedBy::Information);
        }
        Some(if self.truth_leads()? { MissedBy::Verdict } else { MissedBy::Model })
    }

    /// Whether the true set is the likeliest of those that were fitted; what no catalogue lists leads wherever it can be seen. None without a table.
    fn truth_leads(&self) -> Option<bool> {
        let table = &self.report.evidence.table;
        let leader = likeliest(table, &Hyperparameters::shipped())?;
        let is_there = |id: &String| self.label.effects.iter().any(|truth| truth.id == *id);
        let effects = &table.rows[leader].effects;
        Some(!self.label.listed || effects.len() == self.label.effects.len() && effects.iter().all(is_there))
    }

    pub(super) fn first_truth(&self) -> &str {
        self.label.effects.first().map_or("none", |truth| truth.id.as_str())
    }

    pub(super) fn is_first(&self) -> bool {
        self.report.word() == self.first_truth()
    }

    pub(super) fn blamed_in_small_class(&self) -> bool {
        self.report.blames(self.first_truth()) && self.report.effects.len() <= LARGEST_CLASS
    }

    /// Whether an id of the ranking is true of the unit.
    pub(super) fn holds(&self, id: &str) -> bool {
        match id {
            "none" => self.sound(),
            "unknown" => !self.label.listed,
            id => self.label.listed && self.label.effects.iter().any(|truth| truth.id == id),
        }
    }

    /// Whether the claimed interval of the size holds the truth; none where the right effect is not blamed with one.
    pub(super) fn size_is_covered(&self) -> Option<bool> {
        let truth = self.label.effects.first().filter(|_| self.single())?;
        let blamed = self.report.effects.iter().find(|effect| effect.id == truth.id)?;
        let claim = blamed.parameters.first()?.value;
        claim.is_bounded().then(|| (claim.low..=claim.high).contains(&truth.size))
    }

    /// Regret of the search as a share of χ²; none where the true values are not known.
    pub fn regret(&self) -> Option<f64> {
        self.report.evidence.regret.as_ref().map(Regret::share).filter(|share| !share.is_nan())
    }

    pub(super) fn explained_fraction_is_covered(&self) -> Option<bool> {
        // A class claims what its most probable effect closes.
        let (claim, realised) = (self.report.explained_fraction()?, self.realised_fraction?);
        Some((claim.low..=claim.high).contains(&realised))
    }
}
