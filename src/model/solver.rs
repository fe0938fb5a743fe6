//! Methods that advance the continuous plant by one tick.

pub(crate) mod rk4;
pub(crate) mod rosenbrock;
pub mod split;

use crate::plant::rates::{Rates, confine, piston_rates, rates};
use crate::plant::{Drive, Plant};
use crate::solver::split::Split;
use crate::state::State;

/// How the continuous plant is integrated.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Method {
    /// The split linearly implicit method, the default at 0.5 ms: the fastest within 1e-4 pu.
    Split {
        /// Greatest step of the spool stage, s.
        max_step_s: f64,
    },
    /// Explicit Runge–Kutta of order 4 with steps of at most this many seconds: the reference at 50 µs.
    Rk4 {
        /// Greatest step, s.
        max_step_s: f64,
    },
    /// The L-stable Rosenbrock method ROS2 with steps of at most this many seconds.
    Rosenbrock {
        /// Greatest step, s.
        max_step_s: f64,
    },
}

impl Default for Method {
    fn default() -> Self {
        Self::Split { max_step_s: split::SPOOL_STEP_S }
    }
}

/// A method prepared for a plant and a tick.
#[derive(Clone, Debug)]
pub enum Solver {
    /// See [`Method::Split`].
    Split(Split),
    /// [`Method::Rk4`] or [`Method::Rosenbrock`].
    Stepwise(Stepwise),
}

/// One step of so many seconds.
type SolverStep = fn(&Plant, &mut State, &Drive, f64, Rates);

/// A method that takes the whole plant at once, in whole steps.
#[derive(Clone, Debug)]
pub struct Stepwise {
    step: SolverStep,
    count: u32,
    step_s: f64,
}

impl Stepwise {
    fn advance(&self, plant: &Plant, state: &mut State, drive: &Drive, rates: Rates) {
        let mut drive = *drive;
        for _ in 0..self.count {
            (self.step)(plant, state, &drive, self.step_s, rates);
            confine(plant, state);
            drive.time_s += self.step_s;
        }
    }
}

impl Solver {
    /// Prepares a method for ticks of `tick_s`.
    pub fn new(method: Method, plant: &Plant, tick_s: f64) -> Self {
        let (step, max_step_s): (SolverStep, f64) = match method {
            Method::Split { max_step_s } => return Self::Split(Split::new(plant, tick_s, max_step_s)),
            Method::Rk4 { max_step_s } => (rk4::step, max_step_s),
            Method::Rosenbrock { max_step_s } => (rosenbrock::step, max_step_s),
        };
        let (count, step_s) = steps(tick_s, max_step_s);
        Self::Stepwise(Stepwise { step, count, step_s })
    }

    /// The split method's steps, where that is the method.
    pub fn split(&self) -> Option<&Split> {
        if let Self::Split(split) = self { Some(split) } else { None }
    }

    /// Advances the state by one tick under a drive that holds.
    #[inline]
    pub fn advance(&self, plant: &Plant, state: &mut State, drive: &Drive) {
        match self {
            Self::Split(split) => split.advance(&plant.blocks(), state, drive),
            Self::Stepwise(method) => method.advance(plant, state, drive, rates),
        }
    }

    /// Advances the servomotor alone by one tick; the spool is wherever the caller put it.
    pub(crate) fn advance_piston(&self, plant: &Plant, state: &mut State, drive: &Drive) {
        match self {
            Self::Split(split) => split.advance_piston(&plant.blocks(), state, drive),
            Self::Stepwise(method) => method.advance(plant, state, drive, piston_rates),
        }
    }
}

/// Whole steps of at most `max_step_s` in a tick, and their length.
fn steps(tick_s: f64, max_step_s: f64) -> (u32, f64) {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to a small count")]
    let count = (tick_s / max_step_s - 1e-9).ceil().clamp(1.0, 1e6) as u32;
    (count, tick_s / f64::from(count))
}
