//! Which effects are present: grown one by one, each time with the rivals for the place.

use crate::diagnosis::decide::SEEN;
use crate::diagnosis::model::Model;
use crate::diagnosis::own_noise;
use crate::diagnosis::search::{Start, extend};
use crate::effects::EffectSpec;
use crate::parameters::Unit;
use crate::tuning::bench::Bench;
use crate::tuning::cooling::COOLING;
use crate::tuning::fit::{Effort, fit};

/// Smallest gain with which the search takes a first effect in, in halves of a log-likelihood; for a verdict it must gain
/// [`SEEN`].
pub const DETECTED: f64 = 8.0;

/// A further effect must gain this share of what the effects before it did: what an effect's own equation leaves behind is not
/// another effect. On the generated battery of seed 502 single effects left 0.7 % at most to others, pairs 5 % to their second one.
pub const FURTHER_SHARE: f64 = 0.03;

/// Most effects at once.
pub const MOST: usize = 3;

/// How many of the scouted models are fitted with care: for the first place, and for those on top of it.
const FINALISTS: usize = 5;
const SECONDS: usize = 2;

/// Detours for one place at most.
const DETOURS: usize = 2;

/// How often a model is fitted on as long as that gains anything.
const REFINEMENTS: usize = 6;

/// A model that misses more than this share of the best gain is no rival of the best: it is in no class with it.
const NEAR: f64 = 0.1;

/// Share of the best gain that a model must have reached when scouted to be fitted with care.
const HOPEFUL: f64 = 0.4;

/// One place among the effects that are present, and who was tried for it.
#[derive(Clone, Debug)]
pub struct Slot {
    /// The model without the effect of this place.
    pub before: Model,
    /// The models with each effect in this place, best first.
    pub tried: Vec<Model>,
}

impl Slot {
    /// The model with this effect in this place; none where it promised next to nothing.
    #[must_use]
    pub fn with(&self, id: &str) -> Option<&Model> {
        self.tried.iter().find(|model| model.newest() == Some(id))
    }

    /// The effect that stands here.
    #[must_use]
    pub fn holder(&self) -> Option<&'static str> {
        self.tried.first().and_then(Model::newest)
    }

    /// The least cost that was reached here, with an effect or without.
    #[must_use]
    pub fn best_cost(&self) -> f64 {
        self.tried.iter().map(Model::cost).fold(self.before.cost(), f64::min)
    }

    /// By how much the best effect lowers the cost; 0 where none does.
    #[must_use]
    pub fn best_gain(&self) -> f64 {
        self.before.cost() - self.best_cost()
    }
}

/// What the search found.
#[derive(Clone, Debug)]
pub struct Found {
    /// The sheet refitted, without any effect.
    pub refitted: Model,
    /// The model of the effects that earned their place; the refitted one if none did.
    pub best: Model,
    /// A place for each of its effects; with none, the rivals for the first.
    pub slots: Vec<Slot>,
    /// The models with one effect more than the best, best first, none of which earned its place.
    pub further: Vec<Model>,
    /// Some of the best model's effects, together or alone, where a verdict claims what the search did not come by.
    pub claims: Vec<Model>,
}

impl Found {
    /// The model with these effects alone, where it was fitted; the best one otherwise.
    #[must_use]
    pub fn claimed(&self, ids: &[&str]) -> &Model {
        self.grown(ids).unwrap_or(&self.best)
    }

    /// The model with this effect alone, where it was fitted; the best one otherwise.
    #[must_use]
    pub fn alone(&self, id: &str) -> &Model {
        self.tried_alone(id).unwrap_or(&self.best)
    }

    /// Fits those models that a verdict claims and the search did not come by: of all the effects that it blames, and of each alone.
    pub fn complete(&mut self, bench: &Bench, blamed: &[&str]) {
        let lacking = |found: &Self, ids: &[&str]| match ids {
            [] => false,
            [id] => found.best.has(id) && found.tried_alone(id).is_none(),
            several => several.iter().all(|id| found.best.has(id)) && found.grown(several).is_none(),
        };
        for ids in [blamed].into_iter().chain(blamed.chunks(1)) {
            if lacking(self, ids) {
                let claim = self.best.keeping(bench, ids);
                self.claims.push(claim);
            }
        }
    }

    fn grown(&self, ids: &[&str]) -> Option<&Model> {
        let grown = self.slots.iter().map(|slot| &slot.before).chain([&self.best]).chain(&self.claims);
        let is_it = |model: &&Model| model.effects.len() == ids.len() && ids.iter().all(|id| model.has(id));
        grown.into_iter().find(is_it)
    }

    fn tried_alone(&self, id: &str) -> Option<&Model> {
        let claimed = self.claims.iter().find(|model| model.ids() == [id]);
        self.slots.first().and_then(|slot| slot.with(id)).or(claimed)
    }

    /// The least cost that one effect more than the best would have reached.
    #[must_use]
    pub fn beyond(&self) -> f64 {
        let tried = match self.slots.first() {
            Some(slot) if self.best.effects.is_empty() => &slot.tried,
            _ => &self.further,
        };
        tried.iter().map(Model::cost).fold(self.best.cost(), f64::min)
    }
}

/// Sorts, best first.
fn sort(models: &mut [Model]) {
    models.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
}

/// Fits those models with care that may still win, and sorts; `visited` is the winner from whose place all were tried before.
fn finals(
    bench: &Bench,
    mut tried: Vec<Model>,
    before: &Model,
    catalogue: &[&'static EffectSpec],
    count: usize,
    visited: Option<&[f64]>,
) -> Vec<Model> {
    sort(&mut tried);
    let gain = before.cost() - tried.first().map_or(before.cost(), Model::cost);
    // Where nothing gains when scouted, what comes first may still: a valley may bend.
    let hopeful = if gain > 0.5 * DETECTED { before.cost() - HOPEFUL * gain } else { f64::INFINITY };
    refine(bench, &mut tried, before, count, hopeful);
    // What does nearly the same as the winner must not lose for having been caught elsewhere.
    let winner = tried.first().filter(|winner| before.cost() - winner.cost() > 0.5 * DETECTED);
    if winner.is_some_and(|winner| Some(winner.fit.positions.as_slice()) != visited) {
        from_the_winners_place(bench, &mut tried, before, catalogue, hopeful);
        refine(bench, &mut tried, before, count, hopeful);
    }
    tried
}

/// Fits the first so many to the end that cost no more than this, and sorts; what was fitted with care before has its slopes still.
///
/// A model is given up where all that may follow, at the pace of the last fit, would not bring it near the best.
fn refine(bench: &Bench, tried: &mut [Model], before: &Model, count: usize, hopeful: f64) {
    let mut near = f64::INFINITY;
    for model in tried.iter_mut().take(count).filter(|model| model.cost() <= hopeful) {
        let refinements = if model.fit.slopes.is_empty() { REFINEMENTS } else { 0 };
        for left in (0..refinements).rev() {
            let last = model.cost();
            *model = model.refined(bench, Effort::FULL);
            let gained = last - model.cost();
            if gained < 0.25 * DETECTED || model.cost() - left as f64 * gained > near {
                break;
            }
        }
        near = near.min(model.cost() + NEAR * (before.cost() - model.cost()));
    }
    sort(tried);
}

/// Tries all effects but the winner's once more from where the winner has the sheet's parameters, and takes what is better.
fn from_the_winners_place(
    bench: &Bench,
    tried: &mut Vec<Model>,
    before: &Model,
    catalogue: &[&'static EffectSpec],
    hopeful: f64,
) {
    let Some(winner) = tried.first() else { return };
    let Some(place) = before.moved(bench, winner) else { return };
    let others: Vec<&'static EffectSpec> =
        catalogue.iter().copied().filter(|spec| Some(spec.id) != winner.newest()).collect();
    for again in extend(bench, &[Start { bar: hopeful, ..cold(&place) }], &others) {
        match tried.iter_mut().find(|model| model.newest() == again.newest()) {
            Some(model) if again.cost() < model.cost() => *model = again,
            Some(_) => {}
            None => tried.push(again),
        }
    }
    sort(tried);
}

/// The model without its last effect, fitted from where the model with it stands: a way round a ridge that a direct fit did not cross.
fn without_last(bench: &Bench, model: &Model, before: &Model) -> Model {
    let start = &model.fit.positions[..before.knobs.len()];
    let fit = fit(bench, &before.base, &before.knobs, start, Effort::FULL, None);
    before.or_better(fit)
}

/// Takes the model before the detour through the best effect; where that leads to a better place, those effects that now cost
/// more than they explain are tried from there again, so that none loses for having started behind a ridge.
fn settled(
    bench: &Bench,
    mut before: Model,
    mut tried: Vec<Model>,
    catalogue: &[&'static EffectSpec],
    count: usize,
) -> (Model, Vec<Model>) {
    let mut winner: Option<Vec<f64>> = None;
    for _ in 0..DETOURS {
        let Some(first) = tried.first().filter(|first| first.cost() < before.cost()) else { break };
        if winner.as_ref() == Some(&first.fit.positions) {
            break;
        }
        let around = without_last(bench, first, &before);
        let better = before.cost() - around.cost();
        before = around;
        if better <= DETECTED {
            break;
        }
        winner = Some(first.fit.positions.clone());
        tried.retain(|model| model.cost() < before.cost());
        let found = |spec: &EffectSpec| tried.iter().any(|model| model.newest() == Some(spec.id));
        let lost: Vec<&'static EffectSpec> = catalogue.iter().copied().filter(|spec| !found(spec)).collect();
        tried.extend(extend(bench, &[cold(&before)], &lost));
        tried = finals(bench, tried, &before, catalogue, count, winner.as_deref());
    }
    (before, tried)
}

/// Grows the set of effects from the refitted sheet; the noise is laid out anew where a model is likelier with a noise of its own.
///
/// Returns the bench with the noise as laid out in the end, too.
#[must_use]
pub fn find(
    mut bench: Bench,
    mut refitted: Model,
    mut sheet: Model,
    catalogue: &[&'static EffectSpec],
    progress: &(dyn Fn(&str, f64) + Sync),
) -> (Bench, Found) {
    let mut gaining: Option<Vec<&'static EffectSpec>> = None;
    loop {
        match grow(&bench, refitted.clone(), &sheet, catalogue, gaining.as_deref(), progress) {
            Grown::Found(found) => return (bench, *found),
            Grown::Along(unit, gained) => {
                gaining = Some(gained);
                bench = bench.laid_along(&unit);
                (refitted, sheet) = (refitted.anew(&bench), Model::sheet(&bench, &sheet.base, &sheet.knobs));
            }
        }
    }
}

/// How a search ends.
enum Grown {
    /// With what was found.
    Found(Box<Found>),
    /// With a unit along which the noise should be laid out first, and the effects that gained anything without.
    Along(Box<Unit>, Vec<&'static EffectSpec>),
}

/// Grows the set of effects: until one is notably likelier with the noise of its own, or, given the effects for the first place that gained without
/// it, with every model charged for the noise of its own.
fn grow(
    bench: &Bench,
    refitted: Model,
    sheet: &Model,
    catalogue: &[&'static EffectSpec],
    gaining: Option<&[&'static EffectSpec]>,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Grown {
    let (own, candidates) = (gaining.is_some(), gaining.unwrap_or(catalogue));
    let charged = |(mut before, mut tried): (Model, Vec<Model>)| {
        if own {
            tried.iter_mut().chain([&mut before]).for_each(|model| model.noise = own_noise::charge(bench, model));
            sort(&mut tried);
        }
        (before, tried)
    };
    progress("trying every effect alone", 0.15);
    let starts = [cold(&refitted), Start { model: sheet, ladder: &COOLING, bar: f64::INFINITY }];
    let tried = finals(bench, extend(bench, &starts, candidates), &refitted, candidates, FINALISTS, None);
    let (nominal, mut tried) = charged(settled(bench, refitted, tried, candidates, FINALISTS));
    let mut slots: Vec<Slot> = Vec::new();
    let mut before = nominal.clone();
    loop {
        if let Some(louder) = (!own).then(|| own_noise::louder(bench, &before, &tried)).flatten() {
            let alone = slots.first().map_or(&tried, |slot| &slot.tried);
            // What chatters may have gained nothing as long as its chatter was held against it.
            let gained = |spec: &&EffectSpec| {
                louder.has(spec.id)
                    || alone.iter().any(|model| model.newest() == Some(spec.id) && model.cost() < nominal.cost())
            };
            return Grown::Along(Box::new(louder.unit()), catalogue.iter().copied().filter(gained).collect());
        }
        let explained = nominal.cost() - before.cost();
        let Some(first) = tried.first() else { break };
        if before.cost() - first.cost() <= least_gain(explained, &before) || slots.len() == MOST {
            break;
        }
        progress("trying every effect on top of what was found", 0.35 + 0.15 * slots.len() as f64);
        // A search compares costs on one bench.
        let first = Model { noise: 0.0, ..first.with_slopes(bench) };
        let next = finals(bench, extend(bench, &[cold(&first)], catalogue), &first, catalogue, SECONDS, None);
        let (first, next) = charged(settled(bench, first, next, catalogue, SECONDS));
        tried[0] = first.clone();
        slots.push(Slot { before, tried });
        (before, tried) = (first, next);
    }
    let mut further = tried;
    if slots.is_empty() {
        slots.push(Slot { before: before.clone(), tried: std::mem::take(&mut further) });
    }
    Grown::Found(Box::new(Found { refitted: nominal, best: before, slots, further, claims: Vec::new() }))
}

/// What an effect must gain on top of a model that explains so much: a share of that, but no more than can be seen where the model stretches the
/// sheet beyond belief, since the sheet's own parameters may have taken its mark.
fn least_gain(explained: f64, before: &Model) -> f64 {
    if explained <= 0.0 {
        return DETECTED;
    }
    let most = if before.is_strained() { SEEN } else { f64::INFINITY };
    (FURTHER_SHARE * explained).clamp(1.5 * DETECTED, most)
}

/// A start that is good already; on top of effects that explain the gap most others gain nothing at any size and need no fit.
fn cold(model: &Model) -> Start<'_> {
    let bar = if model.effects.is_empty() { f64::INFINITY } else { model.cost() };
    Start { model, ladder: &COOLING[COOLING.len() - 1..], bar }
}
