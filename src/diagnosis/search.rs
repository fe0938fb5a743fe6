//! Which: every effect of the catalogue tried in turn and together, the sheet's parameters refitted with it.

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::effects::EffectSpec;
use crate::parameters::{EffectSetting, Unit};
use crate::tuning::cooling::cooled;
use crate::tuning::fit::{Bench, DIFFERENCE, Effort, Fit, Misses, fit, prior_square, slopes, square};
use crate::tuning::knob::{Knob, unit_at};
use crate::tuning::linear::{Projection, normal};
use crate::tuning::noise::Noise;
use crate::tuning::trial::Trial;
use crate::tuning::trips::placed;

/// Sizes at which an effect is tried first, in units of its typical size.
const SIZES: [f64; 5] = [0.2, 0.8, 3.0, -0.2, -0.8];

/// Farthest that a slope at nothing is trusted, in units of the typical size.
const FARTHEST: f64 = 3.0;

/// By how much less an effect must promise to cost to be fitted from nothing on.
const PROMISING: f64 = 8.0;

/// Work of a fit that starts from nothing of an effect.
const CREEP: Effort = Effort { rounds: 6, refresh: 100, temperature: 1.0 };

/// A model with all its knobs fitted: the sheet's tolerances, then the parameters of its effects.
#[derive(Clone, Debug)]
pub struct Model {
    /// The effects beyond those of the unit itself.
    pub effects: Vec<&'static EffectSpec>,
    /// The unit with the effects in it, neutral.
    pub base: Unit,
    /// What was fitted.
    pub knobs: Vec<Knob>,
    /// The fit; a model that was only scouted keeps neither misses nor slopes.
    pub fit: Fit,
    /// Covariance of the knobs about the fit.
    pub spread: DMatrix<f64>,
}

impl Model {
    /// A model as fitted.
    #[must_use]
    pub fn new(effects: Vec<&'static EffectSpec>, base: Unit, knobs: Vec<Knob>, fit: Fit) -> Self {
        let spread = covariance(&knobs, &fit);
        Self { effects, base, knobs, fit, spread }
    }

    /// The same without misses and slopes, which are nearly all of its memory.
    fn light(mut self) -> Self {
        (self.fit.misses, self.fit.slopes) = (Vec::new(), Vec::new());
        self
    }

    /// The same effects and knobs, fitted otherwise, if that is better.
    #[must_use]
    pub fn or_better(&self, fit: Fit) -> Self {
        if fit.square + fit.prior <= self.cost() || self.fit.slopes.is_empty() {
            Self::new(self.effects.clone(), self.base.clone(), self.knobs.clone(), fit)
        } else {
            self.clone()
        }
    }

    /// The same model, unfitted, where another that has one effect more has the parameters of this one; none where that one was only scouted.
    #[must_use]
    pub fn moved(&self, bench: &Bench, to: &Self) -> Option<Self> {
        let count = self.knobs.len();
        let positions = to.fit.positions.get(..count)?.to_vec();
        let slopes: Vec<DMatrix<f64>> =
            to.fit.slopes.iter().map(|slopes| slopes.columns(0, count).into_owned()).collect();
        if slopes.is_empty() {
            return None;
        }
        let misses = bench.misses_of(&[unit_at(&self.base, &self.knobs, &positions)]).pop()?;
        let prior = prior_square(&self.knobs, &positions);
        let fit = Fit { square: square(&misses), prior, positions, misses, slopes };
        Some(Self::new(self.effects.clone(), self.base.clone(), self.knobs.clone(), fit))
    }

    /// Squares of misses and priors together.
    #[must_use]
    pub fn cost(&self) -> f64 {
        self.fit.square + self.fit.prior
    }

    /// The unit as fitted.
    #[must_use]
    pub fn unit(&self) -> Unit {
        unit_at(&self.base, &self.knobs, &self.fit.positions)
    }

    /// Whether it has this effect.
    #[must_use]
    pub fn has(&self, id: &str) -> bool {
        self.effects.iter().any(|effect| effect.id == id)
    }

    /// Id of the effect that was added last.
    #[must_use]
    pub fn newest(&self) -> Option<&'static str> {
        self.effects.last().map(|effect| effect.id)
    }

    /// Ids of the effects.
    #[must_use]
    pub fn ids(&self) -> Vec<&'static str> {
        self.effects.iter().map(|effect| effect.id).collect()
    }

    /// The model with slopes to judge it by, fitted on where it was only scouted.
    #[must_use]
    pub fn with_slopes(&self, bench: &Bench) -> Self {
        if self.fit.slopes.is_empty() { self.refined(bench, Effort::SCOUT) } else { self.clone() }
    }

    /// Fits on from here with all the care that a report needs.
    #[must_use]
    pub fn refined(&self, bench: &Bench, effort: Effort) -> Self {
        let known = (!self.fit.slopes.is_empty()).then_some(self.fit.slopes.as_slice());
        self.or_better(fit(bench, &self.base, &self.knobs, &self.fit.positions, effort, known))
    }
}

/// What a nominal fit turns, and from how many starts.
#[derive(Clone, Debug)]
pub struct Turned {
    /// The knobs.
    pub knobs: Vec<Knob>,
    /// Starts: the sheet, and places scattered around it, the same each time.
    pub starts: usize,
}

/// Turns in which trips between slow samples and parameters are fitted to each other.
const TURNS: usize = 3;

/// How far further starts lie from the sheet, in standard deviations.
const SCATTER: f64 = 1.0;

/// Refits the model of the sheet; the noise is laid out anew along the refitted trajectory.
///
/// Returns the bench, the refitted model, and the same model unfitted.
#[must_use]
pub fn nominal(trials: Vec<Trial>, unit: &Unit, turned: Turned, noise: &Noise) -> (Bench, Model, Model) {
    let Turned { knobs, starts } = turned;
    let zeros: Vec<f64> = knobs.iter().map(|knob| knob.start(unit)).collect();
    let first = Bench::new(trials, unit, noise);
    let start = (0..starts.max(1))
        .map(|number| {
            // Additive recurrence with the golden section: even, and without a generator.
            let off = |k: usize| SCATTER * (2.0 * ((k * 7 + number * 3) as f64 * 0.618_033_988_75).fract() - 1.0);
            let scattered = zeros.iter().enumerate().map(|(k, zero)| if number == 0 { *zero } else { zero + off(k) });
            cooled(&first, unit, &knobs, &scattered.collect::<Vec<_>>(), 3)
        })
        .min_by(|a, b| (a.square + a.prior).total_cmp(&(b.square + b.prior)))
        .map_or_else(|| zeros.clone(), |fit| fit.positions);
    let mut bench = Bench::new(first.trials, &unit_at(unit, &knobs, &start), noise);
    let mut fine = fit(&bench, unit, &knobs, &start, Effort::FULL, None);
    // The unit that explains the trips best and the trips that suit it best are found in turns.
    for _ in 0..TURNS {
        let Some(trials) = placed(&bench, &unit_at(unit, &knobs, &fine.positions)) else { break };
        bench = Bench::new(trials, &unit_at(unit, &knobs, &fine.positions), noise);
        fine = cooled(&bench, unit, &knobs, &fine.positions, 3);
    }
    let misses = bench.misses_of(&[unit_at(unit, &knobs, &zeros)]).pop().unwrap_or_default();
    let slopes = slopes(&bench, unit, &knobs, &zeros, 0, &misses);
    let prior = prior_square(&knobs, &zeros);
    let sheet = Fit { square: square(&misses), prior, positions: zeros, misses, slopes };
    let model = |fit| Model::new(Vec::new(), unit.clone(), knobs.clone(), fit);
    (bench, model(fine), model(sheet))
}

/// The model with one more effect, its parameters at a size in units of the typical one.
#[must_use]
pub fn with_effect(from: &Model, spec: &'static EffectSpec, size: f64) -> Option<(Unit, Vec<Knob>, Vec<f64>)> {
    let mut base = from.base.clone();
    let effect = base.effects.len();
    base.effects.push(EffectSetting {
        id: spec.id.to_owned(),
        values: spec.parameters.iter().map(|parameter| parameter.neutral).collect(),
    });
    let mut knobs = from.knobs.clone();
    let mut positions = from.fit.positions.clone();
    for (parameter, spec) in spec.parameters.iter().enumerate() {
        let knob = Knob::Effect { effect, parameter, spec };
        let (low, high) = knob.range(&base);
        positions.push(if parameter == 0 { size } else { 1.0 }.clamp(low, high));
        knobs.push(knob);
    }
    let placed = positions.get(from.knobs.len()).copied();
    // What the bounds cut short is tried at another size.
    (placed == Some(size)).then_some((base, knobs, positions))
}

/// A place to start from: a model, the temperatures through which a fit from there cools, and what is worth a fit.
#[derive(Clone, Copy, Debug)]
pub struct Start<'a> {
    /// The model.
    pub model: &'a Model,
    /// Temperatures, highest first.
    pub ladder: &'a [f64],
    /// An effect that promises no lower cost than this at any size is not fitted.
    pub bar: f64,
}

impl<'a> Start<'a> {
    /// What a change of the model could lead to, at the highest temperature.
    fn projection(&self) -> Projection<'a> {
        let (model, hottest) = (self.model, self.ladder.first().copied().unwrap_or(1.0));
        Projection::new(&model.knobs, &model.fit.positions, &model.fit.slopes, hottest)
    }
}

/// Adds each effect to a model in turn: from each of the starts, screens sizes, then scouts the best; from the first of them also from nothing of
/// the effect, where its slope promises more.
#[must_use]
pub fn extend(bench: &Bench, starts: &[Start<'_>], catalogue: &[&'static EffectSpec]) -> Vec<Model> {
    let priced: Vec<(&Start<'_>, Projection<'_>)> = starts.iter().map(|start| (start, start.projection())).collect();
    catalogue
        .par_iter()
        .filter_map(|spec| {
            let scouted = priced
                .iter()
                .filter(|(start, _)| !start.model.has(spec.id))
                .filter_map(|(start, projection)| scout(bench, start, projection, spec))
                .min_by(|a, b| a.cost().total_cmp(&b.cost()));
            let (start, projection) = priced.first()?;
            crept(bench, start, projection, spec, scouted)
        })
        .collect()
}

/// The model with one effect more, at the best of several sizes, fitted quickly.
fn scout(bench: &Bench, start: &Start<'_>, projection: &Projection<'_>, spec: &'static EffectSpec) -> Option<Model> {
    let from = start.model;
    let price = |size: f64| {
        let (base, knobs, positions) = with_effect(from, spec, size)?;
        let misses = bench.misses_of(&[unit_at(&base, &knobs, &positions)]).pop()?;
        Some((projection.cost(&misses), size))
    };
    let cheaper = |a: &(f64, f64), b: &(f64, f64)| a.0.total_cmp(&b.0);
    let mut best = SIZES.into_iter().filter_map(price).min_by(cheaper)?;
    // What lies nearer to nothing gained than to a lower bar is not brought below it by a better size.
    if start.bar < from.cost() && best.0 > 0.5 * (start.bar + from.cost()) {
        return None;
    }
    for factor in [1.9, 1.35] {
        best = [best.1 * factor, best.1 / factor].into_iter().filter_map(price).chain([best]).min_by(cheaper)?;
    }
    if best.0 > start.bar {
        return None;
    }
    let (base, knobs, mut positions) = with_effect(from, spec, best.1)?;
    let mut slopes = from.fit.slopes.clone();
    let mut fitted = None;
    for &temperature in start.ladder {
        let found = fit(bench, &base, &knobs, &positions, Effort { temperature, ..Effort::SCOUT }, Some(&slopes));
        positions.clone_from(&found.positions);
        slopes.clone_from(&found.slopes);
        fitted = Some(found);
    }
    Some(Model::new(joined(from, spec), base, knobs, fitted?).light())
}

/// The effects of a model and one more.
fn joined(from: &Model, spec: &'static EffectSpec) -> Vec<&'static EffectSpec> {
    from.effects.iter().copied().chain([spec]).collect()
}

/// Fits an effect from nothing on, where every step can only gain, if that promises more than the best of its sizes led to: where other
/// parameters must follow an effect closely, a size tried at a stroke is too far, and its price says nothing.
fn crept(
    bench: &Bench,
    start: &Start<'_>,
    projection: &Projection<'_>,
    spec: &'static EffectSpec,
    scouted: Option<Model>,
) -> Option<Model> {
    let from = start.model;
    let reached = scouted.as_ref().map_or(start.bar, Model::cost);
    let lost = scouted.is_some() && reached > from.cost();
    if from.has(spec.id) || !lost && promise(bench, from, projection, spec) > reached.min(start.bar) - PROMISING {
        return scouted;
    }
    let Some((base, knobs, positions)) = with_effect(from, spec, 0.0) else { return scouted };
    let found = fit(bench, &base, &knobs, &positions, CREEP, Some(&from.fit.slopes));
    let crept =
        (found.square + found.prior < reached).then(|| Model::new(joined(from, spec), base, knobs, found).light());
    crept.or(scouted)
}

/// The least cost that an effect promises by its slope at nothing.
fn promise(bench: &Bench, from: &Model, projection: &Projection<'_>, spec: &'static EffectSpec) -> f64 {
    let towards = |step: f64| {
        let (base, knobs, positions) = with_effect(from, spec, step)?;
        let misses = bench.misses_of(&[unit_at(&base, &knobs, &positions)]).pop()?;
        let along: Misses = misses.iter().zip(&from.fit.misses).map(|(to, from)| (to - from) / step).collect();
        Some(projection.cost_along(&from.fit.misses, &along, step.signum() * FARTHEST))
    };
    [DIFFERENCE, -DIFFERENCE].into_iter().filter_map(towards).fold(f64::INFINITY, f64::min)
}

/// Covariance of the knobs about a fit; infinite where it says nothing.
#[must_use]
pub fn covariance(knobs: &[Knob], fit: &Fit) -> DMatrix<f64> {
    let (hessian, _) = normal(knobs, &fit.positions, &fit.misses, &fit.slopes, 1.0);
    let n = knobs.len();
    (hessian + DMatrix::identity(n, n) * 1e-9)
        .try_inverse()
        .unwrap_or_else(|| DMatrix::from_diagonal(&DVector::from_element(n, f64::INFINITY)))
}
