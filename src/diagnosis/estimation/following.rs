//! Following: where coordinates with known slopes go when another one is moved far, by one Gauss-Newton step.
//!
//! A profile of a size over its whole range needs the others to follow at each size. Their slopes hardly change with it, so that those of one point
//! serve for all sizes: one simulation shows the residuals r at a size, the step is `−(JᵀJ + P)⁻¹ (Jᵀr + P d)` with the distances d from the prior
//! centres (Bates & Watts 1988, *Nonlinear Regression Analysis and Its Applications*, section 6.1, profiles).

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, IntoParallelRefIterator, ParallelIterator};

use crate::estimation::coordinate::{Coordinate, Judge, Residuals, prior_square, square, subject_at};
use crate::estimation::descent::step;
use crate::estimation::linear::crossed;

/// Smallest size of a profile, in typical ones.
const SMALLEST: f64 = 0.4;

/// Each size of a profile over the one before.
const RATIO: f64 = 2.5;

/// Subjects whose residuals are held at once.
const TOGETHER: usize = 64;

/// Farthest that a coordinate follows, in its standard deviations.
const FARTHEST: f64 = 3.0;

/// Damping of the step: next to none, so that what the data hardly show stays where it is.
const DAMPING: f64 = 1e-3;

/// Sizes of a profile over a range on both sides of 0: a logarithmic grid, with the ends of the range where it stops well before them.
pub(crate) fn profile_sizes((low, high): (f64, f64)) -> Vec<f64> {
    let up_to = |bound: f64| {
        let grid = std::iter::successors(Some(SMALLEST), |size| Some(size * RATIO));
        let mut sizes: Vec<f64> = grid.take_while(|size| *size <= bound).collect();
        sizes.extend(sizes.last().filter(|last| **last * RATIO.sqrt() < bound).map(|_| bound));
        sizes
    };
    up_to(high).into_iter().chain(up_to(-low).into_iter().map(|size| -size)).collect()
}

/// Where a subject stands, and which of its coordinates have slopes at the point that it is reached from.
#[derive(Clone, Debug)]
pub struct Displaced<C: Coordinate> {
    /// What is turned.
    pub base: C::Subject,
    /// What may move.
    pub coordinates: Vec<C>,
    /// Where it stands.
    pub positions: Vec<f64>,
    /// Of the leading coordinates, the places of their slopes at the point.
    pub columns: Vec<usize>,
}

impl<C: Coordinate> Displaced<C> {
    /// The subject.
    pub fn subject(&self) -> C::Subject {
        subject_at(&self.base, &self.coordinates, &self.positions)
    }
}

/// Where the coordinates go, and what that promises.
#[derive(Clone, Debug)]
pub struct Followed {
    /// Position of each coordinate.
    pub positions: Vec<f64>,
    /// Cost there, to first order.
    pub cost: f64,
}

/// Lets the coordinates of each subject follow along the slopes of a point by one step.
pub fn followed<C: Coordinate>(
    data: &impl Judge<C::Subject>,
    slopes: &[DMatrix<f64>],
    displaced: &[Displaced<C>],
) -> Vec<Followed> {
    let count = slopes.first().map_or(0, DMatrix::ncols);
    let normal = slopes.iter().fold(DMatrix::zeros(count, count), |sum, slopes| sum + crossed(slopes, slopes));
    let mut all = Vec::with_capacity(displaced.len());
    for some in displaced.chunks(TOGETHER) {
        let subjects: Vec<C::Subject> = some.iter().map(Displaced::subject).collect();
        let residuals = data.residuals_of(&subjects);
        let of = |(one, residuals): (&Displaced<C>, Residuals)| follow(one, &residuals, slopes, &normal);
        all.extend(some.par_iter().zip_eq(residuals.into_par_iter()).map(of).collect::<Vec<_>>());
    }
    all
}

fn follow<C: Coordinate>(
    one: &Displaced<C>,
    residuals: &Residuals,
    slopes: &[DMatrix<f64>],
    normal: &DMatrix<f64>,
) -> Followed {
    let n = one.columns.len();
    let (leading, start) = (&one.coordinates[..n], &one.positions[..n]);
    let along = slopes
        .iter()
        .zip(residuals)
        .fold(DVector::zeros(normal.nrows()), |sum, (slopes, residuals)| sum + slopes.tr_mul(residuals));
    let mut hessian = DMatrix::from_fn(n, n, |k, l| normal[(one.columns[k], one.columns[l])]);
    let mut gradient = DVector::from_fn(n, |k, _| along[one.columns[k]]);
    for (k, coordinate) in leading.iter().enumerate() {
        if let Some(centre) = coordinate.prior_centre() {
            hessian[(k, k)] += 1.0;
            gradient[k] += start[k] - centre;
        }
    }
    let stepped = step(&one.base, leading, start, &hessian, &gradient, DAMPING);
    let change = DVector::from_fn(n, |k, _| (stepped[k] - start[k]).clamp(-FARTHEST, FARTHEST));
    let cost = square(residuals)
        + prior_square(&one.coordinates, &one.positions)
        + 2.0 * gradient.dot(&change)
        + change.dot(&(&hessian * &change));
    let mut positions = one.positions.clone();
    positions.iter_mut().zip(change.iter()).for_each(|(position, change)| *position += change);
    Followed { positions, cost }
}

#[cfg(test)]
mod tests {
    use super::profile_sizes;

    #[test]
    fn a_profile_reaches_both_ends_of_a_range_in_even_ratios() {
        for range in [(0.0, 40.0), (-16.7, 16.7), (-1.0, 10.0), (0.0, 1.6)] {
            let sizes = profile_sizes(range);
            assert!(sizes.iter().all(|size| (range.0..=range.1).contains(size)), "{range:?}: {sizes:?}");
            for end in [range.0, range.1].into_iter().filter(|end| *end != 0.0) {
                let farthest = sizes.iter().map(|size| size / end).fold(0.0, f64::max);
                assert!(farthest > 0.6, "{range:?}: {sizes:?}");
            }
            let mut positive: Vec<f64> = sizes.into_iter().filter(|size| *size > 0.0).collect();
            positive.sort_by(f64::total_cmp);
            assert!(positive.windows(2).all(|two| two[1] <= 2.51 * two[0]), "{range:?}: {positive:?}");
        }
        assert!(profile_sizes((0.0, 0.2)).is_empty());
    }
}
