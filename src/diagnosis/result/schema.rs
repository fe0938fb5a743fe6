//! The machine-readable report, `govtwin-diagnosis/1`: the agreed fields first, the evidence behind them below `evidence`.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::digests::{DIGESTS, sealed, unchanged};
use crate::hypotheses::table::EvidenceTable;
use crate::model::consistency::Consistency;
use crate::result::{
    Blame, Breakdown, ChannelReport, DetectableSize, Diagnosis, DiscrepancyTerm, Experiment, Fitted, Interval, Ranked,
    Regret, Remainder, Setup, SheetLimits, SignalGap, StageFigure, StageOnly, StageTest, Trace, Transfer, Tried,
    Verdict,
};
use govtwin_model::effects::Stage;
use govtwin_model::parameters::{ChannelReadings, Parameters, Sensors, Unit};
use govtwin_model::provenance::Provenance;
use govtwin_model::stored::{LastingText, figure, lasting};

/// The schema's name.
pub const SCHEMA: &str = "govtwin-diagnosis/1";

/// A report of the schema [`SCHEMA`]: what is written is what is read. A section that is missing counts as empty, a field that
/// is missing in a row is an error. Every figure is in the unit that its key names or that stands beside it as
/// `unit`; numbers that do not exist are null.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DiagnosisReport {
    /// The schema's name.
    pub schema: String,
    /// The verdict.
    pub verdict: Verdict,
    /// What was known of the unit beside its recordings. Reports of before it was said are by a data sheet.
    #[serde(default)]
    pub judged_by: Setup,
    /// Where the gap lies.
    #[serde(default)]
    pub location: GapLocation,
    /// Effects that the verdict blames.
    #[serde(default)]
    pub effects: Vec<Blame>,
    /// The whole catalogue, `unknown` and `none`, most probable first.
    #[serde(default)]
    pub ranking: Vec<Ranked>,
    /// The gap and what closes it.
    #[serde(default)]
    pub gap: ReportedGap,
    /// What the blamed effects leave, or, where none is blamed, the likeliest ones; null where there is no gap.
    #[serde(default)]
    pub remainder: Option<Remainder>,
    /// Figures of a stage that was judged alone.
    #[serde(default)]
    pub fitted_stage: Option<Vec<StageFigure>>,
    /// Tests that would tell more, best first.
    #[serde(default, rename = "next_experiment")]
    pub experiments: Vec<Experiment>,
    /// How much the sheet's tolerances limit the verdict.
    #[serde(default, rename = "sheet")]
    pub sheet_limits: Option<SheetLimits>,
    /// Time that it took, s.
    #[serde(default)]
    pub seconds: Option<f64>,
    /// What a reader must know beside the verdict.
    #[serde(default)]
    pub notes: Vec<String>,
    /// What the verdict rests on.
    #[serde(default)]
    pub evidence: ReportedEvidence,
    /// What the report was made from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

/// Where the gap lies.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct GapLocation {
    /// The stage; none where there is no gap.
    pub stage: Option<Stage>,
    /// Probability of each stage.
    #[serde(default)]
    pub probability: BTreeMap<Stage, Option<f64>>,
}

/// The gap and what closes it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct ReportedGap {
    /// In each signal.
    #[serde(default)]
    pub signals: Vec<SignalGap>,
    /// Share of the gap that the blamed effects close together, on other recordings of the unit.
    #[serde(rename = "closure")]
    pub explained_fraction: Interval,
}

/// What a verdict rests on.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ReportedEvidence {
    /// How the innovations look.
    pub innovations: Innovations,
    /// How many values were measured.
    #[serde(rename = "values")]
    pub samples: usize,
    /// Entropy of the posterior over the hypotheses that are left, bits.
    #[serde(deserialize_with = "figure")]
    pub entropy_bits: f64,
    /// Fault sets that hold nine tenths of the probability of something known, likeliest first.
    pub fault_sets: Vec<FaultSet>,
    /// The evidence of all fault sets.
    pub table: EvidenceTable,
    /// Explained fraction on each recording by fits to the others.
    #[serde(rename = "closure_without_recording")]
    pub transfers: Vec<Transfer>,
    /// The sheet's parameters as fitted.
    pub parameters: Vec<SheetParameter>,
    /// What was tried, best first.
    pub tried: Vec<Tried>,
    /// Channels as found.
    pub channels: Vec<ChannelReport>,
    /// What could be seen at all.
    #[serde(rename = "smallest_visible")]
    pub detectable_sizes: Vec<DetectableSize>,
    /// Pairs of effects that these recordings cannot tell apart.
    #[serde(rename = "alike")]
    pub ambiguous_pairs: Vec<AmbiguousPair>,
    /// The squared gap in parts.
    #[serde(rename = "ledgers")]
    pub breakdowns: Vec<Breakdown>,
    /// Stages driven by recorded signals.
    pub stage_tests: Vec<StageTest>,
    /// Free terms.
    #[serde(rename = "free_terms")]
    pub discrepancy_terms: Vec<DiscrepancyTerm>,
    /// Number of simulated recordings that it took.
    pub simulations: usize,
    /// By how much the search missed what the true values reach, where they are known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub regret: Option<Regret>,
    /// Where the servomotor stage alone was judged.
    #[serde(default, rename = "servomotor_stage_only")]
    pub part: Option<StageOnly>,
    /// Curves for pictures.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub traces: Vec<Trace>,
}

/// Innovations of the refitted sheet, and of the likeliest fault set.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Innovations {
    /// Of the refitted sheet.
    pub refitted: Vec<Consistency>,
    /// Of the likeliest fault set.
    pub likeliest: Vec<Consistency>,
}

/// A fault set and its probability.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FaultSet {
    /// Ids of its effects.
    pub effects: Vec<String>,
    /// Its probability.
    #[serde(deserialize_with = "figure")]
    pub probability: f64,
}

/// Two effects that look alike.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct AmbiguousPair {
    /// One.
    pub a: String,
    /// The other.
    pub b: String,
    /// How alike they look, 0 to 1.
    #[serde(deserialize_with = "figure")]
    pub likeness: f64,
}

/// A parameter of the sheet as fitted.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SheetParameter {
    /// The key of parameter files.
    pub key: String,
    /// Its unit.
    #[serde(deserialize_with = "lasting")]
    pub unit: LastingText,
    /// Fitted value, in the unit.
    #[serde(flatten)]
    pub value: Interval,
    /// Value of the sheet.
    #[serde(deserialize_with = "figure")]
    pub sheet: f64,
    /// Distance from the sheet in standard deviations of its tolerance.
    #[serde(deserialize_with = "figure")]
    pub deviations_from_sheet: f64,
    /// Share of what is known of it that these recordings said.
    #[serde(deserialize_with = "figure")]
    pub information: f64,
    /// True where it stands on a bound.
    pub at_bound: bool,
}

impl From<&Fitted> for SheetParameter {
    fn from(one: &Fitted) -> Self {
        let Fitted { name: key, unit, value, sheet, position: deviations_from_sheet, information, at_bound } =
            one.clone();
        Self { key, unit, value, sheet, deviations_from_sheet, information, at_bound }
    }
}

impl From<SheetParameter> for Fitted {
    fn from(one: SheetParameter) -> Self {
        let SheetParameter { key: name, unit, value, sheet, deviations_from_sheet: position, information, at_bound } =
            one;
        Self { name, unit, value, sheet, position, information, at_bound }
    }
}

/// A report that cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// No JSON.
    #[error("expected a report of the schema {SCHEMA}: {0}")]
    Malformed(#[from] serde_json::Error),
    /// Another schema, or none.
    #[error("expected a report of the schema {SCHEMA}, found `{0}`; was it made by another version?")]
    Schema(String),
    /// A field that is missing or is none of those that may stand there.
    #[error(transparent)]
    Field(#[from] serde_path_to_error::Error<serde_json::Error>),
    /// Nothing by which a change would show.
    #[error(
        "{DIGESTS}: expected the SHA-256 of each section, found none: the report was changed, or is of an earlier program; make it again with \
         `govtwin diagnose`"
    )]
    Unsealed,
    /// A section that is not the one that was written.
    #[error(
        "{section}: expected what was written (SHA-256 {stated:.12}), found something else ({found:.12}): the report was changed; make it again \
         with `govtwin diagnose`"
    )]
    Changed {
        /// The section.
        section: String,
        /// The digest in the report.
        stated: String,
        /// The digest of what stands there.
        found: String,
    },
}

impl DiagnosisReport {
    /// A report that holds a verdict and nothing else.
    pub fn of_verdict(verdict: Verdict) -> Self {
        Self {
            schema: SCHEMA.to_owned(),
            verdict,
            judged_by: Setup::default(),
            location: GapLocation::default(),
            effects: Vec::new(),
            ranking: Vec::new(),
            gap: ReportedGap::default(),
            remainder: None,
            fitted_stage: None,
            experiments: Vec::new(),
            sheet_limits: None,
            seconds: None,
            notes: Vec::new(),
            evidence: ReportedEvidence::default(),
            provenance: None,
        }
    }

    /// The report of a diagnosis that took `seconds`, without curves.
    pub fn of(diagnosis: &Diagnosis, seconds: f64) -> Self {
        let Diagnosis { stages, blamed, ranking, gap, explained_fraction, experiments, part, .. } = diagnosis.clone();
        let [refitted, likeliest] = diagnosis.consistency.clone();
        let sets = diagnosis.sets.iter().cloned();
        let pairs = diagnosis.ambiguous_pairs.iter().cloned();
        Self {
            judged_by: diagnosis.setup,
            location: GapLocation {
                stage: diagnosis.stage,
                probability: stages.into_iter().map(|(stage, share)| (stage, Some(share))).collect(),
            },
            effects: blamed,
            ranking,
            gap: ReportedGap { signals: gap, explained_fraction },
            remainder: diagnosis.remainder.clone(),
            fitted_stage: part.as_ref().map(|part| part.figures.clone()),
            experiments,
            sheet_limits: diagnosis.sheet_limits.clone(),
            seconds: Some(seconds),
            notes: diagnosis.notes.clone(),
            evidence: ReportedEvidence {
                innovations: Innovations { refitted, likeliest },
                samples: diagnosis.samples,
                entropy_bits: diagnosis.entropy_bits,
                fault_sets: sets.map(|(effects, probability)| FaultSet { effects, probability }).collect(),
                table: diagnosis.table.clone(),
                transfers: diagnosis.transfers.clone(),
                parameters: diagnosis.parameters.iter().map(SheetParameter::from).collect(),
                tried: diagnosis.tried.clone(),
                channels: diagnosis.channels.clone(),
                detectable_sizes: diagnosis.detectable_sizes.clone(),
                ambiguous_pairs: pairs.map(|(a, b, likeness)| AmbiguousPair { a, b, likeness }).collect(),
                breakdowns: diagnosis.breakdowns.clone(),
                stage_tests: diagnosis.stage_tests.clone(),
                discrepancy_terms: diagnosis.discrepancy_terms.clone(),
                simulations: diagnosis.simulations,
                regret: diagnosis.regret.clone(),
                part,
                traces: Vec::new(),
            },
            ..Self::of_verdict(diagnosis.verdict)
        }
    }

    /// Reads a report.
    ///
    /// # Errors
    /// Where it is none of this schema, a field is missing or holds what cannot stand there, or it was changed; the error names the field.
    pub fn read(text: &str) -> Result<Self, ReportError> {
        Self::of_json(&serde_json::from_str(text)?)
    }

    /// The same of JSON.
    ///
    /// # Errors
    /// As [`DiagnosisReport::read`].
    pub fn of_json(report: &Value) -> Result<Self, ReportError> {
        let schema = report["schema"].as_str().unwrap_or_default();
        if schema != SCHEMA {
            return Err(ReportError::Schema(schema.to_owned()));
        }
        let read = serde_path_to_error::deserialize(report)?;
        unchanged(report)?;
        Ok(read)
    }

    /// The same as JSON, keys in the order of the alphabet, with digests.
    pub fn json(&self) -> Value {
        sealed(serde_json::to_value(self).unwrap_or_default())
    }
}

/// As far as a page shows it: the units are left out.
impl From<DiagnosisReport> for Diagnosis {
    fn from(report: DiagnosisReport) -> Self {
        let DiagnosisReport { location, evidence, gap, fitted_stage, .. } = report;
        let unit = Unit {
            parameters: Parameters::default(),
            tolerances: vec![],
            sensors: Sensors::default(),
            effects: vec![],
            own_effects: vec![],
            recorded: ChannelReadings::default(),
        };
        let share = |(stage, share): (Stage, Option<f64>)| (stage, share.unwrap_or(f64::NAN));
        let mut stages: Vec<(Stage, f64)> = location.probability.into_iter().map(share).collect();
        stages.sort_by(|a, b| b.1.total_cmp(&a.1));
        let figures = fitted_stage.unwrap_or_default();
        let setup = match &evidence.part {
            Some(part) if part.sheet => Setup::Stage,
            Some(_) => Setup::StageFree,
            None => report.judged_by,
        };
        Self {
            verdict: report.verdict,
            setup,
            stage: location.stage,
            stages,
            blamed: report.effects,
            ranking: report.ranking,
            gap: gap.signals,
            explained_fraction: gap.explained_fraction,
            remainder: report.remainder,
            experiments: report.experiments,
            entropy_bits: evidence.entropy_bits,
            refitted: unit.clone(),
            fitted: unit,
            parameters: evidence.parameters.into_iter().map(Fitted::from).collect(),
            channels: evidence.channels,
            detectable_sizes: evidence.detectable_sizes,
            sheet_limits: report.sheet_limits,
            ambiguous_pairs: evidence.ambiguous_pairs.into_iter().map(|one| (one.a, one.b, one.likeness)).collect(),
            breakdowns: evidence.breakdowns,
            stage_tests: evidence.stage_tests,
            discrepancy_terms: evidence.discrepancy_terms,
            tried: evidence.tried,
            transfers: evidence.transfers,
            sets: evidence.fault_sets.into_iter().map(|one| (one.effects, one.probability)).collect(),
            table: evidence.table,
            consistency: [evidence.innovations.refitted, evidence.innovations.likeliest],
            samples: evidence.samples,
            traces: evidence.traces,
            part: evidence.part.map(|part| StageOnly { figures, ..part }),
            notes: report.notes,
            simulations: evidence.simulations,
            regret: evidence.regret,
        }
    }
}
