//! The four answers at the head of a benchmark's page: how often verdicts are right, how sure, whether intervals hold, and the causes of the misses.

use super::{interval, percent, value_text};
use crate::benchmark::score::{RegretScore, Score};
use crate::benchmark::scored::{MissedBy, ScoredUnit};
use govtwin_diagnosis::words::capital;

/// The answers, each under its question.
pub(crate) fn answers(score: &Score, cases: &[ScoredUnit]) -> [(&'static str, Vec<String>); 4] {
    let judged = score.measures.iter().filter(|measure| measure.reached.is_some()).count();
    let reached = score.measures.iter().filter(|measure| measure.reached == Some(true)).count();
    let mut cause =
        vec![format!("{reached} of {judged} targets reached on {} units whose faults were withheld.", cases.len())];
    cause.extend(sentence(score, &["single_first", "single_in_class", "stage"]));
    let sure = sentence(score, &["false_alarm", "detection", "false_unknown", "unknown", "probability"]);
    let far = sentence(score, &["closure_coverage", "size_coverage"]);
    let next = misses_in_words(cases).unwrap_or_else(|| "No fault was missed.".to_owned());
    [
        ("Result", cause),
        ("How sure", sure.into_iter().collect()),
        ("Intervals", far.into_iter().collect()),
        ("What next", vec![next]),
    ]
}

/// Measures with their intervals in a sentence; none where nothing was counted.
fn sentence(score: &Score, ids: &[&str]) -> Option<String> {
    let counted = |id: &&str| score.measures.iter().find(|measure| measure.id == *id && measure.measured.cases > 0);
    let said: Vec<String> = ids
        .iter()
        .filter_map(counted)
        .map(|one| format!("{}: {} {} of {}", one.name, value_text(one), interval(one), one.measured.cases))
        .collect();
    (!said.is_empty()).then(|| format!("{}.", capital(&said.join("; "))))
}

/// How many answers missed, and by what; none where nothing was missed.
pub fn misses_in_words(cases: &[ScoredUnit]) -> Option<String> {
    let missed = cases.iter().filter(|case| case.missed()).count();
    let by = |what: Option<MissedBy>| cases.iter().filter(|case| case.missed() && case.missed_by() == what).count();
    let [information, search, verdict, model] = MissedBy::ALL.map(|what| by(Some(what)));
    (missed > 0).then(|| {
        let [miss, name] = if missed == 1 { ["misses", "names"] } else { ["miss", "name"] };
        let mut words = format!(
            "{missed} of {} answers {miss} a fault or {name} a false one. Information: {information}; by the catalogue's equations the missed fault is \
             too small in the recordings or too similar to the answer, or the answer leaves hardly more than a right model. Search: {search}; no set with \
             the true faults was fitted as well as from the true values. Verdict: {verdict}; the true set leads by the evidence, and the verdict is \
             another. Model: {model}; another set fits the recordings better with the twin's equations than the truth does.",
            cases.len()
        );
        let unknown = by(None);
        if unknown > 0 {
            words += &format!(" Cause unknown: {unknown}.");
        }
        words
    })
}

/// How far the search stayed behind what the true values reach, in sentences; none where no true values are known.
pub fn regret_in_words(regret: &RegretScore) -> Option<String> {
    let share = |share: f64| format!("{} %", percent(share));
    let quantiles: Vec<String> = regret
        .quantiles
        .iter()
        .map(|&(units, at_most)| format!("at most {} in {} % of the units", share(at_most), percent(units)))
        .collect();
    let large: Vec<String> = regret.large.iter().map(|(name, of)| format!("{name} {}", share(*of))).collect();
    let large = if large.is_empty() { "none".to_owned() } else { large.join(", ") };
    (!quantiles.is_empty()).then(|| {
        format!(
            "Regret of the search (χ² found for the best set that holds the true faults, less χ² reached from the true values, as a share of χ²): {}. \
             Above 1 %: {large}.",
            quantiles.join(", ")
        )
    })
}
