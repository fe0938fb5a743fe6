//! Guard rails of a learned correction: clamped to what was trained, faded out of its support, shrunk far from training rows, off on bad input.
//!
//! A tree gives its outermost leaf for anything far away. The support is the box of the training rows' features; a row
//! outside by the share `d` of a side is corrected by the weight `1 − (d − 0.05)/0.25` between 5 % and 30 %, and not at all beyond.
//! Inside the box there are holes: `Reach` knows how far a correction carries there.

use serde::{Deserialize, Serialize};

use super::reach::Reach;

/// A row may leave the box by this share of its side with its full correction.
const FREE_SHARE: f64 = 0.05;

/// From there on the correction fades to zero over this share.
const FADE_SHARE: f64 = 0.25;

/// Where a model knows its way: the training rows' box, and the corrections seen there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Guard {
    /// Lowest and highest of each feature, in its unit.
    pub support: Vec<[f64; 2]>,
    /// Lowest and highest target, in the signal's unit.
    pub range: [f64; 2],
    /// How far corrections carry; a model without it trusts the box alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reach: Option<Reach>,
}

/// What a guard lets through at a row.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passed {
    /// The correction; the coefficient's unit is the signal's.
    pub value: f64,
    /// Its weight, a share of 1.
    pub weight_share: f64,
    /// What the band's half width is multiplied by, a ratio; NaN where the row lies outside the support or is bad.
    pub widening: f64,
}

/// What the guard did to rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct GuardCounts {
    /// Rows seen.
    pub rows: u64,
    /// Corrections cut to the trained range.
    pub clamped: u64,
    /// Corrections lessened because the row lies outside the support.
    pub faded: u64,
    /// Corrections lessened inside the support, because they did not carry so far in other processes.
    pub shrunk: u64,
    /// Rows so far outside that there was no correction.
    pub outside: u64,
    /// Rows with a feature that is not a finite number: no correction.
    pub bad: u64,
}

impl GuardCounts {
    /// Adds what another guard did.
    pub fn add(&mut self, other: &Self) {
        self.rows += other.rows;
        self.clamped += other.clamped;
        self.faded += other.faded;
        self.shrunk += other.shrunk;
        self.outside += other.outside;
        self.bad += other.bad;
    }
}

impl Guard {
    /// The box and range of training rows; rows of features stand one after the other in `values`.
    pub fn of(values: &[f64], features: usize, targets: &[f64]) -> Self {
        let empty = [f64::INFINITY, f64::NEG_INFINITY];
        let widen = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
        let mut support = vec![empty; features];
        for row in values.chunks_exact(features.max(1)) {
            for (side, value) in support.iter_mut().zip(row) {
                *side = widen(*side, *value);
            }
        }
        Self { support, range: targets.iter().copied().fold(empty, widen), reach: None }
    }

    /// The weight of a correction at a row, 1 inside the support; `None` for a row that is not finite.
    pub fn weight(&self, row: &[f64]) -> Option<f64> {
        let mut farthest: f64 = 0.0;
        for (value, [low, high]) in row.iter().zip(&self.support) {
            if !value.is_finite() {
                return None;
            }
            let over = (low - value).max(value - high);
            if over > 0.0 {
                // A feature that never moved in training has no scale: its own size, or a percent, is used.
                let side = (high - low).max(1e-2 * low.abs().max(1.0));
                farthest = farthest.max(over / side);
            }
        }
        Some((1.0 - (farthest - FREE_SHARE) / FADE_SHARE).clamp(0.0, 1.0))
    }

    /// The correction that may be applied, counted. `raw` is the trees' word for the row.
    pub fn apply(&self, raw: f64, row: &[f64], counts: &mut GuardCounts) -> Passed {
        counts.rows += 1;
        let Some(inside) = self.weight(row).filter(|_| raw.is_finite()) else {
            counts.bad += 1;
            return Passed { value: 0.0, weight_share: 0.0, widening: f64::NAN };
        };
        counts.outside += u64::from(inside == 0.0);
        counts.faded += u64::from(inside > 0.0 && inside < 1.0);
        let (share, widening) = self.reach.as_ref().map_or((1.0, 1.0), |reach| reach.at(reach.distance(row)));
        counts.shrunk += u64::from(inside == 1.0 && share < 1.0);
        let [low, high] = self.range;
        counts.clamped += u64::from(raw < low || raw > high);
        let weight_share = inside * share;
        let widening = if inside == 1.0 { widening } else { f64::NAN };
        Passed { value: weight_share * raw.max(low).min(high), weight_share, widening }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::any;
    use proptest::{prop_assert, proptest};

    use super::{Guard, GuardCounts, Passed};

    fn guard() -> Guard {
        Guard::of(&[0.0, 10.0, 1.0, 20.0], 2, &[-0.1, 0.2])
    }

    #[test]
    fn full_inside_faded_near_off_far_and_on_bad_input() {
        let (guard, mut counts) = (guard(), GuardCounts::default());
        let full = |value| Passed { value, weight_share: 1.0, widening: 1.0 };
        assert_eq!(guard.apply(0.15, &[0.5, 15.0], &mut counts), full(0.15));
        assert_eq!(guard.apply(0.9, &[0.5, 15.0], &mut counts), full(0.2));
        assert_eq!(guard.apply(0.15, &[1.04, 15.0], &mut counts).weight_share, 1.0);
        let half = guard.apply(0.1, &[1.175, 15.0], &mut counts);
        assert!((half.weight_share - 0.5).abs() < 1e-12 && (half.value - 0.05).abs() < 1e-12);
        assert!(half.widening.is_nan());
        for (raw, row) in [(0.1, [0.5, 30.0]), (0.1, [f64::NAN, 15.0]), (f64::NAN, [0.5, 15.0])] {
            let passed = guard.apply(raw, &row, &mut counts);
            assert_eq!((passed.value, passed.weight_share), (0.0, 0.0));
        }
        assert_eq!(counts, GuardCounts { rows: 7, clamped: 1, faded: 1, shrunk: 0, outside: 1, bad: 2 });
    }

    proptest! {
        #[test]
        fn no_correction_ever_leaves_the_trained_range(raw in any::<f64>(), a in any::<f64>(), b in any::<f64>()) {
            let passed = guard().apply(raw, &[a, b], &mut GuardCounts::default());
            prop_assert!((-0.1..=0.2).contains(&passed.value) && (0.0..=1.0).contains(&passed.weight_share));
        }
    }
}
