//! Model error: columns of discrepancy terms, free shapes over state and time that stand at one point of the chain each.
//!
//! A term that the equations lack shows as a force, flow, position or signal at some point of the chain (Kristensen, Madsen & Jørgensen 2004 let a
//! random walk find the deficient equation; here it is a sum of shapes, so that its mark is linear in a few numbers). Small terms at all
//! points are the error of the equations; a large one at one point is something unknown there.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::diagnosis::model::FittedModel;
use crate::effects::{self, Stage, clock_offset};
use crate::estimation::coordinate::Residuals;
use crate::likelihood::problem::{METHOD, Problem};
use crate::parameters::Unit;
use crate::plant::Plant;
use crate::plant::term::{Point, Term, View};
use crate::twin::Twin;

/// A place for discrepancy terms.
#[derive(Clone, Copy, Debug)]
pub struct DiscrepancyPoint {
    at: At,
    /// Where that is, in words.
    pub words: &'static str,
    /// The stage that it belongs to.
    pub stage: Stage,
    /// Unit of the term.
    pub unit: &'static str,
    /// Size of a moderate term.
    pub scale: f64,
    /// Shapes beside [`COMMON`], if that is had at all.
    own: &'static [Shape],
}

/// What a term changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum At {
    /// The signal at a point, by the common shapes and its own.
    Point(Point),
    /// Coefficients, by its own shapes alone.
    Coefficients,
}

/// A shape of a term.
#[derive(Clone, Copy, Debug)]
enum Shape {
    /// A function of the state.
    State(fn(&View<'_>) -> f64),
    /// A function of the signal at the point.
    Signal(fn(f64) -> f64),
    /// How far the signal at the point has moved within [`LAG_S`], over so much: what a delay or a lag of it takes off.
    Lag(f64),
    /// What fades within so many seconds of a trip.
    Trip(f64),
    /// A coefficient of the plant.
    Coefficient(fn(&mut Plant, f64)),
}

const fn place(
    point: Point,
    (words, stage): (&'static str, Stage),
    (unit, scale): (&'static str, f64),
    own: &'static [Shape],
) -> DiscrepancyPoint {
    DiscrepancyPoint { at: At::Point(point), words, stage, unit, scale, own }
}

/// All places, along the chain.
pub const PLACES: [DiscrepancyPoint; 13] = [
    place(
        Point::Command,
        ("command on its way to the regulator", Stage::Regulator),
        ("pu", 1.0e-3),
        // A moderate one is late by 10 ms.
        &[Shape::Lag(0.1 * LAG_S)],
    ),
    place(Point::RegulatorServomotor, ("servomotor reading in the regulator", Stage::Sensor), ("pu", 1.0e-3), &[]),
    place(
        Point::RegulatorSpool,
        ("spool reading in the regulator", Stage::Sensor),
        ("pu", 5.0e-3),
        &[Shape::State(spool_speed)],
    ),
    place(
        Point::ValveCurrent,
        ("current to the pilot valve", Stage::PilotValve),
        ("pu", 5.0e-3),
        &[
            Shape::Signal(|current| current / 0.1),
            // Beyond half of full current.
            Shape::Signal(|current| (current - current.clamp(-0.5, 0.5)) / 0.1),
            Shape::Signal(|current| (current / 0.02).tanh()),
            Shape::Lag(0.1),
        ],
    ),
    place(
        Point::EsvOpening,
        ("opening of the emergency shutdown valve", Stage::Esv),
        ("pu", 0.2),
        &[Shape::Trip(0.1), Shape::Trip(0.5), Shape::Trip(2.0)],
    ),
    place(Point::SupplyPressure, ("supply pressure at the valves", Stage::Supply), ("Pa", 5.0e4), &[]),
    place(
        Point::ChamberFlow,
        ("flow into the control chamber", Stage::Spool),
        ("m³/s", 5.0e-6),
        &[Shape::State(spool_speed), Shape::State(|view| spool_speed(view).max(0.0))],
    ),
    place(
        Point::SpoolForce,
        ("force on the spool", Stage::Spool),
        ("N", 100.0),
        &[Shape::State(spool_speed), Shape::State(|view| (spool_speed(view) / 0.02).tanh())],
    ),
    DiscrepancyPoint {
        at: At::Coefficients,
        words: "spool transducer",
        stage: Stage::Sensor,
        unit: "pu",
        scale: 5.0e-3,
        own: &[
            Shape::Coefficient(|plant, size| plant.spool.reading_bias_pu += size),
            Shape::Coefficient(|plant, size| plant.spool.reading_gain *= 1.0 + size),
        ],
    },
    place(Point::ServomotorForce, ("force on the piston", Stage::Servomotor), ("N", 1.0e4), &[]),
    place(Point::OpeningFlow, ("flow into the opening chamber", Stage::Servomotor), ("m³/s", 2.0e-4), &[]),
    place(Point::ServomotorReading, ("servomotor transducer", Stage::Sensor), ("pu", 5.0e-4), &[]),
    DiscrepancyPoint {
        at: At::Coefficients,
        words: "stamps of command and ESV",
        stage: Stage::Sensor,
        unit: "s",
        scale: 0.01,
        own: &[Shape::Coefficient(|plant, size| clock_offset::apply([-size], plant))],
    },
];

/// Shapes that a term has at every point of the chain but the ESV.
const COMMON: [Shape; 8] = [
    Shape::State(|_| 1.0),
    Shape::State(|view| view.servomotor_reading_pu),
    Shape::State(|view| speed(view) / 0.2),
    Shape::State(|view| (speed(view) / 2.0e-3).tanh()),
    Shape::State(|view| speed(view) * speed(view).abs() / 0.04),
    Shape::State(|view| view.spool_reading_pu),
    Shape::State(|view| (view.spool_reading_pu / 5.0e-3).tanh()),
    // The start of the recording.
    Shape::State(|view| (-view.time_s / 20.0).exp()),
];

/// Time over which a signal lags, s.
const LAG_S: f64 = 0.05;

fn speed(view: &View<'_>) -> f64 {
    // Full stroke is some half a metre; only the shape counts.
    view.state.servomotor_velocity_m_s / 0.6
}

fn spool_speed(view: &View<'_>) -> f64 {
    view.state.spool_velocity_m_s / 0.05
}

impl DiscrepancyPoint {
    /// Whether terms here have the common shapes: not where a valve is open or shut.
    fn common(&self) -> &'static [Shape] {
        if matches!(self.at, At::Point(point) if point != Point::EsvOpening) { &COMMON } else { &[] }
    }

    /// How many shapes a term has here.
    #[must_use]
    pub fn shapes(&self) -> usize {
        self.common().len() + self.own.len()
    }

    /// The column of its first shape.
    #[must_use]
    pub fn first(&self) -> usize {
        PLACES.iter().take_while(|other| other.words != self.words).map(Self::shapes).sum()
    }

    fn shape(&self, shape: usize) -> Shape {
        let common = self.common();
        common.get(shape).copied().unwrap_or_else(|| self.own[shape - common.len()])
    }

    /// Puts shapes of so many moderate terms each onto a plant.
    fn put(&self, plant: &mut Plant, sizes: &[f64]) {
        let all = sizes.iter().enumerate().filter(|(_, size)| **size != 0.0);
        let shapes: Vec<(Shape, f64)> = all.map(|(shape, size)| (self.shape(shape), size * self.scale)).collect();
        for (shape, size) in &shapes {
            if let Shape::Coefficient(change) = shape {
                change(plant, *size);
            }
        }
        if let (At::Point(point), false) = (self.at, shapes.is_empty()) {
            plant.terms.push(Arc::new(Free { point, shapes }));
        }
    }
}

/// A term of several shapes.
#[derive(Debug)]
struct Free {
    point: Point,
    /// With their sizes.
    shapes: Vec<(Shape, f64)>,
}

impl Term for Free {
    fn point(&self) -> Point {
        self.point
    }

    fn memory_len(&self) -> usize {
        // Time since the trip, or the lagging signal; no place has two kinds of them.
        usize::from(self.shapes.iter().any(|(shape, _)| matches!(shape, Shape::Trip(_) | Shape::Lag(_))))
    }

    fn reset(&self, signal: f64, memory: &mut [f64]) {
        if let Some(first) = memory.first_mut() {
            *first = if self.point == Point::EsvOpening { 0.0 } else { signal };
        }
    }

    fn apply(&self, signal: f64, view: &View<'_>, memory: &mut [f64]) -> f64 {
        let remembered = memory.first_mut().map_or(0.0, |remembered| {
            *remembered = match self.point {
                Point::EsvOpening if signal >= 1.0 => 0.0,
                Point::EsvOpening => *remembered + view.tick_s,
                _ => *remembered + (signal - *remembered) * (view.tick_s / (LAG_S + view.tick_s)),
            };
            *remembered
        });
        let sized = self.shapes.iter().map(|(shape, size)| match shape {
            Shape::State(of) => size * of(view),
            Shape::Signal(of) => size * of(signal),
            Shape::Lag(over) => size * (remembered - signal) / over,
            Shape::Trip(within_s) if signal < 1.0 => size * (-remembered / within_s).exp(),
            Shape::Trip(_) | Shape::Coefficient(_) => 0.0,
        });
        signal + sized.sum::<f64>()
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
    #[must_use]
    pub fn along(&self, residuals: &Residuals) -> DVector<f64> {
        let products = self.marks.iter().zip(residuals).map(|(marks, residuals)| marks.tr_mul(residuals));
        products.reduce(|a, b| a + b).unwrap_or_else(|| DVector::zeros(0))
    }
}

/// Share of a moderate term that is simulated for its mark.
const STEP: f64 = 0.2;

/// Number of columns.
#[must_use]
pub fn count() -> usize {
    PLACES.iter().map(DiscrepancyPoint::shapes).sum()
}

/// The place of each column.
pub fn places() -> impl Iterator<Item = &'static DiscrepancyPoint> {
    PLACES.iter().flat_map(|place| std::iter::repeat_n(place, place.shapes()))
}

/// Simulates a small term of every shape at every place on top of a model.
#[must_use]
pub fn columns(problem: &Problem, model: &FittedModel) -> Columns {
    let unit = model.unit();
    let twins: Vec<Twin> = PLACES
        .iter()
        .flat_map(|place| (0..place.shapes()).map(move |shape| (place, shape)))
        .map(|(place, shape)| {
            let mut plant = Plant::new(&unit.parameters);
            effects::apply(&unit, &mut plant);
            let mut sizes = vec![0.0; place.shapes()];
            sizes[shape] = STEP;
            place.put(&mut plant, &sizes);
            Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, METHOD)
        })
        .collect();
    let moved = problem.residuals_of_twins(&twins);
    Columns {
        marks: (0..problem.trials.len()).map(|trial| changes(&moved, &model.fit.residuals, trial, STEP)).collect(),
    }
}

/// A twin of a unit with a term of every shape at one place, of these sizes in moderate terms.
#[must_use]
pub fn twin_with(unit: &Unit, place: &DiscrepancyPoint, sizes: &[f64]) -> Twin {
    let mut plant = Plant::new(&unit.parameters);
    effects::apply(unit, &mut plant);
    place.put(&mut plant, sizes);
    Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, METHOD)
}

/// Changes of the residuals of one recording over a step, as columns.
fn changes(moved: &[Residuals], at: &Residuals, trial: usize, step: f64) -> DMatrix<f64> {
    let mut marks = DMatrix::zeros(at[trial].len(), moved.len());
    for (k, moved) in moved.iter().enumerate() {
        marks.set_column(k, &((&moved[trial] - &at[trial]) / step));
    }
    marks
}

/// A recovered shape.
#[derive(Clone, Debug)]
pub struct Curve {
    /// What it is drawn against, with the unit.
    pub against: &'static str,
    /// Points of the free term.
    pub points: Vec<(f64, f64)>,
    /// The same for the improved twin in the unit's stead: the free term that would stand for the named effects. Of the leading place only, and
    /// none where nothing is named.
    pub named: Vec<(f64, f64)>,
}

/// The shape of a place's term against position, speed, spool and time, from the sizes of all columns in moderate terms.
#[must_use]
pub fn curves(place: &DiscrepancyPoint, sizes: &[f64]) -> Vec<Curve> {
    let first = place.first();
    let size = |shape: usize| sizes.get(first + shape).copied().unwrap_or(0.0) * place.scale;
    let line = |against, from: f64, to: f64, value: &dyn Fn(f64) -> f64| {
        let points = (0..=60).map(|k| from + (to - from) * f64::from(k) / 60.0).map(|x| (x, value(x))).collect();
        Curve { against, points, named: Vec::new() }
    };
    if place.common().is_empty() {
        let trip = |t: f64| {
            let of = |(k, shape): (usize, &Shape)| {
                if let Shape::Trip(within_s) = shape { size(k) * (-t / within_s).exp() } else { 0.0 }
            };
            place.own.iter().enumerate().map(of).sum()
        };
        return match place.at {
            At::Point(_) => vec![line("time since the trip, s", 0.0, 4.0, &trip)],
            At::Coefficients if place.shapes() > 1 => {
                vec![line("spool position, pu", -1.0, 1.0, &|y| size(0) + size(1) * y)]
            }
            At::Coefficients => vec![line("time, s", 0.0, 40.0, &|_| size(0))],
        };
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::params::reference;
    use crate::state::State;

    #[test]
    fn columns_stand_in_the_order_of_the_places() {
        let mut next = 0;
        for place in &PLACES {
            assert_eq!(place.first(), next, "{}", place.words);
            next += place.shapes();
        }
        assert_eq!((next, places().count()), (count(), count()));
    }

    #[test]
    fn every_shape_changes_the_plant_and_none_does_at_size_0() {
        let unit = reference();
        let plain = || Plant::new(&unit.parameters);
        for place in &PLACES {
            for shape in 0..place.shapes() {
                let mut plant = plain();
                let mut sizes = vec![0.0; place.shapes()];
                sizes[shape] = 1.0;
                place.put(&mut plant, &sizes);
                let terms = Point::ALL.iter().any(|&point| !plant.terms.is_empty_at(point));
                let readings = (plant.spool.reading_bias_pu, plant.spool.reading_gain);
                assert!(
                    terms || readings != (plain().spool.reading_bias_pu, plain().spool.reading_gain),
                    "{} {shape}",
                    place.words
                );
                sizes[shape] = 0.0;
                let mut plant = plain();
                place.put(&mut plant, &sizes);
                assert!(Point::ALL.iter().all(|&point| plant.terms.is_empty_at(point)), "{}", place.words);
                assert_eq!(plant.spool.reading_gain, plain().spool.reading_gain);
            }
        }
    }

    /// Behind a ramp of 0.1 pu/s a moderate lag of the command takes off what it moves within 10 ms.
    #[test]
    fn a_lag_takes_off_what_a_delay_would() {
        let command = &PLACES[0];
        let mut plant = Plant::new(&reference().parameters);
        let mut sizes = vec![0.0; command.shapes()];
        sizes[COMMON.len()] = 1.0;
        command.put(&mut plant, &sizes);
        let state = State::default();
        let mut memory = vec![0.0; plant.terms.memory_len()];
        plant.terms.reset(Point::Command, 0.3, &mut memory);
        let mut after = 0.0;
        for tick in 0..1000 {
            let time_s = f64::from(tick) * 1e-3;
            let view = View {
                time_s,
                tick_s: 1e-3,
                state: &state,
                tank_pressure_pa: 6.3e6,
                spool_reading_pu: 0.0,
                servomotor_reading_pu: 0.0,
            };
            let ramp = 0.3 + 0.1 * time_s;
            after = plant.terms.apply(Point::Command, ramp, &view, &mut memory) - ramp;
            assert!(tick > 0 || after.abs() < 1e-12);
        }
        assert!((after + 1e-3).abs() < 2e-5, "{after}");
    }
}
