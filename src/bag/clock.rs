//! The clock of the stamps against the recorder's: how far ahead, and whether one of them runs faster.

use govtwin_model::metrics::median;
use govtwin_model::units::seconds_from_nanos;

/// Blocks into which a recording is divided; the least delay of a block is that of a message which nothing held up.
const BLOCKS: usize = 64;

/// Fewer blocks than this determine no slope.
const FEWEST_BLOCKS: usize = 8;

/// The least delay among messages that follow each other.
#[derive(Clone, Copy, Debug)]
struct DelayBlock {
    stamp_ns: i64,
    delay_ns: i64,
    messages: u64,
}

/// What the stamps of one stream show, message by message.
#[derive(Clone, Debug)]
pub(super) struct Clock {
    blocks: Vec<DelayBlock>,
    /// Messages that make a block.
    size: u64,
    first_ns: Option<i64>,
    last_ns: i64,
    /// Messages recorded before their stamp by more than [`Clock::AHEAD_NS`].
    pub(super) ahead: u64,
    /// By how much at most, ns.
    pub(super) most_ahead_ns: i64,
}

/// How stamps and the time of recording drift apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drift {
    /// Seconds of the recorder for each of the stamps, less one.
    pub(super) rate_excess: f64,
    /// How far the two drifted apart over the recording, s; above 0 where the recorder's clock is the faster one.
    pub(super) shift_s: f64,
    /// How far the least delays are from a straight line, their median, s.
    pub(super) scatter_s: f64,
}

impl Default for Clock {
    fn default() -> Self {
        Self { blocks: vec![], size: 1, first_ns: None, last_ns: 0, ahead: 0, most_ahead_ns: 0 }
    }
}

impl Clock {
    /// Clocks that are kept by NTP agree better than this, ns.
    pub(super) const AHEAD_NS: i64 = 10_000_000;

    /// The first and the last stamp.
    pub(super) fn span_ns(&self) -> Option<[i64; 2]> {
        self.first_ns.map(|first_ns| [first_ns, self.last_ns])
    }

    pub(super) fn push(&mut self, stamp_ns: i64, log_time_ns: i64) {
        let delay_ns = log_time_ns.saturating_sub(stamp_ns);
        self.first_ns = self.first_ns.or(Some(stamp_ns));
        self.last_ns = stamp_ns;
        if delay_ns < -Self::AHEAD_NS {
            self.ahead += 1;
            self.most_ahead_ns = self.most_ahead_ns.max(delay_ns.saturating_neg());
        }
        if let Some(block) = self.blocks.last_mut().filter(|block| block.messages < self.size) {
            block.messages += 1;
            if delay_ns < block.delay_ns {
                (block.stamp_ns, block.delay_ns) = (stamp_ns, delay_ns);
            }
            return;
        }
        if self.blocks.len() == BLOCKS {
            self.size *= 2;
            let pairs = self.blocks.chunks(2).filter_map(|pair| {
                let least = pair.iter().min_by_key(|block| block.delay_ns)?;
                Some(DelayBlock { messages: pair.iter().map(|block| block.messages).sum(), ..*least })
            });
            self.blocks = pairs.collect();
        }
        self.blocks.push(DelayBlock { stamp_ns, delay_ns, messages: 1 });
    }

    /// The least time from stamp to recording, s: that of a message which nothing held up.
    pub(super) fn least_delay_s(&self) -> Option<f64> {
        self.blocks.iter().map(|block| block.delay_ns).min().map(seconds_from_nanos)
    }

    /// The drift, by the median of the slopes between all blocks (Theil 1950, Sen 1968).
    pub(super) fn drift(&self) -> Option<Drift> {
        let first_ns = self.first_ns?;
        let whole = self.blocks.iter().filter(|block| block.messages == self.size);
        let points: Vec<[f64; 2]> = whole
            .map(|block| [block.stamp_ns.saturating_sub(first_ns), block.delay_ns].map(seconds_from_nanos))
            .collect();
        if points.len() < FEWEST_BLOCKS {
            return None;
        }
        let pairs = points.iter().enumerate().flat_map(|(k, a)| points[..k].iter().map(move |b| (a, b)));
        let slope = median(pairs.filter(|(a, b)| a[0] > b[0]).map(|(a, b)| (a[1] - b[1]) / (a[0] - b[0])).collect());
        let level = median(points.iter().map(|point| point[1] - slope * point[0]).collect());
        let scatter_s = median(points.iter().map(|point| (point[1] - slope * point[0] - level).abs()).collect());
        let span_s = seconds_from_nanos(self.last_ns.saturating_sub(first_ns));
        slope.is_finite().then_some(Drift { rate_excess: slope, shift_s: slope * span_s, scatter_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drift_is_found_under_delays_and_none_is_made_up() {
        for ppm in [0.0, 40.0, -150.0] {
            let mut clock = Clock::default();
            for step in 0..100_000_i64 {
                let stamp_ns = 1_700_000_000_000_000_000 + step * 10_000_000;
                let drift_ns = (step as f64 * 10_000_000.0 * ppm * 1e-6) as i64;
                // Most messages are held up, some of them long.
                let held_ns = 200_000 + (step * 7919 % 1009) * 3_000;
                clock.push(stamp_ns, stamp_ns + 1_000_000_000 + drift_ns + held_ns);
            }
            let drift = clock.drift().unwrap();
            assert!(
                (drift.rate_excess * 1e6 - ppm).abs() < 1.0 && (drift.shift_s - ppm * 1e-3).abs() < 2e-3,
                "{drift:?}"
            );
            assert!(drift.scatter_s < 1e-3 && clock.ahead == 0, "{drift:?}");
        }
        assert_eq!(Clock::default().drift(), None);
    }
}
