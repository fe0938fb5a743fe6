//! The classic explicit Runge–Kutta method of order 4: slow, plain, and the reference at 50 µs.

use crate::plant::rates::{Rates, confine, piston_rates, rates};
use crate::plant::{Drive, Plant};
use crate::solver::steps;
use crate::state::{State, Vector};

/// Steps of one tick.
#[derive(Clone, Debug)]
pub struct Rk4 {
    count: u32,
    step_s: f64,
}

impl Rk4 {
    /// Whole steps of at most `max_step_s` in a tick.
    #[must_use]
    pub fn new(tick_s: f64, max_step_s: f64) -> Self {
        let (count, step_s) = steps(tick_s, max_step_s);
        Self { count, step_s }
    }

    /// Advances by one tick.
    pub fn advance(&self, plant: &Plant, state: &mut State, drive: &Drive) {
        self.integrate(plant, state, drive, rates);
    }

    /// Advances the servomotor alone by one tick; the rest stays as it is.
    pub fn advance_piston(&self, plant: &Plant, state: &mut State, drive: &Drive) {
        self.integrate(plant, state, drive, piston_rates);
    }

    fn integrate(&self, plant: &Plant, state: &mut State, drive: &Drive, rates: Rates) {
        let h = self.step_s;
        let mut drive = *drive;
        for _ in 0..self.count {
            let y = state.to_vector();
            let f = |y: Vector| rates(plant, &State::from_vector(&y), &drive).to_vector();
            let k_1 = f(y);
            let k_2 = f(y + 0.5 * h * k_1);
            let k_3 = f(y + 0.5 * h * k_2);
            let k_4 = f(y + h * k_3);
            *state = State::from_vector(&(y + h / 6.0 * (k_1 + 2.0 * (k_2 + k_3) + k_4)));
            confine(plant, state);
            drive.time_s += h;
        }
    }
}
