//! What stands out of an effect, and how much of it free parameters hide.
//!
//! A mark of squared length g beyond what the free parameters can imitate has `g + (H⁻¹b)ₖ² / (H⁻¹)ₖₖ` once parameter k is known, by the Schur complement
//! of its row in H; b are the products of the mark with the slopes.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::{Atom, Linearisation};

/// A mark shorter than this is none.
const NO_MARK: f64 = 1e-6;

/// Squared lengths of the marks beyond the discrepancy terms alone; `h` holds slopes, then terms, and `shared` their products with the marks.
pub(super) fn at_best(
    h: &DMatrix<f64>,
    shared: &DMatrix<f64>,
    gram: &DMatrix<f64>,
    (slopes, count): (usize, usize),
) -> DVector<f64> {
    let (known, terms) = (h.nrows(), h.nrows() - slopes);
    let of_terms = shared.view((slopes, 0), (terms, count));
    let factor = Cholesky::new(h.view((slopes, slopes), (terms, terms)).into_owned());
    let solved = factor.map_or_else(|| DMatrix::zeros(terms, count), |cholesky| cholesky.solve(&of_terms));
    DVector::from_fn(count, |k, _| gram[(known + k, known + k)] - of_terms.column(k).dot(&solved.column(k)))
}

impl Linearisation {
    /// The mark of an effect that is nearest in size to what would stand out by this gain in cost, and that size, in typical ones.
    fn nearest(&self, effect: usize, gain: f64) -> Option<(usize, f64)> {
        let visible = |(k, atom): (usize, &Atom)| match atom {
            Atom::Sized { effect: other, variant } if *other == effect && variant.size > 0.0 => {
                let strength = self.gram[(k, k)];
                (strength > NO_MARK).then(|| (k, variant.size * (gain / strength).sqrt(), variant.size))
            }
            _ => None,
        };
        // Of the sizes tried the one nearest to what would stand out knows best.
        let far = |&(_, size, tried): &(usize, f64, f64)| (size / tried).ln().abs();
        let all = self.atoms.iter().enumerate().filter_map(visible);
        all.min_by(|a, b| far(a).total_cmp(&far(b))).map(|(k, size, _)| (k, size))
    }

    /// Smallest size of an effect that would stand out by this gain in cost, in typical sizes; infinite where none would.
    pub fn minimum_detectable_size(&self, effect: usize, gain: f64) -> f64 {
        self.nearest(effect, gain).map_or(f64::INFINITY, |(_, size)| size)
    }

    /// By how much an effect would show sharper, at the size that stands out by this gain, were a free parameter known: a ratio, 1 or more.
    pub fn sharper_ratio(&self, effect: usize, gain: f64, free_parameter: usize) -> f64 {
        let Some((k, _)) = self.nearest(effect, gain) else { return 1.0 };
        let variance = self.variances[free_parameter];
        if variance <= 0.0 {
            return 1.0;
        }
        (1.0 + self.follow[(free_parameter, k)].powi(2) / (variance * self.gram[(k, k)])).sqrt()
    }

    /// The same were all free parameters known.
    pub fn sharpest_ratio(&self, effect: usize, gain: f64) -> f64 {
        self.nearest(effect, gain).map_or(1.0, |(k, _)| (self.at_best[k] / self.gram[(k, k)]).max(1.0).sqrt())
    }
}
