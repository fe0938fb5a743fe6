//! The past of a row on the training period's grid, whatever the rate at which rows arrive.
//!
//! The rule of resampling: tap `k` of a row at time `t` is the row nearest to `t − k·T`, `T` the training period. A
//! model trained on 5 Hz rows therefore sees, at every step of a 1 kHz node, the past 0.2 s, 0.4 s … ago, and where
//! rows arrive every `T` the taps are the rows themselves. Before its first row a history holds that row; a pause of
//! more than 2.5 periods, or a step back in time, begins a new one, so that no window reaches across recordings.

use super::row::{ChannelRow, RowChannel};

/// Taps of the past besides the present one.
pub(crate) const PAST: usize = 10;

/// Rows nearer than this to the last kept one are not kept: the twin itself steps every millisecond, ns.
const NEAREST_NS: i64 = 900_000;

/// The shortest training period, ns.
pub const SHORTEST_PERIOD_NS: i64 = 2_000_000;

/// The longest training period, ns: keeps the memory of a history below 3 MB.
pub const LONGEST_PERIOD_NS: i64 = 2_000_000_000;

/// The present row and the past ones, `taps[k]` lying `k` periods back.
pub type Taps = [ChannelRow; PAST + 1];

/// Rows of the last few periods, in memory that is taken once.
#[derive(Clone, Debug)]
pub struct History {
    period_ns: i64,
    times_ns: Vec<i64>,
    rows: Vec<ChannelRow>,
    /// Rows kept since the beginning; row `n` lies at `n` modulo the capacity.
    kept: usize,
    cursors: [usize; PAST],
    last_ns: Option<i64>,
    taps: Taps,
}

impl History {
    /// An empty history on a grid of `period_ns`, which is brought into the range that a history holds.
    pub fn new(period_ns: i64) -> Self {
        let period_ns = period_ns.clamp(SHORTEST_PERIOD_NS, LONGEST_PERIOD_NS);
        // One period more than the taps reach, since the nearest row may lie before its instant.
        let capacity =
            usize::try_from((i64::try_from(PAST).unwrap_or(0) + 3) * period_ns / NEAREST_NS).unwrap_or(0) + 4;
        let row = [0.0; RowChannel::ALL.len()];
        Self {
            period_ns,
            times_ns: vec![0; capacity],
            rows: vec![row; capacity],
            kept: 0,
            cursors: [0; PAST],
            last_ns: None,
            taps: [row; PAST + 1],
        }
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        self.last_ns = None;
        self.kept = 0;
        self.cursors = [0; PAST];
    }

    /// Takes a row and gives the taps for it. Allocates nothing.
    pub fn push(&mut self, time_ns: i64, row: &ChannelRow) -> &Taps {
        let pause_ns = self.last_ns.map_or(0, |last_ns| time_ns.saturating_sub(last_ns));
        if self.last_ns.is_none() || pause_ns < 0 || pause_ns > self.period_ns * 5 / 2 {
            self.reset();
        }
        self.last_ns = Some(time_ns);
        let capacity = self.times_ns.len();
        if self.kept == 0 || time_ns - self.times_ns[(self.kept - 1) % capacity] >= NEAREST_NS {
            self.times_ns[self.kept % capacity] = time_ns;
            self.rows[self.kept % capacity] = *row;
            self.kept += 1;
        }
        self.taps[0] = *row;
        let oldest = self.kept.saturating_sub(capacity);
        let mut target_ns = time_ns;
        for (cursor, tap) in self.cursors.iter_mut().zip(&mut self.taps[1..]) {
            target_ns = target_ns.saturating_sub(self.period_ns);
            *cursor = (*cursor).max(oldest);
            let distance_ns = |at: usize| (self.times_ns[at % capacity] - target_ns).abs();
            while *cursor + 1 < self.kept && distance_ns(*cursor + 1) <= distance_ns(*cursor) {
                *cursor += 1;
            }
            *tap = self.rows[*cursor % capacity];
        }
        &self.taps
    }
}

#[cfg(test)]
mod tests {
    use super::{History, PAST};
    use crate::row::{ChannelRow, RowChannel};

    const MS: i64 = 1_000_000;

    fn row(value: f64) -> ChannelRow {
        [value; RowChannel::ALL.len()]
    }

    #[test]
    fn taps_lie_whole_periods_back_at_any_rate() {
        for step_ms in [1_i64, 5, 10, 200] {
            let mut history = History::new(200 * MS);
            let mut time_ms = 0;
            while time_ms <= 6000 {
                let taps = *history.push(time_ms * MS, &row(time_ms as f64));
                for (k, tap) in taps.iter().enumerate() {
                    let expected = (time_ms - 200 * i64::try_from(k).unwrap()).max(0);
                    assert_eq!(tap[0], expected as f64, "every {step_ms} ms, tap {k} at {time_ms} ms");
                }
                time_ms += step_ms;
            }
        }
    }

    #[test]
    fn stamps_that_jitter_change_no_tap() {
        let mut history = History::new(200 * MS);
        for k in 0_i64..60 {
            let jitter_ns = [0, 7, -9, 3, -4][usize::try_from(k % 5).unwrap()] * MS;
            let taps = *history.push(k * 200 * MS + jitter_ns, &row(k as f64));
            for (back, tap) in (0_i64..).zip(&taps) {
                assert_eq!(tap[0], (k - back).max(0) as f64);
            }
        }
    }

    #[test]
    fn a_pause_or_a_step_back_begins_anew() {
        let mut history = History::new(200 * MS);
        for k in 0..20 {
            history.push(k * 200 * MS, &row(1.0));
        }
        let taps = *history.push(20 * 200 * MS + 400 * MS, &row(2.0));
        assert!(taps.iter().all(|tap| tap[0] == 2.0), "after a pause");
        let taps = *history.push(0, &row(3.0));
        assert!(taps.iter().all(|tap| tap[0] == 3.0), "after a step back");
        assert_eq!(taps.len(), PAST + 1);
    }

    #[test]
    fn rows_far_denser_than_the_twin_steps_do_not_push_the_past_out() {
        let mut history = History::new(10 * MS);
        for k in 0_i64..200_000 {
            let taps = *history.push(k * 1000, &row(k as f64 * 1e-3));
            if k > 150_000 {
                for (back, tap) in (0_i64..).zip(&taps) {
                    assert!((tap[0] - (k as f64 * 1e-3 - 10.0 * back as f64)).abs() < 0.6, "tap {back} at {k}");
                }
            }
        }
    }
}
