//! What a learned residual costs: a step of 1 ms with and without it and its percentiles, a row through LightGBM's own calls, training and search.
//!
//! `cargo bench --features residual --bench residual -- BAG…`: by default on `bags/reference`, the synthetic recordings.

use std::hint::black_box;
use std::path::PathBuf;
use std::time::Instant;

use govtwin_bag::ReadOptions;
use govtwin_correction::booster::{Hyperparameters, Reference};
use govtwin_correction::corrector::Corrector;
use govtwin_correction::features;
use govtwin_correction::model::{Learned, Model};
use govtwin_correction::prepare::prepare;
use govtwin_correction::row::{Opening, RateOfInputs};
use govtwin_correction::search::bayesian;
use govtwin_correction::split::{folds, seven_to_three};
use govtwin_correction::table::{TableLayout, table};
use govtwin_correction::training::{self, GuardKind, Recipe};
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::recording::Recording;
use govtwin_model::replay::simulate;
use govtwin_model::signal::Signal;
use govtwin_model::twin::Twin;

/// Percentiles of durations, us.
fn told(name: &str, mut ns: Vec<u64>) {
    ns.sort_unstable();
    let at = |share: f64| ns[((ns.len() - 1) as f64 * share) as usize] as f64 * 1e-3;
    let (middle, p99, worst) = (at(0.5), at(0.99), at(1.0));
    println!(
        "{name:<50} median {middle:>8.2} us   p99 {p99:>8.2} us   p99.9 {:>8.2} us   worst {worst:>8.1} us",
        at(0.999)
    );
}

fn recordings() -> Vec<Recording> {
    let given: Vec<PathBuf> =
        std::env::args().skip(1).filter(|word| !word.starts_with("--")).map(PathBuf::from).collect();
    let paths = if given.is_empty() {
        let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("bags/reference");
        let mut paths: Vec<PathBuf> = folder.read_dir().unwrap().map(|entry| entry.unwrap().path()).collect();
        paths.sort();
        paths
    } else {
        given
    };
    paths.iter().map(|path| govtwin_bag::read(path, &ReadOptions::default()).unwrap().recording).collect()
}

/// A minute of a moving unit, a frame each millisecond.
fn minute() -> Vec<Frame> {
    let frame = |k: i64| {
        let time_s = k as f64 * 1e-3;
        let opening_command_pu = 0.5 + 0.2 * (0.4 * time_s).sin() + 0.05 * (2.1 * time_s).sin();
        let inputs = Inputs { opening_command_pu, esv: EsvState::Normal, tank_pressure_pa: 6.2e6, piston_force_n: 0.0 };
        let spool_position_pu = if k % 10 == 0 { 0.05 * (0.4 * time_s).cos() } else { f64::NAN };
        Frame { time_ns: k * 1_000_000, inputs, measured: Signals { spool_position_pu, ..Signals::NONE } }
    };
    (0..60_000).map(frame).collect()
}

fn timed<T>(ns: &mut Vec<u64>, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let out = work();
    ns.push(u64::try_from(start.elapsed().as_nanos()).unwrap());
    out
}

/// A step of 1 ms with a model, without and with adaptation.
fn steps(name: &str, twin: &Twin, model: &Model, frames: &[Frame]) {
    let nodes: usize = model.trees.iter().map(|tree| tree.feature.len()).sum();
    println!("{name}: {} trees, {nodes} nodes", model.trees.len());
    for adapts in [false, true] {
        let mut corrector = Corrector::new(model).unwrap();
        if adapts {
            corrector = corrector.adapting(model).unwrap();
        }
        let (mut whole, mut both, mut correction) = (twin.clone(), vec![], vec![]);
        let mut apart = (twin.clone(), corrector.clone());
        for frame in frames {
            black_box(timed(&mut both, || {
                let estimate = whole.step(frame);
                corrector.step(frame, &estimate)
            }));
            let estimate = apart.0.step(frame);
            black_box(timed(&mut correction, || apart.1.step(frame, &estimate)));
        }
        let more = if adapts { " + adaptation" } else { "" };
        told(&format!("features + trees + guard{more}"), correction);
        told(&format!("twin + features + trees + guard{more}"), both);
    }
}

fn recipe(with: &Hyperparameters) -> Recipe<'_> {
    Recipe { learned: Learned::Residual, with, seed: 1 }
}

fn main() {
    let unit = govtwin_model::params::reference();
    let prepared = prepare(recordings(), Signal::SpoolPosition);
    let twin = Twin::new(&unit);
    let estimates: Vec<_> = prepared.recordings.iter().map(|one| simulate(&mut twin.clone(), one)).collect();
    let (signal, opening, rate_of_inputs) = (Signal::SpoolPosition, Opening::Simulated, RateOfInputs::Hold);
    let layout = TableLayout { signal, opening, rate_of_inputs, period_ns: 200_000_000, features: features::all() };
    let start = Instant::now();
    let table = table(&prepared.recordings, &estimates, layout);
    println!("features of {} rows: {:.2} s", table.marks.len(), start.elapsed().as_secs_f64());
    let split = seven_to_three(&table);

    let start = Instant::now();
    let model =
        training::model(&table, &split.train, recipe(&Hyperparameters::MANUAL), &unit, GuardKind::Range).unwrap();
    let trees = model.trees.len();
    let nodes: usize = model.trees.iter().map(|tree| tree.feature.len()).sum();
    println!("training with its band, {trees} trees, {nodes} nodes: {:.1} s", start.elapsed().as_secs_f64());

    let frames = minute();
    let mut bare = vec![];
    let mut alone = twin.clone();
    for frame in &frames {
        black_box(timed(&mut bare, || alone.step(frame)));
    }
    told("twin, 1 ms", bare);
    steps("manual model", &twin, &model, &frames);
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("params/reference_unit.residual");
    let searched = Model::from_text(&std::fs::read_to_string(path).unwrap()).unwrap();
    steps("params/reference_unit.residual", &twin, &searched, &frames);

    let width = table.layout.features.len();
    let targets = training::targets(&table, &split.train, Learned::Residual);
    let values = table.select(&split.train);
    let reference = Reference::train(&values, width, &targets, &Hyperparameters::MANUAL, 1).unwrap();
    let forest = model.forest().unwrap();
    let (mut own, mut fast, mut plain) = (vec![], vec![], vec![]);
    for row in values.chunks_exact(width).take(5000) {
        let value = timed(&mut own, || forest.value(black_box(row)));
        assert_eq!(value.to_bits(), timed(&mut fast, || reference.fast(black_box(row))).to_bits());
        assert_eq!(value.to_bits(), timed(&mut plain, || reference.plain(black_box(row))).to_bits());
    }
    told("one row: this house's trees", own);
    told("one row: LightGBM's fast single-row path", fast);
    told("one row: LightGBM's plain call", plain);

    let folds = folds(&table, &split.train);
    let start = Instant::now();
    let evaluate = |point: &[f64]| training::loss(&table, &folds, recipe(&training::at(point)));
    let trials = bayesian(&training::SPACE, 5, 10, 1, evaluate).unwrap();
    let seconds_s = start.elapsed().as_secs_f64();
    println!("Bayesian optimisation, {} evaluations of 5 folds: {seconds_s:.1} s", trials.len());
}
