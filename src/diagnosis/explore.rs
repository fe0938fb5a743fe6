//! Which fault sets are worth a joint fit, and those fits: proposals of the linear picture at several points, until the leader stands.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IndexedParallelIterator, IntoParallelIterator, IntoParallelRefIterator, ParallelIterator};

use crate::diagnosis::discrepancy::{Columns, columns};
use crate::diagnosis::evidence::{KAPPAS, Normal, Shared};
use crate::diagnosis::known::Known;
use crate::diagnosis::linearisation::{Linearisation, Proposal};
use crate::diagnosis::model::Model;
use crate::diagnosis::support::{Placed, Variant, add};
use crate::effects::EffectSpec;
use crate::tuning::bench::Bench;
use crate::tuning::fit::{Effort, Fit, Start, fit_all};
use crate::twin::Cut;

/// Most effects at once.
pub const MOST: usize = 3;

/// Error of equations that proposals and rankings count with, in moderate discrepancy terms.
pub const KAPPA: f64 = 0.03;

/// Error of laws that rankings count with, as a share of what an effect does.
pub const LAW_ERROR: f64 = 0.05;

/// Logarithm of the odds against each further effect that the exploration counts with; the posterior has learned odds of its own.
const RARITY: f64 = 5.0;

/// Proposals of each point that are fitted, by number of effects from one.
const TAKEN: [usize; MOST] = [5, 6, 3];

/// The same at the leader, where all sets resemble it.
const TAKEN_AT_LEADER: usize = 6;

/// Fitted sets that are fitted on with care, each time.
const REFINED: usize = 4;

/// Least gain in evidence for which a further effect is tried, nats: a fiftieth of the odds against it.
const LEAST_GAIN: f64 = 1.0;

/// Of the sets of several effects that were fitted by one step, one in so many is fitted on.
const PURSUED: usize = 3;

/// Further steps of such a fit.
const FURTHER: Effort = Effort { rounds: 2, refresh: 100, temperature: 1.0 };

/// Work of a careful fit.
const CAREFUL: Effort = Effort { rounds: 6, refresh: 3, temperature: 1.0 };

/// Sets behind the leader that are tried without each of their effects, each time.
const RUNNERS_UP: usize = 2;

/// How often the leader is taken for a new point at most.
const ROUNDS: usize = 3;

/// Farthest that a proposal moves a free parameter, in its standard deviations.
const FARTHEST: f64 = 3.0;

/// A fault set that was fitted.
#[derive(Clone, Debug)]
pub struct Hypothesis {
    /// Places of its effects in the catalogue, rising.
    pub effects: Vec<usize>,
    /// The model; without residuals and slopes where it is far from the leader.
    pub model: Model,
    /// Normal equations for its evidence.
    pub normal: Normal,
    /// Logarithm of its evidence, and of the odds against so many effects.
    pub log_evidence: f64,
    /// Whether it was fitted with care.
    pub refined: bool,
}

/// What was explored.
#[derive(Debug)]
pub struct Explored {
    /// All fitted sets, likeliest first; the empty one is among them.
    pub hypotheses: Vec<Hypothesis>,
    /// Marks of the discrepancy terms at the refitted sheet.
    pub discrepancy: Columns,
    /// The linear picture there.
    pub linearisation: Linearisation,
}

impl Explored {
    /// The sheet refitted, without any effect.
    #[must_use]
    pub fn refitted(&self) -> &Model {
        // Exploration begins with it.
        self.hypotheses.iter().find(|one| one.effects.is_empty()).map_or(&self.hypotheses[0].model, |one| &one.model)
    }

    /// The likeliest fitted set.
    #[must_use]
    pub fn leader(&self) -> &Model {
        &self.hypotheses[0].model
    }

    /// The model with just these effects, where it was fitted and kept.
    #[must_use]
    pub fn with(&self, ids: &[&str]) -> Option<&Model> {
        let is_it = |one: &&Hypothesis| {
            one.model.effects.len() == ids.len()
                && ids.iter().all(|id| one.model.has(id))
                && !one.model.fit.slopes.is_empty()
        };
        self.hypotheses.iter().find(is_it).map(|one| &one.model)
    }

    /// Fits with care what a verdict claims: all of the effects together where they are named, and each alone.
    pub fn complete(
        &mut self,
        bench: &Bench,
        blamed: &[&'static str],
        together: bool,
        catalogue: &[&'static EffectSpec],
    ) {
        let mut claims: Vec<Vec<&'static str>> = blamed.iter().map(|id| vec![*id]).collect();
        if together && blamed.len() > 1 {
            claims.push(blamed.to_vec());
        }
        let is_it = |one: &Hypothesis, claim: &[&str]| {
            one.effects.len() == claim.len() && claim.iter().all(|id| one.model.has(id))
        };
        claims.retain(|claim| {
            let is_done = |one: &Hypothesis| is_it(one, claim) && one.refined && !one.model.fit.slopes.is_empty();
            !self.hypotheses.iter().any(is_done)
        });
        // The set as it was fitted, and as a larger one leaves it: one may stand behind a ridge.
        let mut places: Vec<(usize, Option<&Hypothesis>, Placed)> = Vec::new();
        for (place, claim) in claims.iter().enumerate() {
            let own = self.hypotheses.iter().find(|one| is_it(one, claim));
            places.extend(own.map(|own| (place, Some(own), own.model.placed())));
            let holds = |one: &&Hypothesis| one.effects.len() > claim.len() && claim.iter().all(|id| one.model.has(id));
            let larger = self.hypotheses.iter().find(holds);
            places.extend(larger.map(|larger| (place, None, larger.model.keeping(claim))));
        }
        let starts: Vec<Start<'_>> = places
            .iter()
            .map(|(_, own, (base, knobs, positions))| match own {
                Some(own) => own.model.onwards(Effort::FULL),
                None => Start { base, knobs, positions, effort: Effort::FULL, known: None },
            })
            .collect();
        let fits = fit_all(bench, &starts);
        let shared = Shared::new(bench, &self.discrepancy, self.refitted().cost());
        let mut best: Vec<Option<Hypothesis>> = vec![None; claims.len()];
        for ((place, _, (base, knobs, _)), fit) in places.into_iter().zip(fits) {
            let known = catalogue.iter().enumerate().filter(|(_, spec)| claims[place].contains(&spec.id));
            let (effects, specs): (Vec<usize>, Vec<&'static EffectSpec>) = known.map(|(k, spec)| (k, *spec)).unzip();
            let model = Model::new(specs, base, knobs, fit);
            if best[place].as_ref().is_none_or(|best| model.cost() < best.model.cost()) {
                let normal = shared.normal(&model);
                let log_evidence = normal.at(kappa(bench), LAW_ERROR) - RARITY * effects.len() as f64;
                best[place] = Some(Hypothesis { effects, model, normal, log_evidence, refined: true });
            }
        }
        for found in best.into_iter().flatten() {
            self.hypotheses.retain(|one| one.effects != found.effects);
            self.hypotheses.push(found);
        }
    }
}

/// Error of equations that explorations count with: next to none where the stage behind a recorded spool stands alone, of which the discrepancy
/// terms know too much: at the spool's own rate nothing in the loop holds them.
fn kappa(bench: &Bench) -> f64 {
    if is_stage_alone(bench) { KAPPAS[0] } else { KAPPA }
}

/// How many leaders are fitted with care each time.
pub(super) fn leaders(bench: &Bench) -> usize {
    if is_stage_alone(bench) { 4 * REFINED } else { REFINED }
}

/// Whether recorded spools drive all that is judged.
#[must_use]
pub fn is_stage_alone(bench: &Bench) -> bool {
    bench.trials.iter().all(|trial| trial.cut == Cut::Spool)
}

/// What all fits share.
pub(super) struct Explorer<'a> {
    kappa: f64,
    pub(super) bench: &'a Bench,
    nominal: &'a Model,
    catalogue: &'a [&'static EffectSpec],
    shared: Shared<'a>,
}

impl Explorer<'_> {
    fn hypothesis(&self, effects: Vec<usize>, model: Model, refined: bool) -> Hypothesis {
        let normal = self.shared.normal(&model);
        let log_evidence = normal.at(self.kappa, LAW_ERROR) - RARITY * effects.len() as f64;
        Hypothesis { effects, model, normal, log_evidence, refined }
    }

    /// Places in the catalogue of the effects that a proposal at a point leaves or adds, with where they stand.
    fn members(&self, point: &Model, proposal: &Proposal) -> Vec<(usize, Variant)> {
        let first = self.nominal.knobs.len();
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
    fn scouted(&self, jobs: &[(&Model, Proposal)]) -> Vec<Hypothesis> {
        let mut known: Vec<(*const Model, Vec<DMatrix<f64>>)> = Vec::new();
        for (point, _) in jobs {
            if known.iter().all(|(other, _)| !std::ptr::eq(*other, *point)) {
                known.push((*point, self.sheet_slopes(point)));
            }
        }
        let places: Vec<(Vec<usize>, Placed)> =
            jobs.iter().map(|(point, proposal)| self.placed(point, proposal)).collect();
        let starts: Vec<Start<'_>> = jobs
            .iter()
            .zip(&places)
            .map(|((point, _), (_, (base, knobs, positions)))| {
                let known = known.iter().find(|(other, _)| std::ptr::eq(*other, *point));
                Start {
                    base,
                    knobs,
                    positions,
                    effort: Effort::GLANCE,
                    known: known.map(|(_, slopes)| slopes.as_slice()),
                }
            })
            .collect();
        let fits = fit_all(self.bench, &starts);
        drop(starts);
        let found = places.into_par_iter().zip(fits).map(|((effects, (base, knobs, _)), fit)| {
            let specs = effects.iter().map(|&effect| self.catalogue[effect]).collect();
            self.hypothesis(effects, Model::new(specs, base, knobs, fit), false)
        });
        let mut found: Vec<Hypothesis> = found.collect();
        found.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        // Single effects are few, and what a verdict most often names.
        found.sort_by_key(|one| one.effects.len() > 1);
        let singles = found.iter().take_while(|one| one.effects.len() == 1).count();
        let promising = singles + (found.len() - singles).div_ceil(PURSUED);
        // An effect's own slopes bend most and are measured at each step.
        let known: Vec<Vec<DMatrix<f64>>> =
            found[..promising].iter().map(|one| self.sheet_slopes(&one.model)).collect();
        let starts = found.iter().zip(&known);
        let starts: Vec<Start<'_>> =
            starts.map(|(one, known)| Start { known: Some(known), ..one.model.onwards(FURTHER) }).collect();
        let fits = fit_all(self.bench, &starts);
        drop(starts);
        let further = self.better(&found[..promising], fits, false);
        found.splice(..promising, further);
        found
    }

    /// Slopes of a model by the parameters of the sheet alone.
    fn sheet_slopes(&self, model: &Model) -> Vec<DMatrix<f64>> {
        let count = self.nominal.knobs.len();
        model.fit.slopes.iter().map(|slopes| slopes.columns(0, count).into_owned()).collect()
    }

    /// The effects of a proposal at a point, and the unit with them where the fit begins.
    fn placed(&self, point: &Model, proposal: &Proposal) -> (Vec<usize>, Placed) {
        let members = self.members(point, proposal);
        let positions = (0..self.nominal.knobs.len()).map(|k| {
            let (low, high) = self.nominal.knobs[k].range(&self.nominal.base);
            (point.fit.positions[k] + proposal.change[k].clamp(-FARTHEST, FARTHEST)).clamp(low, high)
        });
        let mut placed = (self.nominal.base.clone(), self.nominal.knobs.clone(), positions.collect());
        for &(effect, variant) in &members {
            add(&mut placed, self.catalogue[effect], variant);
        }
        (members.into_iter().map(|(effect, _)| effect).collect(), placed)
    }

    /// Proposals of what a leader holds, begun from the sheet, and of what it holds without one of its effects, from the sheet and from where it
    /// stands: what takes an effect's place may have strained it.
    fn narrowed<'b>(&self, leader: &'b Model, sheet: &'b Model) -> Vec<(&'b Model, Proposal)> {
        let still = |point: &Model| DVector::zeros(point.knobs.len());
        let stand = |removed| Proposal { effects: Vec::new(), removed, log_evidence: 0.0, change: still(leader) };
        let own = self.members(leader, &stand(Vec::new()));
        let from_sheet = |left: Option<usize>| {
            let kept = (0..own.len()).filter(|&k| Some(k) != left).map(|k| own[k]).collect();
            (sheet, Proposal { effects: kept, removed: Vec::new(), log_evidence: 0.0, change: still(sheet) })
        };
        let mut jobs = vec![from_sheet(None)];
        if own.len() > 1 {
            jobs.extend((0..own.len()).map(|left| from_sheet(Some(left))));
            jobs.extend((0..own.len()).map(|left| (leader, stand(vec![left]))));
        }
        jobs
    }

    /// Proposals of what a set holds without each of its effects, from where it stands, where that was not fitted with care yet: an effect may have
    /// led a fit past a ridge and then vanished.
    fn lessened<'b>(&self, model: &'b Model, known: &Known) -> Vec<(&'b Model, Proposal)> {
        let change = DVector::zeros(model.knobs.len());
        let of = |left: usize| Proposal {
            effects: Vec::new(),
            removed: vec![left],
            log_evidence: 0.0,
            change: change.clone(),
        };
        let is_open = |proposal: &Proposal| {
            let effects: Vec<usize> = self.members(model, proposal).into_iter().map(|(effect, _)| effect).collect();
            known.fitted.get(&effects).is_none_or(|one| !one.refined)
        };
        (0..model.effects.len()).map(of).filter(is_open).map(|proposal| (model, proposal)).collect()
    }

    /// Fits hypotheses on with care.
    pub(super) fn refined(&self, chosen: &[Hypothesis]) -> Vec<Hypothesis> {
        let starts: Vec<Start<'_>> = chosen.iter().map(|one| one.model.onwards(CAREFUL)).collect();
        self.better(chosen, fit_all(self.bench, &starts), true)
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
fn worthwhile(proposals: Vec<Proposal>) -> Vec<Proposal> {
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

/// Explores the fault sets of a catalogue from the refitted sheet and from the sheet itself.
#[must_use]
pub fn explore(
    bench: &Bench,
    refitted: &Model,
    sheet: &Model,
    catalogue: &[&'static EffectSpec],
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Explored {
    progress("placing discrepancy terms", 0.2);
    let discrepancy = columns(bench, refitted);
    let kappa = kappa(bench);
    let explorer = Explorer {
        kappa,
        bench,
        nominal: refitted,
        catalogue,
        shared: Shared::new(bench, &discrepancy, refitted.cost()),
    };
    let mut known = Known::default();
    known.take(explorer.hypothesis(Vec::new(), refitted.clone(), true));
    progress("weighing all sets of up to three effects", 0.25);
    let at = |point: &Model| Linearisation::new(bench, point, catalogue, &discrepancy, kappa);
    let linearisation = at(refitted);
    let from_sheet = at(sheet);
    progress("fitting the likeliest sets", 0.4);
    let mut jobs: Vec<(&Model, Proposal)> = Vec::new();
    for (point, picture) in [(refitted, &linearisation), (sheet, &from_sheet)] {
        let proposals = worthwhile(picture.proposals(MOST));
        // A stage alone has few effects and all are alike: each is fitted.
        let taken = if is_stage_alone(bench) { [usize::MAX, TAKEN[1], TAKEN[2]] } else { TAKEN };
        for (size, taken) in taken.into_iter().enumerate() {
            let of_size = proposals.iter().filter(|proposal| proposal.effects.len() == size + 1);
            jobs.extend(of_size.take(taken).map(|proposal| (point, proposal.clone())));
        }
    }
    for hypothesis in explorer.scouted(&jobs) {
        known.take(hypothesis);
    }
    known.refine(&explorer);
    for round in 0..ROUNDS {
        let Some(leader) = known.ordered().first().map(|leader| (*leader).clone()) else { break };
        if leader.effects.is_empty() {
            break;
        }
        progress("weighing all sets anew at the likeliest", 0.6 + 0.1 * round as f64);
        let picture = at(&leader.model);
        let mut proposals = picture.proposals(MOST - leader.effects.len());
        let further = |proposal: &Proposal| proposal.effects.len() as f64 - proposal.removed.len() as f64;
        let odds = |proposal: &Proposal| proposal.log_evidence - RARITY * further(proposal);
        proposals.sort_by(|a, b| odds(b).total_cmp(&odds(a)));
        let mut jobs: Vec<(&Model, Proposal)> = Vec::new();
        for proposal in proposals {
            let effects: Vec<usize> =
                explorer.members(&leader.model, &proposal).into_iter().map(|(effect, _)| effect).collect();
            if effects.is_empty() || effects.len() > MOST {
                continue;
            }
            let refined = known.fitted.get(&effects).is_some_and(|known| known.refined);
            let idle =
                proposal.removed.is_empty() && proposal.log_evidence < LEAST_GAIN * proposal.effects.len() as f64;
            if !refined && !idle && jobs.len() < TAKEN_AT_LEADER {
                jobs.push((&leader.model, proposal));
            }
        }
        jobs.extend(explorer.narrowed(&leader.model, sheet));
        let runners_up: Vec<Hypothesis> = known
            .ordered()
            .into_iter()
            .filter(|one| one.effects.len() > 1 && one.effects != leader.effects && !one.model.fit.slopes.is_empty())
            .take(RUNNERS_UP)
            .cloned()
            .collect();
        for one in &runners_up {
            jobs.extend(explorer.lessened(&one.model, &known));
        }
        for hypothesis in explorer.scouted(&jobs) {
            known.take(hypothesis);
        }
        known.refine(&explorer);
        if known.ordered().first().is_some_and(|first| first.effects == leader.effects) {
            break;
        }
    }
    let mut hypotheses: Vec<Hypothesis> = known.fitted.into_values().collect();
    hypotheses.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
    drop(explorer);
    Explored { hypotheses, discrepancy, linearisation }
}
