//! The four answers at the head of a fleet's page: which unit needs attention first, how sure, how much is diagnosed, what to do next.

use std::collections::BTreeSet;

use super::{Context, probability_text};
use crate::diagnosis::claims_like;
use govtwin_diagnosis::fleet::gathered::{Gathered, Status};
use govtwin_diagnosis::words::id_words;
use govtwin_model::number::fixed;

/// The answers, each under its question.
pub(crate) fn answers(gathered: &Gathered, context: &Context, units: usize) -> [(&'static str, Vec<String>); 4] {
    let changed: BTreeSet<&str> = gathered.changed().map(|(unit, _)| unit).collect();
    let (looks, changed) = (context.looks.len(), changed.len());
    let mut cause = match (looks, changed) {
        (0, _) => format!("None of {units} units needs attention."),
        (_, 0) => format!("{looks} of {units} units need attention; no size changed beyond its interval."),
        _ => format!("{looks} of {units} units need attention; in {changed} a size changed beyond its interval."),
    };
    let first = context.looks.first();
    if let Some(look) = first {
        cause += &format!(" First {}: {}.", look.unit, look.reasons.join("; "));
    }
    let last = first.and_then(|look| gathered.last_found(&look.unit)?.found.as_ref());
    let mut sure = Vec::new();
    if let Some(found) = last.filter(|found| !found.causes.is_empty()) {
        let each: Vec<String> = found
            .causes
            .iter()
            .map(|cause| format!("{} {}", id_words(&cause.id), probability_text(cause.probability)))
            .collect();
        let claimed = found.causes.iter().filter_map(|cause| cause.probability).reduce(f64::max);
        let rate = claimed.and_then(claims_like).map_or_else(String::new, |rate| format!(" {rate}"));
        sure.push(format!("First unit, last period: probability of {}.{rate}", each.join(", ")));
    } else if let Some(unknown) =
        last.filter(|found| found.verdict == "unknown").and_then(|found| found.unknown_probability)
    {
        let rate = claims_like(unknown).map_or_else(String::new, |rate| format!(" {rate}"));
        sure.push(format!(
            "First unit, last period: probability of a cause outside the catalogue {}.{rate}",
            probability_text(Some(unknown))
        ));
    }
    sure.push(format!(
        "A size counts as changed if its cumulative sum is above {:.1}; at this limit a fleet in which nothing changes gives one false alarm in ten pages.",
        gathered.limit
    ));
    let (done, failed, missing) =
        (gathered.count(Status::Done), gathered.count(Status::Failed), gathered.count(Status::Missing));
    let mut far =
        vec![format!("{done} of {} entries are diagnosed (one entry per unit and period).", gathered.rows.len())];
    let some = last.filter(|found| !found.causes.is_empty());
    far.extend(some.and_then(|found| found.explained_share).map(|share| {
        format!("In the first unit the cause explains {} % of the error (held-out data).", fixed(100.0 * share, 0))
    }));
    let mut next = Vec::new();
    match (first, last.and_then(|found| found.next_test.as_ref())) {
        (Some(look), Some(test)) => next.push(format!("{}: {test}.", look.unit)),
        (Some(look), None) => next.push(format!("Open the report of {} below.", look.unit)),
        (None, _) => next.push("Run `govtwin fleet gather` again after the next period.".to_owned()),
    }
    if missing > 0 {
        next.push(format!("{missing} have no result yet: run the plan again; it skips finished diagnoses."));
    }
    if failed > 0 {
        next.push(format!("{failed} failed: their recordings cannot be diagnosed; the reasons are below."));
    }
    [("Result", vec![cause]), ("How sure", sure), ("Coverage", far), ("What next", next)]
}
