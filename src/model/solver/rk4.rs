//! The classic explicit Runge–Kutta method of order 4: slow, plain, and the reference at 50 µs.

use crate::plant::rates::Rates;
use crate::plant::{Drive, Plant};
use crate::state::{State, Vector};

/// One step of the length `h`, s.
pub(super) fn step(plant: &Plant, state: &mut State, drive: &Drive, h: f64, rates: Rates) {
    let y = state.to_vector();
    let f = |y: Vector| rates(plant, &State::from_vector(&y), drive).to_vector();
    let k_1 = f(y);
    let k_2 = f(y + 0.5 * h * k_1);
    let k_3 = f(y + 0.5 * h * k_2);
    let k_4 = f(y + h * k_3);
    *state = State::from_vector(&(y + h / 6.0 * (k_1 + 2.0 * (k_2 + k_3) + k_4)));
}
