//! From recordings that were found to a list of work, with every object that is in no entry and why.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};

use super::entry::{BagUsed, Entry, Options};
use govtwin_model::provenance::FileUsed;

/// Why an object is in no entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// The same bytes are in an entry of the unit already.
    Duplicate,
    /// The same bytes lie in the folders of two units.
    TwoUnits,
    /// It states that it is of another unit than its folder.
    OtherUnit,
    /// It lies in no unit's folder.
    UnknownUnit,
    /// A recording that cannot be read, or holds nothing of a servo system.
    Unreadable,
    /// Neither MCAP nor SQLite, and the unit has no import map.
    NoRecording,
}

impl Reason {
    /// The word in tables.
    pub fn id(self) -> &'static str {
        match self {
            Self::Duplicate => "duplicate",
            Self::TwoUnits => "two_units",
            Self::OtherUnit => "other_unit",
            Self::UnknownUnit => "unknown_unit",
            Self::Unreadable => "unreadable",
            Self::NoRecording => "no_recording",
        }
    }
}

/// An object of the source that is in no entry.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LeftOut {
    /// Its path below the source.
    pub path: String,
    /// The unit in whose folder it is; empty if in none.
    pub unit: String,
    /// Why.
    pub reason: Reason,
    /// The same in words.
    pub words: String,
}

/// A recording that was found and can be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundRecording {
    /// Whose folder it lies in.
    pub unit: String,
    /// The period in which it begins.
    pub period: String,
    /// It, with the digests of its files.
    pub bag: BagUsed,
    /// The unit that it states to be of.
    pub states: Option<String>,
}

/// How a unit is diagnosed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct How {
    /// Its sheet, beside the plan.
    pub sheet: Option<FileUsed>,
    /// Its map, beside the plan.
    pub map: Option<FileUsed>,
    /// Its options.
    pub options: Options,
}

/// A plan: entries by unit and period.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Plan {
    /// The work.
    pub entries: Vec<Entry>,
    /// What is in no entry.
    pub left_out: Vec<LeftOut>,
    /// Units of the table without any entry.
    pub idle_units: Vec<String>,
}

/// Makes the plan of recordings that were found in a source.
pub fn plan(source: &str, program: &str, units: &BTreeMap<String, How>, mut found: Vec<FoundRecording>) -> Plan {
    found.sort_by(|a, b| (&a.unit, &a.bag.path).cmp(&(&b.unit, &b.bag.path)));
    let mut left_out = Vec::new();
    let mut out = |one: &FoundRecording, reason: Reason, words: String| {
        left_out.push(LeftOut { path: one.bag.path.clone(), unit: one.unit.clone(), reason, words });
    };
    let mut of_content: BTreeMap<Vec<String>, Vec<(String, String)>> = BTreeMap::new();
    for one in &found {
        of_content.entry(content(one)).or_default().push((one.unit.clone(), one.bag.path.clone()));
    }
    let mut work: BTreeMap<(String, String), Vec<BagUsed>> = BTreeMap::new();
    for one in found {
        if let Some(stated) = one.states.as_ref().filter(|stated| **stated != one.unit) {
            let words = format!("states that it is of the unit `{stated}`, and lies in the folder of `{}`", one.unit);
            out(&one, Reason::OtherUnit, words);
            continue;
        }
        let same = of_content.get(&content(&one)).map(Vec::as_slice).unwrap_or_default();
        if let Some((unit, path)) = same.iter().find(|(unit, _)| *unit != one.unit) {
            let words = format!("has the bytes of {path} in the folder of `{unit}`; nobody can tell whose it is");
            out(&one, Reason::TwoUnits, words);
            continue;
        }
        if let Some((_, first)) = same.first().filter(|(_, path)| *path != one.bag.path) {
            out(&one, Reason::Duplicate, format!("has the bytes of {first}"));
            continue;
        }
        work.entry((one.unit, one.period)).or_default().push(one.bag);
    }
    left_out.sort();
    let worked: BTreeSet<&String> = work.keys().map(|(unit, _)| unit).collect();
    let idle_units = units.keys().filter(|unit| !worked.contains(unit)).cloned().collect();
    let entries = work
        .into_iter()
        .map(|((unit, period), bags)| {
            let How { sheet, map, options } = units.get(&unit).cloned().unwrap_or_default();
            let source = source.to_owned();
            Entry { unit, period, source, bags, sheet, map, options, ..Entry::default() }.keyed(program)
        })
        .collect();
    Plan { entries, left_out, idle_units }
}

/// The digests of its files.
fn content(one: &FoundRecording) -> Vec<String> {
    let mut all: Vec<String> = one.bag.files.iter().map(|file| file.sha256.clone()).collect();
    all.sort();
    all
}

/// The objects that are left out as a table.
pub fn left_out_csv(left_out: &[LeftOut]) -> String {
    let row = |one: &LeftOut| vec![one.path.clone(), one.unit.clone(), one.reason.id().to_owned(), one.words.clone()];
    super::table::csv_text(&["path", "unit", "reason", "words"], left_out.iter().map(row))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(unit: &str, path: &str, period: &str, sha256: &str) -> FoundRecording {
        let file = FileUsed { path: path.to_owned(), bytes: 1, sha256: sha256.to_owned() };
        let bag = BagUsed { path: path.to_owned(), files: vec![file] };
        FoundRecording { unit: unit.to_owned(), period: period.to_owned(), bag, states: None }
    }

    #[test]
    fn everything_found_is_in_an_entry_or_left_out_with_a_reason() {
        let units = ["a", "b", "c"].map(|unit| (unit.to_owned(), How::default())).into();
        let stray = FoundRecording { states: Some("b".into()), ..found("a", "a/6", "2024", "66") };
        let all = vec![
            found("b", "b/1", "2024", "44"),
            found("a", "a/2", "2025", "22"),
            found("a", "a/1", "2024", "11"),
            found("a", "a/3", "2024", "33"),
            found("a", "a/4", "2025", "11"),
            found("a", "a/5", "2025", "55"),
            found("b", "b/5", "2025", "55"),
            stray,
        ];
        let plan = plan("s", "p", &units, all.clone());
        let entries: Vec<_> =
            plan.entries.iter().map(|one| (one.unit.as_str(), one.period.as_str(), one.bags.len())).collect();
        assert_eq!(entries, [("a", "2024", 2), ("a", "2025", 1), ("b", "2024", 1)]);
        let left: Vec<_> = plan.left_out.iter().map(|one| (one.path.as_str(), one.reason)).collect();
        assert_eq!(
            left,
            [
                ("a/4", Reason::Duplicate),
                ("a/5", Reason::TwoUnits),
                ("a/6", Reason::OtherUnit),
                ("b/5", Reason::TwoUnits)
            ]
        );
        assert!(plan.left_out[0].words.contains("a/1") && plan.left_out[1].words.contains("b/5"));
        assert_eq!(plan.idle_units, ["c"]);
        let used: usize = plan.entries.iter().map(|one| one.bags.len()).sum();
        assert_eq!(used + plan.left_out.len(), all.len());
        let mut turned = all;
        turned.reverse();
        assert_eq!(
            super::plan("s", "p", &units, turned),
            plan,
            "the order in which objects are listed makes no difference"
        );
    }
}
