//! Which units need a look first, each with its reasons.

use serde::Serialize;

use super::gathered::{Gathered, Status};
use crate::result::Verdict;
use crate::words::{capital, id_words, key_words, shown_unit, stage_words};
use govtwin_model::number::{fixed, quantity};

/// A unit that needs a look.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Look {
    /// The unit.
    pub unit: String,
    /// Reasons, weightiest first.
    pub reasons: Vec<String>,
    /// Class of the weightiest reason, 0 first.
    pub class: u8,
    /// Within a class, the larger first: a probability, or how far a sum is beyond its limit; a share.
    pub weight: f64,
}

/// Classes of reasons: changes, faults, undetermined causes, failed runs.
const CHANGES: u8 = 0;
const FAULT: u8 = 1;
const UNEXPLAINED: u8 = 2;
const NOT_RUN: u8 = 3;
const NOT_TOLD: u8 = 4;

/// Units by how soon they need a look; those that need none are not among them. Of the verdicts that of the last period counts.
pub fn look_first(gathered: &Gathered) -> Vec<Look> {
    let mut all = Vec::new();
    for (unit, trends) in &gathered.trends {
        let mut reasons: Vec<(u8, f64, String)> = Vec::new();
        for trend in trends {
            let Some(point) = trend.points.last().filter(|point| point.changed) else { continue };
            let first = trend.points.first().map_or(f64::NAN, |first| first.value);
            let way = if point.cumulative_sum > 0.0 { "rises" } else { "falls" };
            let words = format!(
                "{} {way} beyond its interval: {} at first, {} in {} (cumulative sum {}, limit {:.1})",
                capital(&key_words(&trend.name)),
                quantity(first, shown_unit(&trend.name, &trend.unit)),
                quantity(point.value, shown_unit(&trend.name, &trend.unit)),
                point.period,
                fixed(point.cumulative_sum, 1),
                gathered.limit
            );
            reasons.push((CHANGES, point.cumulative_sum.abs(), words));
        }
        for row in gathered.of_unit(unit).filter(|row| row.status != Status::Done) {
            reasons.push((NOT_RUN, 0.0, format!("{} in {}: {}", row.status.id(), row.period, row.words)));
        }
        let last = gathered.last_found(unit);
        if let Some((row, found)) = last.and_then(|row| Some((row, row.found.as_ref()?))) {
            let fault = 1.0 - found.none_probability.unwrap_or(0.0);
            let causes: Vec<String> = found.causes.iter().map(|cause| id_words(&cause.id)).collect();
            let is = |verdict: Verdict| found.verdict == verdict.id();
            if is(Verdict::Named) {
                reasons.push((FAULT, fault, format!("cause found in {}: {}", row.period, causes.join(" and "))));
            } else if is(Verdict::Class) {
                reasons.push((FAULT, fault, format!("possible causes in {}: {}", row.period, causes.join(" or "))));
            } else if is(Verdict::Unknown) {
                let place =
                    found.stage.as_deref().map(|stage| format!(", in the {}", stage_words(stage))).unwrap_or_default();
                reasons.push((UNEXPLAINED, fault, format!("unknown cause in {}{place}", row.period)));
            } else if is(Verdict::NotExcited) || is(Verdict::NoSuchUnit) {
                let words = if is(Verdict::NotExcited) {
                    "too little movement in the recordings for a verdict"
                } else {
                    "recordings not of a servomotor stage"
                };
                reasons.push((NOT_TOLD, 0.0, format!("{words}, in {}", row.period)));
            }
        }
        // A stable sort keeps the order of names and periods among equals.
        reasons.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
        if let Some((class, weight, _)) = reasons.first() {
            let (class, weight) = (*class, *weight);
            let reasons = reasons.into_iter().map(|(_, _, words)| words).collect();
            all.push(Look { unit: unit.clone(), reasons, class, weight });
        }
    }
    all.sort_by(|a, b| a.class.cmp(&b.class).then(b.weight.total_cmp(&a.weight)).then(a.unit.cmp(&b.unit)));
    all
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::fleet::entry::Entry;
    use crate::fleet::gathered::gather;
    use crate::fleet::result::{EntryResult, FoundCause, SizeInterval};

    #[test]
    fn what_changes_comes_first_and_sound_units_do_not_come_at_all() {
        let mut plan = Vec::new();
        let mut outcomes = Vec::new();
        let mut add = |unit: &str, period: &str, verdict: &str, none: f64, value: f64| {
            let mut entry = Entry { unit: unit.into(), period: period.into(), ..Entry::default() };
            entry.options.seed = plan.len() as u64;
            let entry = entry.keyed("p");
            let size = SizeInterval {
                name: "x".into(),
                unit: "1".into(),
                value: Some(value),
                low: Some(value - 0.1),
                high: Some(value + 0.1),
                information_share: Some(0.9),
                ..SizeInterval::default()
            };
            let found = FoundCause {
                verdict: verdict.into(),
                none_probability: Some(none),
                parameters: vec![size],
                ..FoundCause::default()
            };
            if !verdict.is_empty() {
                outcomes.push(EntryResult { found: Some(found), ..EntryResult::of(&entry, "p") });
            }
            plan.push(entry);
        };
        add("drifting", "1", "no_gap", 0.9, 0.0);
        add("drifting", "2", "no_gap", 0.9, 2.0);
        add("faulty", "1", "named", 0.1, 0.0);
        add("lost", "1", "", 0.0, 0.0);
        add("odd", "1", "unknown", 0.05, 0.0);
        add("sound", "1", "no_gap", 0.9, 0.0);
        add("worse", "1", "class", 0.01, 0.0);
        let looks = look_first(&gather(Some(&plan), outcomes, &BTreeMap::new(), "p"));
        let units: Vec<_> = looks.iter().map(|look| look.unit.as_str()).collect();
        assert_eq!(units, ["drifting", "worse", "faulty", "odd", "lost"]);
        assert!(looks[0].reasons[0].contains("X rises beyond its interval: 0"), "{:?}", looks[0]);
        assert!(looks[4].reasons[0].contains("missing in 1: no result yet"), "{:?}", looks[4]);
    }
}
