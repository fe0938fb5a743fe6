//! Which effects are present: grown one by one, each time with the rivals for the place.

use crate::diagnosis::search::{Model, Start, extend};
use crate::effects::EffectSpec;
use crate::tuning::cooling::COOLING;
use crate::tuning::fit::{Bench, Effort, fit};

/// Smallest gain with which the search takes a first effect in, in halves of a log-likelihood; for a verdict it must gain
/// [`SEEN`](crate::diagnosis::decide::SEEN).
pub const DETECTED: f64 = 8.0;

/// A further effect must gain this share of what the effects before it did: what an effect's own equation leaves behind is not
/// another effect.
pub const FURTHER_SHARE: f64 = 0.06;

/// Most effects at once.
pub const MOST: usize = 3;

/// How many of the scouted models are fitted with care: for the first place, and for those on top of it.
const FINALISTS: usize = 5;
const SECONDS: usize = 2;

/// Detours for one place at most.
const DETOURS: usize = 2;

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
    /// The model with this effect in this place; none where it was not tried or gains nothing at any size.
    #[must_use]
    pub fn with(&self, spec: &EffectSpec) -> Option<&Model> {
        self.tried.iter().find(|model| model.newest() == Some(spec.id))
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
    /// The least cost that one effect more would have reached.
    pub beyond: f64,
}

/// Fits those models with care that may still win, and sorts.
fn finals(bench: &Bench, mut tried: Vec<Model>, before: f64, count: usize) -> Vec<Model> {
    tried.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
    let best = tried.first().map_or(before, Model::cost);
    let hopeful = before - HOPEFUL * (before - best);
    if before - best > 0.5 * DETECTED {
        // What was fitted with care before has its slopes still.
        let scouted = |model: &&mut Model| model.cost() <= hopeful && model.fit.slopes.is_empty();
        for model in tried.iter_mut().take(count).filter(scouted) {
            *model = model.refined(bench, Effort::FULL);
        }
    }
    tried.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
    tried
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
    for _ in 0..DETOURS {
        let Some(first) = tried.first().filter(|first| first.cost() < before.cost()) else { break };
        let around = without_last(bench, first, &before);
        let better = before.cost() - around.cost();
        before = around;
        if better <= DETECTED {
            break;
        }
        tried.retain(|model| model.cost() < before.cost());
        let found = |spec: &EffectSpec| tried.iter().any(|model| model.newest() == Some(spec.id));
        let lost: Vec<&'static EffectSpec> = catalogue.iter().copied().filter(|spec| !found(spec)).collect();
        tried.extend(extend(bench, &[cold(&before)], &lost));
        tried = finals(bench, tried, before.cost(), count);
    }
    (before, tried)
}

/// Grows the set of effects from the refitted sheet.
#[must_use]
pub fn find(
    bench: &Bench,
    refitted: Model,
    sheet: &Model,
    catalogue: &[&'static EffectSpec],
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Found {
    progress("trying every effect alone", 0.15);
    let starts = [cold(&refitted), Start { model: sheet, ladder: &COOLING }];
    let tried = finals(bench, extend(bench, &starts, catalogue), refitted.cost(), FINALISTS);
    let (nominal, mut tried) = settled(bench, refitted, tried, catalogue, FINALISTS);
    let mut slots: Vec<Slot> = Vec::new();
    let mut before = nominal.clone();
    loop {
        let explained = nominal.cost() - before.cost();
        let Some(first) = tried.first() else { break };
        if before.cost() - first.cost() <= least_gain(explained) || slots.len() == MOST {
            break;
        }
        progress("trying every effect on top of what was found", 0.35 + 0.15 * slots.len() as f64);
        let next = finals(bench, extend(bench, &[cold(first)], catalogue), first.cost(), SECONDS);
        let (first, next) = settled(bench, first.clone(), next, catalogue, SECONDS);
        tried[0] = first.clone();
        slots.push(Slot { before, tried });
        (before, tried) = (first, next);
    }
    let beyond = tried.first().map_or(f64::INFINITY, Model::cost).min(before.cost());
    let mut further = tried;
    if slots.is_empty() {
        slots.push(Slot { before: before.clone(), tried: std::mem::take(&mut further) });
    }
    Found { refitted: nominal, best: before, slots, further, beyond }
}

/// What an effect must gain when others have explained so much before it.
fn least_gain(explained: f64) -> f64 {
    if explained > 0.0 { (1.5 * DETECTED).max(FURTHER_SHARE * explained) } else { DETECTED }
}

/// A start that is good already.
fn cold(model: &Model) -> Start<'_> {
    Start { model, ladder: &COOLING[COOLING.len() - 1..] }
}
