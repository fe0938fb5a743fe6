//! The verdict: the most probable set of faults given all recordings, with model error and tolerances integrated out.
//!
//! What is likeliest of nothing, something unknown and something known is the first word. Known is told by the smallest set of fault sets
//! that holds nine tenths of its probability: effects that all of them share are named, with every other that is likelier there than not; where they
//! share none, the verdict is the class of them.

pub mod hyperparameters;
pub mod posterior;

use crate::decision::posterior::Posterior;
use crate::hypotheses::table::{EvidenceRow, EvidenceTable};
use crate::likelihood::problem::SOUND_MEAN_SQUARE;
use crate::result::{Interval, Verdict};
use govtwin_model::effects::{EffectSpec, Stage};

/// Probability that a credible set holds.
const CREDIBLE: f64 = 0.9;

/// Effects of a class at most.
const CLASS: usize = 3;

/// Probabilities and verdict.
#[derive(Clone, Debug)]
pub struct Decision {
    /// Verdict; whether the recordings could show anything is judged elsewhere.
    pub verdict: Verdict,
    /// Ids that it blames.
    pub blamed: Vec<&'static str>,
    /// Probability of each effect of the catalogue, in its order.
    pub effects: Vec<(&'static EffectSpec, f64)>,
    /// Probability of something outside the catalogue instead of a known set.
    pub unknown: f64,
    /// Probability of something else at work, beside a known set or instead of it.
    pub something_else: f64,
    /// The same by stage.
    pub unknown_at: Vec<(Stage, f64)>,
    /// Probability that there is nothing.
    pub none: f64,
    /// The fault sets that hold nine tenths of what is known, likeliest first; the sheet alone is the empty one.
    pub sets: Vec<(Vec<String>, f64)>,
}

impl Decision {
    /// By a posterior.
    pub fn new(table: &EvidenceTable, posterior: &Posterior, catalogue: &[&'static EffectSpec]) -> Self {
        let effects: Vec<(&'static EffectSpec, f64)> =
            catalogue.iter().map(|&spec| (spec, posterior.inclusion(table, spec.id))).collect();
        let (unknown, none) = (posterior.unknown(), posterior.nothing(table));
        let known = (1.0 - unknown - none).max(0.0);
        let ids = |row: usize| table.rows[row].effects.clone();
        let mut held = 0.0;
        let sets: Vec<(Vec<String>, f64)> = posterior
            .sets
            .iter()
            .filter(|(row, _)| !table.rows[*row].effects.is_empty())
            .take_while(|(_, probability)| {
                let wanted = held < CREDIBLE * known;
                held += probability;
                wanted
            })
            .map(|&(row, probability)| (ids(row), probability))
            .collect();
        let unknown_at = |stage: Stage| {
            let at = posterior.unknown.iter().find(|(id, _)| id == stage.id());
            (stage, at.map_or(0.0, |(_, probability)| *probability))
        };
        let something_else = posterior.something_else;
        let (verdict, mut blamed) = if none >= unknown.max(known) {
            (Verdict::NoGap, Vec::new())
        } else if unknown > known {
            (Verdict::Unknown, Vec::new())
        } else {
            verdict_on(&sets, &effects, known)
        };
        if verdict == Verdict::Named && something_else > 0.5 {
            blamed = beside_something_else(table, &blamed);
        }
        Self {
            verdict,
            blamed,
            effects,
            unknown,
            something_else,
            unknown_at: Stage::ALL.into_iter().map(unknown_at).collect(),
            none,
            sets,
        }
    }

    /// Whether what is blamed surely explains less than half of the gap, beside something else: it is then no cause of it.
    pub(crate) fn claims_too_much(&self, explained: Interval) -> bool {
        !self.blamed.is_empty() && self.something_else > 0.5 && explained.high < 0.5
    }

    /// The same with another verdict that blames nothing, which is then the probable one.
    pub(crate) fn forced(mut self, verdict: Verdict) -> Self {
        let to_unknown = matches!(verdict, Verdict::Unknown | Verdict::NoSuchUnit);
        let room = if to_unknown { 1.0 - self.unknown } else { 1.0 - self.none };
        // What there is least doubt of keeps nine tenths.
        let share = ((1.0 - CREDIBLE) / room.max(1e-12)).min(1.0);
        self.effects.iter_mut().for_each(|(_, p)| *p *= share);
        self.sets.iter_mut().for_each(|(_, p)| *p *= share);
        if to_unknown {
            self.none *= share;
            let before = self.unknown.max(1e-12);
            self.unknown = 1.0 - (1.0 - self.unknown) * share;
            let grown = self.unknown / before;
            self.something_else = self.something_else.max(self.unknown);
            self.unknown_at.iter_mut().for_each(|(_, p)| *p *= grown);
        } else {
            self.unknown *= share;
            self.something_else *= share;
            self.unknown_at.iter_mut().for_each(|(_, p)| *p *= share);
            self.none = 1.0 - (1.0 - self.none) * share;
        }
        Self { verdict, blamed: Vec::new(), ..self }
    }

    /// Probability of each stage: of its effects, and of something unknown there.
    pub fn stages(&self) -> Vec<(Stage, f64)> {
        let of = |stage: Stage| {
            let known: f64 = self.effects.iter().filter(|(spec, _)| spec.stage == stage).map(|(_, p)| p).sum();
            let unknown = self.unknown_at.iter().find(|(at, _)| *at == stage).map_or(0.0, |(_, p)| *p);
            (stage, known + unknown)
        };
        let shares: Vec<(Stage, f64)> = Stage::ALL.into_iter().map(of).collect();
        let total: f64 = shares.iter().map(|(_, share)| share).sum();
        shares.into_iter().map(|(stage, share)| (stage, if total > 0.0 { share / total } else { 0.0 })).collect()
    }
}

/// Of named effects those that explain most of what is left without them, where something else is at work as well: any other may only stand in for that.
fn beside_something_else(table: &EvidenceTable, named: &[&'static str]) -> Vec<&'static str> {
    let sound = SOUND_MEAN_SQUARE * table.samples;
    let is_within = |row: &EvidenceRow| row.effects.iter().all(|id| named.contains(&id.as_str()));
    let least = |holds: &dyn Fn(&EvidenceRow) -> bool| {
        table.rows.iter().filter(|row| is_within(row) && holds(row)).map(|row| row.cost).fold(f64::INFINITY, f64::min)
    };
    let with = least(&|_| true);
    let share = |id: &str| {
        let without = least(&|row: &EvidenceRow| !row.effects.iter().any(|one| one == id));
        if without.is_finite() { (without - with) / (without - sound).max(f64::MIN_POSITIVE) } else { 1.0 }
    };
    let most: Vec<&'static str> = named.iter().copied().filter(|id| share(id) > 0.5).collect();
    let strongest = named.iter().copied().max_by(|a, b| share(a).total_cmp(&share(b)));
    if most.is_empty() { strongest.into_iter().collect() } else { most }
}

/// What is said of the known: named with the shared and the likely, or the class.
fn verdict_on(
    sets: &[(Vec<String>, f64)],
    effects: &[(&'static EffectSpec, f64)],
    known: f64,
) -> (Verdict, Vec<&'static str>) {
    let shared = |id: &str| sets.iter().all(|(set, _)| set.iter().any(|one| one == id));
    let mut order: Vec<(&'static str, f64)> = effects.iter().map(|(spec, p)| (spec.id, *p)).collect();
    order.sort_by(|a, b| b.1.total_cmp(&a.1));
    if order.iter().any(|(id, _)| shared(id)) {
        let named = order.iter().filter(|(id, p)| shared(id) || *p > 0.5 * known).map(|(id, _)| *id);
        return (Verdict::Named, named.collect());
    }
    let competing = order.into_iter().filter(|(id, _)| sets.iter().any(|(set, _)| set.iter().any(|one| one == id)));
    (Verdict::Class, competing.take(CLASS).map(|(id, _)| id).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_model::effects::find;

    fn row(ids: &[&str], cost: f64) -> EvidenceRow {
        EvidenceRow { effects: ids.iter().map(|id| (*id).to_owned()).collect(), cost, ..EvidenceRow::default() }
    }

    /// The decision on fault sets with these probabilities, the rest unknown at the spool.
    fn decided(sets: &[(&[&str], f64)]) -> Decision {
        let rows = sets.iter().map(|(ids, _)| row(ids, 0.0)).collect();
        let table = EvidenceTable { rows, ..EvidenceTable::default() };
        let known: f64 = sets.iter().map(|(_, p)| p).sum();
        let posterior = Posterior {
            sets: sets.iter().enumerate().map(|(row, (_, p))| (row, *p)).collect(),
            unknown: vec![("spool".to_owned(), 1.0 - known)],
            ..Posterior::default()
        };
        let catalogue: Vec<&'static EffectSpec> =
            ["backlash", "port_overlap", "load"].iter().filter_map(|id| find(id)).collect();
        Decision::new(&table, &posterior, &catalogue)
    }

    #[test]
    fn one_set_names_and_competing_ones_make_a_class() {
        let one = decided(&[(&["backlash"], 0.95), (&[], 0.02)]);
        assert_eq!((one.verdict, one.blamed.as_slice()), (Verdict::Named, ["backlash"].as_slice()));
        let two = decided(&[(&["backlash"], 0.6), (&["load"], 0.3), (&[], 0.05)]);
        assert_eq!((two.verdict, two.blamed.as_slice()), (Verdict::Class, ["backlash", "load"].as_slice()));
        let pair = decided(&[(&["backlash", "load"], 0.6), (&["backlash", "port_overlap"], 0.35)]);
        assert_eq!((pair.verdict, pair.blamed.as_slice()), (Verdict::Named, ["backlash", "load"].as_slice()));
    }

    /// What is surely less than half of a gap that something else shares in is no cause of it.
    #[test]
    fn a_claim_of_less_than_half_beside_something_else_names_nothing() {
        let within = |low, high| Interval { value: 0.5 * (low + high), low, high };
        let mut lone = decided(&[(&["backlash"], 0.95)]);
        lone.something_else = 0.9;
        assert!(lone.claims_too_much(within(0.05, 0.13)));
        assert!(!lone.claims_too_much(within(0.05, 0.6)), "it may be most of it");
        assert!(!decided(&[(&[], 0.95)]).claims_too_much(within(0.0, 0.0)), "nothing is claimed");
        lone.something_else = 0.1;
        assert!(!lone.claims_too_much(within(0.05, 0.13)), "nothing else is there that could be the cause");
    }

    /// Where something else is at work an effect that explains little of what is left without it is not named: it may stand in for that.
    #[test]
    fn what_only_mends_a_law_is_not_named_beside_something_else() {
        let rows = vec![row(&["backlash", "load"], 8200.0), row(&["backlash"], 8600.0), row(&[], 26_000.0)];
        let table = EvidenceTable { samples: 1600.0, rows, ..EvidenceTable::default() };
        let catalogue: Vec<&'static EffectSpec> = ["backlash", "load"].iter().filter_map(|id| find(id)).collect();
        let named = |something_else: f64, table: &EvidenceTable| {
            let sets = vec![(0, 0.9), (1, 0.05)];
            let posterior = Posterior { sets, something_else, ..Posterior::default() };
            Decision::new(table, &posterior, &catalogue).blamed
        };
        assert_eq!(named(0.9, &table), ["backlash"]);
        assert_eq!(named(0.1, &table), ["backlash", "load"]);
        // Both explain most of what the other leaves.
        let mut both = table;
        both.rows[1].cost = 16_000.0;
        both.rows.push(row(&["load"], 24_000.0));
        assert_eq!(named(0.9, &both), ["backlash", "load"]);
    }

    #[test]
    fn nothing_and_unknown_need_more_than_all_else() {
        assert_eq!(decided(&[(&[], 0.5), (&["load"], 0.3)]).verdict, Verdict::NoGap);
        assert_eq!(decided(&[(&[], 0.1), (&["load"], 0.4)]).verdict, Verdict::Unknown);
        assert_eq!(decided(&[(&[], 0.1), (&["load"], 0.5)]).verdict, Verdict::Named);
    }

    #[test]
    fn a_forced_verdict_keeps_the_sum() {
        for verdict in [Verdict::Unknown, Verdict::NoGap] {
            let forced = decided(&[(&["load"], 0.7), (&[], 0.2)]).forced(verdict);
            let sum = forced.effects.iter().map(|(_, p)| p).sum::<f64>() + forced.unknown + forced.none;
            assert!((sum - 1.0).abs() < 1e-9, "{sum}");
            assert!(forced.blamed.is_empty() && forced.unknown.max(forced.none) > 0.89);
        }
    }
}
