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
    #[must_use]
    pub fn share(hits: usize, cases: usize) -> Self {
        if cases == 0 {
            return Self { cases, value: f64::NAN, low: f64::NAN, high: f64::NAN };
        }
        let (n, share) = (cases as f64, hits as f64 / cases as f64);
        let spread = 1.0 + Z * Z / n;
        let middle = (share + Z * Z / (2.0 * n)) / spread;
        let half = Z / spread * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
        // Exact where rounding would leave a trace.
        let low = if hits == 0 { 0.0 } else { middle - half };
        let high = if hits == cases { 1.0 } else { middle + half };
        Self { cases, value: share, low, high }
    }

    /// The share of cases that are so.
    #[must_use]
    pub fn of(cases: impl IntoIterator<Item = bool>) -> Self {
        let (mut hits, mut count) = (0, 0);
        for hit in cases {
            hits += usize::from(hit);
            count += 1;
        }
        Self::share(hits, count)
    }

    /// A mean of probabilities, whose interval stays between 0 and 1.
    #[must_use]
    pub fn mean_probability(values: &[f64]) -> Self {
        let mean = Self::mean(values);
        Self { low: mean.low.max(0.0), high: mean.high.min(1.0), ..mean }
    }

    /// A mean with the interval of a normal one.
    #[must_use]
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
    /// Mean of the probabilities said.
    pub said_probability: f64,
    /// How often it was so.
    pub was: Measured,
}

/// Probabilities said against what was so, in bins of a tenth; empty bins are left out.
#[must_use]
pub fn reliability(pairs: &[(f64, bool)]) -> Vec<Bin> {
    (0..10)
        .filter_map(|bin| {
            let (from, to) = (f64::from(bin) / 10.0, f64::from(bin + 1) / 10.0);
            let inside: Vec<&(f64, bool)> =
                pairs.iter().filter(|(p, _)| *p >= from && (*p < to || (bin == 9 && *p <= 1.0))).collect();
            let count = inside.len();
            (count > 0).then(|| Bin {
                said_probability: inside.iter().map(|(p, _)| p).sum::<f64>() / count as f64,
                was: Measured::of(inside.iter().map(|(_, so)| *so)),
            })
        })
        .collect()
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
        let bins = reliability(&[(0.05, false), (0.07, true), (1.0, true), (0.95, true)]);
        assert_eq!(bins.len(), 2);
        assert!((bins[0].said_probability - 0.06).abs() < 1e-12 && bins[0].was == Measured::share(1, 2));
        assert_eq!(bins[1].was, Measured::share(2, 2));
    }
}
