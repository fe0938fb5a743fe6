//! What a verdict claims: effects and their sizes, the gap and how much of it they close, and the next test.

use serde::{Deserialize, Serialize};

use crate::result::interval::Interval;
use crate::result::test_script::TestScript;
use govtwin_model::effects::{EffectSpec, Stage};
use govtwin_model::signal::Signal;
use govtwin_model::stored::{LastingText, figure, lasting, no_figure};

/// The file beside the report that holds the best test as a script.
pub const NEXT_TEST: &str = "next_test.mcap";

/// A parameter as fitted.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Fitted {
    /// Name with its unit suffix; for the sheet's parameters the key of parameter files.
    pub name: String,
    /// Unit.
    #[serde(deserialize_with = "lasting")]
    pub unit: LastingText,
    /// Fitted value, in the unit.
    #[serde(flatten)]
    pub value: Interval,
    /// Value of the sheet, or the neutral value of an effect.
    #[serde(skip, default = "no_figure")]
    pub sheet: f64,
    /// Distance from the sheet in standard deviations of its tolerance, or from neutral in typical sizes.
    #[serde(skip, default = "no_figure")]
    pub position: f64,
    /// Share of what is known of it that these recordings said: 0 where the tolerance alone speaks, 1 where the recordings do.
    #[serde(skip, default = "no_figure")]
    pub information: f64,
    /// True where it stands on a bound.
    #[serde(default)]
    pub at_bound: bool,
}

/// An effect that the verdict blames, or a rival in a class.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Blame {
    /// Its id.
    pub id: String,
    /// Where it sits.
    pub stage: Stage,
    /// Probability that it is present.
    #[serde(deserialize_with = "figure")]
    pub probability: f64,
    /// Its fitted parameters.
    pub parameters: Vec<Fitted>,
    /// Share of the gap that it closes on its own, on other recordings of the unit.
    #[serde(rename = "closure")]
    pub explained_fraction: Interval,
    /// What it closes on top of the other of two effects; none where it is not one of two.
    #[serde(rename = "closure_last_in")]
    pub last_in: Option<f64>,
    /// Its Shapley share of what both explain together: the mean over the orders in which they may come (Shapley 1953).
    #[serde(rename = "closure_shapley")]
    pub shapley: Option<f64>,
}

impl Blame {
    /// An effect of whose size nothing is known, nor of its share of the gap.
    pub fn unsized_effect(spec: &EffectSpec, probability: f64) -> Self {
        Self {
            id: spec.id.to_owned(),
            stage: spec.stage,
            probability,
            parameters: Vec::new(),
            explained_fraction: Interval::default(),
            last_in: None,
            shapley: None,
        }
    }
}

/// One row of the ranking.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Ranked {
    /// An effect's id, `unknown` or `none`.
    pub id: String,
    /// Probability.
    #[serde(deserialize_with = "figure")]
    pub probability: f64,
}

/// The gap in one signal.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(from = "GapForm", into = "GapForm")]
pub struct SignalGap {
    /// Which signal.
    pub signal: Signal,
    /// What a right twin would still leave, RMS in the signal's unit.
    pub noise_floor: f64,
    /// RMS error with the sheet's values.
    pub delivered: f64,
    /// RMS error after refitting within tolerances.
    pub refitted: f64,
    /// RMS error with the blamed effects.
    pub with_effects: f64,
}

/// A test that is expected to take something off the posterior's entropy.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Experiment {
    /// The two hypotheses that it tells apart most: ids of effects joined by `+`, `none`, or `unknown:STAGE`.
    pub separates: Vec<String>,
    /// What to do, in words.
    pub test: String,
    /// Expected distance between their answers beyond what parameters may hide, in standard deviations.
    #[serde(deserialize_with = "figure")]
    pub separation: f64,
    /// Bits that it takes off the entropy at least.
    #[serde(deserialize_with = "figure")]
    pub expected_drop_bits: f64,
    /// The same at most.
    #[serde(rename = "expected_drop_at_most_bits", deserialize_with = "figure")]
    pub at_most_bits: f64,
    /// Entropy of the posterior now, bits.
    #[serde(deserialize_with = "figure")]
    pub entropy_bits: f64,
    /// Bits that it takes off for each minute.
    #[serde(deserialize_with = "figure")]
    pub bits_per_minute: f64,
    /// Length, s.
    #[serde(deserialize_with = "figure")]
    pub length_s: f64,
    /// Trips of the emergency shutdown valve.
    pub trips: u32,
    /// The state of the unit and what to bring it to first.
    pub unit_state: String,
    /// Signals to record.
    #[serde(rename = "record")]
    pub records: Vec<Signal>,
    /// Samples a second.
    #[serde(deserialize_with = "figure")]
    pub rate_hz: f64,
    /// Command and ESV over time, where the test can be sent to a governor.
    #[serde(default)]
    pub script: Option<TestScript>,
    /// The bag beside the report that holds the script; of the first test alone.
    pub bag: Option<String>,
}

/// The same as reports hold it. A learned residual is no part of a diagnosis; `replay --residual` tells what one leaves on top of `fitted.yaml`.
#[derive(Serialize, Deserialize)]
struct GapForm {
    name: Signal,
    #[serde(deserialize_with = "figure")]
    noise_floor: f64,
    rmse: RmseForm,
}

#[derive(Serialize, Deserialize)]
struct RmseForm {
    #[serde(deserialize_with = "figure")]
    delivered: f64,
    #[serde(deserialize_with = "figure")]
    refitted: f64,
    #[serde(deserialize_with = "figure")]
    with_effects: f64,
    #[serde(default)]
    with_residual: Option<f64>,
}

impl From<GapForm> for SignalGap {
    fn from(GapForm { name: signal, noise_floor, rmse }: GapForm) -> Self {
        let RmseForm { delivered, refitted, with_effects, .. } = rmse;
        Self { signal, noise_floor, delivered, refitted, with_effects }
    }
}

impl From<SignalGap> for GapForm {
    fn from(SignalGap { signal: name, noise_floor, delivered, refitted, with_effects }: SignalGap) -> Self {
        Self { name, noise_floor, rmse: RmseForm { delivered, refitted, with_effects, with_residual: None } }
    }
}
