//! The fault sets that an exploration fitted so far, the likeliest of them with care.

use std::collections::BTreeMap;

use crate::hypotheses::MOST;
use crate::hypotheses::explorer::{Explorer, Hypothesis, is_stage_alone, leaders};
use crate::hypotheses::linearisation::Proposal;
use crate::model::FittedModel;

/// Leading sets that are compared with what they hold.
const COMPARED: usize = 3;

/// By so much a set may cost more than one that it holds before it is fitted anew: less says nothing.
const UNTOLD: f64 = 1.0;

/// By so much a set's score may be behind the leader's and it is still fitted on, nats.
const WITHIN_REACH: f64 = 50.0;

/// Pairs that are united with the likeliest one each time.
const UNITED: usize = 2;

/// Fitted sets so far, by their effects.
#[derive(Default)]
pub(super) struct KnownSets {
    pub(super) fitted: BTreeMap<Vec<usize>, Hypothesis>,
}

impl KnownSets {
    pub(super) fn take(&mut self, hypothesis: Hypothesis) {
        let better = |known: &Hypothesis| hypothesis.model.cost() < known.model.cost();
        if self.fitted.get(&hypothesis.effects).is_none_or(better) {
            self.fitted.insert(hypothesis.effects.clone(), hypothesis);
        }
    }

    /// Keeps what was fitted with care in place of what it began from, also where that brought nothing: its fit has ended.
    fn settle(&mut self, refined: Vec<Hypothesis>) {
        self.fitted.extend(refined.into_iter().map(|one| (one.effects.clone(), one)));
    }

    pub(super) fn ordered(&self) -> Vec<&Hypothesis> {
        let mut all: Vec<&Hypothesis> = self.fitted.values().collect();
        all.sort_by(|a, b| b.score.total_cmp(&a.score));
        all
    }

    /// The cheapest set that a set holds, where it costs less than the set itself.
    fn cheaper_within(&self, set: &Hypothesis) -> Option<&Hypothesis> {
        let within = self.fitted.values().filter(|one| one.is_within(&set.effects));
        let least = within.min_by(|a, b| a.model.cost().total_cmp(&b.model.cost()))?;
        (least.model.cost() + UNTOLD < set.model.cost()).then_some(least)
    }

    /// Least score of what is fitted on.
    fn least_score(&self) -> f64 {
        self.fitted.values().map(|one| one.score).fold(f64::NEG_INFINITY, f64::max) - WITHIN_REACH
    }

    /// Fits sets that cost more than one which they hold anew, from where that one stands, the further effects at nothing: from there a fit ends no higher
    /// than it began. Smaller sets come first, since larger ones begin there. Of several effects they are given up where the one that
    /// they hold is out of reach of the leader.
    fn begin_anew_within(&mut self, explorer: &Explorer<'_>) {
        for size in 1..=MOST {
            let least = self.least_score();
            let is_hopeless =
                |set: &Hypothesis| size > 1 && self.cheaper_within(set).is_some_and(|within| within.score < least);
            let of_size = self.fitted.values().filter(|one| one.effects.len() == size);
            let hopeless: Vec<Vec<usize>> =
                of_size.filter(|one| is_hopeless(one)).map(|one| one.effects.clone()).collect();
            self.fitted.retain(|effects, _| !hopeless.contains(effects));
            let dear = self.fitted.values().filter(|one| one.effects.len() == size);
            let pairs: Vec<(&Hypothesis, &Hypothesis)> =
                dear.filter_map(|one| Some((one, self.cheaper_within(one)?))).collect();
            let jobs: Vec<(&FittedModel, Proposal)> =
                pairs.iter().map(|(set, within)| explorer.widened_by_nothing(set, &within.model)).collect();
            for hypothesis in explorer.scouted(&jobs) {
                self.take(hypothesis);
            }
        }
    }

    /// The likeliest pair of effects with each of the next that share one of its effects, where all three together were not fitted with care yet, from
    /// either end: what a pair leaves may look like another effect than the third.
    pub(super) fn to_unite(&self) -> Vec<(&Hypothesis, &Hypothesis)> {
        let pairs = self.ordered().into_iter().filter(|one| one.effects.len() == 2 && one.refined);
        let pairs: Vec<&Hypothesis> = pairs.filter(|one| !one.model.fit.slopes.is_empty()).collect();
        let Some((&first, others)) = pairs.split_first() else { return Vec::new() };
        let is_open = |other: &&&Hypothesis| {
            let mut all = [first.effects.as_slice(), other.effects.as_slice()].concat();
            all.sort_unstable();
            all.dedup();
            all.len() == MOST && self.fitted.get(&all).is_none_or(|known| !known.refined)
        };
        others.iter().filter(is_open).take(UNITED).flat_map(|&other| [(first, other), (other, first)]).collect()
    }

    /// Fits with care what leads, or would lead if its fit had ended, and was not yet. No set costs more than one that it holds.
    pub(super) fn refine(&mut self, explorer: &Explorer<'_>) {
        self.begin_anew_within(explorer);
        let promise = |one: &Hypothesis| {
            let further = if one.refined { 0.0 } else { one.model.normal.unfinished() };
            explorer.scale.score(one.model.cost() - further, one.effects.len())
        };
        let mut promising: Vec<(f64, &Hypothesis)> = self.fitted.values().map(|one| (promise(one), one)).collect();
        promising.sort_by(|a, b| b.0.total_cmp(&a.0));
        // Single effects are few: before nothing leads, each has had a whole fit. So has each of a stage alone, where all are alike.
        let nothing_leads = self.ordered().first().is_some_and(|leader| leader.effects.is_empty());
        let singles = nothing_leads || is_stage_alone(explorer.problem);
        let is_single = |one: &Hypothesis| singles && one.effects.len() == 1;
        let least = self.least_score();
        let chosen: Vec<Hypothesis> = promising
            .into_iter()
            .enumerate()
            .filter(|(place, (promise, one))| *place < leaders(explorer.problem) && *promise > least || is_single(one))
            .map(|(_, (_, one))| one)
            .filter(|leader| !leader.refined)
            .cloned()
            .collect();
        self.settle(explorer.refined(&chosen));
        // What leads is compared with what it holds: each effect of it must be worth its odds.
        let leading: Vec<Vec<usize>> = self.ordered().iter().take(COMPARED).map(|one| one.effects.clone()).collect();
        let is_within =
            |one: &&Hypothesis| leading.iter().any(|set| one.effects.len() + 1 == set.len() && one.is_within(set));
        let least = self.least_score();
        let is_open = |one: &&Hypothesis| !one.refined && promise(one) > least;
        let within: Vec<Hypothesis> = self.fitted.values().filter(is_within).filter(is_open).cloned().collect();
        self.settle(explorer.refined(&within));
        self.begin_anew_within(explorer);
        // Slopes and residuals are nearly all of the memory.
        let mut order: Vec<(f64, Vec<usize>)> =
            self.fitted.values().map(|known| (known.score, known.effects.clone())).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, effects) in order.into_iter().skip(4 * leaders(explorer.problem)) {
            if let Some(known) = self.fitted.get_mut(&effects).filter(|known| !known.effects.is_empty()) {
                known.model.lighten();
            }
        }
    }
}
