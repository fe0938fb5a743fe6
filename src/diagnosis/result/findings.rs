//! What stands behind a verdict: channels, visible sizes, the gap in parts, tests of stages, free terms and what was tried.

use serde::{Deserialize, Serialize};

use crate::model::discrepancy::Curve;
use crate::result::claims::Fitted;
use crate::result::interval::Interval;
use govtwin_model::effects::Stage;
use govtwin_model::signal::Signal;
use govtwin_model::stored::{LastingText, figure, lasting, no_figure, unbounded};

/// One channel of one recording, as found.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ChannelReport {
    /// Recording.
    pub recording: String,
    /// Signal.
    pub signal: Signal,
    /// Samples with a value.
    pub samples: usize,
    /// Typical rate, Hz.
    #[serde(deserialize_with = "figure")]
    pub rate_hz: f64,
    /// Smallest step between different values, signal unit.
    #[serde(deserialize_with = "figure")]
    pub step: f64,
    /// Noise from sample to sample where the unit stands still, signal unit; NaN where it never does.
    #[serde(deserialize_with = "figure")]
    pub noise: f64,
    /// What is wrong with it, in words; empty where nothing is.
    pub troubles: Vec<String>,
}

/// How well an effect could be seen at all.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DetectableSize {
    /// Effect.
    #[serde(deserialize_with = "lasting")]
    pub id: LastingText,
    /// Name of the parameter that sizes it.
    #[serde(deserialize_with = "lasting")]
    pub parameter: LastingText,
    /// Its unit.
    #[serde(deserialize_with = "lasting")]
    pub unit: LastingText,
    /// Smallest deviation from neutral that would stand out, in the parameter's unit; infinite where none would.
    #[serde(deserialize_with = "unbounded")]
    pub smallest: f64,
    /// The same if every value of the sheet were known.
    #[serde(rename = "smallest_with_known_sheet", default = "no_figure", deserialize_with = "unbounded")]
    pub with_known_sheet: f64,
    /// A moderate fault, as deviation from neutral.
    #[serde(deserialize_with = "figure")]
    pub typical: f64,
}

/// One part of a cut through the squared gap.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct BreakdownPart {
    /// What the part holds, in words.
    pub name: String,
    /// Samples in it.
    pub samples: usize,
    /// Share of the squared gap of the refitted twin; all parts of a cut sum to 1.
    #[serde(deserialize_with = "figure")]
    pub refitted: f64,
    /// The same for the twin with the effects, as a share of the refitted gap.
    #[serde(deserialize_with = "figure")]
    pub with_effects: f64,
}

/// One way of cutting the squared gap of one signal into parts.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Breakdown {
    /// Which signal.
    pub signal: Signal,
    /// By what: process, phase, direction, spool band, end zones, ESV.
    #[serde(deserialize_with = "lasting")]
    pub by: LastingText,
    /// The parts; together they are the whole.
    pub parts: Vec<BreakdownPart>,
}

/// A stage driven by the recorded signals at its input.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StageTest {
    /// What is driven, in words.
    #[serde(deserialize_with = "lasting")]
    pub stage: LastingText,
    /// Signal that it is judged by.
    pub signal: Signal,
    /// Zero error taken off the fed spool first, pu.
    #[serde(deserialize_with = "figure")]
    pub zero_error_pu: f64,
    /// RMS error, signal unit.
    #[serde(deserialize_with = "figure")]
    pub rmse: f64,
    /// Residuals made white: mean square, 1 where only noise is left.
    #[serde(deserialize_with = "figure")]
    pub excess: f64,
}

/// A free term placed in one equation: how much it would explain, and what it looks like.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct DiscrepancyTerm {
    /// Where it stands, in words.
    #[serde(deserialize_with = "lasting")]
    pub place: LastingText,
    /// Stage.
    pub stage: Stage,
    /// Unit of the term.
    #[serde(deserialize_with = "lasting")]
    pub unit: LastingText,
    /// Share of the gap beyond noise that it would explain.
    #[serde(deserialize_with = "figure")]
    pub explains: f64,
    /// Its shape against what it depends on.
    pub curves: Vec<Curve>,
}

/// An effect tried alone on top of the refitted twin.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Tried {
    /// Ids, one or more.
    #[serde(rename = "effects")]
    pub ids: Vec<String>,
    /// By how much the cost fell, prior included.
    #[serde(deserialize_with = "figure")]
    pub gain: f64,
    /// The same on data left out of the fit.
    #[serde(deserialize_with = "figure")]
    pub held_out_gain: f64,
    /// Fitted parameters.
    pub parameters: Vec<Fitted>,
}

/// How far the gap of a recording closes when the fit has not seen it.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Transfer {
    /// Recording.
    pub recording: String,
    /// Explained fraction on it.
    #[serde(rename = "closure")]
    pub explained_fraction: Interval,
}
