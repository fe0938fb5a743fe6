//! ROS2, an L-stable linearly implicit Runge–Kutta method of order 2 (Verwer et al. 1999, SIAM J. Sci. Comput. 20(4)).
//!
//! `(I − γhJ) k_1 = f(y)`, `(I − γhJ) k_2 = f(y + h k_1) − 2 k_1`, `y ← y + h (3 k_1 + k_2)/2`, γ = 1 + 1/√2. The Jacobian
//! is taken by one-sided differences; ROS2 keeps order 2 with any approximation of it.

use nalgebra::SMatrix;

use crate::plant::rates::Rates;
use crate::plant::{Drive, Plant};
use crate::state::{DIMENSION, State, Vector};

/// One step of the length `h`, s.
pub(super) fn step(plant: &Plant, state: &mut State, drive: &Drive, h: f64, rates: Rates) {
    let gamma = 1.0 + std::f64::consts::FRAC_1_SQRT_2;
    let y = state.to_vector();
    let f = |y: &Vector| rates(plant, &State::from_vector(y), drive).to_vector();
    let f_0 = f(&y);
    let mut system = SMatrix::<f64, DIMENSION, DIMENSION>::identity();
    for (j, delta) in deltas(plant, state).iter().enumerate() {
        let mut moved = y;
        moved[j] += delta;
        let column = (f(&moved) - f_0) * (-gamma * h / delta);
        system.set_column(j, &(system.column(j) + column));
    }
    let lu = system.lu();
    let Some(k_1) = lu.solve(&f_0) else { return };
    let second = f(&(y + h * k_1)) - 2.0 * k_1;
    let Some(k_2) = lu.solve(&second) else { return };
    *state = State::from_vector(&(y + h * (1.5 * k_1 + 0.5 * k_2)));
}

/// Difference steps, a ten-millionth of each state's typical size.
///
/// A body at a stop is moved into the stop: away from it the rates jump, and a difference over a jump is no slope.
fn deltas(plant: &Plant, state: &State) -> Vector {
    let into = |position: f64, max: f64| if position >= max { 1.0 } else { -1.0 };
    let pilot = into(state.pilot_position_pu, 1.0);
    let spool = into(state.spool_position_m, plant.spool.stroke_max_m);
    let piston = into(state.servomotor_position_m, plant.servomotor.stroke_m);
    1e-7 * State {
        pilot_position_pu: pilot,
        pilot_rate_pu_s: 400.0 * pilot,
        control_pressure_pa: 1e6,
        spool_position_m: 1e-2 * spool,
        spool_velocity_m_s: 0.1 * spool,
        opening_pressure_pa: 1e6,
        closing_pressure_pa: 1e6,
        servomotor_position_m: 0.1 * piston,
        servomotor_velocity_m_s: 0.1 * piston,
    }
    .to_vector()
}
