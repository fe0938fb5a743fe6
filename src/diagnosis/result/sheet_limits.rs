//! How much the sheet limits a verdict, value by value.

use serde::{Deserialize, Serialize};

use govtwin_model::stored::{LastingText, ends, figure, lasting};

/// A value of the sheet that has a tolerance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SheetValue {
    /// Its key in parameter files.
    pub key: String,
    /// Its unit.
    #[serde(deserialize_with = "lasting")]
    pub unit: LastingText,
    /// What the sheet says.
    #[serde(deserialize_with = "figure")]
    pub sheet: f64,
    /// The ends of one standard deviation of its tolerance.
    #[serde(deserialize_with = "ends")]
    pub tolerance: (f64, f64),
    /// Share of what is known of it that these recordings said, 0 to 1.
    #[serde(deserialize_with = "figure")]
    pub information: f64,
    /// Bits that its true value is expected to take off what is open between the fault sets.
    #[serde(deserialize_with = "figure")]
    pub bits: f64,
    /// Effects that it hides, most first.
    pub hides: Vec<HiddenEffect>,
}

/// An effect that a value of the sheet hides.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct HiddenEffect {
    /// Its id.
    pub id: String,
    /// The ratio by which it would show sharper were the value known.
    #[serde(deserialize_with = "figure")]
    pub sharper: f64,
}

/// How much the sheet's tolerances limit a verdict.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SheetLimits {
    /// Entropy of the posterior over the fitted fault sets, nothing unknown considered, bits.
    #[serde(deserialize_with = "figure")]
    pub open_bits: f64,
    /// The key of the value to look up next; none where no value is expected to settle anything.
    pub look_up: Option<String>,
    /// The values, the most worth looking up first.
    pub values: Vec<SheetValue>,
}

impl SheetLimits {
    /// The value to look up next.
    pub fn next(&self) -> Option<&SheetValue> {
        let key = self.look_up.as_ref()?;
        self.values.iter().find(|value| value.key == *key)
    }
}
