//! Evidence of something unknown at a stage: the discrepancy terms of each place fitted together with the data-sheet parameters.
//!
//! A large term moves a unit farther than a linear picture at the refitted sheet holds, and the sheet may have been strained to make up for it. Each
//! place's terms are therefore fitted from the refitted sheet and from the sheet itself. The evidence is the larger of two linear pictures: about the end
//! of that fit, where the terms are large, and about the refitted sheet, where they are small; there they gain no more than the fit did.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IndexedParallelIterator, IntoParallelRefIterator, ParallelIterator};

use crate::diagnosis::evidence::{NormalEquations, Shared};
use crate::diagnosis::model::FittedModel;
use crate::diagnosis::model::discrepancy::{self, PLACES};
use crate::effects::Stage;
use crate::estimation::coordinate::{Coordinate, Judge, Residuals};
use crate::estimation::fit::{Effort, Fit, Start, beside, fit_all};
use crate::estimation::linear::crossed;
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::noise::log_sum;
use crate::likelihood::problem::Problem;
use crate::parameters::Unit;
use crate::twin::Twin;

/// What 1 is of a term's position, in moderate terms; beforehand positions are N(0, 1).
const SCALE: f64 = 16.0;

/// Farthest position of a term.
const FARTHEST: f64 = 6.0;

/// Places that are fitted in step with each other, from two points each: enough to fill the lanes of all threads, few enough to hold all of their slopes.
const TOGETHER: usize = 4;

/// Places that are fitted on with care.
const REFINED: usize = 4;

/// Work of such a fit.
const CAREFUL: Effort = Effort { rounds: 6, refresh: 3, temperature: 1.0 };

/// A unit with terms at one place.
#[derive(Clone, Debug)]
struct WithTerms {
    unit: Unit,
    place: usize,
    /// In moderate terms, by the place's shapes.
    sizes: Vec<f64>,
}

/// What such a fit turns.
#[derive(Clone, Copy, Debug)]
enum Direction {
    /// A parameter of the data sheet.
    Sheet(FreeParameter),
    /// A shape of the place.
    Shape(usize),
}

impl Coordinate for Direction {
    type Subject = WithTerms;

    fn range(&self, base: &WithTerms) -> (f64, f64) {
        match self {
            Self::Sheet(parameter) => parameter.range(&base.unit),
            Self::Shape(_) => (-FARTHEST, FARTHEST),
        }
    }

    fn prior_centre(&self) -> Option<f64> {
        match self {
            Self::Sheet(parameter) => parameter.prior_centre(),
            Self::Shape(_) => Some(0.0),
        }
    }

    fn turn(&self, base: &WithTerms, subject: &mut WithTerms, position: f64) {
        match *self {
            Self::Sheet(parameter) => parameter.turn(&base.unit, &mut subject.unit, position),
            Self::Shape(shape) => subject.sizes[shape] = SCALE * position,
        }
    }
}

/// The recordings, as judges of units with terms.
struct Recordings<'a>(&'a Problem);

impl Judge<WithTerms> for Recordings<'_> {
    fn residuals_of(&self, subjects: &[WithTerms]) -> Vec<Residuals> {
        let twin = |one: &WithTerms| discrepancy::twin_with(&one.unit, &PLACES[one.place], &one.sizes);
        self.0.residuals_of_twins(&subjects.iter().map(twin).collect::<Vec<Twin>>())
    }
}

/// Logarithm of the evidence of something unknown at each stage, whatever it is: a single shape at one of its places, or any sum of one place's
/// shapes, as likely. All places of a stage at once would cost a stage with many of them the more, whatever the recordings say.
#[must_use]
pub fn evidence(problem: &Problem, refitted: &FittedModel, shared: &Shared) -> BTreeMap<String, f64> {
    let sheet = FittedModel::sheet(problem, &refitted.base, &refitted.free_parameters);
    let fitting = Fitting { problem, refitted, sheet: &sheet, shared, near: shared.normal(refitted) };
    let places: Vec<usize> = (0..PLACES.len()).collect();
    let mut found: Vec<Found> = places.chunks(TOGETHER).flat_map(|places| fitting.scouted(places)).collect();
    let mut order = places;
    order.sort_by(|&a, &b| found[a].cost.total_cmp(&found[b].cost));
    order.truncate(REFINED);
    let careful = fitting.refined(&order, &found);
    for (place, one) in order.into_iter().zip(careful) {
        found[place] = one;
    }
    let mean = |all: &[f64]| log_sum(all.iter().copied()) - (all.len() as f64).ln();
    let of = |stage: Stage| {
        let here = || PLACES.iter().zip(&found).filter(|(place, _)| place.stage == stage).map(|(_, one)| one);
        let kinds =
            [0, 1].map(|kind| mean(&here().flat_map(|one| one.evidence[kind].iter().copied()).collect::<Vec<_>>()));
        here().next().map(|_| (stage.id().to_owned(), mean(&kinds)))
    };
    Stage::ALL.into_iter().filter_map(of).filter(|(_, evidence)| evidence.is_finite()).collect()
}

/// Something unknown at a place, fitted.
struct Found {
    positions: Vec<f64>,
    cost: f64,
    /// Logarithms of the evidence of single shapes, and of sums of all.
    evidence: [Vec<f64>; 2],
}

/// Where a fit of a place begins.
struct Begin<'a> {
    place: usize,
    positions: Vec<f64>,
    /// Slopes of the leading directions that are good enough there.
    known: Option<&'a [DMatrix<f64>]>,
}

/// What all such fits share.
struct Fitting<'a> {
    problem: &'a Problem,
    refitted: &'a FittedModel,
    sheet: &'a FittedModel,
    shared: &'a Shared,
    /// The linear picture about the refitted sheet.
    near: NormalEquations,
}

impl Fitting<'_> {
    fn base(&self, place: usize) -> WithTerms {
        WithTerms { unit: self.refitted.base.clone(), place, sizes: vec![0.0; PLACES[place].shapes()] }
    }

    fn directions(&self, place: usize) -> Vec<Direction> {
        let sheet = self.refitted.free_parameters.iter().copied().map(Direction::Sheet);
        sheet.chain((0..PLACES[place].shapes()).map(Direction::Shape)).collect()
    }

    /// The better of two quick fits of each place: from the refitted sheet, where all slopes are known, and from the sheet itself.
    fn scouted(&self, places: &[usize]) -> Vec<Found> {
        let known: Vec<Vec<DMatrix<f64>>> =
            places.iter().map(|&place| self.shared.slopes_beside(self.refitted, place)).collect();
        let from = |point: &FittedModel, place: usize| -> Vec<f64> {
            point.fit.positions.iter().copied().chain(std::iter::repeat_n(0.0, PLACES[place].shapes())).collect()
        };
        let begins = places.iter().zip(&known).flat_map(|(&place, known)| {
            [(self.refitted, known), (self.sheet, &self.sheet.fit.slopes)].map(|(point, known)| Begin {
                place,
                positions: from(point, place),
                known: Some(known),
            })
        });
        let mut fits = self.fitted(&begins.collect::<Vec<_>>(), Effort::SCOUT).into_iter();
        let pairs = std::iter::from_fn(|| Some((fits.next()?, fits.next()?)));
        let better = pairs.map(|(a, b)| if b.cost() < a.cost() { b } else { a }).collect();
        self.weighed(places, better)
    }

    /// Fits places on with care; all slopes are measured anew, since those by the terms bend most.
    fn refined(&self, places: &[usize], found: &[Found]) -> Vec<Found> {
        let begins =
            places.iter().map(|&place| Begin { place, positions: found[place].positions.clone(), known: None });
        self.weighed(places, self.fitted(&begins.collect::<Vec<_>>(), CAREFUL))
    }

    fn fitted(&self, begins: &[Begin<'_>], effort: Effort) -> Vec<Fit> {
        let bases: Vec<(WithTerms, Vec<Direction>)> =
            begins.iter().map(|begin| (self.base(begin.place), self.directions(begin.place))).collect();
        let starts = begins.iter().zip(&bases).map(|(begin, (base, coordinates))| {
            let Begin { positions, known, .. } = begin;
            Start { base, coordinates, positions, effort, known: *known }
        });
        fit_all(&Recordings(self.problem), &starts.collect::<Vec<_>>())
    }

    fn weighed(&self, places: &[usize], fits: Vec<Fit>) -> Vec<Found> {
        let weighed = places.par_iter().zip(fits).map(|(&place, fit)| {
            let small = self.near.unknown_at(place, (self.refitted.cost() - fit.cost()).max(0.0));
            let large = self.shared.normal_about(self.refitted, place, &fit).unknown_at(place, f64::INFINITY);
            let larger = |kind: usize| small[kind].iter().zip(&large[kind]).map(|(a, b)| a.max(*b)).collect();
            Found { cost: fit.cost(), positions: fit.positions, evidence: [larger(0), larger(1)] }
        });
        weighed.collect()
    }
}

impl Shared {
    /// Slopes of a model without effects, and beside them those of a place's terms by position.
    fn slopes_beside(&self, model: &FittedModel, place: usize) -> Vec<DMatrix<f64>> {
        let (first, count) = (PLACES[place].first(), PLACES[place].shapes());
        let pairs = model.fit.slopes.iter().zip(&self.columns.marks);
        pairs.map(|(slopes, marks)| beside(slopes, &(marks.columns(first, count) * SCALE))).collect()
    }

    /// The normal equations about a fit with terms at a place: the terms' sizes are counted from nothing, their marks are those about the fit.
    fn normal_about(&self, model: &FittedModel, place: usize, fit: &Fit) -> NormalEquations {
        let (n, b) = (model.free_parameters.len(), self.gram.nrows());
        let (first, count) = (PLACES[place].first(), PLACES[place].shapes());
        let (sheet, terms) = fit.positions.split_at(n);
        let sizes = DVector::from_iterator(count, terms.iter().map(|position| SCALE * position));
        let mut normal = NormalEquations {
            cost: model
                .free_parameters
                .iter()
                .zip(sheet)
                .filter_map(|(one, at)| Some((at - one.prior_centre()?).powi(2)))
                .sum(),
            slopes: n,
            settled: 0,
            terms: b,
            hessian: DMatrix::zeros(n + b, n + b),
            gradient: DVector::zeros(n + b),
            sizes: 0.0,
            log_precision: 0.0,
            parts: Vec::new(),
        };
        normal.hessian.view_mut((n, n), (b, b)).copy_from(&self.gram);
        normal.hessian.view_mut((n, n + first), (b, count)).fill(0.0);
        normal.hessian.view_mut((n + first, n), (count, b)).fill(0.0);
        for (trial, residuals) in fit.residuals.iter().enumerate() {
            let slopes = fit.slopes[trial].columns(0, n).into_owned();
            let own = fit.slopes[trial].columns(n, count) / SCALE;
            let residuals = residuals - &own * &sizes;
            let mut marks = self.columns.marks[trial].clone();
            marks.columns_mut(first, count).copy_from(&own);
            normal.cost += residuals.norm_squared();
            let mut add = |at: (usize, usize), block: &DMatrix<f64>| {
                let mut view = normal.hessian.view_mut(at, block.shape());
                view += block;
            };
            let across = crossed(&marks, &own);
            add((0, 0), &crossed(&slopes, &slopes));
            add((0, n), &crossed(&slopes, &marks));
            add((n, n + first), &across);
            // The block of the terms with themselves is in it already.
            let mut rest = across.transpose();
            rest.columns_mut(first, count).fill(0.0);
            add((n + first, n), &rest);
            for (at, along) in [(0, slopes.tr_mul(&residuals)), (n, marks.tr_mul(&residuals))] {
                let mut view = normal.gradient.rows_mut(at, along.len());
                view += along;
            }
        }
        normal.hessian.fill_lower_triangle_with_upper_triangle();
        normal.add_priors(&model.base, &model.free_parameters, sheet);
        normal
    }
}
