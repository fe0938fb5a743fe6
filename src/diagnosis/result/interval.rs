//! A value with the interval that is expected to hold it.

/// A value with the interval that holds the truth nine times in ten.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Interval {
    /// Best value.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Interval {
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
