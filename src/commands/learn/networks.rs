//! The networks of the comparison: their searches and estimates.

use std::process::Command;
use std::time::Instant;

use anyhow::Context;
use govtwin_correction::booster::Objective;
use govtwin_correction::deep::{NetworkKind, SPACE, residuals};
use govtwin_correction::split::{RowSplit, folds};
use govtwin_correction::table::FeatureTable;
use govtwin_lab::comparison::Contender;
use govtwin_lab::comparison::summary::Searched;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use super::journal::EvaluationJournal;
use super::{Args, SearchJob, search, searched};
use crate::commands::output::{Progress, print};

/// The processors that candle may use, as it reads them when it starts: one, for every fold.
const PROCESSORS: &str = "CANDLE_CPU_MASK";

/// In searches every so many-th row of a fold teaches and judges: a network takes ten times as long as trees.
const EVERY: usize = 4;

/// Starts the program anew with one thread for each network. Left alone, candle keeps one pool of threads that wait in a spin and serve one caller at
/// a time, and networks are trained side by side here: they take several times as long. The environment is all that it listens to.
pub fn one_thread_each() {
    #[cfg(unix)]
    if std::env::var_os(PROCESSORS).is_none() {
        use std::os::unix::process::CommandExt;

        let Ok(program) = std::env::current_exe() else { return };
        // This only returns where it failed; the networks are then slow, and nothing else.
        let _ = Command::new(program).args(std::env::args_os().skip(1)).env(PROCESSORS, "0").exec();
    }
}

/// Searches, trains and asks both networks by one seed; `budget` is the number of evaluations of each search.
pub fn compete(
    args: &Args,
    budget: usize,
    (table, split, seed): (&FeatureTable, &RowSplit, u64),
    (contenders, searches): (&mut Vec<Contender>, &mut Vec<Searched>),
) -> anyhow::Result<()> {
    let networks = [
        (NetworkKind::Lstm, "lstm", "BO-LSTM hybrid", "evaluations, LSTM"),
        (NetworkKind::Tcn, "tcn", "BO-TCN hybrid", "evaluations, TCN"),
    ];
    let folds = folds(table, &split.train);
    let initial = Args::initial(budget);
    for (kind, id, title, noun) in networks {
        let key = format!("{kind:?}, every {EVERY}");
        let mut journal = EvaluationJournal::open(&args.out.join("search.json"), table, &split.train, key, seed)?;
        let progress = Progress::new(budget, noun);
        let (mut done, search_start) = (0, now());
        let trials = search(&SPACE, "bayesian", [initial, budget], seed, |point| {
            let evaluate = || {
                done += 1;
                loss(kind, table, &folds, point, seed)
            };
            journal.loss(point, evaluate).inspect(|_| progress.step())
        })?;
        drop(progress);
        let search_s = search_start.elapsed().as_secs_f64();
        let job = SearchJob { id, kind: "bayesian", noun, objective: Objective::L1 };
        let found = searched(&SPACE, job, &trials);
        let best = found.best().context("no evaluation of the search succeeded")?.0.to_vec();
        searches.push(found);
        let fit_start = now();
        let said = residuals(kind, table, split, 1, &best, seed)?;
        let fit_s = fit_start.elapsed().as_secs_f64();
        print(&format!("{title}: {done} evaluations in {search_s:.0} s, trained in {fit_s:.1} s.\n"))?;
        let estimates = split.test.iter().zip(said).map(|(&row, residual)| table.marks[row].model + residual).collect();
        contenders.push(Contender { id, title, estimates });
    }
    Ok(())
}

#[expect(clippy::disallowed_methods, reason = "how long it took is said to the person who waits, and is no result")]
fn now() -> Instant {
    Instant::now()
}

/// Mean absolute error over the validation rows of all folds.
fn loss(kind: NetworkKind, table: &FeatureTable, folds: &[RowSplit], point: &[f64], seed: u64) -> anyhow::Result<f64> {
    let of = |fold: &RowSplit| -> anyhow::Result<(f64, usize)> {
        let said = residuals(kind, table, fold, EVERY, point, seed)?;
        let judged = fold.test.iter().step_by(EVERY).zip(&said);
        Ok((judged.map(|(&row, said)| (table.marks[row].residual() - said).abs()).sum(), said.len()))
    };
    let folds = folds.par_iter().map(of).collect::<anyhow::Result<Vec<_>>>()?;
    let (sum, count) = folds.iter().fold((0.0, 0), |(sum, count), (more, rows)| (sum + more, count + rows));
    Ok(sum / count as f64)
}
