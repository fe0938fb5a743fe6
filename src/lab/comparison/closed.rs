//! The additive residual against the one inside the loop, in closed-loop free run: without measured inputs, and both positions are evaluated.

use std::sync::Arc;

use super::Contender;
use super::contenders::estimates;
use super::inloop::{self, FEATURES, Pull, at, features};
use super::summary::{FreeRunFigures, ModelFigures};
use govtwin_correction::booster::{Hyperparameters, TrainError, grow};
use govtwin_correction::forest::Forest;
use govtwin_correction::guard::Guard;
use govtwin_correction::model::Learned;
use govtwin_correction::split::RowSplit;
use govtwin_correction::table::FeatureTable;
use govtwin_correction::training::{self, Recipe, targets, walkable};
use govtwin_model::effects;
use govtwin_model::frame::Estimate;
use govtwin_model::parameters::Unit;
use govtwin_model::plant::Plant;
use govtwin_model::recording::Recording;
use govtwin_model::replay::between::drawn;
use govtwin_model::replay::simulate;
use govtwin_model::signal::Signal;
use govtwin_model::solver::Method;
use govtwin_model::twin::Twin;
use govtwin_model::units::seconds_from_nanos;

/// Gain of the pull to the recorded spool, 1/s.
const PULL_1_S: f64 = 30.0;

/// Rows of features with the rate that the twin misses there, m/s; index of the frame beside each.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pulled {
    /// Features, row by row.
    pub values: Vec<f64>,
    /// Missing rate, m/s.
    pub targets: Vec<f64>,
    /// Frame of each row.
    pub frames: Vec<usize>,
}

/// Pulls a twin along a recorded spool. Where rows are slow, draw the inputs in between them first
/// ([`govtwin_model::replay::between`]): the pull would learn their lag.
pub fn pull(unit: &Unit, recording: &Recording) -> Pulled {
    let mut plant = plant(unit);
    let start_ns = recording.frames.first().map_or(0, |frame| frame.time_ns);
    let path = recording.frames.iter().filter(|frame| frame.measured.spool_position_pu.is_finite()).map(|frame| {
        let time_s = seconds_from_nanos(frame.time_ns - start_ns);
        [time_s, plant.spool.position_m(frame.measured.spool_position_pu)]
    });
    let path: Vec<[f64; 2]> = path.collect();
    plant.terms.push(Arc::new(Pull { path: path.clone(), area_m2: plant.spool.control_area_m2, gain_1_s: PULL_1_S }));
    let mut twin = Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, Method::default());
    let mut pulled = Pulled::default();
    for (index, frame) in recording.frames.iter().enumerate() {
        let _ = twin.step(frame);
        let time_s = seconds_from_nanos(frame.time_ns - start_ns);
        let missing_m_s = PULL_1_S * (at(&path, time_s) - twin.state().spool_position_m);
        let row = features(twin.state(), frame.inputs.tank_pressure_pa);
        if frame.measured.spool_position_pu.is_finite()
            && missing_m_s.is_finite()
            && row.iter().all(|value| value.is_finite())
        {
            pulled.values.extend(row);
            pulled.targets.push(missing_m_s);
            pulled.frames.push(index);
        }
    }
    pulled
}

/// A twin with what was learned inside it.
pub fn twin(unit: &Unit, forest: Forest, guard: Guard) -> Twin {
    let mut plant = plant(unit);
    plant.terms.push(Arc::new(inloop::LearnedSpoolRate { forest, guard, area_m2: plant.spool.control_area_m2 }));
    Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, Method::default())
}

fn plant(unit: &Unit) -> Plant {
    let mut plant = Plant::new(&unit.parameters);
    effects::apply(unit, &mut plant);
    plant
}

/// Trains both residuals with the manual hyperparameters on the training rows, and evaluates them on the others, guarded, beside the twin
/// alone. An additive residual of the spool cannot reach the servomotor.
///
/// The table must have been made of these recordings, in closed loop, with inputs that run straight between rows on a grid of `grid_ns`.
///
/// # Errors
/// Where a model cannot be trained.
pub fn closed_loop(
    unit: &Unit,
    (recordings, grid_ns): (&[Recording], i64),
    table: &FeatureTable,
    split: &RowSplit,
    seed: u64,
    mut done: impl FnMut(),
) -> Result<FreeRunFigures, TrainError> {
    let recipe = Recipe { learned: Learned::Residual, with: &Hyperparameters::MANUAL, seed };
    let forest = training::forest(table, &split.train, recipe)?;
    let width = table.layout.features.len();
    let guard = Guard::of(&table.select(&split.train), width, &targets(table, &split.train, Learned::Residual));
    let additive = estimates(&forest, table, &split.test, Learned::Residual, Some(&guard));
    done();

    let drawn: Vec<(Recording, Vec<usize>)> = recordings.iter().map(|one| drawn(one, grid_ns)).collect();
    let mut teaches: Vec<Vec<bool>> = drawn.iter().map(|(one, _)| vec![false; one.frames.len()]).collect();
    for mark in split.train.iter().map(|&row| &table.marks[row]) {
        teaches[mark.recording][drawn[mark.recording].1[mark.frame]] = true;
    }
    let (mut values, mut missing) = (vec![], vec![]);
    for ((recording, _), teaches) in drawn.iter().zip(&teaches) {
        let pulled = pull(unit, recording);
        for (row, _) in pulled.frames.iter().enumerate().filter(|(_, frame)| teaches[**frame]) {
            values.extend(&pulled.values[row * FEATURES..(row + 1) * FEATURES]);
            missing.push(pulled.targets[row]);
        }
    }
    done();
    let grown = grow(&values, FEATURES, &missing, &Hyperparameters::MANUAL, seed)?;
    let inside = twin(unit, walkable(&grown.trees, FEATURES)?, Guard::of(&values, FEATURES, &missing));
    let run =
        |twin: &Twin| -> Vec<Vec<Estimate>> { drawn.iter().map(|(one, _)| simulate(&mut twin.clone(), one)).collect() };
    let (free, plain) = (run(&inside), run(&Twin::new(unit)));
    done();

    let of = |estimates: &[Vec<Estimate>], signal: Signal| -> Vec<f64> {
        let marks = split.test.iter().map(|&row| &table.marks[row]);
        marks.map(|mark| signal.of(&estimates[mark.recording][drawn[mark.recording].1[mark.frame]].signals)).collect()
    };
    let contender = |id, title, estimates| Contender { id, title, estimates };
    let field = |signal: Signal, additive: Vec<f64>| {
        let judged = judged(table, recordings, signal);
        let contenders = [
            contender("mbm", "MBM, inputs drawn in", of(&plain, signal)),
            contender("additive", "additive residual", additive),
            contender("inside", "residual inside the loop", of(&free, signal)),
        ];
        contenders.map(|one| ModelFigures::of(&judged, &split.test, &one)).to_vec()
    };
    let untouched = of(&plain, Signal::ServomotorPosition);
    Ok(FreeRunFigures {
        spool: field(Signal::SpoolPosition, additive),
        servomotor: field(Signal::ServomotorPosition, untouched),
    })
}

/// The same rows with another measured signal.
fn judged(table: &FeatureTable, recordings: &[Recording], signal: Signal) -> FeatureTable {
    let mut marks = table.marks.clone();
    for mark in &mut marks {
        mark.measured = signal.of(&recordings[mark.recording].frames[mark.frame].measured);
    }
    FeatureTable { layout: table.layout.clone(), values: vec![], marks, left_out: table.left_out }
}

#[cfg(test)]
mod tests {
    use super::{FEATURES, pull, twin};
    use crate::comparison::tests::made;
    use govtwin_correction::forest::{Forest, Tree};
    use govtwin_correction::guard::Guard;
    use govtwin_model::recording::Recording;
    use govtwin_model::replay::simulate;
    use govtwin_model::twin::Twin;

    /// A wavy command; the recorded spool is off the twin's by `gap_pu`.
    fn recording(rows: i64, gap_pu: f64) -> Recording {
        let (mut recording, _) = made(rows);
        recording.frames.iter_mut().for_each(|frame| frame.measured.spool_position_pu += gap_pu);
        recording
    }

    #[test]
    fn a_twin_is_pulled_to_the_side_on_which_the_recorded_spool_stands() {
        let unit = govtwin_model::params::reference();
        let own = recording(300, 0.0);
        let pulled = pull(&unit, &own);
        assert_eq!((pulled.targets.len(), pulled.values.len()), (300, 300 * FEATURES));
        // A spool that is always off pulls always, to its side.
        let mean = |gap: f64| {
            let targets = pull(&unit, &recording(300, gap)).targets;
            targets.iter().sum::<f64>() / targets.len() as f64
        };
        let [below, level, above] = [-0.05, 0.0, 0.05].map(mean);
        assert!(below < 5.0 * -level.abs() && above > 5.0 * level.abs(), "{below}, {level}, {above}");
    }

    #[test]
    fn trees_that_say_nothing_leave_the_twin_as_it_was_to_the_bit_and_others_move_the_spool() {
        let unit = govtwin_model::params::reference();
        let rows = recording(100, 0.0);
        let plain = simulate(&mut Twin::new(&unit), &rows);
        let with = |rate_m_s: f64| {
            let leaf = vec![rate_m_s, rate_m_s];
            let tree = Tree { feature: vec![0], threshold: vec![0.0], left: vec![-1], right: vec![-2], leaf };
            let guard = Guard { support: vec![[-1e12, 1e12]; FEATURES], range: [-0.01, 0.01], reach: None };
            simulate(&mut twin(&unit, Forest::new(&[tree], FEATURES).unwrap(), guard), &rows)
        };
        assert!(with(0.0) == plain);
        let apart = |(a, b): (&govtwin_model::frame::Estimate, &govtwin_model::frame::Estimate)| {
            (a.signals.spool_position_pu - b.signals.spool_position_pu).abs()
        };
        let moved: f64 = with(0.005).iter().zip(&plain).map(apart).sum();
        assert!(moved > 0.01, "{moved}");
    }
}
