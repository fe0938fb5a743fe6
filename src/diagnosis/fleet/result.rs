//! What is kept of an entry: done or failed, and of a diagnosis what a fleet is compared by.

use std::collections::BTreeMap;

use govtwin_files::digest::sha256;
use serde::{Deserialize, Serialize};

use super::entry::Entry;
use crate::result::{Blame, Diagnosis, Fitted, Verdict};

/// The schema of a result.
pub const SCHEMA: &str = "govtwin-fleet-result/1";

/// At least so much of what is known of a parameter must have come from the recordings, a share; less is the sheet's tolerance speaking.
const DETERMINED_SHARE: f64 = 0.5;

/// The result of an entry.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EntryResult {
    /// [`SCHEMA`].
    pub schema: String,
    /// The entry's key.
    pub key: String,
    /// The entry's unit.
    pub unit: String,
    /// The entry's period.
    pub period: String,
    /// Program and version.
    pub program: String,
    /// How many recordings went in.
    pub recordings: usize,
    /// Why there is no diagnosis; none where there is one.
    pub error: Option<String>,
    /// What a reader should know before believing it.
    pub warnings: Vec<String>,
    /// The origins of the recordings that bags and folders state.
    #[serde(default)]
    pub origins: Vec<String>,
    /// The folder of its report in the store.
    pub report: Option<String>,
    /// What the diagnosis found.
    pub found: Option<FoundCause>,
    /// How the work went; of no weight for the table.
    pub work: Work,
    /// SHA-256 of the files in that folder, by name.
    #[serde(default)]
    pub files: BTreeMap<String, String>,
    /// SHA-256 of all else in here.
    #[serde(default)]
    pub digest: String,
}

/// How the work on an entry went.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Work {
    /// From reading the entry to its report, s.
    pub elapsed_s: f64,
    /// Processor time of all threads, s; none if the system does not report it.
    pub processor_s: Option<f64>,
    /// The most memory that the process held, bytes; none if the system does not report it.
    pub peak_memory_bytes: Option<u64>,
}

/// What a diagnosis found.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FoundCause {
    /// The verdict's word.
    pub verdict: String,
    /// The stage of the gap.
    pub stage: Option<String>,
    /// Probability of something outside the catalogue.
    pub unknown_probability: Option<f64>,
    /// Probability of no fault.
    pub none_probability: Option<f64>,
    /// Share of the gap that the causes explain on held-out data.
    pub explained_share: Option<f64>,
    /// Entropy over the hypotheses that are left, in bits; it has no physical unit, 1.
    pub entropy_bits: Option<f64>,
    /// The blamed effects.
    pub causes: Vec<Cause>,
    /// The sheet's parameters as fitted.
    pub parameters: Vec<SizeInterval>,
    /// The most informative test, in words.
    pub next_test: Option<String>,
}

/// A blamed effect.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cause {
    /// Its id.
    pub id: String,
    /// Its stage.
    pub stage: String,
    /// Probability that it is present.
    pub probability: Option<f64>,
    /// Its parameters; the first is its size.
    pub sizes: Vec<SizeInterval>,
}

/// A value with its 90 % interval, in the unit beside it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SizeInterval {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// The value.
    pub value: Option<f64>,
    /// Lower end.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// It is on a bound of its range.
    pub at_bound: bool,
    /// Share of its information that comes from the recordings; none for effects, which have no tolerance.
    pub information_share: Option<f64>,
}

impl SizeInterval {
    /// A fitted value, without the share of information from the recordings.
    fn of(fitted: &Fitted) -> Self {
        Self {
            name: fitted.name.clone(),
            unit: fitted.unit.to_owned(),
            value: number(fitted.value.value),
            low: number(fitted.value.low),
            high: number(fitted.value.high),
            at_bound: fitted.at_bound,
            information_share: None,
        }
    }

    /// Whether the recordings determine it: a value inside its bounds, a finite interval of some width, and not mostly the sheet's word.
    pub(crate) fn is_determined(&self) -> bool {
        let (Some(value), Some(low), Some(high)) = (self.value, self.low, self.high) else { return false };
        let inside = low < high && low <= value && value <= high && (high - low).is_finite();
        inside && !self.at_bound && self.information_share.is_none_or(|share| share >= DETERMINED_SHARE)
    }
}

impl FoundCause {
    /// What a fleet keeps of a diagnosis.
    pub fn of(diagnosis: &Diagnosis) -> Self {
        let probability = |id: &str| {
            let one = diagnosis.ranking.iter().find(|one| one.id == id);
            one.and_then(|one| number(one.probability))
        };
        let of_sheet =
            |one: &Fitted| SizeInterval { information_share: number(one.information), ..SizeInterval::of(one) };
        Self {
            verdict: diagnosis.verdict.id().to_owned(),
            stage: diagnosis.stage.map(|stage| stage.id().to_owned()),
            unknown_probability: probability("unknown"),
            none_probability: probability("none"),
            explained_share: number(diagnosis.explained_fraction.value),
            entropy_bits: number(diagnosis.entropy_bits),
            causes: diagnosis.blamed.iter().map(Cause::of).collect(),
            parameters: diagnosis.parameters.iter().map(of_sheet).collect(),
            next_test: diagnosis.experiments.first().map(|one| one.test.clone()),
        }
    }

    /// Whether the causes are named and not alternatives: only then has a cause a size that the recordings determine.
    pub(crate) fn names_causes(&self) -> bool {
        self.verdict == Verdict::Named.id()
    }
}

impl Cause {
    fn of(blame: &Blame) -> Self {
        Self {
            id: blame.id.clone(),
            stage: blame.stage.id().to_owned(),
            probability: number(blame.probability),
            sizes: blame.parameters.iter().map(SizeInterval::of).collect(),
        }
    }
}

/// A number; none where it does not exist.
fn number(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}

/// A result that cannot be taken.
#[derive(Debug, thiserror::Error)]
pub enum OutcomeError {
    /// Not JSON, or not of the schema.
    #[error("expected a result of the schema {SCHEMA}: {0}")]
    Malformed(#[from] serde_json::Error),
    /// Another schema.
    #[error("expected a result of the schema {SCHEMA}, found `{0}`; was it made by another version?")]
    Schema(String),
    /// It is stored under the name of another.
    #[error("expected the result of the key {expected}, found that of `{found}`; was the file renamed?")]
    Key {
        /// The key of its name.
        expected: String,
        /// The key in it.
        found: String,
    },
    /// It was changed.
    #[error("digest: expected {expected:.12}, found {found:.12}: the result was changed, or is of an earlier program")]
    Digest {
        /// The digest of what it holds.
        expected: String,
        /// The digest in it.
        found: String,
    },
}

impl EntryResult {
    /// The outcome of an entry, with nothing found yet.
    pub fn of(entry: &Entry, program: &str) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            key: entry.key.clone(),
            unit: entry.unit.clone(),
            period: entry.period.clone(),
            program: program.to_owned(),
            recordings: entry.bags.len(),
            ..Self::default()
        }
    }

    /// The same with its digest.
    #[must_use]
    pub fn sealed(self) -> Self {
        Self { digest: self.own_digest(), ..self }
    }

    fn own_digest(&self) -> String {
        sha256(Self { digest: String::new(), ..self.clone() }.json())
    }

    /// Reads the result of a key from the store.
    ///
    /// # Errors
    /// Where it is none, not that of the key, or was changed.
    pub fn read(text: &[u8], key: &str) -> Result<Self, OutcomeError> {
        let outcome: Self = serde_json::from_slice(text)?;
        if outcome.schema != SCHEMA {
            return Err(OutcomeError::Schema(outcome.schema));
        }
        if outcome.key != key {
            return Err(OutcomeError::Key { expected: key.to_owned(), found: outcome.key });
        }
        let expected = outcome.own_digest();
        if outcome.digest != expected {
            let found = if outcome.digest.is_empty() { "none".to_owned() } else { outcome.digest };
            return Err(OutcomeError::Digest { expected, found });
        }
        Ok(outcome)
    }

    /// As the store holds it.
    pub fn json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// The path of the result of a key in a store.
    pub fn path(key: &str) -> String {
        format!("results/{key}.json")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::schema::{DiagnosisReport, SheetParameter};
    use crate::result::{Blame, Fitted, Interval, Ranked, Verdict};
    use govtwin_model::effects::{Stage, find};

    #[test]
    fn a_diagnosis_is_taken_as_far_as_a_fleet_is_compared_by_it() {
        let interval = |value, low, high| Interval { value, low, high };
        let fitted = |name: &str, value, information| Fitted {
            name: name.into(),
            unit: "1",
            value,
            sheet: f64::NAN,
            position: f64::NAN,
            information,
            at_bound: false,
        };
        let mut report = DiagnosisReport::of_verdict(Verdict::Named);
        report.location.stage = Some(Stage::Servomotor);
        report.effects = vec![Blame {
            parameters: vec![fitted("play_pu", interval(0.01, 0.008, 0.012), f64::NAN)],
            ..Blame::unsized_effect(find("backlash").unwrap(), 0.93)
        }];
        report.ranking = [("backlash", 0.93), ("unknown", 0.05), ("none", 0.01)]
            .map(|(id, probability)| Ranked { id: id.into(), probability })
            .into();
        report.evidence.parameters = [
            fitted("oil.bulk_modulus_pa", interval(1.0, 0.5, 1.5), 0.02),
            fitted("main_ports.width_m", interval(0.03, 0.029, f64::NAN), 0.9),
        ]
        .iter()
        .map(SheetParameter::from)
        .collect();
        let found = FoundCause::of(&report.into());
        assert!(found.names_causes() && found.causes[0].sizes[0].is_determined());
        assert_eq!((found.unknown_probability, found.none_probability), (Some(0.05), Some(0.01)));
        assert!(
            found.parameters.iter().all(|one| !one.is_determined()),
            "one by its tolerance alone, one without an end"
        );
        let bound = SizeInterval { at_bound: true, ..found.causes[0].sizes[0].clone() };
        assert!(!bound.is_determined());
    }

    #[test]
    fn a_result_reads_back_and_stands_under_its_own_key() {
        let entry = Entry { unit: "a".into(), ..Entry::default() }.keyed("p");
        let open = EntryResult { error: Some("torn".into()), ..EntryResult::of(&entry, "p") };
        let outcome = open.clone().sealed();
        assert_eq!(EntryResult::read(outcome.json().as_bytes(), &entry.key).unwrap(), outcome);
        for (changed, words) in
            [(open, "found none"), (EntryResult { unit: "b".into(), ..outcome.clone() }, "digest: expected ")]
        {
            let error = EntryResult::read(changed.json().as_bytes(), &entry.key).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
        }
        assert!(matches!(EntryResult::read(outcome.json().as_bytes(), "other"), Err(OutcomeError::Key { .. })));
        assert!(matches!(EntryResult::read(b"{}", "other"), Err(OutcomeError::Malformed(_))));
        assert!(matches!(
            EntryResult::read(&outcome.json().as_bytes()[..40], &entry.key),
            Err(OutcomeError::Malformed(_))
        ));
    }
}
