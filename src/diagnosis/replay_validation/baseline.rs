//! A stored replay as a limit: no figure of the new one may be worse by more than a share.

use serde::Deserialize;

use govtwin_model::replay::figures::SignalFigures;
use govtwin_model::signal::Signal;

use super::{Check, Measure, Side, figures_of, short_name};
use crate::replay_summary::{RecordingFigures, ReplaySummary, SCHEMA};

/// The figures that are compared: errors, which are worse where they are larger.
const MEASURES: [Measure; 3] = [Measure::Mae, Measure::Rmse, Measure::Max];

/// A file that is no baseline of this replay.
#[derive(Debug, thiserror::Error)]
pub enum BaselineError {
    /// It is no replay.
    #[error("expected the replay.json of an earlier `govtwin replay --out`: {0}")]
    Json(#[from] serde_json::Error),
    /// Of another schema.
    #[error("expected the schema {SCHEMA}, found `{0}`")]
    Schema(String),
    /// Made otherwise.
    #[error("it was made with {option} {found}, this replay with {expected}; make both alike")]
    Option {
        /// Option of the command line.
        option: &'static str,
        /// That of the baseline.
        found: String,
        /// That of the new replay.
        expected: String,
    },
    /// A corrected replay against one that is not.
    #[error(
        "it was made without --residual, and this replay judges corrected figures; make a baseline with --residual"
    )]
    Uncorrected,
}

/// The figures of an earlier replay.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Baseline {
    schema: String,
    cut: String,
    inputs_between_samples: String,
    recordings: Vec<Recorded>,
    processes: Vec<Group>,
    overall: Group,
    residual: Option<Groups>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Recorded {
    name: String,
    process: String,
    signals: Vec<Figures>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Group {
    process: Option<String>,
    signals: Vec<Figures>,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Groups {
    processes: Vec<Group>,
    overall: Group,
}

#[derive(Clone, Debug, PartialEq, Deserialize)]
struct Figures {
    name: String,
    mae: Option<f64>,
    rmse: Option<f64>,
    max_abs: Option<f64>,
}

impl Figures {
    fn of(&self, measure: Measure) -> Option<f64> {
        match measure {
            Measure::Mae => self.mae,
            Measure::Rmse => self.rmse,
            Measure::Max => self.max_abs,
            Measure::Bias | Measure::R2 => None,
        }
    }
}

impl Baseline {
    /// Reads the text of a `replay.json`.
    ///
    /// # Errors
    /// On a text that is no replay.
    pub fn read(text: &[u8]) -> Result<Self, BaselineError> {
        let baseline: Self = serde_json::from_slice(text)?;
        if baseline.schema != SCHEMA {
            return Err(BaselineError::Schema(baseline.schema));
        }
        Ok(baseline)
    }

    /// The baseline of a replay with this cut, these inputs between samples, and with or without a residual.
    ///
    /// # Errors
    /// If it was made otherwise.
    pub fn of_replay(self, cut: &str, inputs: &str, is_corrected: bool) -> Result<Self, BaselineError> {
        let mut baseline = self;
        let options = [("--cut", &baseline.cut, cut), ("--rate-of-inputs", &baseline.inputs_between_samples, inputs)];
        for (option, found, expected) in options {
            if found != expected {
                return Err(BaselineError::Option { option, found: found.clone(), expected: expected.to_owned() });
            }
        }
        if is_corrected {
            let Groups { processes, overall } = baseline.residual.take().ok_or(BaselineError::Uncorrected)?;
            // A replay keeps the corrected figures of processes only.
            baseline = Self { recordings: Vec::new(), processes, overall, ..baseline };
        }
        Ok(baseline)
    }

    /// Each error of the baseline as the limit of the new one: of recordings that both have, of every process, and overall.
    pub(super) fn checks(&self, summary: &ReplaySummary, worse_by: f64) -> Vec<Check> {
        let mut checks = Vec::new();
        for old in &self.recordings {
            let is_same = |one: &&RecordingFigures| one.name == old.name && one.process == old.process;
            if let Some(at) = summary.recordings.iter().position(|one| is_same(&one)) {
                let new = |signal| figures_of(&summary.recordings[at].signals, signal);
                let found = compare(&old.name, &old.signals, worse_by, new);
                checks.extend(found.into_iter().map(|check| Check { recording: Some(at), ..check }));
            }
        }
        for old in self.processes.iter().chain([&self.overall]) {
            let groups = summary.processes.iter().chain([&summary.overall]);
            let group = groups.into_iter().find(|group| group.process == old.process.as_deref());
            let new = |signal| group.and_then(|group| group.of(signal));
            checks.extend(compare(old.process.as_deref().unwrap_or("overall"), &old.signals, worse_by, new));
        }
        checks
    }
}

fn compare<'a>(
    of: &str,
    old: &[Figures],
    worse_by: f64,
    new: impl Fn(Signal) -> Option<&'a SignalFigures>,
) -> Vec<Check> {
    let mut checks = Vec::new();
    for signal in Signal::ALL {
        let Some(old) = old.iter().find(|figures| figures.name == signal.id()) else { continue };
        for measure in MEASURES {
            // What the baseline does not show limits nothing.
            let Some(was) = old.of(measure) else { continue };
            let limit = format!(
                "{}.{} of the baseline + {} %",
                short_name(signal),
                measure.id(),
                govtwin_model::number::significant(100.0 * worse_by, 3)
            );
            let bound = was * (1.0 + worse_by);
            checks.push(Check::of(of.to_owned(), limit, (signal, measure, Side::AtMost, bound), new(signal)));
        }
    }
    checks
}
