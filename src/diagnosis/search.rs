//! Which: every effect of the catalogue tried in turn and together, the sheet's parameters refitted with it.

use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::diagnosis::model::Model;
use crate::effects::EffectSpec;
use crate::parameters::{EffectSetting, Unit};
use crate::tuning::bench::{Bench, Misses};
use crate::tuning::cooling::cooled;
use crate::tuning::fit::{DIFFERENCE, Effort, fit};
use crate::tuning::knob::{Knob, unit_at};
use crate::tuning::linear::Projection;
use crate::tuning::noise::Noise;
use crate::tuning::trial::Trial;
use crate::tuning::trips::placed;

/// Sizes at which an effect is tried first, in units of its typical size; a dead time gains nothing at 0.7 beside its own.
const SIZES: [f64; 6] = [0.2, 0.8, 2.0, 3.0, -0.2, -0.8];

/// Where the further parameters of an effect stand when its sizes are tried: typical, or neutral, which leaves the unit's own parts alone.
const FURTHER: [f64; 2] = [1.0, 0.0];

/// Farthest that a slope at nothing is trusted, in units of the typical size.
const FARTHEST: f64 = 3.0;

/// By how much less an effect must promise to cost to be fitted from nothing on.
const PROMISING: f64 = 8.0;

/// What promises less than this share of the best promise is not fitted: until a fit has gone its way promises fall short of what is reached
/// by up to a factor of ten, and what explains a tenth of the best is no rival.
const WORTH: f64 = 0.01;

/// Work of a fit that starts from nothing of an effect.
const CREEP: Effort = Effort { rounds: 6, refresh: 100, temperature: 1.0 };

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
        .min_by(|a, b| a.cost().total_cmp(&b.cost()))
        .map_or_else(|| zeros.clone(), |fit| fit.positions);
    let mut bench = first.laid_along(&unit_at(unit, &knobs, &start));
    let mut fine = fit(&bench, unit, &knobs, &start, Effort::FULL, None);
    // The unit that explains the trips best and the trips that suit it best are found in turns.
    for _ in 0..TURNS {
        let Some(trials) = placed(&bench, &unit_at(unit, &knobs, &fine.positions)) else { break };
        bench = bench.anew(trials, &unit_at(unit, &knobs, &fine.positions));
        fine = cooled(&bench, unit, &knobs, &fine.positions, 3);
    }
    let sheet = Model::sheet(&bench, unit, &knobs);
    let refitted = Model::new(Vec::new(), unit.clone(), knobs, fine);
    (bench, refitted, sheet)
}

/// The model with one more effect: its first parameter at a size in units of the typical one, its further ones neutral at 0, typical at 1.
#[must_use]
pub fn with_effect(
    from: &Model,
    spec: &'static EffectSpec,
    size: f64,
    further: f64,
) -> Option<(Unit, Vec<Knob>, Vec<f64>)> {
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
        positions.push(if parameter == 0 { size } else { further }.clamp(low, high));
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

/// A start with what a change of its model could lead to, at its highest temperature.
struct Priced<'a> {
    start: Start<'a>,
    temperature: f64,
    projection: Projection<'a>,
    /// What it promises to cost without any effect.
    nothing: f64,
}

impl<'a> Priced<'a> {
    fn new(start: Start<'a>) -> Self {
        let (model, temperature) = (start.model, start.ladder.first().copied().unwrap_or(1.0));
        let projection = Projection::new(&model.knobs, &model.fit.positions, &model.fit.slopes, temperature);
        let nothing = projection.cost(&model.fit.misses);
        Self { start, temperature, projection, nothing }
    }

    /// By how much less a cost is than that of nothing, were the temperature 1.
    fn gain(&self, cost: f64) -> f64 {
        self.temperature * (self.nothing - cost)
    }
}

/// One way to take an effect in.
#[derive(Clone, Copy, Debug)]
struct Offer {
    /// Number of the start.
    start: usize,
    /// Size from which to fit, in units of the typical one; 0 from nothing of the effect on.
    size: f64,
    /// Where its further parameters start.
    further: f64,
    /// The cost that it promises, at the start's highest temperature.
    cost: f64,
    /// By how much that is less than without the effect.
    gain: f64,
}

/// Adds each effect to a model in turn, fitted quickly: from each of the starts at the best of several sizes, and from the first of them also from
/// nothing of the effect on, where its slope promises more. What promises next to nothing of the best promise from there is not fitted.
#[must_use]
pub fn extend(bench: &Bench, starts: &[Start<'_>], catalogue: &[&'static EffectSpec]) -> Vec<Model> {
    let priced: Vec<Priced<'_>> = starts.iter().copied().map(Priced::new).collect();
    let offers: Vec<(&'static EffectSpec, Vec<Offer>)> =
        catalogue.par_iter().map(|spec| (*spec, offers(bench, &priced, spec))).collect();
    // Where priors weigh most an effect may promise what the sheet's own parameters do as well, so that every start has its own measure.
    let mut most = vec![0.0_f64; priced.len()];
    for offer in offers.iter().flat_map(|(_, offers)| offers) {
        most[offer.start] = most[offer.start].max(offer.gain);
    }
    let worth = |offer: &&Offer| offer.gain >= WORTH * most[offer.start];
    offers
        .par_iter()
        .filter_map(|(spec, offers)| {
            let (crept, sized): (Vec<&Offer>, Vec<&Offer>) =
                offers.iter().filter(worth).partition(|offer| offer.size == 0.0);
            let scouted = sized
                .iter()
                .filter_map(|offer| scout(bench, &priced[offer.start].start, spec, offer))
                .min_by(|a, b| a.cost().total_cmp(&b.cost()));
            match crept.first() {
                Some(offer) => crept_from(bench, &priced[offer.start].start, spec, offer, scouted),
                None => scouted,
            }
        })
        .collect()
}

/// The ways to take an effect in that promise anything.
fn offers(bench: &Bench, priced: &[Priced<'_>], spec: &'static EffectSpec) -> Vec<Offer> {
    let lacking = || priced.iter().enumerate().filter(|(_, priced)| !priced.start.model.has(spec.id));
    let sized = lacking().filter_map(|(start, priced)| {
        let (cost, size, further) = best_size(bench, priced, spec)?;
        Some(Offer { start, size, further, cost, gain: priced.gain(cost) })
    });
    let from_nothing = lacking().take(1).filter_map(|(start, priced)| {
        let further = where_nothing_is(bench, priced.start.model, spec);
        let cost = promise(bench, priced, spec, further);
        let gain = priced.gain(cost);
        (gain >= PROMISING).then_some(Offer { start, size: 0.0, further, cost, gain })
    });
    sized.chain(from_nothing).collect()
}

/// Where the further parameters of an effect stand for its first one at nothing to be nothing of the effect: typical, if that leaves the model alone,
/// else neutral.
fn where_nothing_is(bench: &Bench, from: &Model, spec: &'static EffectSpec) -> f64 {
    let leaves_alone = || {
        let (base, knobs, positions) = with_effect(from, spec, 0.0, 1.0)?;
        let misses = bench.misses_of(&[unit_at(&base, &knobs, &positions)]).pop()?;
        Some(misses == from.fit.misses)
    };
    if spec.parameters.len() == 1 || leaves_alone() == Some(true) { 1.0 } else { 0.0 }
}

/// The cost that an effect promises at the best of several sizes, that size, and where its further parameters stand with it; none where it promises
/// nothing, or more than the bar.
fn best_size(bench: &Bench, priced: &Priced<'_>, spec: &'static EffectSpec) -> Option<(f64, f64, f64)> {
    let Priced { start, projection, nothing, .. } = priced;
    let price = |(size, further): (f64, f64)| {
        let (base, knobs, positions) = with_effect(start.model, spec, size, further)?;
        let misses = bench.misses_of(&[unit_at(&base, &knobs, &positions)]).pop()?;
        Some((projection.cost(&misses), size, further))
    };
    let cheaper = |a: &(f64, f64, f64), b: &(f64, f64, f64)| a.0.total_cmp(&b.0);
    let shapes = if spec.parameters.len() > 1 { &FURTHER[..] } else { &FURTHER[..1] };
    let tried = shapes.iter().flat_map(|&further| SIZES.map(|size| (size, further)));
    let mut best = tried.filter_map(price).min_by(cheaper)?;
    let from = start.model.cost();
    // What lies nearer to nothing gained than to a lower bar is not brought below it by a better size; nor are sizes sought where none gains.
    if best.0 >= *nothing || start.bar < from && best.0 > 0.5 * (start.bar + from) {
        return None;
    }
    for factor in [1.9, 1.35] {
        let around = [best.1 * factor, best.1 / factor].map(|size| (size, best.2));
        best = around.into_iter().filter_map(price).chain([best]).min_by(cheaper)?;
    }
    (best.0 <= start.bar).then_some(best)
}

/// The model with one effect more, fitted quickly from this size on.
fn scout(bench: &Bench, start: &Start<'_>, spec: &'static EffectSpec, offer: &Offer) -> Option<Model> {
    let from = start.model;
    let (base, knobs, mut positions) = with_effect(from, spec, offer.size, offer.further)?;
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
fn crept_from(
    bench: &Bench,
    start: &Start<'_>,
    spec: &'static EffectSpec,
    offer: &Offer,
    scouted: Option<Model>,
) -> Option<Model> {
    let from = start.model;
    let reached = scouted.as_ref().map_or(f64::INFINITY, Model::cost).min(start.bar);
    if offer.cost > reached - PROMISING {
        return scouted;
    }
    let Some((base, knobs, positions)) = with_effect(from, spec, 0.0, offer.further) else { return scouted };
    let found = fit(bench, &base, &knobs, &positions, CREEP, Some(&from.fit.slopes));
    let crept = (found.cost() < reached).then(|| Model::new(joined(from, spec), base, knobs, found).light());
    crept.or(scouted)
}

/// The least cost that an effect promises by its slope at nothing.
fn promise(bench: &Bench, priced: &Priced<'_>, spec: &'static EffectSpec, further: f64) -> f64 {
    let (from, projection) = (priced.start.model, &priced.projection);
    let towards = |step: f64| {
        let (base, knobs, positions) = with_effect(from, spec, step, further)?;
        let misses = bench.misses_of(&[unit_at(&base, &knobs, &positions)]).pop()?;
        let along: Misses = misses.iter().zip(&from.fit.misses).map(|(to, from)| (to - from) / step).collect();
        Some(projection.cost_along(&from.fit.misses, &along, step.signum() * FARTHEST))
    };
    [DIFFERENCE, -DIFFERENCE].into_iter().filter_map(towards).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dead time gains nothing where it is tried farther from its size than that.
    #[test]
    fn the_sizes_tried_leave_no_valley_out() {
        for tenth in 1..37 {
            let size = f64::from(tenth) / 10.0;
            let nearest = SIZES.iter().map(|tried| (tried - size).abs()).fold(f64::INFINITY, f64::min);
            assert!(nearest <= 0.7, "{size}: {nearest}");
        }
    }
}
