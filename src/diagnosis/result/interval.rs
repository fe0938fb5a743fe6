//! A value with the interval that is expected to hold it.

use serde::{Deserialize, Serialize};

use govtwin_model::stored::{ends, figure};

/// A value with the interval that holds the truth nine times in ten.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "IntervalForm", into = "IntervalForm")]
pub struct Interval {
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// The same as reports hold it.
#[derive(Serialize, Deserialize)]
struct IntervalForm {
    #[serde(deserialize_with = "figure")]
    value: f64,
    #[serde(deserialize_with = "ends")]
    ci90: (f64, f64),
}

impl From<IntervalForm> for Interval {
    fn from(IntervalForm { value, ci90: (low, high) }: IntervalForm) -> Self {
        Self { value, low, high }
    }
}

impl From<Interval> for IntervalForm {
    fn from(Interval { value, low, high }: Interval) -> Self {
        Self { value, ci90: (low, high) }
    }
}

/// Nothing is known of it.
impl Default for Interval {
    fn default() -> Self {
        Self { value: f64::NAN, low: f64::NAN, high: f64::NAN }
    }
}

impl Interval {
    /// Whether it has both ends.
    pub fn is_bounded(self) -> bool {
        self.low.is_finite() && self.high.is_finite()
    }

    /// Of a share: whether it leaves everything open, from nothing to the whole.
    pub fn leaves_all_open(self) -> bool {
        self.low <= 0.0 && self.high >= 1.0
    }
}
