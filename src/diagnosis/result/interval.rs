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
    #[must_use]
    pub fn is_bounded(self) -> bool {
        self.low.is_finite() && self.high.is_finite()
    }

    /// Of a share: whether it leaves everything open, from nothing to the whole.
    #[must_use]
    pub fn leaves_all_open(self) -> bool {
        self.low <= 0.0 && self.high >= 1.0
    }

    /// The same of a share, which is 1 at most, so many times as wide about its value.
    #[must_use]
    pub fn widened(self, times: f64) -> Self {
        let Self { value, low, high } = self;
        Self { value, low: (value - times * (value - low)).max(-1.0), high: (value + times * (high - value)).min(1.0) }
    }

    /// By how much the interval of a share would have to be widened to reach what came true; 0 where that is its value or beyond its bound of 1.
    #[must_use]
    pub fn falls_short(self, came_true: f64) -> f64 {
        let off = came_true.min(1.0) - self.value;
        let half = if off >= 0.0 { self.high - self.value } else { self.value - self.low };
        match off.abs() {
            off if off < 1e-9 || (self.high >= 1.0 && came_true >= self.value) => 0.0,
            off => off / half.max(1e-9),
        }
    }
}
