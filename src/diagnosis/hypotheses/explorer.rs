//! What explorations share: fault sets, where their fits begin, and these fits.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use rayon::iter::{
    IndexedParallelIterator, IntoParallelIterator, IntoParallelRefIterator, ParallelExtend, ParallelIterator,
};

use crate::decision::hyperparameters::Hyperparameters;
use crate::estimation::annealing::annealed;
use crate::estimation::coordinate::Coordinate;
use crate::estimation::fit::{Effort, Fit, Start, fit_all};
use crate::evidence::KAPPAS;
use crate::hypotheses::linearisation::{Linearisation, Proposal};
use crate::hypotheses::profile::{ProfilePlace, profiles};
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use crate::model::discrepancy::Columns;
use crate::model::support::{Placed, Variant, add};
use govtwin_model::effects::EffectSpec;
use govtwin_model::twin::Cut;

/// Error of equations that proposals count with, in moderate discrepancy terms.
pub const KAPPA: f64 = 0.03;

/// Fitted sets that are fitted on with care, each time.
const REFINED: usize = 4;

/// Least gain in evidence for which a further effect is tried, nats: a fiftieth of the odds against it.
pub(super) const LEAST_GAIN: f64 = 1.0;

/// Of the sets of several effects that were fitted by one step, one in so many is fitted on.
const PURSUED: usize = 3;

/// Sets that are fitted in step with each other: enough to fill the lanes of all threads, few enough to hold all of their slopes.
const TOGETHER: usize = 8;

/// Further steps of such a fit.
const FURTHER: Effort = Effort { rounds: 2, refresh: 100, ..Effort::FULL };

/// Work of a careful fit.
pub(super) const CAREFUL: Effort = Effort { rounds: 6, refresh: 3, ..Effort::FULL };

/// The same by wide differences: limit cycles make χ² rough, and over a small difference the roughness is larger than the slope.
const WIDE: Effort = Effort { difference: 0.5, ..CAREFUL };

/// Sets that are fitted so, each time: all slopes are measured anew.
const WIDELY: usize = 4;

/// Farthest that a proposal moves a free parameter, in its standard deviations.
const FARTHEST: f64 = 3.0;

/// A fault set that was fitted.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// Places of its effects in the catalogue, rising.
    pub effects: Vec<usize>,
    /// The model; without residuals and slopes where it is far from the leader.
    pub model: FittedModel,
    /// Logarithm of its evidence, and of the odds against so many effects: what the posterior counts.
    pub score: f64,
    /// Whether it was fitted with care.
    pub refined: bool,
}

impl Hypothesis {
    /// Whether it is a smaller set, and all of its effects are among these.
    pub(super) fn is_within(&self, effects: &[usize]) -> bool {
        self.effects.len() < effects.len() && self.effects.iter().all(|effect| effects.contains(effect))
    }

    /// Weighs a fitted model.
    pub(super) fn new(scale: &Scale, effects: Vec<usize>, model: FittedModel, refined: bool) -> Self {
        let score = scale.score(model.cost(), effects.len());
        Self { effects, model, score, refined }
    }
}

/// What costs of fitted sets are weighed by.
#[derive(Clone, Debug)]
pub(super) struct Scale {
    numbers: Hyperparameters,
    samples: f64,
    without_effects: f64,
}

impl Scale {
    /// On a problem, where the sheet alone costs so much.
    pub(super) fn new(problem: &Problem, without_effects: f64) -> Self {
        let samples = problem.independent_samples().max(1.0);
        Self { numbers: Hyperparameters::shipped(), samples, without_effects }
    }

    /// The score of a set of so many effects that costs so much.
    pub(super) fn score(&self, cost: f64, effects: usize) -> f64 {
        self.numbers.score(self.samples, self.without_effects, cost, effects)
    }

    /// Logarithm of the odds against each further effect.
    pub(super) fn rarity(&self) -> f64 {
        self.numbers.rarity
    }
}

/// Error of equations that explorations count with: next to none where the stage behind a recorded spool stands alone, of which the discrepancy
/// terms know too much: at the spool's own rate nothing in the loop holds them.
fn kappa(problem: &Problem) -> f64 {
    if is_stage_alone(problem) { KAPPAS[0] } else { KAPPA }
}

/// How many leaders are fitted with care each time.
pub(super) fn leaders(problem: &Problem) -> usize {
    if is_stage_alone(problem) { 4 * REFINED } else { REFINED }
}

/// Whether recorded spools drive all that is judged.
pub fn is_stage_alone(problem: &Problem) -> bool {
    problem.recordings.iter().all(|recording| recording.cut == Cut::Spool)
}

/// What all fits share.
pub(super) struct Explorer<'a> {
    kappa: f64,
    pub(super) scale: Scale,
    pub(super) problem: &'a Problem,
    nominal: &'a FittedModel,
    catalogue: &'a [&'static EffectSpec],
}

impl<'a> Explorer<'a> {
    /// For a problem, the refitted sheet on it, and a catalogue.
    pub(super) fn new(problem: &'a Problem, nominal: &'a FittedModel, catalogue: &'a [&'static EffectSpec]) -> Self {
        Self { kappa: kappa(problem), scale: Scale::new(problem, nominal.cost()), problem, nominal, catalogue }
    }

    /// Profiles of all effects on top of a point.
    pub(super) fn profiles(&self, point: &FittedModel) -> Vec<ProfilePlace> {
        profiles(self.problem, point, self.catalogue, self.nominal.cost())
    }

    /// The linear picture about a point.
    pub(super) fn picture(&self, point: &FittedModel, places: &[ProfilePlace], discrepancy: &Columns) -> Linearisation {
        Linearisation::new(self.problem, point, places, discrepancy, self.kappa)
    }

    pub(super) fn hypothesis(&self, effects: Vec<usize>, model: FittedModel, refined: bool) -> Hypothesis {
        Hypothesis::new(&self.scale, effects, model, refined)
    }

    /// Places in the catalogue of the effects that a proposal at a point leaves or adds, with where they stand.
    pub(super) fn members(&self, point: &FittedModel, proposal: &Proposal) -> Vec<(usize, Variant)> {
        let first = self.nominal.free_parameters.len();
        let mut members = proposal.effects.clone();
        let mut place = first;
        for (own, spec) in point.effects.iter().enumerate() {
            let at = |k: usize| point.fit.positions[k] + proposal.change[k].clamp(-1.0, 1.0);
            let variant =
                Variant { size: at(place), further: if spec.parameters.len() > 1 { at(place + 1) } else { 1.0 } };
            place += spec.parameters.len();
            let known = self.catalogue.iter().position(|known| known.id == spec.id);
            members.extend(known.filter(|_| !proposal.removed.contains(&own)).map(|known| (known, variant)));
        }
        members.sort_by_key(|(effect, _)| *effect);
        members
    }

    /// Fits proposals quickly, each at its point: one step each, and those that are worth it then go on.
    pub(super) fn scouted(&self, jobs: &[(&FittedModel, Proposal)]) -> Vec<Hypothesis> {
        let mut known: Vec<(*const FittedModel, Vec<DMatrix<f64>>)> = Vec::new();
        for (point, _) in jobs {
            if known.iter().all(|(other, _)| !std::ptr::eq(*other, *point)) {
                known.push((*point, point.sheet_slopes(self.nominal)));
            }
        }
        let singles = |found: &[Hypothesis]| found.iter().take_while(|one| one.effects.len() == 1).count();
        let places: Vec<(Vec<usize>, Placed)> =
            jobs.iter().map(|(point, proposal)| self.begun_at(point, proposal)).collect();
        let several = places.iter().filter(|(effects, _)| effects.len() > 1).count().div_ceil(PURSUED);
        let mut found: Vec<Hypothesis> = Vec::new();
        for (jobs, places) in jobs.chunks(TOGETHER).zip(places.chunks(TOGETHER)) {
            let starts: Vec<Start<'_, FreeParameter>> = jobs
                .iter()
                .zip(places)
                .map(|((point, _), (_, (base, free_parameters, positions)))| {
                    let known = known.iter().find(|(other, _)| std::ptr::eq(*other, *point));
                    let known = known.map(|(_, slopes)| slopes.as_slice());
                    Start { base, coordinates: free_parameters, positions, effort: Effort::GLANCE, known }
                })
                .collect();
            let fits = fit_all(self.problem, &starts);
            let glanced = places.par_iter().zip(fits).map(|((effects, (base, free_parameters, _)), fit)| {
                let specs = effects.iter().map(|&effect| self.catalogue[effect]).collect();
                self.hypothesis(
                    effects.clone(),
                    FittedModel::new(specs, base.clone(), free_parameters.clone(), fit),
                    false,
                )
            });
            found.par_extend(glanced);
            found.sort_by(|a, b| b.score.total_cmp(&a.score));
            // Single effects are few, and what a verdict most often names.
            found.sort_by_key(|one| one.effects.len() > 1);
            // Slopes are nearly all of the memory.
            let promising = singles(&found) + several;
            found.iter_mut().skip(promising).for_each(|one| one.model.lighten());
        }
        drop(known);
        let rest = found.split_off((singles(&found) + several).min(found.len()));
        let count = self.nominal.free_parameters.len();
        let mut all: Vec<Hypothesis> = Vec::new();
        while !found.is_empty() {
            let mut some: Vec<Hypothesis> = found.drain(..TOGETHER.min(found.len())).collect();
            // An effect's own slopes bend most and are measured at each step.
            let known: Vec<Vec<DMatrix<f64>>> = some
                .iter_mut()
                .map(|one| std::mem::take(&mut one.model.fit.slopes))
                .map(|slopes| slopes.into_iter().map(|slopes| slopes.resize_horizontally(count, 0.0)).collect())
                .collect();
            let starts = some.iter().zip(&known);
            let starts: Vec<Start<'_, FreeParameter>> =
                starts.map(|(one, known)| Start { known: Some(known), ..one.model.onwards(FURTHER) }).collect();
            let fits = fit_all(self.problem, &starts);
            drop(starts);
            // A fit ends no higher than it began.
            let further = some.into_par_iter().zip(fits).map(|(one, fit)| {
                let FittedModel { effects, base, free_parameters, .. } = one.model;
                self.hypothesis(one.effects, FittedModel::new(effects, base, free_parameters, fit), false)
            });
            all.par_extend(further);
        }
        all.extend(rest);
        all
    }

    /// The effects of a proposal at a point, and the unit with them where the fit begins.
    fn begun_at(&self, point: &FittedModel, proposal: &Proposal) -> (Vec<usize>, Placed) {
        let members = self.members(point, proposal);
        let positions = (0..self.nominal.free_parameters.len()).map(|k| {
            let (low, high) = self.nominal.free_parameters[k].range(&self.nominal.base);
            (point.fit.positions[k] + proposal.change[k].clamp(-FARTHEST, FARTHEST)).clamp(low, high)
        });
        let mut placed = (self.nominal.base.clone(), self.nominal.free_parameters.clone(), positions.collect());
        for &(effect, variant) in &members {
            add(&mut placed, self.catalogue[effect], variant);
        }
        (members.into_iter().map(|(effect, _)| effect).collect(), placed)
    }

    /// Proposals of what a leader holds, begun from the sheet, and of what it holds without one of its effects, from the sheet and from where it
    /// stands: what takes an effect's place may have strained it.
    pub(super) fn narrowed<'b>(
        &self,
        leader: &'b FittedModel,
        sheet: &'b FittedModel,
    ) -> Vec<(&'b FittedModel, Proposal)> {
        let own = self.members(leader, &Proposal::at(leader, Vec::new()));
        let from_sheet = |left: Option<usize>| {
            let kept = (0..own.len()).filter(|&k| Some(k) != left).map(|k| own[k]).collect();
            (sheet, Proposal::at(sheet, kept))
        };
        let without = |left: usize| Proposal { removed: vec![left], ..Proposal::at(leader, Vec::new()) };
        let mut jobs = vec![from_sheet(None)];
        if own.len() > 1 {
            jobs.extend((0..own.len()).map(|left| from_sheet(Some(left))));
            jobs.extend((0..own.len()).map(|left| (leader, without(left))));
        }
        jobs
    }

    /// Proposals of what a set holds without each of its effects, from where it stands, where that was not fitted with care yet: an effect may have
    /// led a fit past a ridge and then vanished.
    pub(super) fn lessened<'b>(
        &self,
        model: &'b FittedModel,
        is_open: impl Fn(&[usize]) -> bool,
    ) -> Vec<(&'b FittedModel, Proposal)> {
        let of = |left: usize| Proposal { removed: vec![left], ..Proposal::at(model, Vec::new()) };
        let is_open = |proposal: &Proposal| {
            let effects: Vec<usize> = self.members(model, proposal).into_iter().map(|(effect, _)| effect).collect();
            is_open(&effects)
        };
        (0..model.effects.len()).map(of).filter(is_open).map(|proposal| (model, proposal)).collect()
    }

    /// What a model and a set hold together, from where the model stands: the set's further effects at nothing, and as large as in its own fit.
    pub(super) fn widened<'b>(&self, set: &Hypothesis, model: &'b FittedModel) -> [(&'b FittedModel, Proposal); 2] {
        let further = self.further(set, model);
        [self.widened_by_nothing(set, model), (model, Proposal::at(model, further))]
    }

    /// The same with the further effects at nothing alone.
    pub(super) fn widened_by_nothing<'b>(
        &self,
        set: &Hypothesis,
        model: &'b FittedModel,
    ) -> (&'b FittedModel, Proposal) {
        let nothing = |(effect, _)| (effect, Variant { size: 0.0, further: 0.0 });
        (model, Proposal::at(model, self.further(set, model).into_iter().map(nothing).collect()))
    }

    /// The effects of a set that a model lacks, as they stand.
    fn further(&self, set: &Hypothesis, model: &FittedModel) -> Vec<(usize, Variant)> {
        let mut further = self.members(&set.model, &Proposal::at(&set.model, Vec::new()));
        further.retain(|(effect, _)| !model.has(self.catalogue[*effect].id));
        further
    }

    /// Fits hypotheses on with care, likeliest first; where the unit chatters the first by wide differences too, and once more those that this brought
    /// further.
    pub(super) fn refined(&self, chosen: &[Hypothesis]) -> Vec<Hypothesis> {
        let careful = |some: &[Hypothesis]| {
            let starts: Vec<Start<'_, FreeParameter>> = some.iter().map(|one| one.model.onwards(CAREFUL)).collect();
            self.better(some, fit_all(self.problem, &starts), true)
        };
        let mut refined = careful(chosen);
        if self.problem.chatters() {
            let rest = refined.split_off(WIDELY.min(refined.len()));
            let starts: Vec<Start<'_, FreeParameter>> =
                refined.iter().map(|one| Start { known: None, ..one.model.onwards(WIDE) }).collect();
            let wide = self.better(&refined, fit_all(self.problem, &starts), true);
            let (further, there): (Vec<_>, Vec<_>) =
                wide.into_iter().zip(refined).partition(|(one, before)| one.model.cost() < before.model.cost());
            let further: Vec<Hypothesis> = further.into_iter().map(|(one, _)| one).collect();
            refined = careful(&further);
            refined.extend(there.into_iter().map(|(_, before)| before).chain(rest));
        }
        if is_stage_alone(self.problem) {
            refined = refined
                .into_iter()
                .map(|one| if one.effects.len() == 1 { self.annealed_single(one) } else { one })
                .collect();
        }
        refined
    }

    /// A single effect of a stage alone, annealed from where it stands and from the sheet: where all parameters are free, one effect's fit strands where
    /// another one's begins.
    fn annealed_single(&self, one: Hypothesis) -> Hypothesis {
        let model = &one.model;
        let mut from_sheet = model.fit.positions.clone();
        from_sheet[..self.nominal.free_parameters.len()].fill(0.0);
        let starts = [model.fit.positions.clone(), from_sheet];
        let fits = annealed(self.problem, &model.base, &model.free_parameters, &starts, CAREFUL.rounds);
        let Some(best) = fits.into_iter().min_by(|a, b| a.cost().total_cmp(&b.cost())) else {
            return one;
        };
        let better = model.or_better(best);
        self.hypothesis(one.effects, better, true)
    }

    /// Hypotheses with fits that went on from them, where these are better.
    fn better(&self, chosen: &[Hypothesis], fits: Vec<Fit>, refined: bool) -> Vec<Hypothesis> {
        let found = chosen
            .par_iter()
            .zip(fits)
            .map(|(one, fit)| self.hypothesis(one.effects.clone(), one.model.or_better(fit), refined));
        found.collect()
    }
}

/// Proposals without those whose evidence hardly exceeds that of a proposal with one effect less: the odds against an effect leave them next to
/// no probability, and effects that leave no mark would take all places.
pub(super) fn worthwhile(proposals: Vec<Proposal>) -> Vec<Proposal> {
    let ids = |proposal: &Proposal| -> Vec<usize> {
        let mut ids: Vec<usize> = proposal.effects.iter().map(|(effect, _)| *effect).collect();
        ids.sort_unstable();
        ids
    };
    let mut known: BTreeMap<Vec<usize>, f64> = BTreeMap::from([(Vec::new(), 0.0)]);
    for proposal in &proposals {
        let best = known.entry(ids(proposal)).or_insert(f64::NEG_INFINITY);
        *best = best.max(proposal.log_evidence);
    }
    let gains = |proposal: &Proposal| {
        let all = ids(proposal);
        (0..all.len()).all(|left| {
            let mut fewer = all.clone();
            fewer.remove(left);
            known.get(&fewer).is_none_or(|fewer| proposal.log_evidence > fewer + LEAST_GAIN)
        })
    };
    proposals.into_iter().filter(|proposal| proposal.effects.len() < 2 || gains(proposal)).collect()
}
