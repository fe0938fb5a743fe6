//! Shares and means with their intervals.

/// 97.5 % quantile of the standard normal distribution.
const Z: f64 = 1.959_963_984_540_054;

/// A share of cases, or a mean over them, with its 95 % interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Cases that count.
    pub cases: usize,
    /// Share or mean; NaN without a case.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Measured {
    /// A share with Wilson's interval (Wilson 1927, Journal of the American Statistical Association 22(158)).
    pub fn share(hits: usize, cases: usize) -> Self {
        Self { cases, ..Self::wilson(hits as f64 / cases as f64, cases as f64) }
    }

    /// A share of so many equal cases, which need be no whole number.
    fn wilson(share: f64, n: f64) -> Self {
        if n.is_nan() || n <= 0.0 {
            return Self { cases: 0, value: f64::NAN, low: f64::NAN, high: f64::NAN };
        }
        let spread = 1.0 + Z * Z / n;
        let middle = (share + Z * Z / (2.0 * n)) / spread;
        let half = Z / spread * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
        // Exact where rounding would leave a trace.
        let low = if share == 0.0 { 0.0 } else { middle - half };
        let high = if share == 1.0 { 1.0 } else { middle + half };
        Self { cases: 0, value: share, low, high }
    }

    /// The share of cases that are so.
    pub fn of(cases: impl IntoIterator<Item = bool>) -> Self {
        let (mut hits, mut count) = (0, 0);
        for hit in cases {
            hits += usize::from(hit);
            count += 1;
        }
        Self::share(hits, count)
    }

    /// The share of weighted cases that are so; the interval is that of as many equal cases as the weights are worth (Kish 1965, Survey Sampling, 11.7).
    pub fn weighted(cases: &[(bool, f64)]) -> Self {
        let all: f64 = cases.iter().map(|(_, weight)| weight).sum();
        let squares: f64 = cases.iter().map(|(_, weight)| weight * weight).sum();
        let hits: f64 = cases.iter().filter(|(hit, _)| *hit).map(|(_, weight)| weight).sum();
        let worth = if squares > 0.0 { all * all / squares } else { 0.0 };
        let share = if all > 0.0 { hits / all } else { f64::NAN };
        Self { cases: cases.len(), ..Self::wilson(share, worth) }
    }

    /// A mean of probabilities, whose interval stays between 0 and 1.
    pub(crate) fn mean_probability(values: &[f64]) -> Self {
        let mean = Self::mean(values);
        Self { low: mean.low.max(0.0), high: mean.high.min(1.0), ..mean }
    }

    /// A mean with the interval of a normal one.
    pub fn mean(values: &[f64]) -> Self {
        let cases = values.len();
        if cases == 0 {
            return Self::share(0, 0);
        }
        let value = values.iter().sum::<f64>() / cases as f64;
        let square = values.iter().map(|v| (v - value).powi(2)).sum::<f64>() / (cases.max(2) - 1) as f64;
        let half = Z * (square / cases as f64).sqrt();
        Self { cases, value, low: value - half, high: value + half }
    }
}

/// One bin of a reliability curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bin {
    /// Mean of the reported probabilities.
    pub stated_probability: f64,
    /// How often it was so.
    pub was: Measured,
}

/// A reported probability, whether the claim was true, and its weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatedProbability {
    /// The reported probability.
    pub stated_probability: f64,
    /// Whether it was so.
    pub was: bool,
    /// How much it counts beside others.
    pub weight: f64,
}

/// Reported probabilities against observed frequencies, in bins of a tenth; empty bins are left out.
pub fn reliability(claims: &[StatedProbability]) -> Vec<Bin> {
    (0..10)
        .filter_map(|bin| {
            let (from, to) = (f64::from(bin) / 10.0, f64::from(bin + 1) / 10.0);
            let is_inside = |p: f64| p >= from && (p < to || (bin == 9 && p <= 1.0));
            let inside = || claims.iter().filter(|claim| is_inside(claim.stated_probability));
            let weight: f64 = inside().map(|claim| claim.weight).sum();
            (weight > 0.0).then(|| Bin {
                stated_probability: inside().map(|claim| claim.weight * claim.stated_probability).sum::<f64>() / weight,
                was: Measured::weighted(&inside().map(|claim| (claim.was, claim.weight)).collect::<Vec<_>>()),
            })
        })
        .collect()
}

/// Prior share of fault-free units, as many as faulty ones; a battery has fewer, to contain more faults.
const SOUND: f64 = 0.5;

/// Weight of a fault-free unit of a set relative to a faulty one, so that fault-free ones are half of it.
pub(crate) fn weight_of_sound(sound: usize, all: usize) -> f64 {
    if (1..all).contains(&sound) { SOUND / (1.0 - SOUND) * (all - sound) as f64 / sound as f64 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilsons_interval_is_the_closed_form() {
        // The roots of (p − p̂)² = z² p (1 − p)/n.
        for (hits, cases) in [(0, 10), (3, 12), (85, 100), (24, 24)] {
            let share = Measured::share(hits, cases);
            let (n, p_hat) = (cases as f64, hits as f64 / cases as f64);
            for p in [share.low, share.high] {
                let miss = (p - p_hat).powi(2) - Z * Z * p * (1.0 - p) / n;
                assert!(miss.abs() < 1e-12, "{hits}/{cases}: {p}");
            }
            assert!(share.low <= p_hat && p_hat <= share.high);
        }
        // Known values: 8 of 10 gives 0.490 to 0.943 (Brown, Cai & DasGupta 2001).
        let eight = Measured::share(8, 10);
        assert!((eight.low - 0.4902).abs() < 1e-4 && (eight.high - 0.9433).abs() < 1e-4);
        assert!(Measured::share(0, 0).value.is_nan());
    }

    #[test]
    fn means_and_bins_are_those_of_the_cases() {
        let mean = Measured::mean(&[0.2, 0.4, 0.9]);
        assert!((mean.value - 0.5).abs() < 1e-12 && (mean.high - 0.5 - Z * (0.13_f64 / 3.0).sqrt()).abs() < 1e-12);
        let claim = |(stated_probability, was)| StatedProbability { stated_probability, was, weight: 1.0 };
        let bins = reliability(&[(0.05, false), (0.07, true), (1.0, true), (0.95, true)].map(claim));
        assert_eq!(bins.len(), 2);
        assert!((bins[0].stated_probability - 0.06).abs() < 1e-12 && bins[0].was == Measured::share(1, 2));
        assert_eq!(bins[1].was, Measured::share(2, 2));
    }

    #[test]
    fn weights_are_worth_as_many_equal_cases() {
        let equal = [true, true, false, true].map(|hit| (hit, 2.5));
        assert_eq!(Measured::weighted(&equal), Measured::share(3, 4));
        // One of weight 3 beside three of weight 1: half of the weight, worth 36/12 = 3 cases.
        let mixed = Measured::weighted(&[(true, 3.0), (false, 1.0), (false, 1.0), (false, 1.0)]);
        let worth = Measured::wilson(0.5, 3.0);
        assert!((mixed.cases, mixed.value, mixed.low) == (4, 0.5, worth.low) && mixed.high == worth.high);
        assert!(Measured::weighted(&[]).value.is_nan());
        assert!((weight_of_sound(10, 50) - 4.0).abs() < 1e-12);
        assert_eq!((weight_of_sound(0, 5), weight_of_sound(5, 5)), (1.0, 1.0));
    }
}
