//! Model error: columns of discrepancy terms, free shapes over state and time that stand at one point of the chain each.
//!
//! A term that the equations lack shows as a force, flow, position or signal at some point of the chain (Kristensen, Madsen & Jørgensen 2004 let a
//! random walk find the deficient equation; here it is a sum of shapes, so that its mark is linear in a few numbers). Small terms at all
//! points are the error of the equations; a large one at one point is something unknown there.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::estimation::coordinate::Residuals;
use crate::likelihood::problem::{METHOD, Problem};
use crate::model::FittedModel;
use govtwin_model::effects::{self, Stage};
use govtwin_model::parameters::Unit;
use govtwin_model::plant::Plant;
use govtwin_model::plant::term::{Point, Term, View};
use govtwin_model::stored::{LastingText, lasting, points};
use govtwin_model::twin::Twin;

/// A place for a discrepancy term.
#[derive(Clone, Copy, Debug)]
pub struct DiscrepancyPoint {
    point: Point,
    /// Where that is, in words.
    pub words: &'static str,
    /// The stage that it belongs to.
    pub stage: Stage,
    /// Unit of the term.
    pub unit: &'static str,
    /// Size of a moderate term.
    pub scale: f64,
}

const fn place(point: Point, words: &'static str, stage: Stage, unit: &'static str, scale: f64) -> DiscrepancyPoint {
    DiscrepancyPoint { point, words, stage, unit, scale }
}

/// All places, along the chain.
pub const PLACES: [DiscrepancyPoint; 11] = [
    place(Point::Command, "command on its way to the regulator", Stage::Regulator, "pu", 1.0e-3),
    place(Point::RegulatorServomotor, "servomotor reading in the regulator", Stage::Sensor, "pu", 1.0e-3),
    place(Point::RegulatorSpool, "spool reading in the regulator", Stage::Sensor, "pu", 5.0e-3),
    place(Point::ValveCurrent, "current to the pilot valve", Stage::PilotValve, "pu", 5.0e-3),
    place(Point::EsvOpening, "opening of the emergency shutdown valve", Stage::Esv, "pu", 0.2),
    place(Point::SupplyPressure, "supply pressure at the valves", Stage::Supply, "Pa", 5.0e4),
    place(Point::ChamberFlow, "flow into the control chamber", Stage::Spool, "m³/s", 5.0e-6),
    place(Point::SpoolForce, "force on the spool", Stage::Spool, "N", 100.0),
    place(Point::ServomotorForce, "force on the piston", Stage::Servomotor, "N", 1.0e4),
    place(Point::OpeningFlow, "flow into the opening chamber", Stage::Servomotor, "m³/s", 2.0e-4),
    place(Point::ServomotorReading, "servomotor transducer", Stage::Sensor, "pu", 5.0e-4),
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

/// Times after a trip over which the ESV's opening may be off, s.
const TRIP_TIMES_S: [f64; 3] = [0.1, 0.5, 2.0];

fn speed(view: &View<'_>) -> f64 {
    // Full stroke is some half a metre; only the shape counts.
    view.state.servomotor_velocity_m_s / 0.6
}

impl DiscrepancyPoint {
    /// How many shapes a term has here.
    pub fn shapes(&self) -> usize {
        if self.point == Point::EsvOpening { TRIP_TIMES_S.len() } else { SHAPES.len() }
    }
}

/// A term with one shape.
#[derive(Debug)]
struct Free {
    point: Point,
    shape: usize,
    size: f64,
}

impl Term for Free {
    fn point(&self) -> Point {
        self.point
    }

    fn memory_len(&self) -> usize {
        // Time since the trip.
        usize::from(self.point == Point::EsvOpening)
    }

    fn apply(&self, signal: f64, view: &View<'_>, memory: &mut [f64]) -> f64 {
        let Some(since_s) = memory.first_mut() else { return signal + self.size * (SHAPES[self.shape].1)(view) };
        if signal >= 1.0 {
            *since_s = 0.0;
            return signal;
        }
        *since_s += view.tick_s;
        signal + self.size * (-*since_s / TRIP_TIMES_S[self.shape]).exp()
    }
}

/// Marks of moderate terms: changes of the whitened residuals, by recording, one column for each shape of each place.
#[derive(Clone, Debug)]
pub struct Columns {
    /// By recording.
    pub marks: Vec<DMatrix<f64>>,
}

impl Columns {
    /// Products of residuals with all marks.
    pub fn along(&self, residuals: &Residuals) -> DVector<f64> {
        let products = self.marks.iter().zip(residuals).map(|(marks, residuals)| marks.tr_mul(residuals));
        products.reduce(|a, b| a + b).unwrap_or_else(|| DVector::zeros(0))
    }
}

/// Share of a moderate term that is simulated for its mark.
const STEP: f64 = 0.2;

/// The place of each column.
pub fn places() -> impl Iterator<Item = &'static DiscrepancyPoint> {
    PLACES.iter().flat_map(|place| std::iter::repeat_n(place, place.shapes()))
}

/// Simulates a small term of every shape at every place on top of a model.
pub fn columns(problem: &Problem, model: &FittedModel) -> Columns {
    let unit = model.unit();
    let twins: Vec<Twin> = PLACES
        .iter()
        .flat_map(|place| (0..place.shapes()).map(move |shape| (place, shape)))
        .map(|(place, shape)| {
            let mut plant = Plant::new(&unit.parameters);
            effects::apply(&unit, &mut plant);
            plant.terms.push(Arc::new(Free { point: place.point, shape, size: STEP * place.scale }));
            Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, METHOD)
        })
        .collect();
    let moved = problem.residuals_of_twins(&twins);
    Columns {
        marks: (0..problem.recordings.len())
            .map(|recording| changes(&moved, &model.fit.residuals, recording, STEP))
            .collect(),
    }
}

/// A twin of a unit with a term of every shape at one place; `sizes` are those of all columns, in moderate terms.
pub fn twin_with(unit: &Unit, place: &DiscrepancyPoint, sizes: &[f64]) -> Twin {
    let mut plant = Plant::new(&unit.parameters);
    effects::apply(unit, &mut plant);
    let first: usize = PLACES.iter().take_while(|other| other.point != place.point).map(DiscrepancyPoint::shapes).sum();
    for shape in 0..place.shapes() {
        let size = sizes.get(first + shape).copied().unwrap_or(0.0) * place.scale;
        plant.terms.push(Arc::new(Free { point: place.point, shape, size }));
    }
    Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, METHOD)
}

/// Changes of the residuals of one recording over a step, as columns.
fn changes(moved: &[Residuals], at: &Residuals, recording: usize, step: f64) -> DMatrix<f64> {
    let mut marks = DMatrix::zeros(at[recording].len(), moved.len());
    for (k, moved) in moved.iter().enumerate() {
        marks.set_column(k, &((&moved[recording] - &at[recording]) / step));
    }
    marks
}

/// A recovered shape.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Curve {
    /// What it is drawn against, with the unit.
    #[serde(deserialize_with = "lasting")]
    pub against: LastingText,
    /// Points of the free term.
    #[serde(deserialize_with = "points")]
    pub points: Vec<(f64, f64)>,
    /// The same for the improved twin in the unit's stead: the free term that would stand for the named effects. Of the leading place only, and
    /// none where nothing is named.
    #[serde(default, deserialize_with = "points")]
    pub named: Vec<(f64, f64)>,
}

/// The shape of a place's term against position, speed, spool and time, from the sizes of all columns in moderate terms.
pub fn curves(place: &DiscrepancyPoint, sizes: &[f64]) -> Vec<Curve> {
    let first: usize = PLACES.iter().take_while(|other| other.point != place.point).map(DiscrepancyPoint::shapes).sum();
    let size = |shape: usize| sizes.get(first + shape).copied().unwrap_or(0.0) * place.scale;
    let line = |against, from: f64, to: f64, value: &dyn Fn(f64) -> f64| {
        let points = (0..=60).map(|k| from + (to - from) * f64::from(k) / 60.0).map(|x| (x, value(x))).collect();
        Curve { against, points, named: Vec::new() }
    };
    if place.point == Point::EsvOpening {
        let value = |t: f64| (0..TRIP_TIMES_S.len()).map(|k| size(k) * (-t / TRIP_TIMES_S[k]).exp()).sum();
        return vec![line("time since the trip, s", 0.0, 4.0, &value)];
    }
    vec![
        line("servomotor position, pu", 0.0, 1.0, &|x| size(0) + size(1) * x),
        line("servomotor speed, pu/s", -0.2, 0.2, &|v| {
            size(2) * v / 0.2 + size(3) * (v / 2.0e-3).tanh() + size(4) * v * v.abs() / 0.04
        }),
        line("spool position, pu", -1.0, 1.0, &|y| size(5) * y + size(6) * (y / 5.0e-3).tanh()),
        line("time, s", 0.0, 40.0, &|t| size(7) * (-t / 20.0).exp()),
    ]
}
