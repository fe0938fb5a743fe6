//! How much the sheet limits a verdict, value by value.

use serde_json::{Value, json};

/// A value of the sheet that has a tolerance.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SheetValue {
    /// Its key in parameter files.
    pub key: String,
    /// Its unit.
    pub unit: &'static str,
    /// What the sheet says.
    pub sheet: f64,
    /// The ends of one standard deviation of its tolerance.
    pub tolerance: (f64, f64),
    /// Share of what is known of it that these recordings said, 0 to 1.
    pub information: f64,
    /// Bits that its true value is expected to take off what is open between the fault sets.
    pub bits: f64,
    /// Effects that it hides, most first, each with the ratio by which it would show sharper were this value known.
    pub hides: Vec<(String, f64)>,
}

/// How much the sheet's tolerances limit a verdict.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SheetLimits {
    /// Entropy of the posterior over the fitted fault sets, nothing unknown considered, bits.
    pub open_bits: f64,
    /// The key of the value to look up next; none where no value is expected to settle anything.
    pub look_up: Option<String>,
    /// The values, the most worth looking up first.
    pub values: Vec<SheetValue>,
}

impl SheetLimits {
    /// The value to look up next.
    #[must_use]
    pub fn next(&self) -> Option<&SheetValue> {
        let key = self.look_up.as_ref()?;
        self.values.iter().find(|value| value.key == *key)
    }

    /// As reports hold it.
    #[must_use]
    pub fn json(&self) -> Value {
        let value = |one: &SheetValue| {
            let hides: Vec<Value> = one.hides.iter().map(|(id, ratio)| json!({"id": id, "sharper": ratio})).collect();
            json!({
                "key": one.key, "unit": one.unit, "sheet": one.sheet, "tolerance": [one.tolerance.0, one.tolerance.1],
                "information": one.information, "bits": one.bits, "hides": hides,
            })
        };
        json!({
            "open_bits": self.open_bits,
            "look_up": self.look_up,
            "values": self.values.iter().map(value).collect::<Vec<_>>(),
        })
    }
}
