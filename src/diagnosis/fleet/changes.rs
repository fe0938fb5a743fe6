//! What changed since the fleet was gathered before.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::gathered::{Gathered, Row};
use super::result::FoundCause;
use crate::words::{id_words, key_words, verdict_words};

/// The state of the fleet from which changes are computed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Standing {
    /// When it was gathered.
    pub date: String,
    /// A word for each unit and period.
    pub rows: Vec<Stood>,
    /// Sizes beyond the limit, as unit and name.
    pub changed: Vec<(String, String)>,
}

/// The state of a unit in a period.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Stood {
    /// The unit.
    pub unit: String,
    /// The period.
    pub period: String,
    /// Key of its result.
    pub key: String,
    /// Verdict and causes, or that it failed or is missing.
    pub word: String,
}

/// A difference from before.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Change {
    /// The unit.
    pub unit: String,
    /// The period; empty where it is about all of them.
    pub period: String,
    /// What changed, in words.
    pub words: String,
}

impl Standing {
    /// The state of a fleet.
    pub fn of(gathered: &Gathered, date: &str) -> Self {
        let stood = |row: &Row| Stood {
            unit: row.unit.clone(),
            period: row.period.clone(),
            key: row.key.clone(),
            word: word(row),
        };
        let changed = gathered.changed().map(|(unit, trend)| (unit.to_owned(), trend.name.clone())).collect();
        Self { date: date.to_owned(), rows: gathered.rows.iter().map(stood).collect(), changed }
    }

    /// What is different now.
    pub fn changes(&self, now: &Self) -> Vec<Change> {
        let place = |one: &Stood| (one.unit.clone(), one.period.clone());
        let before: BTreeMap<_, _> = self.rows.iter().map(|one| (place(one), one)).collect();
        let after: BTreeMap<_, _> = now.rows.iter().map(|one| (place(one), one)).collect();
        let change = |one: &Stood, words: String| Change { unit: one.unit.clone(), period: one.period.clone(), words };
        let mut changes = Vec::new();
        for (place, one) in &after {
            match before.get(place) {
                None => changes.push(change(one, format!("new: {}", said(&one.word)))),
                Some(there) if there.word != one.word => {
                    let why =
                        if there.key == one.key { "" } else { ", from other recordings, options or another version" };
                    changes.push(change(one, format!("{}; before {}{why}", said(&one.word), said(&there.word))));
                }
                Some(_) => {}
            }
        }
        for (_, one) in before.iter().filter(|(place, _)| !after.contains_key(*place)) {
            changes.push(change(one, format!("gone; before {}", said(&one.word))));
        }
        for (unit, name) in now.changed.iter().filter(|one| !self.changed.contains(one)) {
            changes.push(Change {
                unit: unit.clone(),
                period: String::new(),
                words: format!("{} changed beyond its interval", key_words(name)),
            });
        }
        changes.sort_by(|a, b| (&a.unit, &a.period, &a.words).cmp(&(&b.unit, &b.period, &b.words)));
        changes
    }
}

/// Verdict and causes of a row, or its other state.
pub fn word(row: &Row) -> String {
    row.found.as_ref().map_or_else(|| row.status.id().to_owned(), word_of)
}

/// Verdict and causes.
pub fn word_of(found: &FoundCause) -> String {
    let causes: Vec<&str> = found.causes.iter().map(|cause| cause.id.as_str()).collect();
    if causes.is_empty() { found.verdict.clone() } else { format!("{} {}", found.verdict, causes.join(", ")) }
}

/// The same for people: `cause found (backlash)`.
fn said(word: &str) -> String {
    let (verdict, causes) = word.split_once(' ').unwrap_or((word, ""));
    let causes: Vec<String> = causes.split(", ").filter(|id| !id.is_empty()).map(id_words).collect();
    let verdict = verdict_words(verdict);
    if causes.is_empty() { verdict.to_owned() } else { format!("{verdict} ({})", causes.join(", ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_difference_is_told_and_nothing_else() {
        let stood = |unit: &str, period: &str, word: &str| Stood {
            unit: unit.into(),
            period: period.into(),
            key: format!("{unit}{period}"),
            word: word.into(),
        };
        let before = Standing {
            rows: vec![stood("a", "1", "no_gap"), stood("b", "1", "failed"), stood("c", "1", "no_gap")],
            changed: vec![("a".into(), "x".into())],
            ..Standing::default()
        };
        assert_eq!(before.changes(&before), []);
        let now = Standing {
            rows: vec![stood("a", "1", "no_gap"), stood("a", "2", "named backlash"), stood("b", "1", "no_gap")],
            changed: vec![("a".into(), "x".into()), ("a".into(), "y".into())],
            ..Standing::default()
        };
        let words: Vec<_> =
            before.changes(&now).into_iter().map(|one| format!("{} {}: {}", one.unit, one.period, one.words)).collect();
        assert_eq!(
            words,
            [
                "a : y changed beyond its interval",
                "a 2: new: cause found (backlash)",
                "b 1: no fault found; before failed",
                "c 1: gone; before no fault found"
            ]
        );
    }
}
