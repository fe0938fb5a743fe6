//! Training and test rows: 7:3 by time, and five folds by time inside the training part, without leakage.
//!
//! Each process is cut by itself, so that every process is on both sides: its rows in time order, the first
//! 70 % are for training. Where a cut falls inside a recording, the rows behind it whose windows still reach across are left out on the side
//! for testing. A fold's validation rows lie behind all its training rows of the same process (expanding window).

use super::history::PAST;
use super::table::FeatureTable;
use govtwin_model::recording::Process;

/// Share of each process's rows for training.
const TRAINING_SHARE: f64 = 0.7;

/// Folds of the cross-validation.
const FOLDS: usize = 5;

/// Rows by their index in the table.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RowSplit {
    /// Training rows.
    pub train: Vec<usize>,
    /// Test rows.
    pub test: Vec<usize>,
    /// Rows left out because their windows reach across the cut.
    pub purged: usize,
}

/// The 7:3 split of all rows.
pub fn seven_to_three(table: &FeatureTable) -> RowSplit {
    let all: Vec<usize> = (0..table.marks.len()).collect();
    let mut split = RowSplit::default();
    for rows in by_process(table, &all) {
        let cut = share_of(rows.len(), TRAINING_SHARE);
        judge_behind(table, &rows[..cut], &rows[cut..], &mut split);
    }
    split
}

/// The five folds of training rows: each process in six blocks, of which the first `k` are for training and the next one for testing.
pub fn folds(table: &FeatureTable, train: &[usize]) -> Vec<RowSplit> {
    let mut folds = vec![RowSplit::default(); FOLDS];
    for rows in by_process(table, train) {
        let edge = |block: usize| rows.len() * block / (FOLDS + 1);
        for (k, fold) in folds.iter_mut().enumerate() {
            judge_behind(table, &rows[..edge(k + 1)], &rows[edge(k + 1)..edge(k + 2)], fold);
        }
    }
    folds
}

/// All rows of other processes for training, those of one for testing: how well a model extrapolates to an unseen process.
pub fn without_process(table: &FeatureTable, process: Process) -> RowSplit {
    without(table, &(0..table.marks.len()).collect::<Vec<_>>(), process)
}

/// The same among some rows.
pub fn without(table: &FeatureTable, rows: &[usize], process: Process) -> RowSplit {
    let (test, train) = rows.iter().partition(|&&row| table.marks[row].process == process);
    RowSplit { train, test, purged: 0 }
}

/// Rows of each process in time order.
fn by_process(table: &FeatureTable, rows: &[usize]) -> Vec<Vec<usize>> {
    let of = |process: Process| {
        let mut own: Vec<usize> = rows.iter().copied().filter(|&row| table.marks[row].process == process).collect();
        own.sort_by_key(|&row| (table.marks[row].time_ns, table.marks[row].recording));
        own
    };
    Process::ALL.into_iter().map(of).collect()
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a share below one of a count of rows")]
fn share_of(count: usize, share: f64) -> usize {
    (count as f64 * share).round() as usize
}

/// Adds training rows, and the later ones for testing except those whose windows reach across.
fn judge_behind(table: &FeatureTable, train: &[usize], behind: &[usize], split: &mut RowSplit) {
    split.train.extend(train);
    let reach_ns = i64::try_from(PAST).unwrap_or(i64::MAX).saturating_mul(table.layout.period_ns);
    let last = train.last().map(|&row| table.marks[row]);
    for &row in behind {
        let mark = table.marks[row];
        let reaches_across =
            last.is_some_and(|last| last.recording == mark.recording && mark.time_ns - last.time_ns <= reach_ns);
        if reaches_across {
            split.purged += 1;
        } else {
            split.test.push(row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{FOLDS, RowSplit, folds, seven_to_three, without_process};
    use crate::history::PAST;
    use crate::table::FeatureTable;
    use crate::table::tests::{of, recording};
    use govtwin_model::recording::Process;

    fn table() -> FeatureTable {
        let recordings: Vec<_> = (0..4).map(|k| recording(&format!("{k}"), 1000 * k, 300, |_, _| 0.01)).collect();
        let mut table = of(&recordings);
        for mark in &mut table.marks {
            mark.process = if mark.recording < 2 { Process::Startup } else { Process::Shutdown };
        }
        table
    }

    /// Test rows whose windows contain a training row, or that are before one of their process.
    fn leaks(table: &FeatureTable, split: &RowSplit) -> usize {
        let reach_ns = i64::try_from(PAST).unwrap() * table.layout.period_ns;
        let leaks = |&&row: &&usize| {
            let judge = table.marks[row];
            split.train.iter().map(|&row| table.marks[row]).any(|teacher| {
                let inside = teacher.recording == judge.recording && judge.time_ns - teacher.time_ns <= reach_ns;
                inside || (teacher.process == judge.process && teacher.time_ns >= judge.time_ns)
            })
        };
        split.test.iter().filter(leaks).count()
    }

    #[test]
    fn seven_teach_three_judge_in_every_process_and_nothing_leaks() {
        let table = table();
        let split = seven_to_three(&table);
        assert_eq!(split.train.len() + split.test.len() + split.purged, 1200);
        assert_eq!((split.train.len(), split.purged), (840, 2 * PAST));
        for process in [Process::Startup, Process::Shutdown] {
            assert!(split.test.iter().any(|&row| table.marks[row].process == process));
        }
        assert_eq!(leaks(&table, &split), 0);
    }

    #[test]
    fn folds_judge_behind_what_teaches() {
        let table = table();
        let train = seven_to_three(&table).train;
        let folds = folds(&table, &train);
        assert_eq!(folds.len(), FOLDS);
        for pair in folds.windows(2) {
            assert!(pair[0].train.len() < pair[1].train.len());
        }
        for fold in &folds {
            assert!(!fold.test.is_empty());
            assert_eq!(leaks(&table, fold), 0);
            assert!(fold.train.iter().chain(&fold.test).all(|row| train.contains(row)));
        }
    }

    #[test]
    fn the_leak_test_sees_a_leak() {
        let table = table();
        let mut split = seven_to_three(&table);
        // Put the purged rows back, as a split that forgot about windows would.
        let rest = |row: &usize| !split.train.contains(row) && !split.test.contains(row);
        let purged: Vec<usize> = (0..1200).filter(rest).collect();
        split.test.extend(purged);
        assert_eq!(leaks(&table, &split), 2 * PAST);
        // And a shuffled split.
        let every_other =
            RowSplit { train: (0..1200).step_by(2).collect(), test: (1..1200).step_by(2).collect(), purged: 0 };
        assert!(leaks(&table, &every_other) > 500);
    }

    #[test]
    fn a_process_left_out_is_unseen() {
        let table = table();
        let split = without_process(&table, Process::Shutdown);
        assert_eq!((split.train.len(), split.test.len()), (600, 600));
        assert!(split.train.iter().all(|&row| table.marks[row].process == Process::Startup));
    }
}
