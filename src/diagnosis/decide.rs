//! Verdict and probabilities: what the costs of all models that were tried say together.

use crate::diagnosis::model::{Model, STRAINED};
use crate::diagnosis::outcome::Verdict;
use crate::diagnosis::rivals::{DETECTED, FURTHER_SHARE, Found, Slot};
use crate::effects::{EffectSpec, Stage};

/// Degrees of freedom of the evidence: likelihoods fall as a power of the cost that a model leaves, not exponentially, since what it leaves is
/// the error of its equation rather than noise (Student's t with the scale integrated out).
const FREEDOM: f64 = 10.0;

/// Share of the gap that adds to the scale of those likelihoods: the equation of a true effect leaves up to a quarter of what it
/// causes, so that in a large gap small differences say little. Chosen by the logarithmic score on the generated batteries of
/// seeds 77 and 501.
const INEXACT: f64 = 0.2;

/// An effect that explains this share of what the best one does cannot be told from it, since neither equation is exact: both
/// are named as a class. Chosen on the same batteries and on that of seed 502.
const CLOSE: f64 = 0.9;

/// Where something acts on top of something else, what is named must explain this share of the gap, or most of it has another cause. On the
/// generated batteries of seeds 77, 501, 502 and 601 all five verdicts that named something with less were wrong.
const MOST_OF_IT: f64 = 0.5;

/// Share of the squared gap left beyond what a right model may, at which something outside the catalogue is as likely as what is named. At
/// 100 Hz the right effect left 0.065 at most in `practice` and on the generated batteries of seeds 77, 603 and 604, and nearly always less than
/// 0.02; a neighbour of an effect that the catalogue was made to lack left from nothing to 0.55, every second more than 0.05.
const STAYS: f64 = 0.1;

/// Effects of a class at most.
const CLASS: usize = 3;

/// What an effect outside the catalogue is taken to leave of the gap: as much as the best free term, but within these shares, since free terms
/// are both more supple and more roughly fitted than an equation.
pub const UNKNOWN_LEAVES: (f64, f64) = (0.3, 0.6);

/// Power of the share of the gap that an effect explains, which its weight also carries: what explains next to nothing of a gap did not
/// cause it, however little the others explain.
const SHARE_POWER: f64 = 2.0;

/// A free term is so supple that something unknown must leave less than a named effect by this ratio to be as likely.
const SUPPLE: f64 = 1.3;

/// Gain from which there is something: luck and the errors of equations gain a sound unit less. The sound units of seed 502 gain up to 19.
pub const SEEN: f64 = 20.0;

/// Probability from which one of several effects is named.
const LIKELY: f64 = 0.5;

/// Probability from which an effect is named on its own.
const SURE: f64 = 0.6;

/// Probabilities and verdict.
#[derive(Clone, Debug)]
pub struct Decision {
    /// Verdict; whether the recordings could show anything is judged elsewhere.
    pub verdict: Verdict,
    /// Ids that it blames.
    pub blamed: Vec<&'static str>,
    /// What acts besides what is named: the rivals of each place that one of several effects holds, none of which is likely alone.
    pub besides: Vec<Vec<&'static str>>,
    /// Probability of each effect of the catalogue, in its order.
    pub effects: Vec<(&'static EffectSpec, f64)>,
    /// Probability of something outside the catalogue.
    pub unknown: f64,
    /// Probability that there is nothing.
    pub none: f64,
    /// Cost that a perfect model would have.
    pub floor: f64,
}

/// Least probability of what a verdict is forced to.
const FORCED: f64 = 0.9;

impl Decision {
    /// The same, forced to something unknown, or by any other verdict to nothing, which is then the probable one.
    #[must_use]
    pub fn forced(mut self, verdict: Verdict) -> Self {
        let (forced, other) = match verdict {
            Verdict::Unknown => (&mut self.unknown, &mut self.none),
            _ => (&mut self.none, &mut self.unknown),
        };
        *forced = forced.max(FORCED);
        let room = 1.0 - *forced;
        let sum = self.effects.iter().map(|(_, p)| p).sum::<f64>() + *other;
        let share = room / sum.max(room).max(1e-12);
        *other *= share;
        self.effects.iter_mut().for_each(|(_, p)| *p *= share);
        Self { verdict, blamed: Vec::new(), besides: Vec::new(), ..self }
    }

    /// The model of what is named: of several effects all at once, of rivals the first; the refitted sheet where nothing is.
    #[must_use]
    pub fn chosen<'a>(&self, found: &'a Found) -> &'a Model {
        match self.blamed.as_slice() {
            [] => &found.refitted,
            several @ [_, _, ..] if self.verdict == Verdict::Named => found.claimed(several),
            [first, ..] => found.alone(first),
        }
    }

    /// The model by which to doubt what is named: with what acts besides, whose mark the sheet would take otherwise.
    #[must_use]
    pub fn whole<'a>(&self, found: &'a Found) -> &'a Model {
        if self.besides.is_empty() { self.chosen(found) } else { &found.best }
    }

    /// The same, with these odds that what is said, even that there is nothing, only resembles what there is.
    #[must_use]
    pub fn doubted(mut self, odds: f64) -> Self {
        let unknown = odds / (1.0 + odds);
        if unknown > self.unknown {
            let share = (1.0 - unknown) / (1.0 - self.unknown);
            self.none *= share;
            self.effects.iter_mut().for_each(|(_, p)| *p *= share);
            self.unknown = unknown;
        }
        // What is named must stay the likelier.
        let top = self.effects.iter().map(|(_, p)| *p).fold(0.0, f64::max);
        if odds > 1.0 || !self.blamed.is_empty() && self.unknown > top {
            (self.verdict, self.blamed, self.besides) = (Verdict::Unknown, Vec::new(), Vec::new());
        }
        self
    }
}

/// Odds on something unknown where what is named leaves this share of the squared gap ([`share_left`](crate::diagnosis::closure::share_left)).
#[must_use]
pub fn odds_of_left(left: f64) -> f64 {
    left / STAYS
}

/// Odds on something unknown where a model stretches the sheet this far ([`Model::strain`]).
#[must_use]
pub fn odds_of_strain(strain: f64) -> f64 {
    (strain - STRAINED).max(0.0)
}

/// Weighs the rivals for one place: each effect, something unknown, nothing.
struct Weighed {
    effects: Vec<f64>,
    unknown: f64,
    none: f64,
}

/// The tail weight of a cost above the floor, where a model without effect stands above it by the gap.
fn weight(above: f64, gap: f64) -> f64 {
    (1.0 + above.max(0.0) / (FREEDOM + INEXACT * gap.max(0.0))).powf(-0.5 * FREEDOM)
}

/// Odds on one named effect before anything is seen: a gain that shows nothing makes nothing likely.
fn rarity() -> f64 {
    (-0.5 * SEEN).exp()
}

fn weigh(slot: &Slot, catalogue: &[&'static EffectSpec], floor: f64, unknown_leaves: f64) -> Weighed {
    let gap = slot.before.cost() - floor;
    let mut effects: Vec<f64> = catalogue
        .iter()
        .map(|spec| {
            slot.with(spec.id).map_or(0.0, |model| {
                let share = ((slot.before.cost() - model.cost()) / gap.max(1e-9)).clamp(0.0, 1.0);
                rarity() * weight(model.cost() - floor, gap) * share.powf(SHARE_POWER)
            })
        })
        .collect();
    let mut unknown = rarity() * weight(SUPPLE * unknown_leaves * gap + 0.5 * DETECTED, gap);
    // Against nothing at all an effect is a nested model: there the gain itself is the evidence.
    let mut none = weight(slot.best_cost() - floor, gap) * (-0.5 * slot.best_gain()).exp();
    let total = effects.iter().sum::<f64>() + unknown + none;
    for effect in &mut effects {
        *effect /= total;
    }
    unknown /= total;
    none /= total;
    Weighed { effects, unknown, none }
}

/// Decides; `explained` is the share of the refitted twin's gap that the best free term would explain.
#[must_use]
pub fn decide(found: &Found, catalogue: &[&'static EffectSpec], floor: f64, explained: f64) -> Decision {
    let mut effects = vec![0.0_f64; catalogue.len()];
    let (mut unknown, mut none) = (0.0_f64, 1.0_f64);
    let mut rivals: Vec<Vec<usize>> = Vec::new();
    let detected = !found.best.effects.is_empty() && found.slots.first().is_some_and(|slot| slot.best_gain() > SEEN);
    for (place, slot) in found.slots.iter().enumerate() {
        let floor = match found.slots.get(place + 1) {
            // The effects that came later explain the rest.
            Some(next) => next.before.cost(),
            None if detected => floor,
            None => found.beyond(),
        };
        // Free terms were tried where nothing was explained yet.
        let leaves = if found.slots.len() == 1 { 1.0 - explained } else { UNKNOWN_LEAVES.1 };
        let weighed = weigh(slot, catalogue, floor, leaves.clamp(UNKNOWN_LEAVES.0, UNKNOWN_LEAVES.1));
        for (all, one) in effects.iter_mut().zip(&weighed.effects) {
            *all = 1.0 - (1.0 - *all) * (1.0 - one);
        }
        // What is less than an effect's own equation may leave behind is no sign of anything unknown.
        let before = found.slots[0].before.cost() - slot.before.cost();
        if place == 0 || slot.best_gain() > FURTHER_SHARE * before {
            unknown = unknown.max(weighed.unknown);
        }
        let mut suits = credible(&weighed.effects);
        suits.truncate(CLASS);
        if suits.iter().map(|&k| weighed.effects[k]).sum::<f64>() < SURE {
            suits.clear();
        }
        rivals.push(suits);
        if place == 0 {
            none = weighed.none;
        }
    }
    let ids = |list: &[usize]| list.iter().map(|&k| catalogue[k].id).collect::<Vec<_>>();
    // What something unknown explains as well has no name.
    let likely: Vec<usize> =
        (0..catalogue.len()).filter(|&k| effects[k] >= LIKELY && found.best.has(catalogue[k].id)).collect();
    let nameless = |slot: &Slot| !likely.iter().any(|&k| slot.holder() == Some(catalogue[k].id));
    let besides: Vec<Vec<&'static str>> =
        found.slots.iter().zip(&rivals).filter(|(slot, _)| nameless(slot)).map(|(_, suits)| ids(suits)).collect();
    // One of several rivals is there even where none of them has a name.
    let whole = besides.iter().all(|rivals| !rivals.is_empty());
    if let [first, _, ..] = found.slots.as_slice() {
        // Several effects may each suit their place and yet leave most of the gap.
        let gap = first.before.cost() - floor;
        let leaves = (1.0 - explained).clamp(UNKNOWN_LEAVES.0, UNKNOWN_LEAVES.1);
        let (named, other) =
            (weight(found.best.cost() - floor, gap), weight(SUPPLE * leaves * gap + 0.5 * DETECTED, gap));
        unknown = unknown.max(other / (named + other));
        let claim = match ids(&likely).as_slice() {
            _ if whole => &found.best,
            [] => found.alone(found.best.ids().first().copied().unwrap_or_default()),
            [one] => found.alone(one),
            several => found.claimed(several),
        };
        let share = (first.before.cost() - claim.cost()) / gap.max(1e-9);
        if share < MOST_OF_IT {
            unknown = unknown.max(1.0 - share);
        }
        // Each suits its place; whether what stands there has another cause altogether is as open as the rest of the gap is large.
        if unknown > LIKELY {
            for effect in &mut effects {
                *effect *= share.max(0.0);
            }
        }
    }
    let top = effects.iter().copied().fold(0.0, f64::max);
    let (verdict, blamed) = if !detected || none > 0.5 {
        (Verdict::NoGap, Vec::new())
    } else if unknown > top {
        (Verdict::Unknown, Vec::new())
    } else if found.best.effects.len() > 1 && !likely.is_empty() {
        (Verdict::Named, ids(&likely))
    } else {
        let shares = |k: usize| found.slots.first().is_some_and(|slot| close(slot, catalogue[k]));
        let mut rivals = credible(&effects);
        if top >= SURE {
            rivals.truncate(1);
        }
        let near: Vec<usize> = ordered(&effects).into_iter().filter(|&k| shares(k) && !rivals.contains(&k)).collect();
        rivals.extend(near);
        rivals.truncate(CLASS);
        (if rivals.len() > 1 { Verdict::Class } else { Verdict::Named }, ids(&rivals))
    };
    let besides = if whole && verdict == Verdict::Named { besides } else { Vec::new() };
    let effects = catalogue.iter().copied().zip(effects).collect();
    Decision { verdict, blamed, besides, effects, unknown, none, floor }
}

/// The effects by probability, most probable first.
fn ordered(probabilities: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..probabilities.len()).collect();
    order.sort_by(|&a, &b| probabilities[b].total_cmp(&probabilities[a]));
    order
}

/// The most probable effects that make up nine tenths together, one at least.
fn credible(probabilities: &[f64]) -> Vec<usize> {
    let mut sum = 0.0;
    let credited = |k: &usize| {
        let wanted = sum == 0.0 || sum < 0.9 && probabilities[*k] > 0.03;
        sum += probabilities[*k];
        wanted
    };
    ordered(probabilities).into_iter().take_while(credited).collect()
}

/// Whether an effect explains nearly as much as the best one.
fn close(slot: &Slot, spec: &EffectSpec) -> bool {
    slot.with(spec.id).is_some_and(|model| slot.before.cost() - model.cost() >= CLOSE * slot.best_gain())
}

/// Probability of each stage: of its effects, and of something unknown there.
#[must_use]
pub fn stages(decision: &Decision, unknown_at: &[(Stage, f64)]) -> Vec<(Stage, f64)> {
    let mut shares: Vec<(Stage, f64)> = Stage::ALL
        .into_iter()
        .map(|stage| {
            let known: f64 = decision.effects.iter().filter(|(spec, _)| spec.stage == stage).map(|(_, p)| p).sum();
            let place = unknown_at.iter().find(|(at, _)| *at == stage).map_or(0.0, |(_, share)| *share);
            (stage, known + decision.unknown * place)
        })
        .collect();
    let total: f64 = shares.iter().map(|(_, share)| share).sum();
    if total > 0.0 {
        for (_, share) in &mut shares {
            *share /= total;
        }
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{CATALOGUE, find};
    use crate::tuning::fit::Fit;

    fn model(ids: &[&str], cost: f64) -> Model {
        let fit = Fit { positions: Vec::new(), square: cost, prior: 0.0, misses: Vec::new(), slopes: Vec::new() };
        let effects = ids.iter().map(|id| find(id).expect("an effect of the catalogue")).collect();
        Model::new(effects, crate::params::reference(), Vec::new(), fit)
    }

    /// `backlash` leaves this of a gap of 1000; on top of it two others leave nearly the same.
    fn two_places(leaves: f64, together: f64) -> Found {
        let nominal = model(&[], 1000.0);
        let first = model(&["backlash"], leaves);
        let second = ["load", "viscosity"].map(|id| model(&["backlash", id], together + id.len() as f64));
        let slots = vec![
            Slot { before: nominal.clone(), tried: vec![first.clone()] },
            Slot { before: first, tried: second.to_vec() },
        ];
        Found { refitted: nominal, best: second[0].clone(), slots, further: Vec::new(), claims: Vec::new() }
    }

    fn found(leaves: f64) -> Found {
        two_places(leaves, 0.5 * leaves)
    }

    fn judged(found: &Found, floor: f64) -> Decision {
        decide(found, &CATALOGUE.iter().collect::<Vec<_>>(), floor, 0.5)
    }

    /// A place that was opened for the sheet's sake alone: what little is gained there shows nothing unknown, whoever falls short of filling it.
    #[test]
    fn what_an_equation_may_leave_behind_is_not_unknown() {
        let verdict = |leaves: f64, together: f64| judged(&two_places(leaves, together), 0.0).verdict;
        assert_eq!(verdict(150.0, 130.0), Verdict::Named);
        assert_eq!(verdict(150.0, 110.0), Verdict::Unknown);
    }

    #[test]
    fn what_is_named_must_explain_most_of_the_gap() {
        let verdict = |leaves: f64, together: f64| {
            let decision = judged(&two_places(leaves, together), 0.0);
            (decision.verdict, decision.blamed)
        };
        assert_eq!(verdict(400.0, 200.0), (Verdict::Named, vec!["backlash"]));
        // With what has no name it would still be three fifths.
        assert_eq!(verdict(700.0, 600.0), (Verdict::Unknown, vec![]));
    }

    /// Which of two acts besides is open, that one of them does is not: neither gap nor sheet speaks against what is named.
    #[test]
    fn rivals_for_a_further_place_do_not_count_as_unknown() {
        let found = two_places(700.0, 250.0);
        let decision = judged(&found, 0.0);
        assert_eq!((decision.verdict, decision.blamed.as_slice()), (Verdict::Named, ["backlash"].as_slice()));
        assert_eq!(decision.besides, vec![vec!["load", "viscosity"]]);
        assert!(decision.unknown < 0.2 && decision.whole(&found).effects.len() == 2, "{decision:?}");
        assert_eq!(decision.chosen(&found).ids(), ["backlash"]);
        assert!(decision.doubted(9.0).besides.is_empty());
    }

    #[test]
    fn a_forced_verdict_is_the_probable_one() {
        let sum = |decision: &Decision| {
            decision.effects.iter().map(|(_, p)| p).sum::<f64>() + decision.unknown + decision.none
        };
        let single =
            Found { slots: found(10.0).slots.drain(..1).collect(), best: model(&["backlash"], 10.0), ..found(10.0) };
        let decision = judged(&single, 0.0);
        assert_eq!((decision.verdict, decision.blamed.as_slice()), (Verdict::Named, ["backlash"].as_slice()));
        let unknown = decision.clone().forced(Verdict::Unknown);
        assert!(
            unknown.unknown >= FORCED && unknown.blamed.is_empty() && (sum(&unknown) - 1.0).abs() < 1e-9,
            "{unknown:?}"
        );
        let nothing = decision.forced(Verdict::NotExcited);
        assert!(nothing.none >= FORCED && nothing.verdict == Verdict::NotExcited && (sum(&nothing) - 1.0).abs() < 1e-9);
    }

    #[test]
    fn what_leaves_more_than_a_right_model_would_only_resembles_the_cause() {
        let single =
            Found { slots: found(10.0).slots.drain(..1).collect(), best: model(&["backlash"], 10.0), ..found(10.0) };
        let decision = judged(&single, 0.0);
        assert!(decision.chosen(&single).has("backlash"));
        let p = |decision: &Decision| decision.effects.iter().map(|(_, p)| p).sum::<f64>();
        for (left, verdict, unknown) in
            [(0.0, Verdict::Named, decision.unknown), (0.05, Verdict::Named, 1.0 / 3.0), (0.3, Verdict::Unknown, 0.75)]
        {
            let doubted = decision.clone().doubted(odds_of_left(left) + odds_of_strain(1.0));
            assert_eq!((doubted.verdict, doubted.blamed.is_empty()), (verdict, left > STAYS), "{left}");
            assert!((doubted.unknown - unknown).abs() < 1e-12);
            assert!((p(&doubted) + doubted.unknown + doubted.none - 1.0).abs() < 1e-12);
            assert_eq!(doubted.chosen(&single).effects.is_empty(), left > STAYS);
        }
        // A sheet stretched beyond belief speaks against what is named, and against nothing at all.
        for (strain, believed) in [(2.0, true), (STRAINED + 0.9, true), (STRAINED + 3.0, false)] {
            assert_eq!(
                decision.clone().doubted(odds_of_strain(strain)).verdict == Verdict::Named,
                believed,
                "{strain}"
            );
            let nothing = decision.clone().forced(Verdict::NoGap).doubted(odds_of_strain(strain));
            assert_eq!(nothing.verdict == Verdict::NoGap, believed, "{strain}");
            assert!(believed || (nothing.unknown - 0.75).abs() < 1e-12, "{nothing:?}");
        }
    }

    /// What gains just enough to be seen is as likely as nothing.
    #[test]
    fn probabilities_agree_with_what_can_be_seen() {
        for (gain, likely) in [(SEEN - 6.0, false), (SEEN + 6.0, true)] {
            let nominal = model(&[], 1000.0);
            let best = model(&["backlash"], 1000.0 - gain);
            let slots = vec![Slot { before: nominal.clone(), tried: vec![best.clone()] }];
            let found = Found { refitted: nominal, best, slots, further: Vec::new(), claims: Vec::new() };
            let decision = judged(&found, 1000.0 - gain);
            assert_eq!(decision.effects.iter().any(|(_, p)| *p > 0.5), likely, "gain {gain}");
            assert_eq!(decision.verdict == Verdict::Named, likely, "gain {gain}");
        }
    }
}
