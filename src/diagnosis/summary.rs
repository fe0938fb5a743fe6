//! Gathers what a report shows from what the search found.

pub(crate) mod breakdown;
pub(crate) mod discrepancy_terms;
pub mod explained_fraction;
pub(crate) mod remainder;
pub(crate) mod sheet_limits;
pub(crate) mod stages;
pub(crate) mod traces;

use crate::DiagnosisSettings;
use crate::decision::Decision;
use crate::decision::hyperparameters::Hyperparameters;
use crate::decision::posterior::{CountedNats, Posterior};
use crate::detectability::{ambiguous_pairs, detectable_sizes};
use crate::estimation::coordinate::Coordinate;
use crate::experiment::design;
use crate::hypotheses::Explored;
use crate::hypotheses::explorer::Hypothesis;
use crate::hypotheses::table::EvidenceTable;
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use crate::model::consistency::consistency;
use crate::result::{Blame, ChannelReport, Diagnosis, Fitted, Interval, Ranked, Transfer, Tried, Verdict};
use crate::summary::breakdown::{breakdowns, gaps};
use crate::summary::discrepancy_terms::discrepancy_terms;
use crate::summary::explained_fraction::{ExplainedFractions, Refitted, explained_fraction_of, without_recordings};
use crate::summary::remainder::remainder;
use crate::summary::sheet_limits::sheet_limits;
use crate::summary::traces::traces;
use govtwin_model::effects::EffectSpec;
use govtwin_model::parameters::Unit;
use govtwin_model::units::NORMAL_90;

/// Nearer to an end of its range than this share of it, a parameter stands there.
const AT_BOUND_SHARE: f64 = 1e-3;

/// Share of an effect's plausible range below which it counts as excited: smallest visible size over a moderate fault.
const EXCITED: f64 = 3.0;

/// So many of the tried models are judged on left-out recordings.
const LEADERS: usize = 3;

/// What was seen before the verdict.
#[derive(Clone, Debug)]
pub struct BeforeVerdict {
    /// Channels as found.
    pub channels: Vec<ChannelReport>,
    /// What a reader must know.
    pub notes: Vec<String>,
}

/// What the verdict was read off.
#[derive(Debug)]
pub struct Judged<'a> {
    /// The recordings with their noise.
    pub problem: &'a Problem,
    /// The fitted fault sets.
    pub explored: &'a Explored,
    /// Their evidence.
    pub table: EvidenceTable,
    /// The probabilities.
    pub posterior: &'a Posterior,
    /// The verdict.
    pub decision: &'a Decision,
    /// The learned numbers.
    pub numbers: &'a Hyperparameters,
    /// What models explain.
    pub(crate) fractions: ExplainedFractions<'a>,
    /// What the claimed one does.
    pub whole: Interval,
}

/// The model of what is named: of several effects all at once, of competing ones the first; the refitted sheet where nothing is.
pub(crate) fn claimed<'a>(explored: &'a Explored, decision: &Decision) -> &'a FittedModel {
    let blamed = decision.blamed.as_slice();
    let claim = if decision.verdict == Verdict::Class { &blamed[..1] } else { blamed };
    explored.with(claim).unwrap_or_else(|| explored.refitted())
}

impl Judged<'_> {
    /// The claimed model, and where nothing is named that of the likeliest fault set.
    fn nearest(&self) -> &FittedModel {
        let chosen = claimed(self.explored, self.decision);
        if !chosen.effects.is_empty() {
            return chosen;
        }
        self.explored.nearest(&self.decision.sets)
    }
}

/// Builds the diagnosis.
pub fn gather(judged: Judged<'_>, unit: &Unit, settings: &DiagnosisSettings, seen: BeforeVerdict) -> Diagnosis {
    let Judged { problem, explored, decision, whole, ref fractions, .. } = judged;
    let BeforeVerdict { channels, mut notes } = seen;
    let detectable_sizes = detectable_sizes(explored, &settings.catalogue);
    let shown = detectable_sizes.iter().filter(|effect| effect.smallest <= EXCITED * effect.typical).count();
    let mut verdict = decision.verdict;
    if verdict == Verdict::NoGap && shown * 2 < detectable_sizes.len() {
        verdict = Verdict::NotExcited;
        notes.push(format!(
            "Only {shown} of {} effects could show in these recordings; there is no evidence of any of them.",
            detectable_sizes.len()
        ));
    }
    // What the verdict claims, and nothing else, goes into the improved twin.
    let refitted_model = explored.refitted();
    let chosen = claimed(explored, decision);
    let stage_shares = decision.stages();
    let has_gap = !matches!(verdict, Verdict::NoGap | Verdict::NotExcited | Verdict::NoSuchUnit);
    let stage = stage_shares.iter().copied().reduce(|a, b| if b.1 > a.1 { b } else { a }).map(|(stage, _)| stage);

    // What explains nothing comes near nothing.
    let nearest = has_gap.then(|| judged.nearest()).filter(|nearest| !std::ptr::eq(*nearest, chosen));
    let nearest = nearest.map(|model| (model, fractions.of(model))).filter(|(_, explained)| explained.value > 0.0);
    let (nearest, explained) = nearest.unwrap_or((chosen, whole));
    let mut blamed = blames(&judged, (chosen, whole), verdict);
    if verdict == Verdict::Named {
        share_out(whole.value, &mut blamed);
    }
    let refitted_without = without_recordings(problem, refitted_model);
    let is_new = !chosen.effects.is_empty();
    let chosen_without = if is_new { without_recordings(problem, chosen) } else { refitted_without.clone() };
    let shown = [unit.clone(), refitted_model.unit(), chosen.unit(), nearest.unit()];
    let [delivered, refitted, with_effects, with_nearest] = problem.simulate_all(&shown).try_into().unwrap_or_default();
    let known = unit.effects.len();
    let spread = judged.numbers.size_spread;
    let of_sheet = |free_parameter: &FreeParameter| !matches!(free_parameter, FreeParameter::Effect { effect, .. } if *effect >= known);
    let parameters = fitted(chosen, spread, of_sheet);
    for parameter in parameters.iter().filter(|parameter| parameter.at_bound) {
        notes.push(format!("{} was fitted to the end of its range.", parameter.name));
    }
    notes.extend(problem.limit_cycle_note());
    for channel in &channels {
        for trouble in &channel.troubles {
            notes.push(format!("{}, {}: {trouble}.", channel.recording, channel.signal.title()));
        }
    }
    let next = design(problem, explored, (&judged.table, judged.posterior, judged.numbers), decision);
    Diagnosis {
        verdict,
        stage: stage.filter(|_| has_gap),
        stages: stage_shares,
        ranking: ranking(decision),
        gap: gaps(problem, &delivered, &refitted, &with_effects),
        explained_fraction: whole,
        remainder: has_gap
            .then(|| remainder(problem, explored, (nearest, &with_nearest), (explained, decision.something_else))),
        experiments: next.experiments,
        entropy_bits: next.entropy_bits,
        refitted: refitted_model.unit(),
        fitted: chosen.unit(),
        parameters,
        channels,
        sheet_limits: Some(sheet_limits(
            explored,
            (&judged.table, judged.posterior),
            CountedNats::new(&judged.table, judged.numbers),
            &settings.catalogue,
        )),
        ambiguous_pairs: ambiguous_pairs(explored, &settings.catalogue),
        detectable_sizes,
        breakdowns: breakdowns(problem, &refitted, &with_effects),
        stage_tests: stages::tests(problem, &refitted_model.unit()),
        discrepancy_terms: discrepancy_terms(problem, explored, chosen),
        transfers: transfers(problem, [&refitted_without, &chosen_without], chosen, settings.seed),
        tried: tried(explored, (&refitted_without, chosen, &chosen_without), problem, spread),
        samples: problem.recordings.iter().map(|t| t.samples.len() * t.has.iter().filter(|&&has| has).count()).sum(),
        consistency: [refitted_model, explored.leader()].map(|model| consistency(problem, model)),
        sets: decision.sets.clone(),
        traces: traces(problem, [&delivered, &refitted, &with_nearest]),
        blamed,
        setup: settings.setup,
        part: None,
        notes,
        simulations: problem.simulations(),
        regret: None,
        table: judged.table,
    }
}

/// The fitted values of those free parameters that are wanted.
fn fitted(model: &FittedModel, size_spread: f64, wanted: impl Fn(&FreeParameter) -> bool) -> Vec<Fitted> {
    // Effects of the unit itself come before those that were tried.
    let first = model.base.effects.len().saturating_sub(model.effects.len());
    model
        .free_parameters
        .iter()
        .enumerate()
        .filter(|(_, free_parameter)| wanted(free_parameter))
        .map(|(k, free_parameter)| {
            let position = model.fit.positions[k];
            let variance = model.spread[(k, k)].max(0.0);
            let (low, high) = free_parameter.range(&model.base);
            let equation =
                if matches!(free_parameter, FreeParameter::Effect { .. }) { size_spread * position } else { 0.0 };
            let deviation = variance.sqrt().hypot(equation);
            let (name, unit) = free_parameter.key(&model.base);
            let scale = model.base.recorded.of_unit(unit);
            let value = |position: f64| scale * free_parameter.value(&model.base, position);
            let at = |offset: f64| value((position + offset * deviation).clamp(low, high));
            let (a, b) = (at(-NORMAL_90), at(NORMAL_90));
            Fitted {
                name: match free_parameter {
                    FreeParameter::Effect { effect, .. } if *effect >= first => {
                        name.rsplit('.').next().unwrap_or(&name).to_owned()
                    }
                    _ => name,
                },
                unit,
                value: Interval { value: at(0.0), low: a.min(b), high: a.max(b) },
                sheet: value(0.0),
                position,
                information: model.information(k),
                at_bound: position != 0.0 && (position - low).min(high - position) <= AT_BOUND_SHARE * (high - low),
            }
        })
        .collect()
}

/// The fitted parameters of one effect of a model.
fn fitted_effect(model: &FittedModel, size_spread: f64, effect: &EffectSpec) -> Vec<Fitted> {
    fitted(model, size_spread, |free_parameter| match free_parameter {
        FreeParameter::Effect { effect: place, .. } => model.base.effects[*place].id == effect.id,
        _ => false,
    })
}

fn blames(judged: &Judged<'_>, (chosen, whole): (&FittedModel, Interval), verdict: Verdict) -> Vec<Blame> {
    let decision = judged.decision;
    let probability = |id: &str| decision.effects.iter().find(|(spec, _)| spec.id == id).map_or(0.0, |(_, p)| *p);
    if !matches!(verdict, Verdict::Named | Verdict::Class) {
        return Vec::new();
    }
    let mut all: Vec<Blame> = decision
        .blamed
        .iter()
        .filter_map(|id| {
            let alone = judged.explored.with(&[id]).unwrap_or(chosen);
            let spec = decision.effects.iter().find(|(spec, _)| spec.id == *id)?.0;
            // Parameters come from the model that is claimed, explained fraction from the effect on its own.
            let model = if chosen.has(id) { chosen } else { alone };
            let share = if std::ptr::eq(alone, chosen) { whole } else { judged.fractions.of(alone) };
            Some(Blame {
                id: spec.id.to_owned(),
                stage: spec.stage,
                probability: probability(id),
                parameters: fitted_effect(model, judged.numbers.size_spread, spec),
                explained_fraction: share,
                last_in: None,
                shapley: None,
            })
        })
        .collect();
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    all
}

/// What each of two effects explains on top of the other, and its Shapley share of the whole (Shapley 1953).
fn share_out(whole: f64, blamed: &mut [Blame]) {
    if let [one, other] = blamed {
        let alone = [one.explained_fraction.value, other.explained_fraction.value];
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

/// Explained fraction on each recording by fits to the others.
fn transfers(
    problem: &Problem,
    [refitted, with_effects]: [&Refitted; 2],
    chosen: &FittedModel,
    seed: u64,
) -> Vec<Transfer> {
    if chosen.effects.is_empty() || problem.recordings.len() < 2 {
        return Vec::new();
    }
    problem
        .recordings
        .iter()
        .enumerate()
        .map(|(index, recording)| Transfer {
            recording: recording.name.clone(),
            explained_fraction: explained_fraction_of(
                problem,
                std::slice::from_ref(&refitted.estimates),
                std::slice::from_ref(&with_effects.estimates),
                index..index + 1,
                seed,
            ),
        })
        .collect()
}

/// All sets that were fitted; `judged` are the refitted sheet's fits without each recording, and the chosen model with its own.
fn tried(
    explored: &Explored,
    judged: (&Refitted, &FittedModel, &Refitted),
    problem: &Problem,
    size_spread: f64,
) -> Vec<Tried> {
    let (refitted, chosen, chosen_without) = judged;
    let base: f64 = refitted.costs.iter().sum();
    let held_out = |model: &FittedModel| -> f64 {
        let same = model.ids() == chosen.ids();
        let without = if same { chosen_without.clone() } else { without_recordings(problem, model) };
        base - without.costs.iter().sum::<f64>()
    };
    let cost = explored.refitted().cost();
    let sets: Vec<&Hypothesis> = explored.hypotheses.iter().filter(|one| !one.effects.is_empty()).collect();
    sets.into_iter()
        .enumerate()
        .map(|(rank, one)| Tried {
            ids: one.model.ids().into_iter().map(str::to_owned).collect(),
            gain: cost - one.model.cost(),
            // Only the leaders were fitted with the care that leaving one out needs.
            held_out_gain: if rank < LEADERS && one.refined && !one.model.fit.slopes.is_empty() {
                held_out(&one.model)
            } else {
                f64::NAN
            },
            parameters: one
                .model
                .effects
                .iter()
                .flat_map(|effect| fitted_effect(&one.model, size_spread, effect))
                .collect(),
        })
        .collect()
}
