//! How far the numbers of a law may be off, by what free runs say of them one by one: a jackknife over runs, linear about the fit.
//!
//! Left out of its fit, a run moves the numbers by `(H − Hᵢ)⁻¹ gᵢ`, with its own slopes in `Hᵢ` and `gᵢ` (Efron & Tibshirani 1993, *An Introduction to the
//! Bootstrap*, chapter 11). What a law misses in the same way over a whole run, and otherwise in the next, is in it; white noise alone would not be.

use nalgebra::{DMatrix, DVector};

use crate::stage_alone::run::Run;

/// Weight of the ridge that keeps numbers which a run alone determines finite, though wide.
const RIDGE: f64 = 1e-9;

/// Slopes and residuals of a law in one piece of data.
pub(crate) struct PieceSlopes {
    /// What each number, turned up, adds to what the law says.
    pub slopes: DMatrix<f64>,
    /// What was measured less what the law says.
    pub residuals: DVector<f64>,
}

impl PieceSlopes {
    /// Those of a law with some numbers in a run, each turned from one end to another.
    pub(crate) fn of(
        run: &Run,
        numbers: &[f64],
        ends: &[[f64; 2]],
        simulated: impl Fn(&[f64], &Run) -> Vec<f64>,
    ) -> Self {
        let said = simulated(numbers, run);
        let mut slopes = DMatrix::zeros(said.len(), numbers.len());
        for (k, ends) in ends.iter().enumerate() {
            let [low, high] = ends.map(|end| {
                let mut turned = numbers.to_vec();
                turned[k] = end;
                simulated(&turned, run)
            });
            let column = high.iter().zip(&low).map(|(high, low)| (high - low) / (ends[1] - ends[0]));
            slopes.set_column(k, &DVector::from_iterator(said.len(), column));
        }
        let residuals = said.iter().zip(&run.opening).map(|(said, seen)| seen - said);
        Self { slopes, residuals: DVector::from_iterator(said.len(), residuals) }
    }
}

/// Covariance of the numbers, from one piece to the next; none of a single piece. `whole` is the Hessian of all, with what is known beforehand.
pub(crate) fn spread(whole: &DMatrix<f64>, pieces: &[PieceSlopes]) -> Option<DMatrix<f64>> {
    let width = whole.ncols();
    let count = pieces.len() as f64;
    if pieces.len() < 2 || width == 0 {
        return None;
    }
    // Each number by its own size, so that the ridge means the same in every unit.
    let sizes = DVector::from_fn(width, |k, _| whole[(k, k)].max(0.0).sqrt().max(f64::MIN_POSITIVE.sqrt()));
    let scaled = |matrix: &DMatrix<f64>| DMatrix::from_fn(width, width, |i, j| matrix[(i, j)] / (sizes[i] * sizes[j]));
    let mut moved = DMatrix::zeros(width, width);
    for piece in pieces {
        let others = scaled(&(whole - piece.slopes.tr_mul(&piece.slopes))) + DMatrix::identity(width, width) * RIDGE;
        let gradient = piece.slopes.tr_mul(&piece.residuals).component_div(&sizes);
        let by = others.cholesky()?.solve(&gradient).component_div(&sizes);
        moved.ger(1.0, &by, &by, 1.0);
    }
    Some(moved * ((count - 1.0) / count))
}

/// Share of what a law misses that is common to all pieces, and so not seen in what differs between them.
const COMMON: f64 = 0.25;

/// The same with what the law misses in all pieces alike: the design effect `1 + (n − 1) ρ` of n pieces with a correlation ρ (Kish 1965, *Survey Sampling*,
/// section 5.4).
pub(crate) fn with_common(spread: DMatrix<f64>, pieces: usize) -> DMatrix<f64> {
    spread * (1.0 + COMMON * (pieces as f64 - 1.0).max(0.0))
}

/// Standard errors beyond which a gain is more than chance.
const STANDARD_ERRORS: f64 = 2.0;

/// Whether what pieces gain is more than what differs between them.
pub(crate) fn is_gain(gained: &[f64]) -> bool {
    let count = gained.len() as f64;
    let mean = gained.iter().sum::<f64>() / count;
    let variance = gained.iter().map(|one| (one - mean).powi(2)).sum::<f64>() / (count - 1.0);
    mean > STANDARD_ERRORS * (variance / count).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Runs of a line whose slope differs from run to run by a deviation.
    fn runs(seed: u64, deviation: f64) -> Vec<Run> {
        let mut state = seed;
        let mut even = move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let mut run = || {
            let slope = 2.0 + deviation * 12.0_f64.sqrt() * even();
            let time_s: Vec<f64> = (0..50).map(f64::from).collect();
            let opening = time_s.iter().map(|t| slope * t + 0.01 * even()).collect();
            Run { spool: time_s.clone(), opening, time_s, ..Run::default() }
        };
        (0..12).map(|_| run()).collect()
    }

    #[test]
    fn what_differs_from_run_to_run_is_in_the_spread() {
        let law = |numbers: &[f64], run: &Run| run.time_s.iter().map(|t| numbers[0] * t).collect::<Vec<f64>>();
        let mut inside = 0;
        for seed in 0..200 {
            let runs = runs(seed, 0.1);
            let of = |run: &Run| run.opening.iter().zip(&run.time_s).map(|(y, t)| y * t).sum::<f64>();
            let square: f64 = runs.iter().flat_map(|run| &run.time_s).map(|t| t * t).sum();
            let found = runs.iter().map(of).sum::<f64>() / square;
            let pieces: Vec<PieceSlopes> =
                runs.iter().map(|run| PieceSlopes::of(run, &[found], &[[found - 1e-3, found + 1e-3]], law)).collect();
            let hessian = DMatrix::from_element(1, 1, square);
            let sd = spread(&hessian, &pieces).unwrap()[(0, 0)].sqrt();
            inside += usize::from((found - 2.0).abs() <= 1.645 * sd);
        }
        // By chance 180 ± 4, and somewhat fewer with 12 runs.
        assert!((165..=192).contains(&inside), "{inside} of 200");
        assert!(spread(&DMatrix::identity(1, 1), &[]).is_none());
    }
}
