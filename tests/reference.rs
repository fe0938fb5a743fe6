//! The figures that `docs/benchmarks.md` quotes: replays of shipped recordings stay within stated bounds.
//!
//! The recordings are synthetic; see `bags/ORIGIN.txt`. The bounds stand a tenth above what the twin
//! reached with the shipped parameters when they were written down.

use std::path::Path;

use govtwin_bag::ReadOptions;
use govtwin_model::recording::Process;
use govtwin_model::replay::{Replayed, Scores};
use govtwin_model::signal::Signal;
use govtwin_model::twin::{Cut, Twin};
use rayon::iter::{IntoParallelIterator, ParallelIterator};

/// Recordings of a folder under `bags/`, replayed with the shipped parameters.
fn replay(folder: &str, cut: Cut) -> Vec<Replayed> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags").join(folder);
    let mut paths: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.retain(|path| path.extension().is_some_and(|suffix| suffix == "mcap"));
    paths.sort();
    let twin = Twin::new(&govtwin_model::params::reference()).with_cut(cut);
    let one = |path: std::path::PathBuf| {
        Replayed::new(&mut twin.clone(), govtwin_bag::read(&path, &ReadOptions::default()).unwrap().recording)
    };
    paths.into_par_iter().map(one).collect()
}

fn scores(replayed: &[Replayed], process: Option<Process>) -> Scores {
    let mut scores = Scores::default();
    for one in replayed.iter().filter(|one| process.is_none_or(|process| one.recording.process == process)) {
        scores.merge(&one.scores);
    }
    scores
}

/// RMSE, pu, of servomotor and spool.
fn rmse_pu(scores: &Scores) -> [f64; 2] {
    [Signal::ServomotorPosition, Signal::SpoolPosition].map(|signal| scores.figures(signal).rmse)
}

#[track_caller]
fn within(found: [f64; 2], bounds: [f64; 2]) {
    assert!(found[0] <= bounds[0] && found[1] <= bounds[1], "found {found:?}, bounds {bounds:?}");
}

#[test]
fn the_reference_unit_at_5_hz() {
    let replayed = replay("reference", Cut::None);
    let overall = scores(&replayed, None);
    assert_eq!(overall.figures(Signal::SpoolPosition).count, 23_293);
    within(rmse_pu(&overall), [0.00155, 0.0525]);
    within(rmse_pu(&scores(&replayed, Some(Process::Startup))), [0.0010, 0.0445]);
    within(rmse_pu(&scores(&replayed, Some(Process::LoadIncrease))), [0.0012, 0.0626]);
    within(rmse_pu(&scores(&replayed, Some(Process::Shutdown))), [0.0018, 0.0490]);
    within(rmse_pu(&scores(&replayed, Some(Process::LoadRejection))), [0.0021, 0.0453]);
    assert!(overall.figures(Signal::ServomotorPosition).r2 > 0.9999);
    assert!(overall.figures(Signal::SpoolPosition).r2 > 0.975);
}

#[test]
fn a_unit_without_effects_at_100_hz() {
    let overall = scores(&replay("practice/case_01", Cut::None), None);
    within(rmse_pu(&overall), [0.0021, 0.0193]);
    let cut = scores(&replay("practice/case_01", Cut::Servomotor), None);
    within([0.0, rmse_pu(&cut)[1]], [0.0, 0.0109]);
}
