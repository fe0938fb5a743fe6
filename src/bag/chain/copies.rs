//! Whether one of command and position is the other of some time before, to the bit.

use std::collections::VecDeque;

use govtwin_model::units::seconds_from_nanos;

use super::impossible::Impossible;

/// Rows back that are compared: 0.6 s at 100 Hz, more at less.
const MOST_ROWS: usize = 64;
/// The share of changes, and the least number of them, that make a copy.
const COPY_SHARE: f64 = 0.95;
const COPY_CHANGES: u64 = 50;
/// Values that are whole multiples of this, pu, may be equal because they were rounded.
const ROUNDED_PU: f64 = 1e-4;

/// A signal that may be another of some rows before.
#[derive(Clone, Debug, Default)]
pub(super) struct CopyWatch {
    /// Values of the other with their times, ns, the newest last.
    recent: VecDeque<(i64, u64)>,
    last: u64,
    /// Changes of the signal to a value that no rounding explains.
    changes: u64,
    /// How many of them equal the other so many rows before, and the times between, s, summed up.
    hits: Vec<(u64, f64)>,
}

impl CopyWatch {
    /// Takes a row of the signal and of the other.
    pub(super) fn take(&mut self, time_ns: i64, value: f64, other: f64) {
        let bits = value.to_bits();
        if bits != self.last && !is_rounded(value) {
            self.changes += 1;
            self.hits.resize(MOST_ROWS, (0, 0.0));
            for (rows, (since_ns, before)) in self.recent.iter().rev().enumerate() {
                if *before == bits {
                    let (count, lags_s) = &mut self.hits[rows];
                    *count += 1;
                    *lags_s += seconds_from_nanos(time_ns.saturating_sub(*since_ns));
                    break;
                }
            }
        }
        self.last = bits;
        if self.recent.len() == MOST_ROWS {
            self.recent.pop_front();
        }
        self.recent.push_back((time_ns, other.to_bits()));
    }

    /// A copy of some rows before; `of_position` where the signal is the command.
    pub(super) fn found(&self, of_position: bool) -> Option<Impossible> {
        let equal: u64 = self.hits.iter().map(|(count, _)| count).sum();
        // A value that stayed is found too near: the commonest distance is the lag.
        let (count, lags_s) = self.hits.iter().copied().max_by_key(|(count, _)| *count)?;
        let copied = self.changes >= COPY_CHANGES && equal as f64 > COPY_SHARE * self.changes as f64;
        copied.then_some(Impossible::LateCopy {
            of_position,
            lag_s: lags_s / count.max(1) as f64,
            equal,
            changes: self.changes,
        })
    }
}

fn is_rounded(value: f64) -> bool {
    let steps = value / ROUNDED_PU;
    !steps.is_finite() || (steps - steps.round()).abs() < 1e-6
}
