//! A value that stays somewhere: since when, for how long, and between which limits.

use govtwin_model::units::seconds_from_nanos;

/// A value from the row on at which it came there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stay {
    pub(super) since_ns: i64,
    last_ns: i64,
    pub(super) samples: u64,
    pub(super) first: f64,
    pub(super) last: f64,
    pub(super) least: f64,
    pub(super) most: f64,
}

impl Stay {
    pub(super) const fn new(time_ns: i64, value: f64) -> Self {
        Self { since_ns: time_ns, last_ns: time_ns, samples: 1, first: value, last: value, least: value, most: value }
    }

    /// The same with one more row.
    pub(super) fn with(self, time_ns: i64, value: f64) -> Self {
        let (least, most) = (self.least.min(value), self.most.max(value));
        Self { last_ns: time_ns, samples: self.samples + 1, last: value, least, most, ..self }
    }

    /// Whether a value is no farther than this from the first; one that was not recorded is.
    pub(super) fn holds(&self, value: f64, band: f64) -> bool {
        value.is_nan() || (value - self.first).abs() <= band
    }

    /// The same with one more row where that holds, else one that begins with it.
    pub(super) fn within(self, time_ns: i64, value: f64, band: f64) -> Self {
        if self.holds(value, band) { self.with(time_ns, value) } else { Self::new(time_ns, value) }
    }

    /// Greatest less least.
    pub(super) fn span(&self) -> f64 {
        self.most - self.least
    }

    /// From its first to its last row, s.
    pub(super) fn lasted_s(&self) -> f64 {
        seconds_from_nanos(self.last_ns.saturating_sub(self.since_ns))
    }
}
