//! What a diagnosis of a servomotor stage alone says beside the verdict.

use serde::{Deserialize, Serialize};

use crate::result::interval::Interval;
use govtwin_model::stored::{LastingText, ends, figure, lasting};

/// A parameter of a plain model, in the units of the recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelParameter {
    /// What it is.
    #[serde(deserialize_with = "lasting")]
    pub name: LastingText,
    /// Its value, in the unit.
    #[serde(deserialize_with = "figure")]
    pub value: f64,
    /// Its 90 % interval; not numbers where there is none, as of an older program.
    #[serde(rename = "ci90", default = "unknown_ends", deserialize_with = "ends")]
    pub ends: (f64, f64),
    /// Its unit, in words.
    pub unit: String,
}

fn unknown_ends() -> (f64, f64) {
    (f64::NAN, f64::NAN)
}

/// A model in free runs over pieces that it was not fitted to: each half of the recordings is fitted in turn and the other predicted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ComparedModel {
    /// The model: a plain one by its name, a twin by the ids of its effects, empty for the recalibrated one.
    pub model: String,
    /// Whether it is a plain model, which knows nothing of a servomotor.
    pub is_plain: bool,
    /// Parameters of a plain model, fitted to all recordings; those of a twin stand in `effects`, `fitted_stage` and `evidence.parameters`.
    pub parameters: Vec<ModelParameter>,
    /// RMS error of the servomotor over all pieces, each held out, pu.
    #[serde(rename = "held_out_rmse_pu", deserialize_with = "figure")]
    pub held_out: f64,
    /// The same over the pieces of either half, pu.
    #[serde(rename = "half_rmse_pu")]
    pub halves: [f64; 2],
    /// The same in each piece, pu.
    #[serde(rename = "piece_rmse_pu")]
    pub pieces: Vec<f64>,
}

/// One figure of a fitted stage, in the numbers of its recordings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageFigure {
    /// Its id in reports.
    #[serde(deserialize_with = "lasting")]
    pub id: LastingText,
    /// What it is.
    #[serde(rename = "words", deserialize_with = "lasting")]
    pub title: LastingText,
    /// Its unit, as recorded.
    #[serde(deserialize_with = "lasting")]
    pub unit: LastingText,
    /// Value and interval.
    #[serde(flatten)]
    pub value: Interval,
}

/// What to know of a diagnosis of a part of the chain.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StageOnly {
    /// Whether a data sheet was given; without one everything is fitted freely.
    #[serde(rename = "data_sheet")]
    pub sheet: bool,
    /// Number of pieces that the recordings were cut into.
    pub pieces: usize,
    /// Length of a piece, s.
    #[serde(deserialize_with = "figure")]
    pub piece_s: f64,
    /// What was fitted, in the numbers of the recordings.
    #[serde(skip)]
    pub figures: Vec<StageFigure>,
    /// RMS residual of a right model over a piece, due to the transducers alone, pu of stroke.
    #[serde(rename = "transducers_rmse_pu", deserialize_with = "figure")]
    pub transducers_pu: f64,
    /// Why the recordings are of no such stage; none where they are.
    #[serde(rename = "of_no_such_stage")]
    pub foreign: Option<String>,
    /// Length of a free run, s.
    #[serde(deserialize_with = "figure")]
    pub free_run_s: f64,
    /// The models beside each other on the same held-out pieces; empty of an older program.
    #[serde(default)]
    pub models: Vec<ComparedModel>,
    /// The plain model that predicts better than any twin; none where none does.
    #[serde(default)]
    pub plain_wins: Option<String>,
    /// The plain model of the stage's own law that errs less than the twin of the verdict, though what differs between pieces may be chance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plain_as_good: Option<String>,
    /// What drives the plain models: spool or command.
    #[serde(default)]
    pub driven_by: String,
}
