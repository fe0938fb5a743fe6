//! Where and what shape: a free term placed at each point of the chain in turn, as far as the gap asks for it.
//!
//! The term is a sum of simple shapes in time and state; their sizes follow from one linear step about the refitted twin, tolerances
//! refitted along (the idea of Kristensen, Madsen & Jørgensen 2004, who let a random walk find the deficient equation).

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

use crate::diagnosis::model::Model;
use crate::diagnosis::outcome::{Curve, Latent};
use crate::effects::{self, Stage};
use crate::parameters::Unit;
use crate::plant::Plant;
use crate::plant::term::{Point, Term, View};
use crate::solver::Method;
use crate::tuning::bench::{Bench, Misses, square};
use crate::tuning::fit::prior_square;
use crate::tuning::linear::normal;
use crate::twin::Twin;

/// A place for a free term: point, words, stage, unit, and the size of a moderate term.
const PLACES: [(Point, &str, Stage, &str, f64); 9] = [
    (Point::Command, "command on its way to the regulator", Stage::Regulator, "pu", 1.0e-3),
    (Point::RegulatorServomotor, "servomotor reading in the regulator", Stage::Sensor, "pu", 1.0e-3),
    (Point::RegulatorSpool, "spool reading in the regulator", Stage::Sensor, "pu", 5.0e-3),
    (Point::ValveCurrent, "current to the pilot valve", Stage::PilotValve, "pu", 5.0e-3),
    (Point::ChamberFlow, "flow into the control chamber", Stage::Spool, "m³/s", 5.0e-6),
    (Point::SpoolForce, "force on the spool", Stage::Spool, "N", 100.0),
    (Point::ServomotorForce, "force on the piston", Stage::Servomotor, "N", 1.0e4),
    (Point::OpeningFlow, "flow into the opening chamber", Stage::Servomotor, "m³/s", 2.0e-4),
    (Point::ServomotorReading, "servomotor transducer", Stage::Sensor, "pu", 5.0e-4),
];

/// What a shape is called, and its value at a state.
type Shape = (&'static str, fn(&View<'_>) -> f64);

/// Shapes of a term.
const SHAPES: [Shape; 8] = [
    ("constant", |_| 1.0),
    ("servomotor position", |view| view.servomotor_reading_pu),
    ("servomotor speed", |view| speed(view) / 0.2),
    ("sign of servomotor speed", |view| (speed(view) / 2.0e-3).tanh()),
    ("speed times its size", |view| speed(view) * speed(view).abs() / 0.04),
    ("spool position", |view| view.spool_reading_pu),
    ("sign of spool position", |view| (view.spool_reading_pu / 5.0e-3).tanh()),
    ("start of the recording", |view| (-view.time_s / 20.0).exp()),
];

fn speed(view: &View<'_>) -> f64 {
    // Full stroke is some half a metre; only the shape counts.
    view.state.servomotor_velocity_m_s / 0.6
}

/// A free term: sizes of its shapes.
#[derive(Debug)]
struct Free {
    point: Point,
    sizes: [f64; SHAPES.len()],
}

impl Term for Free {
    fn point(&self) -> Point {
        self.point
    }

    fn apply(&self, signal: f64, view: &View<'_>, _memory: &mut [f64]) -> f64 {
        signal + SHAPES.iter().zip(&self.sizes).map(|((_, shape), size)| size * shape(view)).sum::<f64>()
    }
}

fn misses(bench: &Bench, unit: &Unit, point: Point, sizes: [f64; SHAPES.len()]) -> Misses {
    (0..bench.trials.len())
        .map(|trial| {
            let mut plant = Plant::new(&unit.parameters);
            effects::apply(unit, &mut plant);
            plant.terms.push(Arc::new(Free { point, sizes }));
            let twin = Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, Method::default());
            bench.misses_by(twin, trial)
        })
        .collect()
}

/// Tries all places on top of a model; best first. `gap` is the cost above that of a perfect model.
#[must_use]
pub fn latents(bench: &Bench, model: &Model, gap: f64) -> Vec<Latent> {
    let unit = model.unit();
    let mut all: Vec<Latent> = PLACES
        .par_iter()
        .filter_map(|&(point, place, stage, term_unit, scale)| {
            let (sizes, gain) = fitted(bench, model, &unit, point, scale, None)?;
            let explains = if gap > 0.0 { (gain / gap).clamp(0.0, 1.0) } else { 0.0 };
            Some(Latent { place, stage, unit: term_unit, explains, curves: curves(&sizes) })
        })
        .collect();
    all.sort_by(|a, b| b.explains.total_cmp(&a.explains));
    all
}

/// Draws beside the leading free term what it would look like if the unit were the improved twin: found in the same way, in that twin's
/// positions instead of the measured ones. The closer the two, the more of what is missing the named effects are.
pub fn draw_named(bench: &Bench, model: &Model, improved: &Model, latents: &mut [Latent]) {
    let Some(leading) = latents.first_mut() else { return };
    let Some(&(point, .., scale)) = PLACES.iter().find(|(_, place, ..)| *place == leading.place) else { return };
    let goal = bench.misses_of(&[improved.unit()]).pop().unwrap_or_default();
    let found = fitted(bench, model, &model.unit(), point, scale, Some(&goal));
    for (curve, named) in leading.curves.iter_mut().zip(found.iter().flat_map(|(sizes, _)| curves(sizes))) {
        curve.named = named.points;
    }
}

/// Sizes of the shapes, and by how much the cost falls; none where the place has no say.
///
/// What is to be explained is what the model misses, or what it misses of another unit whose own misses are given as the `goal`.
fn fitted(
    bench: &Bench,
    model: &Model,
    unit: &Unit,
    point: Point,
    scale: f64,
    goal: Option<&Misses>,
) -> Option<([f64; SHAPES.len()], f64)> {
    let beyond = |misses: Misses| match goal {
        Some(goal) => misses.iter().zip(goal).map(|(misses, goal)| misses - goal).collect(),
        None => misses,
    };
    let left = beyond(model.fit.misses.clone());
    let step = 0.2 * scale;
    let columns: Vec<Misses> = (0..SHAPES.len())
        .map(|shape| {
            let mut sizes = [0.0; SHAPES.len()];
            sizes[shape] = step;
            misses(bench, unit, point, sizes)
        })
        .collect();
    if columns.iter().all(|column| *column == model.fit.misses) {
        return None;
    }
    let slopes: Vec<DMatrix<f64>> = (0..bench.trials.len())
        .map(|trial| {
            let old = &model.fit.slopes[trial];
            let mut slope = DMatrix::zeros(old.nrows(), old.ncols() + SHAPES.len());
            slope.columns_mut(0, old.ncols()).copy_from(old);
            for (shape, column) in columns.iter().enumerate() {
                slope.set_column(old.ncols() + shape, &((&column[trial] - &model.fit.misses[trial]) / step));
            }
            slope
        })
        .collect();
    let kept = model.knobs.len();
    let (mut hessian, mut gradient) = (DMatrix::zeros(0, 0), DVector::zeros(0));
    for (slope, misses) in slopes.iter().zip(&left) {
        if hessian.nrows() == 0 {
            hessian = slope.tr_mul(slope);
            gradient = slope.tr_mul(misses);
        } else {
            hessian += slope.tr_mul(slope);
            gradient += slope.tr_mul(misses);
        }
    }
    let (known, _) = normal(&model.knobs, &model.fit.positions, &model.fit.misses, &model.fit.slopes, 1.0);
    hessian.view_mut((0, 0), (kept, kept)).copy_from(&known);
    for k in 0..kept {
        gradient[k] += if model.knobs[k].has_prior() { model.fit.positions[k] } else { 0.0 };
    }
    for k in kept..hessian.nrows() {
        // A term a hundred times moderate is beyond belief.
        hessian[(k, k)] += 1.0 / (100.0 * scale).powi(2);
    }
    let Some(cholesky) = hessian.cholesky() else { return Some(([0.0; SHAPES.len()], 0.0)) };
    let change = -cholesky.solve(&gradient);
    let before = square(&left) + model.fit.prior;
    let mut best = ([0.0; SHAPES.len()], 0.0);
    for share in [1.0, 0.5, 0.2] {
        let positions: Vec<f64> = model.fit.positions.iter().enumerate().map(|(k, p)| p + share * change[k]).collect();
        let moved = crate::tuning::knob::unit_at(&model.base, &model.knobs, &positions);
        let mut sizes = [0.0; SHAPES.len()];
        for (k, size) in sizes.iter_mut().enumerate() {
            *size = share * change[kept + k];
        }
        let left = beyond(misses(bench, &moved, point, sizes));
        let gain = before - square(&left) - prior_square(&model.knobs, &positions);
        if gain > best.1 {
            best = (sizes, gain);
        }
    }
    Some(best)
}

/// The shape against position, speed and spool.
fn curves(sizes: &[f64; SHAPES.len()]) -> Vec<Curve> {
    let line = |against, from: f64, to: f64, value: &dyn Fn(f64) -> f64| {
        let points = (0..=60).map(|k| from + (to - from) * f64::from(k) / 60.0).map(|x| (x, value(x))).collect();
        Curve { against, points, named: Vec::new() }
    };
    vec![
        line("servomotor position, pu", 0.0, 1.0, &|x| sizes[0] + sizes[1] * x),
        line("servomotor speed, pu/s", -0.2, 0.2, &|v| {
            sizes[2] * v / 0.2 + sizes[3] * (v / 2.0e-3).tanh() + sizes[4] * v * v.abs() / 0.04
        }),
        line("spool position, pu", -1.0, 1.0, &|y| sizes[5] * y + sizes[6] * (y / 5.0e-3).tanh()),
        line("time, s", 0.0, 40.0, &|t| sizes[7] * (-t / 20.0).exp()),
    ]
}
