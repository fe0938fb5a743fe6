//! The four answers at the head of an acceptance report: what fails, how sure, the measured values, what to do next.

use super::{kind, limit_text, value_text};
use govtwin_diagnosis::acceptance::limits::LimitStanding;
use govtwin_diagnosis::acceptance::summary::{AcceptanceSummary, AskedMeasure, Figure};
use govtwin_diagnosis::words::{capital, id_words, verdict_words};

/// The answers, each under its question.
pub(crate) fn answers(summary: &AcceptanceSummary) -> [(&'static str, Vec<String>); 4] {
    [
        ("Result", cause(summary)),
        ("How sure", vec![sureness(summary)]),
        ("Values", vec![reach(summary)]),
        ("What next", vec![next(summary)]),
    ]
}

/// The measures that stand so, each with its figure.
fn standing(summary: &AcceptanceSummary, wanted: LimitStanding) -> Vec<(usize, &AskedMeasure, &Figure)> {
    let limited =
        summary.measures.iter().enumerate().filter_map(|(i, asked)| Some((i, asked, asked.as_found.as_ref()?)));
    limited.filter(|(_, _, figure)| figure.standing == Some(wanted)).collect()
}

fn titles(all: &[(usize, &AskedMeasure, &Figure)]) -> String {
    all.iter().map(|(_, asked, _)| asked.title).collect::<Vec<_>>().join(", ")
}

fn cause(summary: &AcceptanceSummary) -> Vec<String> {
    let named = |wanted: LimitStanding| titles(&standing(summary, wanted));
    let head = match summary.standing {
        None => "Measured without limits; `--limits FILE` compares the measures with limits.".to_owned(),
        Some(LimitStanding::Passes) => "The unit meets all limits.".to_owned(),
        Some(LimitStanding::Fails) => format!("The unit fails: {}.", named(LimitStanding::Fails)),
        Some(LimitStanding::Undecided) => {
            format!("Undecided: {}; the intervals include the limits.", named(LimitStanding::Undecided))
        }
        Some(LimitStanding::NotMeasured) => {
            format!("Not shown by these recordings: {}; all other limits pass.", named(LimitStanding::NotMeasured))
        }
    };
    std::iter::once(head).chain(summary.sentences.first().cloned()).collect()
}

fn sureness(summary: &AcceptanceSummary) -> String {
    let mut words = "Intervals are 90 % intervals; a limit passes or fails only if the whole interval does.".to_owned();
    if !summary.faults.is_empty() {
        let faults: Vec<String> = summary.faults.iter().map(|id| id_words(id)).collect();
        words += &format!(
            " The removed faults are those of the diagnosis ({}): {}.",
            verdict_words(&summary.verdict),
            faults.join(", ")
        );
    }
    words
}

/// The measures with a limit, those first that do not pass.
fn reach(summary: &AcceptanceSummary) -> String {
    let order = [LimitStanding::Fails, LimitStanding::Undecided, LimitStanding::Passes];
    let each = |(_, asked, figure): &(usize, &AskedMeasure, &Figure)| {
        let (value, interval) = value_text(figure, kind(asked));
        let limit = limit_text(asked.limit.as_ref(), kind(asked));
        format!("{} {value} ({interval}), limit {limit}", asked.title)
    };
    let limited: Vec<String> =
        order.into_iter().flat_map(|wanted| standing(summary, wanted)).map(|one| each(&one)).collect();
    if limited.is_empty() {
        let known =
            summary.measures.iter().filter(|asked| asked.as_found.as_ref().is_some_and(|one| one.value.is_some()));
        return format!(
            "{} of {} measures have a value, from the recordings or from the twin's standard test.",
            known.count(),
            summary.measures.len()
        );
    }
    format!("{}.", capital(&limited.join("; ")))
}

fn next(summary: &AcceptanceSummary) -> String {
    match summary.standing {
        None => "Enter the limits of the contract in the file that `govtwin accept --template > limits.yaml` writes.".to_owned(),
        Some(LimitStanding::Passes) => "Sign below.".to_owned(),
        Some(LimitStanding::Fails) => repair(summary),
        Some(LimitStanding::Undecided) => {
            "Record more of the same movements, or the next test that the diagnosis proposes: both narrow the intervals."
                .to_owned()
        }
        Some(LimitStanding::NotMeasured) => {
            let missing = standing(summary, LimitStanding::NotMeasured);
            let of = |(i, asked, _): &(usize, &AskedMeasure, &Figure)| {
                let note =
                    summary.subjects.first().and_then(|measured| measured.figures.get(*i)).map(|one| one.note.as_str());
                let note = note.filter(|note| !note.is_empty()).map(|note| format!(" ({note})")).unwrap_or_default();
                format!("{}{note}", asked.title)
            };
            format!("Record movements that show: {}.", missing.iter().map(of).collect::<Vec<_>>().join("; "))
        }
    }
}

/// What would help where a limit fails: a fault without which it passes, or a look elsewhere.
fn repair(summary: &AcceptanceSummary) -> String {
    let mut helped = Vec::new();
    let mut left = Vec::new();
    for (i, asked, _) in standing(summary, LimitStanding::Fails) {
        let without = |wanted: LimitStanding| {
            let mut units = summary.subjects.iter().filter(|subject| subject.name.starts_with("unit without"));
            let subject = units.find(|subject| subject.figures[i].standing == Some(wanted))?;
            Some(subject.removed.iter().map(|id| id_words(id)).collect::<Vec<_>>().join(" and "))
        };
        if let Some(faults) = without(LimitStanding::Passes) {
            helped.push(format!("Repair {faults}: without it the {} passes.", asked.title));
        } else if let Some(faults) = without(LimitStanding::Undecided) {
            helped.push(format!("Repair {faults}: without it the {} may pass; longer recordings decide.", asked.title));
        } else {
            left.push(asked.title);
        }
    }
    if !left.is_empty() {
        let why =
            if summary.faults.is_empty() { "The diagnosis names no fault" } else { "No named fault explains this" };
        helped.push(format!("{why}: check what determines the {}.", left.join(", ")));
    }
    helped.join(" ")
}
