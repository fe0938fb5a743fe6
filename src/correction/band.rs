//! A band around a corrected estimate: split conformal prediction (Vovk et al. 2005; Lei et al. 2018), by the state of motion.
//!
//! The half width is the ⌈(n + 1)·c⌉-th smallest residual on rows that the trees were not trained on, apart for rows at rest
//! and rows in motion. Coverage is guaranteed where new rows are exchangeable with those; rows of one recording follow each
//! other, so it is measured on the test part and stated beside the band.

use serde::{Deserialize, Serialize};

/// Half widths of a band, in the signal's unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Band {
    /// Share of rows that it is to cover.
    pub coverage_share: f64,
    /// A row whose twin moved by more than this over the last five periods is in motion; the coefficient's unit is the signal's.
    pub moving_above: f64,
    /// Half width at rest; the coefficient's unit is the signal's.
    pub at_rest: f64,
    /// Half width in motion; the coefficient's unit is the signal's.
    pub in_motion: f64,
}

/// Fewer residuals than this give no band of their own.
const FEWEST: usize = 30;

impl Band {
    /// The band of residuals, each with how far its twin moved. `None` where there are too few.
    pub fn of(residuals: &[(f64, f64)], coverage_share: f64) -> Option<Self> {
        let mut motions: Vec<f64> = residuals.iter().map(|(motion, _)| *motion).collect();
        motions.sort_by(f64::total_cmp);
        // The livelier third, so that both states have rows.
        let moving_above = *motions.get(motions.len() * 2 / 3)?;
        let of = |keep: &dyn Fn(f64) -> bool| {
            let kept =
                residuals.iter().filter(|(motion, _)| keep(*motion)).map(|(_, residual)| residual.abs()).collect();
            quantile(kept, coverage_share)
        };
        let whole = of(&|_| true)?;
        Some(Self {
            coverage_share,
            moving_above,
            at_rest: of(&|motion| motion <= moving_above).unwrap_or(whole),
            in_motion: of(&|motion| motion > moving_above).unwrap_or(whole),
        })
    }

    /// The half width for a row whose twin moved so far.
    pub fn half_width(&self, motion: f64) -> f64 {
        if motion > self.moving_above { self.in_motion } else { self.at_rest }
    }
}

/// The conformal quantile of residuals that are not negative.
fn quantile(mut residuals: Vec<f64>, coverage_share: f64) -> Option<f64> {
    residuals.retain(|residual| residual.is_finite());
    if residuals.len() < FEWEST {
        return None;
    }
    residuals.sort_by(f64::total_cmp);
    conformal(&residuals, coverage_share)
}

/// The ⌈(n + 1)·c⌉-th smallest of n sorted numbers, the largest where there is none.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "counts of rows, and a share of them that lies between 0 and the count plus one"
)]
pub(crate) fn conformal(sorted: &[f64], share: f64) -> Option<f64> {
    let rank = ((sorted.len() + 1) as f64 * share).ceil() as usize;
    sorted.get(rank.clamp(1, sorted.len().max(1)) - 1).copied()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::Band;

    fn residuals(count: usize, seed: u64) -> Vec<(f64, f64)> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = || {
            let motion: f64 = random.random();
            let residual = random.random_range(-1.0..1.0_f64) * if motion > 0.7 { 5.0 } else { 0.1 };
            (motion, residual)
        };
        (0..count).map(|_| draw()).collect()
    }

    #[test]
    fn new_rows_are_covered_as_stated_in_both_states() {
        let band = Band::of(&residuals(3000, 1), 0.9).unwrap();
        assert!(band.in_motion > 10.0 * band.at_rest);
        for state in [true, false] {
            let fresh = residuals(30_000, 2);
            let of_state: Vec<_> = fresh.iter().filter(|(motion, _)| (*motion > band.moving_above) == state).collect();
            let covered =
                of_state.iter().filter(|(motion, residual)| residual.abs() <= band.half_width(*motion)).count();
            let share = covered as f64 / of_state.len() as f64;
            assert!((share - 0.9).abs() < 0.02, "{share}");
        }
    }

    #[test]
    fn too_few_rows_give_no_band() {
        assert_eq!(Band::of(&residuals(20, 3), 0.9), None);
        assert_eq!(Band::of(&[], 0.9), None);
    }
}
