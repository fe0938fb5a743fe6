//! What is kept of one signal, or of two, from row to row.

use std::collections::VecDeque;

use super::LASTS;
use super::impossible::Impossible;
use super::stay::Stay;
use crate::correlation::Correlation;
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// A value that is held for so long, s, in so many samples, and then jumps by more, pu; as a share of all travel, and so many times.
const HELD_S: f64 = 0.2;
const HELD_SAMPLES: u64 = 4;
const HELD_PU: f64 = 0.003;
const HELD_SHARE: f64 = 0.7;
const HELD_JUMPS: u64 = 6;

/// A signal whose values may be held.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HeldWatch {
    held: Option<Stay>,
    jumps: u64,
    jumped: f64,
    travel: f64,
    held_s: f64,
}

impl HeldWatch {
    pub(super) fn take(&mut self, time_ns: i64, value: f64) {
        let Some(held) = self.held else {
            self.held = Some(Stay::new(time_ns, value));
            return;
        };
        if held.last.to_bits() == value.to_bits() {
            self.held = Some(held.with(time_ns, value));
            return;
        }
        self.held = Some(Stay::new(time_ns, value));
        let step = (value - held.last).abs();
        if step > HELD_PU {
            self.travel += step;
            let held_s = seconds_from_nanos(time_ns.saturating_sub(held.since_ns));
            if held.samples >= HELD_SAMPLES && held_s >= HELD_S {
                self.jumps += 1;
                self.jumped += step;
                self.held_s += held_s;
            }
        }
    }

    pub(super) fn found(&self, signal: Signal) -> Option<Impossible> {
        let share = self.jumped / self.travel.max(f64::MIN_POSITIVE);
        let held_s = self.held_s / self.jumps.max(1) as f64;
        (self.jumps >= HELD_JUMPS && share > HELD_SHARE).then_some(Impossible::Held {
            signal,
            jumps: self.jumps,
            share,
            held_s,
        })
    }
}

/// Sums for the correlation of the spool with the speed of the servomotor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Relation {
    pub(super) sums: Correlation,
    last: Option<(f64, f64)>,
    /// Half the squares of the speed's steps.
    steps: f64,
}

impl Relation {
    /// Takes a spool and a speed; a spool that stands still to the last bit is frozen, and tells nothing here.
    pub(super) fn take(&mut self, x: f64, y: f64) {
        let Some((_, before)) = self.last.replace((x, y)).filter(|(last, _)| last.to_bits() != x.to_bits()) else {
            return;
        };
        self.steps += 0.5 * (y - before).powi(2);
        self.sums.take(x, y);
    }

    /// Whether the speed is more than the noise of the position.
    pub(super) fn speed_lasts(&self) -> bool {
        self.steps < LASTS * self.sums.yy
    }
}

/// Steps of the speed by which spool and speed are shifted against each other, each way.
const SHIFTS: usize = 10;
/// The speed goes with the spool of another time where that leaves so much of what is left at its own, at most.
const LEAVES: f64 = 0.5;

/// Speed and spool of the steps before, and how well they go together where one of the two is taken later.
#[derive(Clone, Debug, Default)]
pub(super) struct ShiftWatch {
    steps: VecDeque<(f64, f64)>,
    /// The speed with the spool of so many steps before; and the spool with the speed of so many steps before.
    late: [Relation; SHIFTS],
    ahead: [Relation; SHIFTS],
}

impl ShiftWatch {
    /// Takes a step's spool and speed; none where it does not follow the one before.
    pub(super) fn take(&mut self, step: Option<(f64, f64)>) {
        let Some((spool, speed)) = step else { return self.steps.clear() };
        for (before, (spool_before, speed_before)) in self.steps.iter().enumerate() {
            self.late[before].take(*spool_before, speed);
            self.ahead[before].take(spool, *speed_before);
        }
        self.steps.push_front((spool, speed));
        self.steps.truncate(SHIFTS);
    }

    /// By how many steps the speed is later than its spool, below 0 earlier, where that tells much more than its own time does, and the correlation.
    pub(super) fn best(&self, own: f64, fewest: f64) -> Option<(isize, f64)> {
        let late = (1..).zip(&self.late);
        let ahead = (1..).map(|steps: isize| -steps).zip(&self.ahead);
        let all = late.chain(ahead);
        let told =
            all.filter(|(_, relation)| relation.sums.pairs >= fewest).map(|(by, relation)| (by, relation.sums.value()));
        let best = told.max_by(|a, b| a.1.total_cmp(&b.1))?;
        (best.1 > own.max(0.0) && 1.0 - best.1.powi(2) < LEAVES * (1.0 - own.max(0.0).powi(2))).then_some(best)
    }
}
