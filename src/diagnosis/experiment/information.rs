//! How many bits a recording that is yet to be made would tell of which hypothesis is true.
//!
//! Each hypothesis predicts the outcome as a Gaussian: its mean, and noise of unit size with the spread that parameters known no better give it. The
//! expected drop of the posterior's entropy is the mutual information of hypothesis and outcome, which has no closed form for a mixture; it lies
//! between two sums over pairs (Kolchinsky & Tracey 2017, *Estimating mixture entropy with pairwise distances*, Entropy 19(7):361): at least that of
//! Bhattacharyya distances, at most that of Kullback-Leibler divergences.

use nalgebra::{DMatrix, DVector};

use crate::decision::posterior::CountedNats;

/// What one hypothesis predicts, in coefficients of columns that all hypotheses share.
#[derive(Clone, Debug)]
pub struct Predicted {
    /// Probability of the hypothesis.
    pub probability: f64,
    /// Mean of the outcome, one coefficient a column.
    pub mean: DVector<f64>,
    /// Deviations of the outcome, one a column, whose products with themselves sum to the covariance that noise is added to.
    pub deviations: DMatrix<f64>,
}

/// Bits that a recording is expected to take off the posterior's entropy.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Drop {
    /// At least.
    pub least_bits: f64,
    /// At most.
    pub most_bits: f64,
    /// The two hypotheses between which it tells most, by their places, with their distance in standard deviations.
    pub separates: Option<(usize, usize, f64)>,
}

/// Entropy of probabilities that sum to 1, bits.
pub fn entropy_bits(probabilities: impl IntoIterator<Item = f64>) -> f64 {
    let positive = probabilities.into_iter().filter(|p| *p > 0.0);
    positive.map(|p| -p * p.log2()).sum::<f64>().max(0.0)
}

/// One hypothesis with what its distances to others need.
struct Side<'a> {
    of: &'a Predicted,
    /// Products of its deviations with all columns.
    along: DMatrix<f64>,
    log_determinant: f64,
}

/// Logarithm of the determinant of `I + K`, and `(I + K)⁻¹ X`; `K` is a Gram matrix.
fn solved(k: DMatrix<f64>, x: &DMatrix<f64>) -> Option<(f64, DMatrix<f64>)> {
    let n = k.nrows();
    let cholesky = (k + DMatrix::identity(n, n)).cholesky()?;
    let log_determinant = 2.0 * cholesky.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>();
    Some((log_determinant, cholesky.solve(x)))
}

/// The bounds, where the hypotheses predict so and the columns have this Gram matrix; `counted` is what the logarithm of a likelihood ratio counts for.
pub fn expected_drop(gram: &DMatrix<f64>, all: &[Predicted], counted: CountedNats) -> Drop {
    let sides: Option<Vec<Side<'_>>> = all
        .iter()
        .map(|of| {
            let along = of.deviations.tr_mul(gram);
            let (log_determinant, _) = solved(&along * &of.deviations, &DMatrix::zeros(along.nrows(), 0))?;
            Some(Side { of, along, log_determinant })
        })
        .collect();
    let Some(sides) = sides else { return Drop::default() };
    let n = all.len();
    let mut near = DMatrix::zeros(n, n);
    let mut far = DMatrix::zeros(n, n);
    let mut separates: Option<(usize, usize, f64, f64)> = None;
    for i in 0..n {
        for j in 0..n {
            if i == j {
                continue;
            }
            far[(i, j)] = counted.of(divergence(gram, &sides[i], &sides[j]));
            if i < j {
                let (bhattacharyya, square) = distance(gram, &sides[i], &sides[j]);
                near[(i, j)] = counted.of(bhattacharyya);
                near[(j, i)] = near[(i, j)];
                let told = all[i].probability * all[j].probability * (1.0 - (-near[(i, j)]).exp());
                if separates.is_none_or(|(.., most)| told > most) {
                    separates = Some((i, j, square.max(0.0).sqrt(), told));
                }
            }
        }
    }
    let sum = |distances: &DMatrix<f64>| {
        let mixed = |i: usize| (0..n).map(|j| all[j].probability * (-distances[(i, j)]).exp()).sum::<f64>();
        let bits = (0..n).filter(|&i| all[i].probability > 0.0).map(|i| -all[i].probability * mixed(i).log2());
        bits.sum::<f64>().max(0.0)
    };
    let least_bits = sum(&near);
    Drop {
        least_bits,
        most_bits: sum(&far).max(least_bits),
        separates: separates.map(|(i, j, apart, _)| (i, j, apart)),
    }
}

/// Bhattacharyya distance of two Gaussians, and the square of the distance of their means in their mean covariance.
fn distance(gram: &DMatrix<f64>, one: &Side<'_>, other: &Side<'_>) -> (f64, f64) {
    let change = DMatrix::from_column_slice(gram.nrows(), 1, (&one.of.mean - &other.of.mean).as_slice());
    let (a, b) = (one.along.nrows(), other.along.nrows());
    let mut along = DMatrix::zeros(a + b, gram.nrows());
    along.rows_mut(0, a).copy_from(&one.along);
    along.rows_mut(a, b).copy_from(&other.along);
    along *= 0.5_f64.sqrt();
    let mut own = DMatrix::zeros(a + b, a + b);
    let mut left = own.columns_mut(0, a);
    left.copy_from(&(&along * &one.of.deviations));
    let mut right = own.columns_mut(a, b);
    right.copy_from(&(&along * &other.of.deviations));
    own *= 0.5_f64.sqrt();
    let products = &along * &change;
    let straight = (change.tr_mul(&(gram * &change)))[(0, 0)];
    let Some((log_determinant, solution)) = solved(own, &products) else { return (0.0, 0.0) };
    let square = straight - products.tr_mul(&solution)[(0, 0)];
    let spread = 0.5 * (log_determinant - 0.5 * (one.log_determinant + other.log_determinant));
    ((square / 8.0 + spread).max(0.0), square)
}

/// Kullback-Leibler divergence from one Gaussian to another.
fn divergence(gram: &DMatrix<f64>, from: &Side<'_>, to: &Side<'_>) -> f64 {
    let change = DMatrix::from_column_slice(gram.nrows(), 1, (&from.of.mean - &to.of.mean).as_slice());
    let own = &to.along * &to.of.deviations;
    let mixed = &to.along * &from.of.deviations;
    let products = &to.along * &change;
    let mut right = DMatrix::zeros(own.nrows(), own.ncols() + 1);
    right.columns_mut(0, own.ncols()).copy_from(&(&own + &mixed * mixed.transpose()));
    right.columns_mut(own.ncols(), 1).copy_from(&products);
    let Some((log_determinant, solution)) = solved(own, &right) else { return 0.0 };
    let n = solution.nrows();
    let square = (change.tr_mul(&(gram * &change)))[(0, 0)] - products.column(0).dot(&solution.column(n));
    let trace = (&from.along * &from.of.deviations).trace() - solution.columns(0, n).trace();
    (0.5 * (trace + square + log_determinant - from.log_determinant)).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decision::hyperparameters::Hyperparameters;
    use crate::hypotheses::table::{EvidenceRow, EvidenceTable};

    /// Two hypotheses of one number: means `apart`, standard deviations of what is not noise.
    fn of_two(apart: f64, deviations: [f64; 2], probability: f64) -> (DMatrix<f64>, [Predicted; 2]) {
        let one = |probability, mean, deviation| Predicted {
            probability,
            mean: DVector::from_element(1, mean),
            deviations: DMatrix::from_element(1, 1, deviation),
        };
        let predicted = [one(probability, 0.0, deviations[0]), one(1.0 - probability, apart, deviations[1])];
        (DMatrix::identity(1, 1), predicted)
    }

    /// The mutual information by the trapezoidal rule, bits.
    fn integrated(apart: f64, deviations: [f64; 2], probability: f64) -> f64 {
        let variances = deviations.map(|d| 1.0 + d * d);
        let density = |y: f64, mean: f64, variance: f64| {
            (-0.5 * (y - mean).powi(2) / variance).exp() / (std::f64::consts::TAU * variance).sqrt()
        };
        let step = 0.01;
        (-5000..=5000)
            .map(|k| {
                let y = f64::from(k) * step;
                let of = [density(y, 0.0, variances[0]), density(y, apart, variances[1])];
                let all = probability * of[0] + (1.0 - probability) * of[1];
                let term = |p: f64, of: f64| if of > 1e-300 { p * of * (of / all).log2() } else { 0.0 };
                step * (term(probability, of[0]) + term(1.0 - probability, of[1]))
            })
            .sum()
    }

    #[test]
    fn the_bounds_hold_the_mutual_information_between_them() {
        for apart in [0.0, 0.3, 1.0, 3.0, 8.0] {
            for deviations in [[0.0, 0.0], [1.0, 1.0], [0.0, 3.0]] {
                for probability in [0.5, 0.1] {
                    let (gram, predicted) = of_two(apart, deviations, probability);
                    let drop = expected_drop(&gram, &predicted, CountedNats::FULL);
                    let truth = integrated(apart, deviations, probability);
                    let entropy = entropy_bits([probability, 1.0 - probability]);
                    let all = format!("{apart} {deviations:?} {probability}: {drop:?}, truly {truth}");
                    assert!(drop.least_bits <= truth + 1e-6 && truth <= drop.most_bits + 1e-6, "{all}");
                    assert!((0.0..=entropy + 1e-9).contains(&drop.least_bits), "{all}");
                    assert!(drop.most_bits <= entropy + 1e-9, "{all}");
                }
            }
        }
    }

    #[test]
    fn what_parameters_may_hide_tells_less() {
        let told = |deviation: f64, counted: CountedNats| {
            let (gram, predicted) = of_two(3.0, [deviation; 2], 0.5);
            expected_drop(&gram, &predicted, counted).least_bits
        };
        let full = |deviation: f64| told(deviation, CountedNats::FULL);
        assert!(full(0.0) > 0.3 && full(3.0) < 0.2 * full(0.0), "{} {}", full(0.0), full(3.0));
        // What the best set leaves beyond a right model makes nats count for less.
        let left = EvidenceRow { cost: 1e4, ..EvidenceRow::default() };
        let table = EvidenceTable { samples: 1e3, rows: vec![left], ..EvidenceTable::default() };
        assert!(told(0.0, CountedNats::new(&table, &Hyperparameters::shipped())) < 0.5 * full(0.0));
        let (gram, predicted) = of_two(3.0, [0.0; 2], 1.0);
        assert!(expected_drop(&gram, &predicted, CountedNats::FULL).most_bits.abs() < 1e-12, "nothing is open");
    }
}
