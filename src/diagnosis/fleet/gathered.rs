//! The fleet as a whole: results put beside the plan, in one order, with trends and what is missing.

use std::collections::BTreeMap;

use super::ageing::{self, Trend};
use super::entry::Entry;
use super::result::{EntryResult, FoundCause, Work};

/// The state of an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Status {
    /// Diagnosed.
    Done,
    /// Tried, and not possible.
    Failed,
    /// Planned, without a result.
    Missing,
}

/// A unit in a period.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// The unit.
    pub unit: String,
    /// The period.
    pub period: String,
    /// Key of its result.
    pub key: String,
    /// Its state.
    pub status: Status,
    /// How many recordings it has.
    pub recordings: usize,
    /// What was found.
    pub found: Option<FoundCause>,
    /// Why it failed, or what was noted of a result that is missing, or the warnings.
    pub words: String,
    /// The folder of its report in the store.
    pub report: Option<String>,
    /// The origins of the recordings that bags and folders state.
    pub origins: Vec<String>,
    /// How the work went.
    pub work: Option<Work>,
}

/// A fleet.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gathered {
    /// By unit and period.
    pub rows: Vec<Row>,
    /// Determined sizes over time, by unit.
    pub trends: BTreeMap<String, Vec<Trend>>,
    /// The limit of the cumulative sums; no unit, 1.
    pub limit: f64,
    /// Keys of results that are of no entry of the plan, or that another result of the same unit and period takes the place of.
    pub superseded: Vec<String>,
}

/// Gathers results. With a plan its entries decide what counts and what is missing; without one every result of this program counts, and
/// of several of a unit and period the one with the most recordings.
pub fn gather(
    plan: Option<&[Entry]>,
    outcomes: Vec<EntryResult>,
    notes: &BTreeMap<String, Vec<String>>,
    program: &str,
) -> Gathered {
    let mut by_key: BTreeMap<String, EntryResult> = outcomes.into_iter().map(|one| (one.key.clone(), one)).collect();
    let mut rows: Vec<Row> = Vec::new();
    if let Some(entries) = plan {
        for entry in entries {
            let outcome = by_key.remove(&entry.key);
            rows.push(row(&entry.unit, &entry.period, &entry.key, entry.bags.len(), outcome, notes));
        }
    } else {
        let mut best: BTreeMap<(String, String), EntryResult> = BTreeMap::new();
        for outcome in by_key.values().filter(|one| one.program == program) {
            let place = (outcome.unit.clone(), outcome.period.clone());
            if best.get(&place).is_none_or(|there| there.recordings < outcome.recordings) {
                best.insert(place, outcome.clone());
            }
        }
        for ((unit, period), outcome) in best {
            by_key.remove(&outcome.key);
            let (key, recordings) = (outcome.key.clone(), outcome.recordings);
            rows.push(row(&unit, &period, &key, recordings, Some(outcome), notes));
        }
    }
    rows.sort_by(|a, b| (&a.unit, &a.period, &a.key).cmp(&(&b.unit, &b.period, &b.key)));
    let mut trends: BTreeMap<String, Vec<Trend>> = BTreeMap::new();
    for of_unit in rows.chunk_by(|a, b| a.unit == b.unit) {
        let periods = of_unit.iter().filter_map(|row| Some((row.period.as_str(), row.found.as_ref()?)));
        let Some(first) = of_unit.first() else { continue };
        trends.insert(first.unit.clone(), ageing::trends(periods));
    }
    let limit = ageing::sum_up(trends.values_mut().flatten());
    Gathered { rows, trends, limit, superseded: by_key.into_keys().collect() }
}

fn row(
    unit: &str,
    period: &str,
    key: &str,
    recordings: usize,
    outcome: Option<EntryResult>,
    notes: &BTreeMap<String, Vec<String>>,
) -> Row {
    let (unit, period, key) = (unit.to_owned(), period.to_owned(), key.to_owned());
    let origins = outcome.as_ref().map(|one| one.origins.clone()).unwrap_or_default();
    match outcome {
        None => {
            let noted = notes.get(&key).map(|notes| notes.join("; ")).filter(|noted| !noted.is_empty());
            let words = noted.unwrap_or_else(|| "no result yet: not started, or its worker was killed".to_owned());
            Row {
                unit,
                period,
                key,
                status: Status::Missing,
                recordings,
                found: None,
                words,
                report: None,
                origins,
                work: None,
            }
        }
        Some(EntryResult { error, warnings, report, found, work, .. }) => {
            let status = if error.is_some() || found.is_none() { Status::Failed } else { Status::Done };
            let words = error.unwrap_or_else(|| warnings.join("; "));
            Row { unit, period, key, status, recordings, found, words, report, origins, work: Some(work) }
        }
    }
}

impl Gathered {
    /// How many entries stand so.
    pub fn count(&self, status: Status) -> usize {
        self.rows.iter().filter(|row| row.status == status).count()
    }

    /// The last period of a unit that was diagnosed.
    pub fn last_found(&self, unit: &str) -> Option<&Row> {
        let first = self.rows.partition_point(|row| row.unit.as_str() < unit);
        self.rows[first..].iter().take_while(|row| row.unit == unit).filter(|row| row.found.is_some()).last()
    }

    /// The rows of a unit, by period.
    pub(crate) fn of_unit<'a>(&'a self, unit: &'a str) -> impl Iterator<Item = &'a Row> {
        let first = self.rows.partition_point(|row| row.unit.as_str() < unit);
        self.rows[first..].iter().take_while(move |row| row.unit == unit)
    }

    /// Sizes that are beyond the limit in the last period in which they are determined.
    pub fn changed(&self) -> impl Iterator<Item = (&str, &Trend)> {
        self.trends.iter().flat_map(|(unit, trends)| {
            let changed = |trend: &&Trend| trend.points.last().is_some_and(|point| point.changed);
            trends.iter().filter(changed).map(move |trend| (unit.as_str(), trend))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(unit: &str, period: &str, seed: u64) -> Entry {
        let mut entry = Entry { unit: unit.into(), period: period.into(), ..Entry::default() };
        entry.options.seed = seed;
        entry.keyed("p")
    }

    fn done(entry: &Entry) -> EntryResult {
        EntryResult {
            found: Some(FoundCause { verdict: "no_gap".into(), ..FoundCause::default() }),
            ..EntryResult::of(entry, "p")
        }
    }

    #[test]
    fn every_entry_of_the_plan_is_a_row_whatever_became_of_it() {
        let plan = [entry("b", "1", 1), entry("a", "1", 2), entry("a", "2", 3)];
        let failed = EntryResult { error: Some("torn".into()), ..EntryResult::of(&plan[1], "p") };
        let stray = done(&entry("c", "1", 9));
        let notes = [(plan[2].key.clone(), vec!["store refused".to_owned()])].into();
        let mut outcomes = vec![done(&plan[0]), failed, stray.clone()];
        let gathered = gather(Some(&plan), outcomes.clone(), &notes, "p");
        let rows: Vec<_> =
            gathered.rows.iter().map(|row| (row.unit.as_str(), row.status, row.words.as_str())).collect();
        assert_eq!(
            rows,
            [("a", Status::Failed, "torn"), ("a", Status::Missing, "store refused"), ("b", Status::Done, "")]
        );
        assert_eq!(gathered.superseded, [stray.key]);
        outcomes.reverse();
        assert_eq!(gather(Some(&plan), outcomes, &notes, "p"), gathered, "the order of results makes no difference");
    }

    #[test]
    fn without_a_plan_the_fullest_result_of_this_program_counts() {
        let (one, other, old) = (entry("a", "1", 1), entry("a", "1", 2), entry("a", "1", 3));
        let fuller = EntryResult { recordings: 4, ..done(&other) };
        let older = EntryResult { recordings: 9, program: "q".into(), ..done(&old) };
        let gathered = gather(None, vec![done(&one), fuller, older], &BTreeMap::new(), "p");
        assert_eq!(gathered.rows.iter().map(|row| row.key.as_str()).collect::<Vec<_>>(), [other.key.as_str()]);
        assert_eq!(gathered.superseded.len(), 2);
    }
}
