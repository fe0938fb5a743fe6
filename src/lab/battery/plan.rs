//! The cases of a battery: fault-free units, single effects, pairs, triples, faults outside the catalogue, and effects that the catalogue will lack.

use crate::battery::draws::{Draw, Question};
use crate::battery::faults::STRANGERS;
use crate::battery::{Case, CaseKind};
use govtwin_model::effects::of_the_chain;

/// Which rates a battery's recordings have.
#[derive(Clone, Debug, PartialEq)]
pub enum BatteryRates {
    /// Two thirds of the units at 100 Hz, as on a bench, one third at 5 Hz, as in a plant's archive.
    Both,
    /// One of these for each unit, drawn, Hz; at least one.
    OneOf(Vec<f64>),
}

/// What the positions hardly show: more of these units have the pilot signals recorded.
const HIDDEN: [&str; 8] = [
    "pv_hysteresis",
    "pv_null_shift",
    "spool_friction",
    "entrained_air",
    "chamber_leak",
    "spring",
    "flow_force",
    "relief",
];

#[derive(Clone, Copy)]
enum Slot {
    Sound,
    Single,
    Pair,
    Triple,
    Stranger,
    LeftOut,
}

/// How kinds follow each other, so that a short battery has some of each.
const PATTERN: [Slot; 24] = [
    Slot::Single,
    Slot::Sound,
    Slot::Single,
    Slot::Pair,
    Slot::LeftOut,
    Slot::Single,
    Slot::Stranger,
    Slot::Single,
    Slot::Sound,
    Slot::LeftOut,
    Slot::Pair,
    Slot::Single,
    Slot::Triple,
    Slot::Sound,
    Slot::Single,
    Slot::Single,
    Slot::Stranger,
    Slot::Pair,
    Slot::LeftOut,
    Slot::Single,
    Slot::Sound,
    Slot::LeftOut,
    Slot::Single,
    Slot::Single,
];

/// The first `count` cases of a seed's battery; a longer battery begins with the shorter one.
///
/// Each part goes through all effects before one comes again. Each unit has one of the structural mismatches, drawn; what no catalogue lists has no
/// equation in the twin: where the plant is the twin itself a listed effect that the catalogue will lack stands in its place.
pub fn plan(count: usize, seed: u64, rates: &BatteryRates, mismatches: &[f64]) -> Vec<Case> {
    let mut draw = Draw::new(seed, Question::Plan, 0);
    // Triples have a stream of their own, so that they leave the other kinds as they were.
    let mut of_triples = Draw::new(seed, Question::Plan, 1);
    let mut of_rates = Draw::new(seed, Question::Plan, 2);
    let mut of_mismatches = Draw::new(seed, Question::Plan, 3);
    let ids: Vec<&'static str> = of_the_chain().map(|spec| spec.id).collect();
    let seconds = ids.clone();
    let strangers: Vec<&str> = STRANGERS.iter().map(|stranger| stranger.id).collect();
    let mut singles = Deck::new(ids.clone(), &mut draw);
    let mut triples = Deck::new(ids.clone(), &mut of_triples);
    let mut left_out = Deck::new(ids.clone(), &mut draw);
    let mut firsts = Deck::new(ids, &mut draw);
    let mut strangers = Deck::new(strangers, &mut draw);
    (0..count)
        .map(|place| {
            let mismatch = mismatches.get(of_mismatches.below(mismatches.len())).copied().unwrap_or(1.0);
            let kind = match PATTERN[place % PATTERN.len()] {
                Slot::Sound => CaseKind::Sound,
                Slot::Single => CaseKind::Single(singles.next(&mut draw)),
                Slot::LeftOut => CaseKind::LeftOut(left_out.next(&mut draw)),
                Slot::Stranger if mismatch == 0.0 => CaseKind::LeftOut(left_out.next(&mut draw)),
                Slot::Stranger => CaseKind::Stranger(strangers.next(&mut draw)),
                Slot::Pair => {
                    let first = firsts.next(&mut draw);
                    let second = another(&seconds, &[&first], &mut draw);
                    CaseKind::Pair(first, second)
                }
                Slot::Triple => {
                    let first = triples.next(&mut of_triples);
                    let second = another(&seconds, &[&first], &mut of_triples);
                    let third = another(&seconds, &[&first, &second], &mut of_triples);
                    CaseKind::Triple(first, second, third)
                }
            };
            // Drawn whether needed or not, so that the rates asked for change nothing else.
            let (slow, rich, seed) = (draw.chance(1.0 / 3.0), draw.between(0.0, 1.0), draw.seed());
            let hidden = kind.ids().iter().any(|id| HIDDEN.contains(id));
            let rich = rich < if hidden { 0.7 } else { 0.3 };
            let rate_hz = match rates {
                BatteryRates::Both if slow => 5.0,
                BatteryRates::Both => 100.0,
                BatteryRates::OneOf(rates_hz) => rates_hz[of_rates.below(rates_hz.len())],
            };
            Case { name: format!("case_{:03}", place + 1), kind, rate_hz, rich, mismatch, seed, alone: None }
        })
        .collect()
}

/// One of some ids that is none of those taken.
fn another(ids: &[&'static str], taken: &[&str], draw: &mut Draw) -> String {
    loop {
        let id = ids[draw.below(ids.len())];
        if !taken.contains(&id) {
            break id.to_owned();
        }
    }
}

/// Ids dealt in random order, again and again.
struct Deck {
    ids: Vec<&'static str>,
    dealt: usize,
}

impl Deck {
    fn new(mut ids: Vec<&'static str>, draw: &mut Draw) -> Self {
        draw.shuffle(&mut ids);
        Self { ids, dealt: 0 }
    }

    fn next(&mut self, draw: &mut Draw) -> String {
        if self.dealt == self.ids.len() {
            draw.shuffle(&mut self.ids);
            self.dealt = 0;
        }
        self.dealt += 1;
        self.ids[self.dealt - 1].to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_of_units_has_their_shares_of_each_kind() {
        let of = |kind: &str| {
            plan(PATTERN.len(), 9, &BatteryRates::Both, &[1.0]).iter().filter(|case| case.kind.id() == kind).count()
        };
        let shares = ["sound", "single", "pair", "triple", "stranger", "left_out"].map(of);
        assert_eq!(shares, [4, 10, 3, 1, 2, 4]);
    }

    #[test]
    fn a_longer_battery_begins_with_the_shorter_and_covers_every_effect() {
        let (short, long) = (plan(12, 7, &BatteryRates::Both, &[1.0]), plan(200, 7, &BatteryRates::Both, &[1.0]));
        assert_eq!(short, long[..12]);
        assert_ne!(short, plan(12, 8, &BatteryRates::Both, &[1.0]));
        for spec in of_the_chain() {
            let single = |case: &&Case| matches!(&case.kind, CaseKind::Single(id) if id == spec.id);
            assert!(long.iter().filter(single).count() >= 2, "{}", spec.id);
            assert!(
                long.iter().any(|case| matches!(&case.kind, CaseKind::LeftOut(id) if id == spec.id)),
                "{}",
                spec.id
            );
        }
        for stranger in STRANGERS {
            assert!(long.iter().any(|case| case.kind == CaseKind::Stranger(stranger.id.to_owned())));
        }
        let kinds: Vec<&str> = short.iter().map(|case| case.kind.id()).collect();
        for kind in ["sound", "single", "pair", "stranger", "left_out"] {
            assert!(kinds.contains(&kind), "{kind}");
        }
        for case in &long {
            let mut ids = case.kind.ids();
            ids.sort_unstable();
            assert!(ids.windows(2).all(|pair| pair[0] != pair[1]), "{ids:?}");
        }
        let triples: Vec<_> = long.iter().filter(|case| matches!(case.kind, CaseKind::Triple(..))).collect();
        assert!(triples.len() == 8 && triples.iter().all(|case| case.kind.ids().len() == 3));
        let slow = long.iter().filter(|case| case.rate_hz == 5.0).count();
        assert!((40..100).contains(&slow), "{slow}");
        assert!(plan(12, 7, &BatteryRates::OneOf(vec![5.0]), &[1.0]).iter().all(|case| case.rate_hz == 5.0));
    }

    #[test]
    fn mismatches_are_drawn_and_leave_the_units_as_they_are() {
        let (usual, others) =
            (plan(60, 7, &BatteryRates::Both, &[1.0]), plan(60, 7, &BatteryRates::Both, &[1.0, 2.0, 4.0]));
        for mismatch in [1.0, 2.0, 4.0] {
            let share = others.iter().filter(|case| case.mismatch == mismatch).count();
            assert!((10..30).contains(&share), "{share} at {mismatch}");
        }
        for (one, other) in usual.iter().zip(&others) {
            assert_eq!(
                (&one.kind, one.seed, one.rich, one.rate_hz),
                (&other.kind, other.seed, other.rich, other.rate_hz)
            );
        }
        let twins = plan(60, 7, &BatteryRates::Both, &[0.0]);
        assert!(twins.iter().all(|case| case.mismatch == 0.0 && case.kind.id() != "stranger"));
    }

    #[test]
    fn other_rates_are_drawn_and_leave_the_units_as_they_are() {
        let (both, others) = (
            plan(60, 7, &BatteryRates::Both, &[1.0]),
            plan(60, 7, &BatteryRates::OneOf(vec![50.0, 20.0, 10.0]), &[1.0]),
        );
        for rate_hz in [50.0, 20.0, 10.0] {
            let share = others.iter().filter(|case| case.rate_hz == rate_hz).count();
            assert!((10..30).contains(&share), "{share} at {rate_hz} Hz");
        }
        for (one, other) in both.iter().zip(&others) {
            assert_eq!((&one.kind, one.seed, one.rich), (&other.kind, other.seed, other.rich));
        }
    }
}
