//! The fault sets that an exploration fitted so far, the likeliest of them with care.

use std::collections::BTreeMap;

use crate::hypotheses::explorer::{Explorer, Hypothesis, is_stage_alone, leaders};

/// Leading sets that are compared with what they hold.
const COMPARED: usize = 3;

/// Fitted sets so far, by their effects.
#[derive(Default)]
pub(super) struct KnownSets {
    pub(super) fitted: BTreeMap<Vec<usize>, Hypothesis>,
}

impl KnownSets {
    pub(super) fn take(&mut self, hypothesis: Hypothesis) {
        let better = |known: &Hypothesis| hypothesis.log_evidence > known.log_evidence;
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
        all.sort_by(|a, b| b.log_evidence.total_cmp(&a.log_evidence));
        all
    }

    /// Fits with care what leads, or would lead if its fit had ended, and was not yet.
    pub(super) fn refine(&mut self, explorer: &Explorer<'_>) {
        let promise = |one: &Hypothesis| one.log_evidence + if one.refined { 0.0 } else { one.normal.unfinished() };
        let mut promising: Vec<(f64, &Hypothesis)> = self.fitted.values().map(|one| (promise(one), one)).collect();
        promising.sort_by(|a, b| b.0.total_cmp(&a.0));
        // Single effects are few: before nothing leads, each has had a whole fit. So has each of a stage alone, where all are alike. One that costs
        // more than nothing, which it holds, has not reached the best size, however little its slopes promise.
        let nothing_leads = self.ordered().first().is_some_and(|leader| leader.effects.is_empty());
        let singles = nothing_leads || is_stage_alone(explorer.problem);
        let without = self.fitted.get(&Vec::new()).map_or(f64::INFINITY, |nothing| nothing.model.fit.cost());
        let is_unfinished = |one: &Hypothesis| one.effects.len() == 1 && (singles || one.model.fit.cost() > without);
        let chosen: Vec<Hypothesis> = promising
            .into_iter()
            .map(|(_, one)| one)
            .enumerate()
            .filter(|(place, one)| *place < leaders(explorer.problem) || is_unfinished(one))
            .map(|(_, one)| one)
            .filter(|leader| !leader.refined)
            .cloned()
            .collect();
        self.settle(explorer.refined(&chosen));
        // What leads is compared with what it holds: each effect of it must be worth its odds.
        let leading: Vec<Vec<usize>> = self.ordered().iter().take(COMPARED).map(|one| one.effects.clone()).collect();
        let is_within = |one: &&Hypothesis| {
            let holds = |set: &Vec<usize>| one.effects.iter().all(|effect| set.contains(effect));
            leading.iter().any(|set| one.effects.len() + 1 == set.len() && holds(set))
        };
        let within: Vec<Hypothesis> =
            self.fitted.values().filter(is_within).filter(|one| !one.refined).cloned().collect();
        self.settle(explorer.refined(&within));
        // Slopes and residuals are nearly all of the memory.
        let mut order: Vec<(f64, Vec<usize>)> =
            self.fitted.values().map(|known| (known.log_evidence, known.effects.clone())).collect();
        order.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (_, effects) in order.into_iter().skip(4 * leaders(explorer.problem)) {
            if let Some(known) = self.fitted.get_mut(&effects).filter(|known| !known.effects.is_empty()) {
                known.model.lighten();
            }
        }
    }
}
