//! How far an estimate is from what was measured: MAE, RMSE, R², bias and the largest error.
//!
//! The equations are those of Liu et al. 2025, section 4.2, with `y` measured, `ŷ` estimated and
//! `ȳ` the mean of the measured values:
//!
//! ```text
//! MAE  = 1/n Σ |y − ŷ|
//! RMSE = √(1/n Σ (y − ŷ)²)
//! R²   = 1 − Σ (y − ŷ)² / Σ (y − ȳ)²
//! ```
//!
//! A pair in which either side is not finite is left out and counted.

/// The middle value, the upper one of two; NaN of none.
pub fn median(mut values: Vec<f64>) -> f64 {
    let middle = values.len() / 2;
    if values.is_empty() { f64::NAN } else { *values.select_nth_unstable_by(middle, f64::total_cmp).1 }
}

/// Standard deviation of white noise by the sizes of its second differences; what moves evenly adds nothing to them. NaN of none.
///
/// The variance of a second difference is six times that of the noise, and the median size of a normal deviate 0.6745 times its deviation.
pub fn noise_of_bends(bends: Vec<f64>) -> f64 {
    median(bends) / (0.6745 * 6.0_f64.sqrt())
}

/// Takes pairs one by one, in constant memory; parts of a data set can be merged into the whole.
///
/// The spread of the measured values is kept about their running mean (Welford 1962; merged after
/// Chan, Golub and LeVeque 1983), so that a large offset costs no digits.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Accumulator {
    count: u64,
    skipped: u64,
    measured_mean: f64,
    measured_spread: f64,
    error_sum: f64,
    absolute_error_sum: f64,
    squared_error_sum: f64,
    largest_error: f64,
}

impl Accumulator {
    /// Nothing taken yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// All pairs of an iterator.
    pub fn of(pairs: impl IntoIterator<Item = (f64, f64)>) -> Self {
        let mut whole = Self::new();
        for (measured, estimated) in pairs {
            whole.push(measured, estimated);
        }
        whole
    }

    /// Takes one pair, both in the same unit.
    pub fn push(&mut self, measured: f64, estimated: f64) {
        let error = estimated - measured;
        if !error.is_finite() {
            self.skipped += 1;
            return;
        }
        self.count += 1;
        let step = measured - self.measured_mean;
        self.measured_mean += step / self.count as f64;
        self.measured_spread += step * (measured - self.measured_mean);
        self.error_sum += error;
        self.absolute_error_sum += error.abs();
        self.squared_error_sum += error * error;
        self.largest_error = self.largest_error.max(error.abs());
    }

    /// Adds what another accumulator took, as if this one had taken it too.
    pub fn merge(&mut self, other: &Self) {
        self.skipped += other.skipped;
        if other.count == 0 {
            return;
        }
        let (own, others) = (self.count as f64, other.count as f64);
        let whole = own + others;
        let apart = other.measured_mean - self.measured_mean;
        self.count += other.count;
        self.measured_mean += apart * (others / whole);
        self.measured_spread += other.measured_spread + apart * apart * (own * others / whole);
        self.error_sum += other.error_sum;
        self.absolute_error_sum += other.absolute_error_sum;
        self.squared_error_sum += other.squared_error_sum;
        self.largest_error = self.largest_error.max(other.largest_error);
    }

    /// The figures of all pairs taken so far.
    pub fn figures(&self) -> Figures {
        let rows = self.count as f64;
        let none = self.count == 0;
        let or_nan = |value: f64| if none { f64::NAN } else { value };
        Figures {
            count: self.count,
            skipped: self.skipped,
            mae: self.absolute_error_sum / rows,
            rmse: (self.squared_error_sum / rows).sqrt(),
            // A constant measurement has nothing to explain: no R², rather than minus infinity.
            r2: if self.measured_spread > 0.0 { 1.0 - self.squared_error_sum / self.measured_spread } else { f64::NAN },
            bias: self.error_sum / rows,
            max_abs: or_nan(self.largest_error),
        }
    }
}

/// The figures of one signal, in the signal's unit; NaN where the data do not determine it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Figures {
    /// Pairs that count.
    pub count: u64,
    /// Pairs left out because either side was not finite.
    pub skipped: u64,
    /// Mean absolute error, in the signal's unit.
    pub mae: f64,
    /// Root mean square error, in the signal's unit.
    pub rmse: f64,
    /// Coefficient of determination R², 1 at best; NaN where the measured signal is constant.
    pub r2: f64,
    /// Mean of estimated − measured, in the signal's unit.
    pub bias: f64,
    /// Largest absolute error, in the signal's unit.
    pub max_abs: f64,
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;
    use proptest::prelude::{Strategy, any, prop};
    use proptest::{prop_assert, proptest};

    use super::{Accumulator, median, noise_of_bends};

    fn pairs() -> impl Strategy<Value = Vec<(f64, f64)>> {
        prop::collection::vec((-2.0..2.0, -2.0..2.0), 2..200)
    }

    fn close(a: f64, b: f64) -> bool {
        (a - b).abs() <= 1e-9 * a.abs().max(b.abs()).max(1.0)
    }

    #[test]
    fn closed_form() {
        // Errors 1, 0, 0, −3; mean 2.5; spread 1.5² + 0.5² + 0.5² + 1.5² = 5.
        let figures = Accumulator::of([(1.0, 2.0), (2.0, 2.0), (3.0, 3.0), (4.0, 1.0)]).figures();
        assert_relative_eq!(figures.mae, 1.0);
        assert_relative_eq!(figures.rmse, (10.0_f64 / 4.0).sqrt());
        assert_relative_eq!(figures.r2, 1.0 - 10.0 / 5.0);
        assert_relative_eq!(figures.bias, -0.5);
        assert_relative_eq!(figures.max_abs, 3.0);
        assert_eq!((figures.count, figures.skipped), (4, 0));
    }

    #[test]
    fn medians_and_noise_of_few_values() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
        assert!(median(vec![]).is_nan());
        assert_relative_eq!(noise_of_bends(vec![1.0, 5.0, 2.0]), 2.0 / (0.6745 * 6.0_f64.sqrt()));
    }

    #[test]
    fn ends_of_the_scale_of_r2() {
        let measured = [0.0, 1.0, 2.0, 3.0];
        assert_relative_eq!(Accumulator::of(measured.map(|y| (y, y))).figures().r2, 1.0);
        assert_relative_eq!(Accumulator::of(measured.map(|y| (y, 1.5))).figures().r2, 0.0);
    }

    #[test]
    fn what_cannot_be_said_is_nan() {
        assert!(Accumulator::new().figures().mae.is_nan());
        assert!(Accumulator::new().figures().max_abs.is_nan());
        let constant = Accumulator::of([(0.3, 0.4), (0.3, 0.2)]).figures();
        assert!(constant.r2.is_nan());
        assert_relative_eq!(constant.rmse, 0.1, epsilon = 1e-15);
    }

    #[test]
    fn pairs_that_are_not_finite_are_counted_and_change_nothing() {
        let clean = Accumulator::of([(1.0, 2.0), (2.0, 2.5)]).figures();
        let dirty = [(f64::NAN, 1.0), (1.0, 2.0), (1.0, f64::INFINITY), (2.0, 2.5), (f64::NEG_INFINITY, f64::NAN)];
        let dirty = Accumulator::of(dirty).figures();
        assert_eq!(dirty.skipped, 3);
        assert_eq!(super::Figures { skipped: 0, ..dirty }, clean);
    }

    #[test]
    fn a_large_offset_costs_no_digits() {
        let wave = |k: i32| f64::from(k).sin();
        let near = Accumulator::of((0..1000).map(|k| (wave(k), wave(k) + 0.01))).figures();
        let far = Accumulator::of((0..1000).map(|k| (wave(k) + 1e6, wave(k) + 1e6 + 0.01))).figures();
        assert_relative_eq!(near.r2, far.r2, epsilon = 1e-9);
    }

    proptest! {
        #[test]
        fn merged_parts_equal_the_whole(pairs in pairs(), cut in any::<prop::sample::Index>()) {
            let cut = cut.index(pairs.len());
            let mut merged = Accumulator::of(pairs[..cut].iter().copied());
            merged.merge(&Accumulator::of(pairs[cut..].iter().copied()));
            let (merged, whole) = (merged.figures(), Accumulator::of(pairs).figures());
            prop_assert!(close(merged.mae, whole.mae) && close(merged.rmse, whole.rmse));
            prop_assert!(close(merged.r2, whole.r2) && close(merged.bias, whole.bias));
            prop_assert!(merged.max_abs == whole.max_abs && merged.count == whole.count);
        }

        #[test]
        fn shifting_both_changes_nothing_and_scaling_scales(pairs in pairs(), shift in -5.0..5.0, scale in 0.1..10.0) {
            let plain = Accumulator::of(pairs.clone()).figures();
            let moved = pairs.into_iter().map(|(y, e)| (scale * (y + shift), scale * (e + shift)));
            let moved = Accumulator::of(moved).figures();
            prop_assert!(close(moved.mae, scale * plain.mae) && close(moved.rmse, scale * plain.rmse));
            prop_assert!(close(moved.bias, scale * plain.bias) && close(moved.max_abs, scale * plain.max_abs));
            prop_assert!((moved.r2 - plain.r2).abs() <= 1e-6 * plain.r2.abs().max(1.0));
        }

        #[test]
        fn the_means_are_ordered(pairs in pairs()) {
            let figures = Accumulator::of(pairs).figures();
            prop_assert!(figures.bias.abs() <= figures.mae * (1.0 + 1e-12));
            prop_assert!(figures.mae <= figures.rmse * (1.0 + 1e-12));
            prop_assert!(figures.rmse <= figures.max_abs * (1.0 + 1e-12));
        }
    }
}
