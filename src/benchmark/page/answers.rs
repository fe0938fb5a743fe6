//! The four answers at the head of a benchmark's page: how often verdicts are right, how sure, how far, and what the misses lie with.

use super::{interval, value_text};
use crate::benchmark::score::Score;
use crate::benchmark::scored::{MissedBy, ScoredUnit};
use crate::report::diagnosis::capital;

/// The answers, each under its question.
pub fn answers(score: &Score, cases: &[ScoredUnit]) -> [(&'static str, Vec<String>); 4] {
    let judged = score.measures.iter().filter(|measure| measure.reached.is_some()).count();
    let reached = score.measures.iter().filter(|measure| measure.reached == Some(true)).count();
    let mut cause =
        vec![format!("{reached} of {judged} targets reached on {} units whose faults were withheld.", cases.len())];
    cause.extend(sentence(score, &["single_first", "single_in_class", "stage"]));
    let sure = sentence(score, &["false_alarm", "detection", "false_unknown", "unknown", "probability"]);
    let far = sentence(score, &["closure_coverage", "size_coverage"]);
    let next = misses_in_words(cases).unwrap_or_else(|| "Nothing was missed.".to_owned());
    [
        ("Cause", cause),
        ("How sure", sure.into_iter().collect()),
        ("How far", far.into_iter().collect()),
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
#[must_use]
pub fn misses_in_words(cases: &[ScoredUnit]) -> Option<String> {
    let missed = cases.iter().filter(|case| case.missed()).count();
    let by = |what: Option<MissedBy>| cases.iter().filter(|case| case.missed() && case.missed_by() == what).count();
    let [recordings, tolerance, method] = MissedBy::ALL.map(|what| by(Some(what)));
    (missed > 0).then(|| {
        let [miss, make] = if missed == 1 { ["misses", "makes"] } else { ["miss", "make"] };
        let mut words = format!(
            "{missed} of {} answers {miss} something or {make} something up. {recordings} lie with the recordings: by the catalogue's equations what \
             was left out is too small in them, or too much like the answer. {tolerance} lie with the method's tolerance: the answer leaves no \
             more than it lets a right model leave; a stricter method might have told. {method} lie with the method.",
            cases.len()
        );
        let unknown = by(None);
        if unknown > 0 {
            words += &format!(" Of {unknown} nothing is known.");
        }
        words
    })
}
