//! How two quantities go together, in memory that does not grow.

/// Sums for a correlation, about running means, so that a pressure in Pa loses no digits.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Correlation {
    pub(crate) pairs: f64,
    x: f64,
    y: f64,
    xx: f64,
    /// Squares of the second about its mean.
    pub(crate) yy: f64,
    xy: f64,
}

impl Correlation {
    pub(crate) fn take(&mut self, x: f64, y: f64) {
        self.pairs += 1.0;
        let (dx, dy) = (x - self.x, y - self.y);
        self.x += dx / self.pairs;
        self.y += dy / self.pairs;
        self.xx += dx * (x - self.x);
        self.yy += dy * (y - self.y);
        self.xy += dx * (y - self.y);
    }

    /// −1 to 1; 0 where one side stands still.
    pub(crate) fn value(&self) -> f64 {
        let scale = (self.xx * self.yy).sqrt();
        if scale > 0.0 { self.xy / scale } else { 0.0 }
    }
}
