//! Rows in the order of time: files list them newest first, one signal after the other, or in parts, and a bag wants them as time went on.

use crate::import::row::{ImportedRow, Target};
use govtwin_model::units::seconds_from_nanos;

/// So many rows are put in order in memory: 0.7 GB.
pub(super) const MOST_SORTED: usize = 10_000_000;
/// A row that is late by less is one of a logger with several inputs, ns.
const LATE_NS: i64 = 2_000_000_000;
/// Where this share of all steps goes back, the newest row stands first.
const NEWEST_FIRST: f64 = 0.9;

/// How the rows of a file follow each other, and what was done about it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RowOrder {
    /// The newest row stood first.
    pub(super) newest_first: bool,
    /// Jumps back in time, each counted once however many rows follow.
    pub(super) jumps: u64,
    /// Rows that are late by little, and by how much at most, ns.
    pub(super) late: u64,
    pub(super) most_late_ns: i64,
}

/// Steps of time from row to row.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Steps {
    last_ns: Option<i64>,
    forward: u64,
    back: u64,
}

impl Steps {
    pub(super) fn take(&mut self, time_ns: i64) {
        match self.last_ns.map(|last_ns| time_ns.cmp(&last_ns)) {
            Some(std::cmp::Ordering::Less) => self.back += 1,
            Some(std::cmp::Ordering::Greater) => self.forward += 1,
            _ => {}
        }
        self.last_ns = Some(time_ns);
    }

    /// Time never goes back.
    pub(super) fn rises(&self) -> bool {
        self.back == 0
    }
}

/// Puts rows in the order of time; rows of one time that hold different signals become one.
///
/// # Errors
/// In words, where time goes back to where rows were before: which of them came first is then not known.
pub(super) fn sort(rows: &mut Vec<ImportedRow>) -> Result<RowOrder, String> {
    let of = |target: Target| rows.iter().filter(move |row| row.value(target).is_some()).map(|row| row.time_ns);
    let mut all = Steps::default();
    for target in Target::ALL {
        // A table that lists one signal after the other goes back from one to the next.
        let mut own = Steps::default();
        of(target).for_each(|time_ns| own.take(time_ns));
        (all.forward, all.back) = (all.forward + own.forward, all.back + own.back);
    }
    let newest_first = all.back as f64 > NEWEST_FIRST * (all.forward + all.back).max(1) as f64;
    if newest_first {
        rows.reverse();
    }
    let mut order = RowOrder { newest_first, ..RowOrder::default() };
    for target in Target::ALL {
        let times = rows.iter().filter(|row| row.value(target).is_some()).map(|row| row.time_ns);
        let own = check(times).map_err(|problem| format!("{}: {problem}", target.id()))?;
        if own.jumps > 0 {
            let samples = rows.iter().filter_map(|row| Some((row.time_ns, row.value(target)?)));
            goes_on(&samples.collect::<Vec<_>>()).map_err(|problem| format!("{}: {problem}", target.id()))?;
        }
        order.jumps = order.jumps.max(own.jumps);
        order.late = order.late.max(own.late);
        order.most_late_ns = order.most_late_ns.max(own.most_late_ns);
    }
    rows.sort_by_key(|row| row.time_ns);
    let mut merged: Vec<ImportedRow> = Vec::with_capacity(rows.len());
    // Of rows of one time, the first of each signal become one, then the second of each, as they stood beside each other.
    let (mut begin, mut next) = (0, [0_usize; Target::ALL.len()]);
    for row in rows.drain(..) {
        if merged.get(begin).is_some_and(|first| first.time_ns != row.time_ns) {
            (begin, next) = (merged.len(), [0; Target::ALL.len()]);
        }
        let holds = || Target::ALL.into_iter().filter(|target| row.value(*target).is_some()).map(Target::place);
        let at = begin + holds().map(|place| next[place]).max().unwrap_or(0);
        holds().for_each(|place| next[place] = at - begin + 1);
        if !merged.get_mut(at).is_some_and(|known| known.merge(&row)) {
            merged.push(row);
        }
    }
    *rows = merged;
    Ok(order)
}

/// A stretch in which time goes on.
struct Part {
    first_ns: i64,
    last_ns: i64,
}

/// Counts the jumps back of one signal; an error where what follows one lies among what was before it.
fn check(times_ns: impl Iterator<Item = i64>) -> Result<RowOrder, String> {
    let mut parts: Vec<Part> = vec![];
    let (mut late, mut most_late_ns, mut before_ns) = (0, 0, i64::MIN);
    for time_ns in times_ns {
        match parts.last_mut().filter(|part| time_ns >= part.last_ns.saturating_sub(LATE_NS)) {
            Some(part) => {
                // Steps back are counted, not the rows that follow them.
                late += u64::from(time_ns < before_ns);
                most_late_ns = most_late_ns.max(part.last_ns.saturating_sub(time_ns));
                part.first_ns = part.first_ns.min(time_ns);
                part.last_ns = part.last_ns.max(time_ns);
            }
            None => parts.push(Part { first_ns: time_ns, last_ns: time_ns }),
        }
        before_ns = time_ns;
    }
    let jumps = parts.len().saturating_sub(1) as u64;
    parts.sort_by_key(|part| part.first_ns);
    if let Some(pair) = parts.windows(2).find(|pair| pair[1].first_ns <= pair[0].last_ns) {
        let back_s = seconds_from_nanos(pair[0].last_ns - pair[1].first_ns);
        return Err(format!(
            "time goes back {jumps} times, once by {back_s:.3} s to where there are rows already, so that their order is not known: \
             several recordings in one file, a counter that began anew, or the end of summer time; split the file where time goes back, \
             or give the `zone` of local times"
        ));
    }
    Ok(RowOrder { newest_first: false, jumps, late, most_late_ns })
}

/// Values that differ by so many times the usual step are not beside each other.
const APART: f64 = 10.0;

/// Fails where values go on although time goes back, and would not in the order of time: a clock began anew there, and no part stands in another place.
fn goes_on(samples: &[(i64, f64)]) -> Result<(), String> {
    let mut parts: Vec<&[(i64, f64)]> =
        samples.chunk_by(|before, after| after.0 >= before.0.saturating_sub(LATE_NS)).collect();
    let mut steps: Vec<f64> =
        parts.iter().flat_map(|part| part.windows(2).map(|pair| (pair[1].1 - pair[0].1).abs())).collect();
    steps.sort_by(f64::total_cmp);
    // The usual step is that of all but one in a hundred: signals rest most of the time.
    let usual = steps.get(steps.len() * 99 / 100).copied().unwrap_or(0.0);
    let seam = |pair: &[&[(i64, f64)]]| Some((pair[1].first()?.1 - pair[0].last()?.1).abs());
    let as_written = parts.windows(2).filter_map(seam).fold(0.0, f64::max);
    let back_ns = parts.windows(2).find_map(|pair| Some(pair[0].last()?.0 - pair[1].first()?.0)).unwrap_or(0);
    parts.sort_by_key(|part| part[0].0);
    let in_order = parts.windows(2).filter_map(seam).fold(0.0, f64::max);
    if usual > 0.0 && as_written <= 2.0 * usual && in_order > APART * usual {
        return Err(format!(
            "time goes back by {:.3} s, and values go on there as if it did not: a counter or a clock of 12 hours that began anew, or the end of summer \
             time; give the `zone` of local times, or export times with their date",
            seconds_from_nanos(back_ns)
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(times_s: &[i64], target: Target) -> Vec<ImportedRow> {
        let row = |time_s: &i64| {
            let mut row = ImportedRow::at(time_s * 1_000_000_000);
            row.set(target, *time_s as f64);
            row
        };
        times_s.iter().map(row).collect()
    }

    fn sorted(mut rows: Vec<ImportedRow>) -> Result<(Vec<i64>, RowOrder), String> {
        let order = sort(&mut rows)?;
        Ok((rows.iter().map(|row| row.time_ns / 1_000_000_000).collect(), order))
    }

    #[test]
    fn rows_of_every_order_come_in_the_order_of_time() {
        let one = |times_s: &[i64]| sorted(rows(times_s, Target::ServomotorPosition)).unwrap();
        assert_eq!(one(&[9, 8, 7, 6]), (vec![6, 7, 8, 9], RowOrder { newest_first: true, ..RowOrder::default() }));
        assert_eq!(
            one(&[20, 21, 22, 1, 2, 3]),
            (vec![1, 2, 3, 20, 21, 22], RowOrder { jumps: 1, ..RowOrder::default() })
        );
        assert_eq!(one(&[1, 3, 2, 4]).0, [1, 2, 3, 4], "a late row");
        let by_signal =
            [rows(&[1, 2, 3], Target::SpoolPosition), rows(&[1, 2, 3], Target::ServomotorPosition)].concat();
        let mut together = by_signal;
        sort(&mut together).unwrap();
        assert_eq!(together.len(), 3);
        assert!(together.iter().all(|row| row.value(Target::SpoolPosition) == row.value(Target::ServomotorPosition)));
    }

    #[test]
    fn rows_of_one_time_stand_beside_each_other_by_their_number() {
        let mut both =
            [rows(&[1, 1, 2], Target::SpoolPosition), rows(&[1, 1, 2, 2], Target::ServomotorPosition)].concat();
        sort(&mut both).unwrap();
        let of = |target: Target| both.iter().map(|row| row.value(target).is_some()).collect::<Vec<_>>();
        assert_eq!(of(Target::SpoolPosition), [true, true, true, false]);
        assert_eq!(of(Target::ServomotorPosition), [true; 4]);
    }

    #[test]
    fn a_clock_that_begins_anew_is_no_other_order() {
        let ramp = |times_s: &[i64], value: &dyn Fn(usize) -> f64| {
            let mut rows = rows(times_s, Target::ServomotorPosition);
            rows.iter_mut().enumerate().for_each(|(k, row)| row.set(Target::ServomotorPosition, value(k)));
            sort(&mut rows)
        };
        let minute: Vec<i64> = (20..60).chain(0..20).collect();
        let words = ramp(&minute, &|k| k as f64).unwrap_err();
        assert!(words.contains("time goes back by 59.000 s") && words.contains("began anew"), "{words}");
        // The same times of a file whose second part is the earlier one.
        assert_eq!(ramp(&minute, &|k| minute[k] as f64).unwrap().jumps, 1);
    }

    #[test]
    fn what_would_be_mixed_up_is_asked() {
        for times_s in [&[0, 10, 20, 30, 5, 15, 25][..], &[3600, 5400, 7199, 3601, 5401, 7200]] {
            let words = sorted(rows(times_s, Target::ServomotorPosition)).unwrap_err();
            assert!(words.contains("time goes back 1 times") && words.contains("split the file"), "{words}");
        }
    }
}
