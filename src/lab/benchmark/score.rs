//! The measures: how right the diagnoses of a set of units were.

use crate::benchmark::scored_report::ScoredReport as _;
use std::collections::BTreeMap;

use crate::benchmark::scored::{MissedBy, ScoredUnit};
use crate::benchmark::statistics::{Bin, Measured, StatedProbability, reliability, weight_of_sound};
use govtwin_diagnosis::result::Verdict;

/// A measure without a target; of others the words, and from what to what the value may lie.
const OPEN: (&str, f64, f64) = ("", 0.0, 1.0);
/// Largest regret of a search that found the optimum, as a share of χ².
pub const SMALL_REGRET: f64 = 0.01;
/// Quantiles of the regret that a score states.
const REGRET_QUANTILES: [f64; 4] = [0.5, 0.9, 0.99, 1.0];

/// One measure with its target.
#[derive(Clone, Debug, PartialEq)]
pub struct ScoredMeasure {
    /// Key in files.
    pub id: &'static str,
    /// What it is.
    pub name: &'static str,
    /// Its value.
    pub measured: Measured,
    /// The target, in words; empty where there is none.
    pub target: &'static str,
    /// Whether the value reaches the target; none without target or cases.
    pub reached: Option<bool>,
    /// What stands in the way; none where nothing is known of misses.
    pub misses: Option<Misses>,
}

/// The misses of a measure, and what they lie with ([`ScoredUnit::missed_by`]); of some nothing may be known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Misses {
    /// All of them.
    pub all: usize,
    /// Those that lie with each of [`MissedBy::ALL`].
    pub by: [usize; MissedBy::ALL.len()],
}

/// The score of one method.
#[derive(Clone, Debug, PartialEq)]
pub struct Score {
    /// Units that were scored.
    pub units: usize,
    /// All measures.
    pub measures: Vec<ScoredMeasure>,
    /// How often each truth got each verdict.
    pub confusion: Confusion,
    /// Reported probabilities against observed frequencies, with half of the units fault-free, as for the learned weights.
    pub reliability: Vec<Bin>,
    /// Regret of the search.
    pub regret: RegretScore,
}

/// Regret of the search over the units whose true values are known, as shares of χ².
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RegretScore {
    /// Quantiles, each with the share of units that have no more.
    pub quantiles: Vec<(f64, f64)>,
    /// The units with more than [`SMALL_REGRET`], the largest first.
    pub large: Vec<(String, f64)>,
}

impl RegretScore {
    fn of(cases: &[ScoredUnit]) -> Self {
        let mut all: Vec<(String, f64)> =
            cases.iter().filter_map(|case| Some((case.label.name.clone(), case.regret()?))).collect();
        all.sort_by(|a, b| a.1.total_cmp(&b.1));
        let quantiles = REGRET_QUANTILES.into_iter().filter_map(|share| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in a short list")]
            let place = (share * all.len() as f64).ceil() as usize;
            all.get(place.max(1) - 1).map(|(_, regret)| (share, *regret))
        });
        Self {
            quantiles: quantiles.collect(),
            large: all.iter().rev().take_while(|(_, regret)| *regret > SMALL_REGRET).cloned().collect(),
        }
    }
}

/// Truths by words: counts.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Confusion {
    /// What is so: `none`, effects, `outside`.
    pub truths: Vec<String>,
    /// The verdict: `none`, effects, `unknown`.
    pub words: Vec<String>,
    /// Counts by truth, then by word.
    pub counts: Vec<Vec<usize>>,
}

/// Scores a set of units.
pub fn score(cases: &[ScoredUnit]) -> Score {
    let sound = weight_of_sound(cases.iter().filter(|case| case.sound()).count(), cases.len());
    let mut claims = Vec::new();
    for case in cases {
        let weight = if case.sound() { sound } else { 1.0 };
        claims.extend(case.report.ranking.iter().map(|rank| StatedProbability {
            stated_probability: case.report.probability(&rank.id),
            was: case.holds(&rank.id),
            weight,
        }));
    }
    let (units, measures, confusion) = (cases.len(), measures(cases), confusion(cases));
    Score { units, measures, confusion, reliability: reliability(&claims), regret: RegretScore::of(cases) }
}

/// The share of cases of which something holds, and its misses; `good`: whether it should hold.
fn share<'a>(
    cases: impl Iterator<Item = &'a ScoredUnit>,
    good: bool,
    holds: impl Fn(&ScoredUnit) -> bool,
) -> (Measured, Option<Misses>) {
    let (hits, missed): (Vec<bool>, Vec<Option<MissedBy>>) = cases
        .map(|case| {
            let hit = holds(case);
            (hit, (hit != good).then(|| case.missed_by()).flatten())
        })
        .unzip();
    let all = hits.iter().filter(|hit| **hit != good).count();
    let by = MissedBy::ALL.map(|what| missed.iter().filter(|missed| **missed == Some(what)).count());
    (Measured::of(hits), (by.iter().any(|&count| count > 0)).then_some(Misses { all, by }))
}

fn measures(cases: &[ScoredUnit]) -> Vec<ScoredMeasure> {
    let all = || cases.iter();
    let singles = || all().filter(|case| case.single());
    let pairs = || all().filter(|case| case.pair());
    let triples = || all().filter(|case| case.triple());
    let outside = || all().filter(|case| !case.label.listed);
    let shares = |named: &ScoredUnit| named.label.effects.iter().filter(|truth| named.report.blames(&truth.id)).count();
    // A class claims that one of them is there.
    let every = |case: &ScoredUnit| case.names() && shares(case) == case.label.effects.len();
    let named = || all().filter(|case| case.label.listed && case.names());
    let detects = |case: &ScoredUnit| case.report.detects();
    let unknown = |case: &ScoredUnit| case.says(Verdict::Unknown);
    let probabilities: Vec<f64> = singles().map(|case| case.report.probability(case.first_truth())).collect();
    let seconds: Vec<f64> = all().filter_map(|case| case.report.seconds).collect();
    let only = |measured| (measured, None);
    let regret = only(Measured::of(all().filter_map(ScoredUnit::regret).map(|regret| regret <= SMALL_REGRET)));
    let explained_fraction = only(Measured::of(all().filter_map(ScoredUnit::explained_fraction_is_covered)));
    let size = only(Measured::of(all().filter_map(ScoredUnit::size_is_covered)));
    let probability = only(Measured::mean_probability(&probabilities));
    let time = only(Measured::mean(&seconds));

    let row =
        |id, name, (target, low, high): (&'static str, f64, f64), (measured, misses): (Measured, Option<Misses>)| {
            let judged = measured.cases > 0 && !target.is_empty();
            let reached = judged.then(|| (low..=high).contains(&measured.value));
            ScoredMeasure { id, name, measured, target, reached, misses }
        };
    // Of all such units, and of those whose faults show.
    let twice = |ids: [&'static str; 2], name, target, of: fn(&ScoredUnit) -> bool, holds: fn(&ScoredUnit) -> bool| {
        let visible = share(all().filter(|case| of(case) && case.visible()), true, holds);
        [
            row(ids[0], name, target, share(all().filter(|case| of(case)), true, holds)),
            row(ids[1], "… of those at ≥ 3 times the noise", OPEN, visible),
        ]
    };
    let false_alarm = share(all().filter(|case| case.sound()), false, detects);
    let detection = share(all().filter(|case| case.visible()), true, detects);
    let noticed = ScoredUnit::says_something_else;
    let placed = share(outside().filter(|case| noticed(case)), true, ScoredUnit::stage_is_right);
    let false_unknown = share(all().filter(|case| case.label.listed), false, unknown);
    let (first, in_class) = (ScoredUnit::is_first, ScoredUnit::blamed_in_small_class);
    let (single, faulty) = (ScoredUnit::single, |case: &ScoredUnit| !case.sound());
    let mut rows = vec![
        row("false_alarm", "false alarm on sound units", ("≤ 2 %", 0.0, 0.02), false_alarm),
        row("detection", "detection at ≥ 3 times the noise", ("≥ 95 %", 0.95, 1.0), detection),
    ];
    let target = ("≥ 85 %", 0.85, 1.0);
    rows.extend(twice(["single_first", "single_first_visible"], "right single effect first", target, single, first));
    let (name, target) = ("right single effect in a class of at most 3", ("≥ 95 %", 0.95, 1.0));
    rows.extend(twice(["single_in_class", "single_in_class_visible"], name, target, single, in_class));
    rows.extend(twice(["stage", "stage_visible"], "stage right", target, faulty, ScoredUnit::stage_is_right));
    rows.extend([
        row("probability", "mean probability on the true effect", ("≥ 0.85", 0.85, 1.0), probability),
        row("pair_both", "pairs: both named", ("≥ 60 %", 0.6, 1.0), share(pairs(), true, every)),
        row(
            "pair_one",
            "pairs: at least one named",
            ("≥ 95 %", 0.95, 1.0),
            share(pairs(), true, |case| shares(case) > 0),
        ),
        row("triple_all", "triples: all three named", OPEN, share(triples(), true, every)),
        row("triple_one", "triples: at least one named", OPEN, share(triples(), true, |case| shares(case) > 0)),
        row(
            "made_up",
            "named verdicts with an effect that is not there",
            OPEN,
            share(named(), false, ScoredUnit::makes_up),
        ),
        row(
            "unknown",
            "outside the catalogue: unknown, or something else as well",
            ("≥ 80 %", 0.8, 1.0),
            share(outside(), true, noticed),
        ),
        row("unknown_stage", "… and placed in the right stage", OPEN, placed),
        row("false_unknown", "false unknown", ("≤ 5 %", 0.0, 0.05), false_unknown),
        row(
            "closure_coverage",
            "explained fraction on fresh recordings inside the 90 % interval",
            ("85–95 %", 0.85, 0.95),
            explained_fraction,
        ),
        row("size_coverage", "true size inside the 90 % interval", OPEN, size),
        row("regret", "search within 1 % of the χ² reached from the true values", ("≥ 99 %", 0.99, 1.0), regret),
        row("seconds", "time for one unit, s", ("≤ 60 s", 0.0, 60.0), time),
    ]);
    rows
}

fn confusion(cases: &[ScoredUnit]) -> Confusion {
    let mut counts: BTreeMap<(usize, String), BTreeMap<(usize, String), usize>> = BTreeMap::new();
    let place = |word: &str| {
        let order = match word {
            "none" => 0,
            "outside" | "unknown" => 2,
            _ => 1,
        };
        (order, word.to_owned())
    };
    for case in cases.iter().filter(|case| !case.pair() && !case.triple()) {
        let truth = if case.label.listed { case.first_truth() } else { "outside" };
        *counts.entry(place(truth)).or_default().entry(place(case.report.word())).or_default() += 1;
    }
    let mut words: Vec<(usize, String)> = counts.values().flat_map(|row| row.keys().cloned()).collect();
    words.sort();
    words.dedup();
    Confusion {
        truths: counts.keys().map(|(_, truth)| truth.clone()).collect(),
        counts: counts
            .values()
            .map(|row| words.iter().map(|word| row.get(word).copied().unwrap_or(0)).collect())
            .collect(),
        words: words.into_iter().map(|(_, word)| word).collect(),
    }
}

#[cfg(test)]
mod tests;
