//! Which fault sets are worth a joint fit, and those fits: proposals of the linear picture at several points, until the leader stands.

pub(crate) mod explorer;
mod fitted_sets;
pub(crate) mod linearisation;
pub(crate) mod profile;
pub mod table;

use std::sync::{Arc, OnceLock};

use nalgebra::{DMatrix, DVector};

use crate::estimation::coordinate::subject_at;
use crate::estimation::fit::{Start, fit_all};
use crate::evidence::{ExtendedEquations, Shared};
use crate::hypotheses::explorer::{CAREFUL, Explorer, Hypothesis, LEAST_GAIN, Scale, is_stage_alone, worthwhile};
use crate::hypotheses::fitted_sets::KnownSets;
use crate::hypotheses::linearisation::{Linearisation, Proposal};
use crate::hypotheses::profile::{ProfilePlace, fitted_best, moved_to, profiles};
use crate::identification::free_parameter::FreeParameter;
use crate::likelihood::problem::Problem;
use crate::model::FittedModel;
use crate::model::discrepancy::{Columns, columns};
use crate::model::support::{Placed, Variant};
use govtwin_model::effects::EffectSpec;
use govtwin_model::parameters::Unit;

/// Most effects at once.
pub(crate) const MOST: usize = 3;

/// Proposals of each point that are fitted, by number of effects from one.
const TAKEN: [usize; MOST] = [5, 6, 3];

/// The same at the leader, where all sets resemble it.
const TAKEN_AT_LEADER: usize = 6;

/// Prior χ² per parameter from which a leader's sheet is stretched: twice what tolerances mean.
const STRETCHED: f64 = 2.0;

/// Sets behind the leader that are tried without each of their effects, each time.
const RUNNERS_UP: usize = 2;

/// How often the leader is taken for a new point at most.
const ROUNDS: usize = 3;

/// What was explored.
#[derive(Debug)]
pub struct Explored {
    /// All fitted sets, likeliest first; the empty one is among them.
    pub hypotheses: Vec<Hypothesis>,
    /// Marks of the discrepancy terms at the refitted sheet.
    pub discrepancy: Arc<Columns>,
    /// The linear picture there.
    pub linearisation: Linearisation,
    /// What discrepancy terms on top of any set share, once anybody asked.
    shared: OnceLock<Shared>,
    /// The refitted sheet beside the discrepancy terms, once anybody asked.
    extended: OnceLock<ExtendedEquations>,
}

impl Explored {
    /// What discrepancy terms on top of any set share.
    pub(crate) fn shared(&self, problem: &Problem) -> &Shared {
        self.shared.get_or_init(|| Shared::new(problem, &self.discrepancy, self.refitted().cost()))
    }

    /// The sheet refitted, without any effect.
    pub fn refitted(&self) -> &FittedModel {
        // Exploration begins with it.
        self.hypotheses.iter().find(|one| one.effects.is_empty()).map_or(&self.hypotheses[0].model, |one| &one.model)
    }

    /// The likeliest fitted set.
    pub fn leader(&self) -> &FittedModel {
        &self.hypotheses[0].model
    }

    /// The model with just these effects, where it was fitted and kept.
    pub fn with(&self, ids: &[&str]) -> Option<&FittedModel> {
        let is_it = |one: &&Hypothesis| {
            one.model.effects.len() == ids.len()
                && ids.iter().all(|id| one.model.has(id))
                && !one.model.fit.slopes.is_empty()
        };
        self.hypotheses.iter().find(is_it).map(|one| &one.model)
    }

    /// The refitted sheet beside the discrepancy terms.
    pub(crate) fn extended(&self, problem: &Problem) -> &ExtendedEquations {
        self.extended.get_or_init(|| self.shared(problem).extended(self.refitted()))
    }

    /// The model of the first of these sets that was fitted and kept, likeliest first; the leader where none was.
    pub fn nearest(&self, sets: &[(Vec<String>, f64)]) -> &FittedModel {
        let model = |(ids, _): &(Vec<String>, f64)| self.with(&ids.iter().map(String::as_str).collect::<Vec<_>>());
        sets.iter().find_map(model).unwrap_or_else(|| self.leader())
    }

    /// Fits with care what a verdict claims: all of the effects together where they are named, and each alone.
    pub fn complete(
        &mut self,
        problem: &Problem,
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
        let mut places: Vec<(usize, &FittedModel, Placed)> = Vec::new();
        for (place, claim) in claims.iter().enumerate() {
            let own = self.hypotheses.iter().find(|one| is_it(one, claim));
            places.extend(own.map(|own| (place, &own.model, own.model.placed())));
            let holds = |one: &&Hypothesis| one.effects.len() > claim.len() && claim.iter().all(|id| one.model.has(id));
            let larger = self.hypotheses.iter().find(holds);
            places.extend(larger.map(|larger| (place, &larger.model, larger.model.keeping(claim))));
        }
        let known: Vec<Vec<DMatrix<f64>>> =
            places.iter().map(|(_, model, _)| model.sheet_slopes(self.refitted())).collect();
        let starts: Vec<Start<'_, FreeParameter>> = places
            .iter()
            .zip(&known)
            .map(|((_, _, (base, coordinates, positions)), known)| {
                let known = Some(known.as_slice());
                Start { base, coordinates, positions, effort: CAREFUL, known }
            })
            .collect();
        let fits = fit_all(problem, &starts);
        let scale = Scale::new(problem, self.refitted().cost());
        let mut best: Vec<Option<Hypothesis>> = vec![None; claims.len()];
        for ((place, _, (base, free_parameters, _)), fit) in places.into_iter().zip(fits) {
            let known = catalogue.iter().enumerate().filter(|(_, spec)| claims[place].contains(&spec.id));
            let (effects, specs): (Vec<usize>, Vec<&'static EffectSpec>) = known.map(|(k, spec)| (k, *spec)).unzip();
            let model = FittedModel::new(specs, base, free_parameters, fit);
            if best[place].as_ref().is_none_or(|best| model.cost() < best.model.cost()) {
                best[place] = Some(Hypothesis::new(&scale, effects, model, true));
            }
        }
        for found in best.into_iter().flatten() {
            self.hypotheses.retain(|one| one.effects != found.effects);
            self.hypotheses.push(found);
        }
    }
}

/// What profiles of single effects found, before fault sets are explored.
pub struct Singles {
    /// Sizes that are worth more, on top of the sheet.
    places: Vec<ProfilePlace>,
    /// The unit with the likeliest effect.
    leading: Option<Unit>,
}

impl Singles {
    /// Profiles every effect on top of the sheet as it was delivered, which a cause that is missing has not stretched.
    pub fn profiled(
        problem: &Problem,
        refitted: &FittedModel,
        sheet: &FittedModel,
        catalogue: &[&'static EffectSpec],
    ) -> Self {
        let places = profiles(problem, sheet, catalogue, refitted.cost());
        let best = fitted_best(problem, sheet, catalogue, &places).filter(|best| best.cost() < refitted.cost());
        let leading = best.map(|best| subject_at(&best.base, &best.free_parameters, &best.fit.positions));
        Self { places, leading }
    }

    /// The unit with the likeliest effect, where any gains something.
    pub fn leading(&self) -> Option<&Unit> {
        self.leading.as_ref()
    }
}

/// What an exploration found before the noise was laid out anew.
pub(crate) struct Found {
    /// The linear picture at the refitted sheet.
    linearisation: Linearisation,
    /// The sets that were fitted, likeliest first.
    sets: Vec<FoundSet>,
}

/// A fitted set.
struct FoundSet {
    /// Places of its effects in the catalogue, with size and shape.
    effects: Vec<(usize, Variant)>,
    /// Where its free parameters stand, the sheet's first.
    positions: Vec<f64>,
}

/// An exploration on its way: fault sets of a catalogue fitted from the refitted sheet and from the sheet itself.
pub struct Exploration<'a> {
    explorer: Explorer<'a>,
    sheet: &'a FittedModel,
    discrepancy: Arc<Columns>,
    linearisation: Linearisation,
    known: KnownSets,
}

impl<'a> Exploration<'a> {
    /// Begins one: the likeliest sets by the linear picture at both points are fitted.
    pub fn begin(
        problem: &'a Problem,
        refitted: &'a FittedModel,
        sheet: &'a FittedModel,
        singles: &Singles,
        catalogue: &'a [&'static EffectSpec],
        progress: &(dyn Fn(&str, f64) + Sync),
    ) -> Self {
        let (explorer, discrepancy, known) = Self::prepared(problem, refitted, catalogue, progress);
        progress("weighing all sets of up to three effects", 0.25);
        let linearisation = explorer.picture(refitted, &moved_to(refitted, catalogue, &singles.places), &discrepancy);
        let from_sheet = explorer.picture(sheet, &singles.places, &discrepancy);
        progress("fitting the likeliest sets", 0.4);
        let mut jobs: Vec<(&FittedModel, Proposal)> = Vec::new();
        for (point, picture) in [(refitted, &linearisation), (sheet, &from_sheet)] {
            let proposals = worthwhile(picture.proposals(MOST));
            // A stage alone has few effects and all are alike: each is fitted.
            let taken = if is_stage_alone(problem) { [usize::MAX, TAKEN[1], TAKEN[2]] } else { TAKEN };
            for (size, taken) in taken.into_iter().enumerate() {
                let of_size = proposals.iter().filter(|proposal| proposal.effects.len() == size + 1);
                jobs.extend(of_size.take(taken).map(|proposal| (point, proposal.clone())));
            }
        }
        drop(from_sheet);
        Self { explorer, sheet, discrepancy, linearisation, known }.scouted(&jobs)
    }

    /// What it found, to begin again with.
    pub(crate) fn found(self) -> Found {
        let sets = self.known.ordered().into_iter().filter(|one| !one.effects.is_empty());
        let placed = |one: &Hypothesis| FoundSet {
            effects: self.explorer.members(&one.model, &Proposal::at(&one.model, Vec::new())),
            positions: one.model.fit.positions.clone(),
        };
        Found { sets: sets.map(placed).collect(), linearisation: self.linearisation }
    }

    /// Begins again on a problem whose noise was laid out anew: the sets that were found before are fitted again, from where they stood.
    pub(crate) fn begin_again(
        problem: &'a Problem,
        refitted: &'a FittedModel,
        sheet: &'a FittedModel,
        found: Found,
        catalogue: &'a [&'static EffectSpec],
        progress: &(dyn Fn(&str, f64) + Sync),
    ) -> Self {
        let (explorer, discrepancy, known) = Self::prepared(problem, refitted, catalogue, progress);
        progress("fitting the likeliest sets again", 0.4);
        let at = |FoundSet { effects, positions }: FoundSet| {
            let from = &refitted.fit.positions;
            let change = DVector::from_fn(from.len(), |k, _| positions[k] - from[k]);
            (refitted, Proposal { change, ..Proposal::at(refitted, effects) })
        };
        let jobs: Vec<(&FittedModel, Proposal)> = found.sets.into_iter().map(at).collect();
        Self { explorer, sheet, discrepancy, linearisation: found.linearisation, known }.scouted(&jobs)
    }

    /// What every exploration begins with: the marks of the discrepancy terms, and the sheet alone among the known sets.
    fn prepared(
        problem: &'a Problem,
        refitted: &'a FittedModel,
        catalogue: &'a [&'static EffectSpec],
        progress: &(dyn Fn(&str, f64) + Sync),
    ) -> (Explorer<'a>, Arc<Columns>, KnownSets) {
        progress("placing discrepancy terms", 0.2);
        let explorer = Explorer::new(problem, refitted, catalogue);
        let mut known = KnownSets::default();
        known.take(explorer.hypothesis(Vec::new(), refitted.clone(), true));
        (explorer, Arc::new(columns(problem, refitted)), known)
    }

    /// The same with proposals fitted quickly.
    fn scouted(mut self, jobs: &[(&FittedModel, Proposal)]) -> Self {
        for hypothesis in self.explorer.scouted(jobs) {
            self.known.take(hypothesis);
        }
        self
    }

    /// The unit of the likeliest set so far.
    pub(crate) fn leading_unit(&self) -> Option<Unit> {
        self.known.ordered().first().map(|leader| leader.model.unit())
    }

    /// Goes on: the leading sets are fitted with care, and all sets are weighed anew at the leader and fitted, until it stands.
    pub fn finish(self, progress: &(dyn Fn(&str, f64) + Sync)) -> Explored {
        let Self { explorer, sheet, discrepancy, linearisation, mut known } = self;
        progress("fitting the likeliest sets with care", 0.5);
        known.refine(&explorer);
        for round in 0..ROUNDS {
            let Some(leader) = known.ordered().first().map(|leader| (*leader).clone()) else { break };
            if leader.effects.is_empty() {
                break;
            }
            progress("weighing all sets anew at the likeliest", 0.6 + 0.1 * round as f64);
            // A sheet that is stretched stands in for an effect, which shows where the sheet stands as it was delivered.
            let unstretched =
                (leader.model.prior_per_parameter() > STRETCHED).then(|| leader.model.unstretched(explorer.problem));
            let mut jobs: Vec<(&FittedModel, Proposal)> = Vec::new();
            for point in std::iter::once(&leader.model).chain(&unstretched) {
                let proposals = proposals_at(&explorer, &known, point, &discrepancy);
                jobs.extend(proposals.into_iter().map(|proposal| (point, proposal)));
            }
            jobs.extend(explorer.narrowed(&leader.model, sheet));
            let behind = known.ordered().into_iter().filter(|one| {
                one.effects.len() > 1 && one.effects != leader.effects && !one.model.fit.slopes.is_empty()
            });
            for one in behind.take(RUNNERS_UP) {
                let is_open = |effects: &[usize]| known.fitted.get(effects).is_none_or(|one| !one.refined);
                jobs.extend(explorer.lessened(&one.model, is_open));
            }
            for (pair, other) in known.to_unite() {
                jobs.extend(explorer.widened(other, &pair.model));
            }
            let found = explorer.scouted(&jobs);
            drop(jobs);
            for hypothesis in found {
                known.take(hypothesis);
            }
            known.refine(&explorer);
            if known.ordered().first().is_some_and(|first| first.effects == leader.effects) {
                break;
            }
        }
        let mut hypotheses: Vec<Hypothesis> = known.fitted.into_values().collect();
        hypotheses.sort_by(|a, b| b.score.total_cmp(&a.score));
        Explored { hypotheses, discrepancy, linearisation, shared: OnceLock::new(), extended: OnceLock::new() }
    }
}

/// The sets that are likeliest by the linear picture at a leader, if they were not yet fitted with care.
fn proposals_at(
    explorer: &Explorer<'_>,
    known: &KnownSets,
    leader: &FittedModel,
    discrepancy: &Columns,
) -> Vec<Proposal> {
    let picture = explorer.picture(leader, &explorer.profiles(leader), discrepancy);
    let mut proposals = picture.proposals(MOST - leader.effects.len());
    let further = |proposal: &Proposal| proposal.effects.len() as f64 - proposal.removed.len() as f64;
    let odds = |proposal: &Proposal| proposal.log_evidence - explorer.scale.rarity() * further(proposal);
    proposals.sort_by(|a, b| odds(b).total_cmp(&odds(a)));
    let is_worth_it = |proposal: &Proposal| {
        let effects: Vec<usize> = explorer.members(leader, proposal).into_iter().map(|(effect, _)| effect).collect();
        let is_refined = known.fitted.get(&effects).is_some_and(|known| known.refined);
        let is_idle = proposal.removed.is_empty() && proposal.log_evidence < LEAST_GAIN * proposal.effects.len() as f64;
        (1..=MOST).contains(&effects.len()) && !is_refined && !is_idle
    };
    proposals.into_iter().filter(is_worth_it).take(TAKEN_AT_LEADER).collect()
}

/// Explores the fault sets of a catalogue to the end.
pub fn explore(
    problem: &Problem,
    refitted: &FittedModel,
    sheet: &FittedModel,
    catalogue: &[&'static EffectSpec],
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Explored {
    let singles = Singles::profiled(problem, refitted, sheet, catalogue);
    Exploration::begin(problem, refitted, sheet, &singles, catalogue, progress).finish(progress)
}
