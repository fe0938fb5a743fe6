//! The linear picture about a point: slopes of the free parameters, marks of discrepancy terms and of every effect at several sizes, their Gram
//! matrix, and the evidence of all fault sets that follows from it.
//!
//! `r = r₀ + J Δθ + B w + Σ c_e d_e`: residuals r₀ and slopes J at the point, marks B of discrepancy terms, and for each effect the change d_e that
//! each size of a profile over its whole range brings, both signs, scaled by c_e between its neighbours. The free parameters follow each size before its
//! mark is taken, `d_e = r(θ₀ + Δθ, s) − r₀ − J Δθ`, so that kinks, play, dead times and limit cycles count as they are where they would stand.
//! With `θ ~ N(θ₀, I)`, `w ~ N(0, κ²)`, everything but c is integrated out by one Cholesky factor, and the evidence of a set of effects is
//! `½ ln Z = −½ cost(ĉ) − ½ ln |I + τ² C G C|` with the projected Gram matrix G of its marks (Bayesian linear regression; Bishop 2006, section 3.5).

mod hidden;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use crate::estimation::coordinate::Coordinate;
use crate::estimation::linear::gram;
use crate::hypotheses::profile::{Atom, ProfilePlace};
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use crate::model::discrepancy::Columns;
use crate::model::support::{SIZE_PRIOR, Variant};
use govtwin_model::parameters::Unit;

/// A mark counts from its own size half-way to its neighbours.
const REACH: (f64, f64) = (0.6, 1.6);

/// Marks that are weighed together at most: three effects in place of one of the point's own, or two in place of two.
const LARGEST: usize = 4;

/// Sets of two effects that are tried with a third.
const PAIRS_EXTENDED: usize = 40;

/// A set of effects that the linear picture proposes, and where it would stand.
#[derive(Clone, Debug)]
pub struct Proposal {
    /// Places in the catalogue, with size and shape.
    pub effects: Vec<(usize, Variant)>,
    /// Places among the point's own effects that are taken away.
    pub removed: Vec<usize>,
    /// Logarithm of the evidence over that of the point.
    pub log_evidence: f64,
    /// Change of the point's free parameters.
    pub change: DVector<f64>,
}

impl Proposal {
    /// Of these effects more at a point, and none of its own less, where it stands.
    pub(super) fn at(point: &FittedModel, effects: Vec<(usize, Variant)>) -> Self {
        let change = DVector::zeros(point.free_parameters.len());
        Self { effects, removed: Vec::new(), log_evidence: 0.0, change }
    }
}

/// The picture.
#[derive(Debug)]
pub struct Linearisation {
    atoms: Vec<Atom>,
    slopes: usize,
    /// Products of the projected marks with the residual, and with each other.
    towards: DVector<f64>,
    gram: DMatrix<f64>,
    /// By how much the free parameters move for nothing, and for each mark.
    rest: DVector<f64>,
    follow: DMatrix<f64>,
    /// Variances of the free parameters.
    variances: DVector<f64>,
    /// Squared lengths of the marks were all free parameters known.
    at_best: DVector<f64>,
}

impl Linearisation {
    /// Simulates all places of the profiles about a model, and projects; `kappa` is the size of the error of equations in moderate discrepancy terms.
    pub fn new(
        problem: &Problem,
        model: &FittedModel,
        places: &[ProfilePlace],
        discrepancy: &Columns,
        kappa: f64,
    ) -> Self {
        let atoms: Vec<Atom> = places.iter().map(|place| place.atom).collect();
        let units: Vec<Unit> = places.iter().map(|place| place.at.subject()).collect();
        let change = |place: &ProfilePlace| {
            let mut change = DVector::zeros(model.free_parameters.len());
            for (&column, position) in place.at.columns.iter().zip(&place.at.positions) {
                change[column] = position - model.fit.positions[column];
            }
            change
        };
        let changes: Vec<DVector<f64>> = places.iter().map(change).collect();
        let slopes = model.free_parameters.len();
        // One recording after another: the residuals of all atoms are much memory.
        let gram_of = |recording: usize| {
            let moved = problem.only(recording).residuals_of(&units);
            let at = &model.fit.residuals[recording];
            let (own, b) = (&model.fit.slopes[recording], &discrepancy.marks[recording]);
            let mut all = DMatrix::zeros(at.len(), slopes + b.ncols() + atoms.len() + 1);
            all.columns_mut(0, slopes).copy_from(own);
            all.columns_mut(slopes, b.ncols()).copy_from(b);
            for (k, (moved, change)) in moved.iter().zip(&changes).enumerate() {
                let mut mark = all.column_mut(slopes + b.ncols() + k);
                mark.copy_from(&(&moved[0] - at));
                mark.gemv(-1.0, own, change, 1.0);
            }
            all.set_column(all.ncols() - 1, at);
            gram(&all)
        };
        let grams = (0..problem.recordings.len()).map(gram_of);
        let gram = grams.reduce(|a, b| a + b).unwrap_or_else(|| DMatrix::zeros(1, 1));
        Self::projected(model, atoms, &gram, discrepancy.marks.first().map_or(0, DMatrix::ncols), kappa)
    }

    fn projected(model: &FittedModel, atoms: Vec<Atom>, gram: &DMatrix<f64>, terms: usize, kappa: f64) -> Self {
        let (slopes, all) = (model.free_parameters.len(), gram.nrows());
        let known = slopes + terms;
        let mut h = gram.view((0, 0), (known, known)).into_owned();
        let mut shared = gram.view((0, known), (known, all - known)).into_owned();
        let residual = all - known - 1;
        for (k, free_parameter) in model.free_parameters.iter().enumerate() {
            h[(k, k)] += 1e-9;
            if let Some(centre) = free_parameter.prior_centre() {
                let distance = model.fit.positions[k] - centre;
                h[(k, k)] += 1.0;
                shared[(k, residual)] += distance;
            }
        }
        for k in slopes..known {
            h[(k, k)] += 1.0 / (kappa * kappa).max(1e-12);
        }
        let count = atoms.len();
        let factor = Cholesky::<f64, Dyn>::new(h.clone());
        let (solved, variances) = factor.map_or_else(
            || (shared.clone() * 0.0, DVector::zeros(slopes)),
            |cholesky| (cholesky.solve(&shared), cholesky.inverse().diagonal().rows(0, slopes).into_owned()),
        );
        let projected = gram.view((known, known), (all - known, all - known)) - shared.transpose() * &solved;
        let at_best = hidden::at_best(&h, &shared, gram, (slopes, count));
        Self {
            slopes,
            towards: projected.view((0, residual), (count, 1)).column(0).into_owned(),
            gram: projected.view((0, 0), (count, count)).into_owned(),
            rest: solved.view((0, residual), (slopes, 1)).column(0).into_owned(),
            follow: solved.view((0, 0), (slopes, count)).into_owned(),
            variances,
            at_best,
            atoms,
        }
    }

    /// How alike the marks of two effects are, sign and range considered: the largest cosine between marks that both may have, 0 to 1.
    pub fn likeness(&self, a: usize, b: usize) -> f64 {
        let of = |effect: usize| {
            let is_it = move |atom: &Atom| matches!(atom, Atom::Sized { effect: other, .. } if *other == effect);
            (0..self.atoms.len()).filter(move |&k| is_it(&self.atoms[k]))
        };
        let mut most = 0.0_f64;
        for k in of(a) {
            for l in of(b) {
                let lengths = self.gram[(k, k)] * self.gram[(l, l)];
                if lengths > 1e-9 {
                    most = most.max(self.gram[(k, l)] / lengths.sqrt());
                }
            }
        }
        most.min(1.0)
    }

    /// The best way of every set of up to `most` further effects, likeliest first; with or without one or two of the point's own taken away.
    pub fn proposals(&self, most: usize) -> Vec<Proposal> {
        let sized: Vec<usize> =
            (0..self.atoms.len()).filter(|&k| matches!(self.atoms[k], Atom::Sized { .. })).collect();
        let removed: Vec<usize> = (0..self.atoms.len()).filter(|&k| !sized.contains(&k)).collect();
        // With all of the point's own effects, without each, and without each two.
        let mut starts: Vec<Vec<usize>> = vec![Vec::new()];
        starts.extend(removed.iter().map(|&one| vec![one]));
        starts.extend(
            removed
                .iter()
                .enumerate()
                .flat_map(|(k, &one)| removed[k + 1..].iter().map(move |&other| vec![one, other])),
        );
        let mut all: Vec<WeighedAtoms> = Vec::new();
        for start in starts {
            let most = (most + start.len()).min(LARGEST - start.len());
            if !start.is_empty() {
                all.extend(self.weighed(&start));
            }
            let ones = best_of_each(self.grown(&start, &sized), self);
            if most >= 2 {
                let twos = best_of_each(
                    sized.iter().flat_map(|&k| self.grown(&[&start[..], &[k]].concat(), &sized)).collect(),
                    self,
                );
                if most >= 3 {
                    let threes = twos.iter().take(PAIRS_EXTENDED).flat_map(|two| self.grown(&two.atoms, &sized));
                    all.extend(best_of_each(threes.collect(), self));
                }
                all.extend(twos);
            }
            all.extend(ones);
        }
        all.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        all.into_iter().map(|weighed| self.proposal(&weighed)).collect()
    }

    /// All sets with one atom more, of another effect and behind in order, so that each set comes once.
    fn grown(&self, start: &[usize], sized: &[usize]) -> Vec<WeighedAtoms> {
        let last = start.iter().rev().find(|k| matches!(self.atoms[**k], Atom::Sized { .. })).copied();
        let others = |k: usize| start.iter().all(|&other| !same_effect(&self.atoms[k], &self.atoms[other]));
        let behind = |k: usize| last.is_none_or(|last| k > last) || start.len() > 1;
        let next = sized.iter().copied().filter(|&k| others(k) && behind(k));
        next.filter_map(|k| self.weighed(&[start, &[k]].concat())).collect()
    }

    /// The evidence of a few marks, each scaled within its reach.
    fn weighed(&self, atoms: &[usize]) -> Option<WeighedAtoms> {
        let n = atoms.len();
        let reach = |k: usize| match self.atoms[atoms[k]] {
            Atom::Sized { .. } => REACH,
            Atom::Removed { .. } => (1.0, 1.0),
        };
        let mut scales = [1.0; LARGEST];
        if n > scales.len() {
            return None;
        }
        let g = |k: usize, l: usize| self.gram[(atoms[k], atoms[l])];
        for _ in 0..20 {
            for k in 0..n {
                let own = g(k, k);
                if own > 1e-12 {
                    let others: f64 = (0..n).filter(|&l| l != k).map(|l| g(k, l) * scales[l]).sum();
                    let (low, high) = reach(k);
                    scales[k] = (-(self.towards[atoms[k]] + others) / own).clamp(low, high);
                }
            }
        }
        let mut gain = 0.0;
        for k in 0..n {
            gain -= scales[k] * (2.0 * self.towards[atoms[k]] + (0..n).map(|l| g(k, l) * scales[l]).sum::<f64>());
        }
        let (median, spread) = SIZE_PRIOR;
        let mut occam = DMatrix::<f64>::identity(n, n);
        let mut prior = 0.0;
        for k in 0..n {
            if let Atom::Sized { variant, .. } = self.atoms[atoms[k]] {
                prior += ((variant.size.abs() * scales[k] / median).ln() / spread).powi(2);
                for l in 0..n {
                    if matches!(self.atoms[atoms[l]], Atom::Sized { .. }) {
                        occam[(k, l)] += spread * spread * scales[k] * scales[l] * g(k, l);
                    }
                }
            }
        }
        let log_evidence = 0.5 * (gain - prior - occam.determinant().max(1.0).ln());
        Some(WeighedAtoms { atoms: atoms.to_vec(), scales, log_evidence })
    }

    fn proposal(&self, weighed: &WeighedAtoms) -> Proposal {
        let mut change = -&self.rest;
        let (mut effects, mut removed) = (Vec::new(), Vec::new());
        for (&k, &scale) in weighed.atoms.iter().zip(&weighed.scales) {
            change -= self.follow.column(k) * scale;
            match self.atoms[k] {
                Atom::Sized { effect, variant } => {
                    effects.push((effect, Variant { size: variant.size * scale, ..variant }));
                }
                Atom::Removed { own } => removed.push(own),
            }
        }
        debug_assert_eq!(change.len(), self.slopes);
        Proposal { effects, removed, log_evidence: weighed.log_evidence, change }
    }
}

/// A few atoms with their scales and the evidence.
#[derive(Clone, Debug)]
struct WeighedAtoms {
    atoms: Vec<usize>,
    scales: [f64; LARGEST],
    log_evidence: f64,
}

fn same_effect(a: &Atom, b: &Atom) -> bool {
    matches!((a, b), (Atom::Sized { effect: a, .. }, Atom::Sized { effect: b, .. }) if a == b)
}

/// The best sizes of every set of effects, likeliest first.
fn best_of_each(mut all: Vec<WeighedAtoms>, of: &Linearisation) -> Vec<WeighedAtoms> {
    let key = |weighed: &WeighedAtoms| -> Vec<usize> {
        let mut effects: Vec<usize> = weighed
            .atoms
            .iter()
            .filter_map(|&k| match of.atoms[k] {
                Atom::Sized { effect, .. } => Some(effect),
                Atom::Removed { .. } => None,
            })
            .collect();
        effects.sort_unstable();
        effects
    };
    all.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    let mut seen = std::collections::BTreeSet::new();
    all.retain(|weighed| seen.insert(key(weighed)));
    all
}
