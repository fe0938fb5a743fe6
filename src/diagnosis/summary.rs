//! Gathers what a report shows from what the search found.

use crate::diagnosis::Settings;
use crate::diagnosis::closure::{LeftOut, Refitted, closure, closure_of, without_parts, without_recordings};
use crate::diagnosis::decide::{Decision, stages as stage_shares};
use crate::diagnosis::latent::draw_named;
use crate::diagnosis::ledger::{gaps, ledgers};
use crate::diagnosis::model::Model;
use crate::diagnosis::next::experiments;
use crate::diagnosis::outcome::{
    Blame, Channel, Diagnosis, Fitted, Interval, Latent, Place, Ranked, Transfer, Tried, Verdict,
};
use crate::diagnosis::rivals::Found;
use crate::diagnosis::stages;
use crate::diagnosis::traces::traces;
use crate::diagnosis::visible::Marks;
use crate::effects::{EffectSpec, Stage};
use crate::parameters::Unit;
use crate::tuning::bench::Bench;
use crate::tuning::knob::Knob;

/// Standard deviations to either side of a 90 % interval.
const NINETY: f64 = 1.645;

/// How far the size of an effect may be off because its true equation is another, one standard deviation over its size.
///
/// Seven of the eight sizes in the practice units then lie inside their 90 % intervals, the eighth just outside.
const EQUATION: f64 = 0.1;

/// Share of an effect's plausible range below which it counts as excited: smallest visible size over a moderate fault.
const EXCITED: f64 = 3.0;

/// So many of the tried models are judged on left-out recordings.
const LEADERS: usize = 3;

/// What was seen before the verdict.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Free terms, best first.
    pub latents: Vec<Latent>,
    /// Channels as found.
    pub channels: Vec<Channel>,
    /// What a reader must know.
    pub notes: Vec<String>,
}

/// Builds the diagnosis.
#[must_use]
pub fn gather(
    bench: &Bench,
    found: &Found,
    decision: &Decision,
    unit: &Unit,
    settings: &Settings,
    seen: Seen,
) -> Diagnosis {
    let Seen { mut latents, channels, mut notes } = seen;
    let marks = Marks::new(bench, &found.refitted, &settings.catalogue);
    let visible = marks.visible();
    let shown = visible.iter().filter(|effect| effect.smallest <= EXCITED * effect.typical).count();
    let mut verdict = decision.verdict;
    if verdict == Verdict::NoGap && shown * 2 < visible.len() {
        verdict = Verdict::NotExcited;
        notes.push(format!(
            "Only {shown} of {} effects could show in these recordings; nothing speaks for any of them.",
            visible.len()
        ));
    }
    // What the verdict claims, and nothing else, goes into the improved twin.
    let chosen = decision.chosen(found).with_slopes(bench);
    let mut unknown_at: Vec<(Stage, f64)> = Stage::ALL.into_iter().map(|stage| (stage, 0.0)).collect();
    let best_share = latents.first().map_or(0.0, |latent| latent.explains);
    for latent in &latents {
        // Places that explain nearly as much share the blame; the tenth part of the gap is a factor of e.
        let share = ((latent.explains - best_share) / 0.1).exp();
        if let Some(at) = unknown_at.iter_mut().find(|(stage, _)| *stage == latent.stage) {
            at.1 = f64::max(at.1, share);
        }
    }
    let total: f64 = unknown_at.iter().map(|(_, share)| share).sum();
    for (_, share) in &mut unknown_at {
        *share /= total.max(1e-12);
    }
    if !chosen.effects.is_empty() {
        draw_named(bench, &found.refitted, &chosen, &mut latents);
    }
    let stage_shares = stage_shares(decision, &unknown_at);
    let has_gap = !matches!(verdict, Verdict::NoGap | Verdict::NotExcited);
    let stage = stage_shares.iter().copied().reduce(|a, b| if b.1 > a.1 { b } else { a }).map(|(stage, _)| stage);

    let refitted_parts = without_parts(bench, &found.refitted);
    let whole = closure(bench, &refitted_parts, &without_parts(bench, &chosen), settings.seed);
    let mut blamed = blames(bench, found, decision, &chosen, verdict, &refitted_parts, settings.seed);
    if verdict == Verdict::Named {
        share_out(whole.value, &mut blamed);
    }
    let refitted_without = without_recordings(bench, &found.refitted);
    let [delivered, refitted, with_effects] =
        [unit, &found.refitted.unit(), &chosen.unit()].map(|unit| bench.simulate_all(unit));
    let known = unit.effects.len();
    let parameters = fitted(&chosen, |knob| !matches!(knob, Knob::Effect { effect, .. } if *effect >= known));
    for parameter in parameters.iter().filter(|parameter| parameter.at_bound) {
        notes.push(format!("{} was fitted onto the end of its range.", parameter.name));
    }
    notes.extend(bench.swinging());
    for channel in &channels {
        for trouble in &channel.troubles {
            notes.push(format!("{}, {}: {trouble}.", channel.recording, channel.signal.title()));
        }
    }
    Diagnosis {
        verdict,
        stage: stage.filter(|_| has_gap),
        stages: stage_shares,
        ranking: ranking(decision),
        gap: gaps(bench, &delivered, &refitted, &with_effects),
        closure: whole,
        experiments: experiments(bench, found, &blamed, verdict),
        refitted: found.refitted.unit(),
        fitted: chosen.unit(),
        parameters,
        channels,
        visible,
        alike: marks.alike(),
        ledgers: ledgers(bench, &refitted, &with_effects),
        stage_tests: stages::tests(bench, &found.refitted.unit()),
        latents,
        transfers: transfers(bench, &refitted_without, &chosen, settings.seed),
        tried: tried(found, &refitted_without, bench),
        samples: bench.trials.iter().map(|t| t.samples.len() * t.has.iter().filter(|&&has| has).count()).sum(),
        floor: decision.floor,
        places: found
            .slots
            .iter()
            .map(|slot| Place { before: slot.before.cost(), tried: costs(&slot.tried) })
            .collect(),
        further: costs(&found.further),
        traces: traces(bench, [&delivered, &refitted, &with_effects]),
        blamed,
        part: None,
        notes,
        simulations: bench.simulations(),
    }
}

/// The fitted values of those knobs that are wanted.
fn fitted(model: &Model, wanted: impl Fn(&Knob) -> bool) -> Vec<Fitted> {
    // Effects of the unit itself come before those that were tried.
    let first = model.base.effects.len().saturating_sub(model.effects.len());
    model
        .knobs
        .iter()
        .enumerate()
        .filter(|(_, knob)| wanted(knob))
        .map(|(k, knob)| {
            let position = model.fit.positions[k];
            let variance = model.spread[(k, k)].max(0.0);
            let (low, high) = knob.range(&model.base);
            let equation = if matches!(knob, Knob::Effect { .. }) { EQUATION * position } else { 0.0 };
            let deviation = variance.sqrt().hypot(equation);
            let at = |offset: f64| knob.value(&model.base, (position + offset * deviation).clamp(low, high));
            let (a, b) = (at(-NINETY), at(NINETY));
            let (name, unit) = knob.key(&model.base);
            Fitted {
                name: match knob {
                    Knob::Effect { effect, .. } if *effect >= first => {
                        name.rsplit('.').next().unwrap_or(&name).to_owned()
                    }
                    _ => name,
                },
                unit,
                value: Interval { value: at(0.0), low: a.min(b), high: a.max(b) },
                sheet: knob.value(&model.base, 0.0),
                position,
                information: model.information(k),
                at_bound: position != 0.0 && (position <= low || position >= high),
            }
        })
        .collect()
}

/// The fitted parameters of one effect of a model.
fn fitted_effect(model: &Model, effect: &EffectSpec) -> Vec<Fitted> {
    fitted(model, |knob| match knob {
        Knob::Effect { effect: place, .. } => model.base.effects[*place].id == effect.id,
        _ => false,
    })
}

fn blames(
    bench: &Bench,
    found: &Found,
    decision: &Decision,
    chosen: &Model,
    verdict: Verdict,
    refitted: &LeftOut,
    seed: u64,
) -> Vec<Blame> {
    let probability = |id: &str| decision.effects.iter().find(|(spec, _)| spec.id == id).map_or(0.0, |(_, p)| *p);
    if !matches!(verdict, Verdict::Named | Verdict::Class) {
        return Vec::new();
    }
    let mut all: Vec<Blame> = decision
        .blamed
        .iter()
        .filter_map(|id| {
            let alone = found.alone(id).with_slopes(bench);
            let spec = decision.effects.iter().find(|(spec, _)| spec.id == *id)?.0;
            // Parameters come from the model that is claimed, closure from the effect on its own.
            let model = if chosen.has(id) { chosen } else { &alone };
            Some(Blame {
                id: spec.id.to_owned(),
                stage: spec.stage,
                probability: probability(id),
                parameters: fitted_effect(model, spec),
                closure: closure(bench, refitted, &without_parts(bench, &alone), seed),
                last_in: None,
                shapley: None,
            })
        })
        .collect();
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    all
}

/// What each of two effects closes on top of the other, and its fair part of the whole (Shapley 1953).
fn share_out(whole: f64, blamed: &mut [Blame]) {
    if let [one, other] = blamed {
        let alone = [one.closure.value, other.closure.value];
        for (this, [alone, rest]) in [(one, alone), (other, [alone[1], alone[0]])] {
            let last_in = whole - rest;
            this.last_in = Some(last_in);
            this.shapley = Some(0.5 * (alone + last_in));
        }
    }
}

fn ranking(decision: &Decision) -> Vec<Ranked> {
    let mut all: Vec<Ranked> = decision
        .effects
        .iter()
        .map(|(spec, probability)| Ranked { id: spec.id.to_owned(), probability: *probability })
        .collect();
    all.push(Ranked { id: "unknown".to_owned(), probability: decision.unknown });
    all.push(Ranked { id: "none".to_owned(), probability: decision.none });
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    all
}

/// What each model costs, by the effect that it has beyond the one before it.
fn costs(models: &[Model]) -> Vec<(String, f64)> {
    models.iter().map(|model| (model.newest().unwrap_or_default().to_owned(), model.cost())).collect()
}

/// Closure on each recording by fits to the others.
fn transfers(bench: &Bench, refitted: &Refitted, chosen: &Model, seed: u64) -> Vec<Transfer> {
    if chosen.effects.is_empty() || bench.trials.len() < 2 {
        return Vec::new();
    }
    let with_effects = without_recordings(bench, chosen);
    bench
        .trials
        .iter()
        .enumerate()
        .map(|(index, trial)| Transfer {
            recording: trial.name.clone(),
            closure: closure_of(bench, &refitted.estimates, &with_effects.estimates, index..index + 1, seed),
        })
        .collect()
}

fn tried(found: &Found, refitted: &Refitted, bench: &Bench) -> Vec<Tried> {
    let base: f64 = refitted.costs.iter().sum();
    let mut models: Vec<&Model> = found.slots.first().into_iter().flat_map(|slot| &slot.tried).collect();
    if found.best.effects.len() > 1 {
        models.push(&found.best);
    }
    models.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
    models
        .into_iter()
        .enumerate()
        .map(|(rank, model)| Tried {
            ids: model.ids().into_iter().map(str::to_owned).collect(),
            gain: found.refitted.cost() - model.cost(),
            // Only the leaders were fitted with the care that leaving one out needs.
            held_out_gain: if rank < LEADERS && !model.fit.slopes.is_empty() {
                base - without_recordings(bench, model).costs.iter().sum::<f64>()
            } else {
                f64::NAN
            },
            parameters: model.effects.iter().flat_map(|effect| fitted_effect(model, effect)).collect(),
        })
        .collect()
}
