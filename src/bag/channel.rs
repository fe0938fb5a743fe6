//! What the numbers of one channel look like: range, repeats, single samples far from both neighbours, alternation.

use super::distribution::Distribution;
use govtwin_model::units::seconds_from_nanos;

/// Samples over which alternation is detected: so many differences are not in such an order by chance.
const WINDOW: u64 = 16;

/// Numbers are sorted by size in these steps, in the channel's unit: finer than any transducer.
const STEP: f64 = 1e-9;

/// How a channel may behave; the limits are those of `qualification`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Behaviour {
    /// Excursions smaller than this are of no account, in the channel's unit.
    pub(super) worth: f64,
    /// No plant moves faster, in the channel's unit each second; `None` where nothing is known.
    pub(super) fastest_per_s: f64,
}

/// A sample that lies far from both neighbours, which lie near each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outlier {
    /// When, ns.
    pub(super) time_ns: i64,
    /// The sample.
    pub(super) value: f64,
    /// What its neighbours let expect there.
    pub(super) expected: f64,
}

/// Numbers of one channel, taken one by one.
#[derive(Clone, Debug)]
pub(crate) struct Channel {
    behaviour: Behaviour,
    last: [Option<(i64, f64)>; 2],
    /// Finite numbers.
    pub(crate) count: u64,
    pub(super) least: f64,
    pub(super) most: f64,
    /// How many are exactly the least, and exactly the most.
    pub(super) at_ends: [u64; 2],
    /// Numbers equal to the one before, and those of them at the ends.
    pub(super) repeats: u64,
    repeats_at_ends: [u64; 2],
    /// How often it came to the ends.
    pub(super) visits: [u64; 2],
    /// How far numbers are from the middle of their neighbours, in [`STEP`]s.
    bends: Distribution,
    /// The same for those whose neighbours are near each other, and that came and went too fast.
    lone_bends: Distribution,
    /// How many of these there are.
    lone: u64,
    /// The largest of these.
    worst: Option<Outlier>,
    window: [f64; 2],
    in_window: u64,
    /// Numbers in windows in which each is unlike the last and like the last but one.
    pub(crate) alternating: u64,
}

impl Channel {
    pub(crate) fn new(behaviour: Behaviour) -> Self {
        Self {
            behaviour,
            last: [None; 2],
            count: 0,
            least: f64::INFINITY,
            most: f64::NEG_INFINITY,
            at_ends: [0; 2],
            repeats: 0,
            repeats_at_ends: [0; 2],
            visits: [0; 2],
            bends: Distribution::default(),
            lone_bends: Distribution::default(),
            lone: 0,
            worst: None,
            window: [0.0; 2],
            in_window: 0,
            alternating: 0,
        }
    }

    /// Takes a number, which counts where it is finite.
    pub(crate) fn push(&mut self, time_ns: i64, value: f64) {
        if !value.is_finite() {
            return;
        }
        self.count += 1;
        let repeats = self.last[1].is_some_and(|(_, last)| last == value);
        self.repeats += u64::from(repeats);
        for (end, far) in [(0, value < self.least), (1, value > self.most)] {
            if far {
                (self.at_ends[end], self.repeats_at_ends[end], self.visits[end]) = (0, 0, 0);
            }
        }
        self.least = self.least.min(value);
        self.most = self.most.max(value);
        for (end, there) in [(0, value == self.least), (1, value == self.most)] {
            self.at_ends[end] += u64::from(there);
            self.repeats_at_ends[end] += u64::from(there && repeats);
            self.visits[end] += u64::from(there && !repeats);
        }
        if let [Some(before), Some(middle)] = self.last {
            self.bend(before, middle, (time_ns, value));
            self.alternate(before.1, middle.1, value, seconds_from_nanos(time_ns.saturating_sub(middle.0)));
        }
        self.last = [self.last[1], Some((time_ns, value))];
    }

    fn bend(&mut self, before: (i64, f64), middle: (i64, f64), after: (i64, f64)) {
        let expected = f64::midpoint(before.1, after.1);
        let bend = (middle.1 - expected).abs();
        self.bends.push(steps(bend));
        let half_s = seconds_from_nanos(after.0.saturating_sub(before.0)) / 2.0;
        let Behaviour { worth, fastest_per_s } = self.behaviour;
        let lone = bend > worth && (after.1 - before.1).abs() < bend / 4.0 && bend > fastest_per_s * half_s;
        if lone {
            self.lone_bends.push(steps(bend));
            self.lone += 1;
            if self.worst.is_none_or(|worst| (worst.value - worst.expected).abs() < bend) {
                self.worst = Some(Outlier { time_ns: middle.0, value: middle.1, expected });
            }
        }
    }

    fn alternate(&mut self, before: f64, middle: f64, after: f64, step_s: f64) {
        let Behaviour { worth, fastest_per_s } = self.behaviour;
        // What a plant can do between two samples is no second sender.
        self.window[0] += ((after - middle).abs() - fastest_per_s * step_s).max(0.0);
        self.window[1] += (after - before).abs();
        self.in_window += 1;
        if self.in_window == WINDOW {
            let [next, next_but_one] = self.window;
            if next > 4.0 * next_but_one && next > worth * WINDOW as f64 {
                self.alternating += WINDOW;
            }
            (self.window, self.in_window) = ([0.0; 2], 0);
        }
    }

    /// How many samples lie alone and more than so many median bends away, and the farthest.
    pub(super) fn outliers(&mut self, medians: f64) -> Option<(u64, Outlier)> {
        let limit = (self.bends.median() as f64 * medians).max(self.behaviour.worth / STEP);
        let count = self.lone_bends.count_where(|bend| bend as f64 > limit);
        self.worst
            .filter(|worst| (worst.value - worst.expected).abs() / STEP > limit)
            .map(|worst| (count.max(1), worst))
    }

    /// How many samples come and go faster than any plant moves, with neighbours that are near each other.
    pub(crate) fn lone(&self) -> u64 {
        self.lone
    }

    /// Numbers elsewhere than at an end that repeat the one before, as a share of those elsewhere.
    pub(super) fn repeats_elsewhere(&self, end: usize) -> f64 {
        let elsewhere = self.count.saturating_sub(self.at_ends[end]);
        self.repeats.saturating_sub(self.repeats_at_ends[end]) as f64 / elsewhere.max(1) as f64
    }
}

#[expect(clippy::cast_possible_truncation, reason = "numbers beyond count as the largest there is")]
fn steps(size: f64) -> i64 {
    (size / STEP) as i64
}
