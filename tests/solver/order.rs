//! Order of convergence: halving the step shrinks the error by the method's order where the solution is smooth.
//!
//! The stretch: spool and piston on their way, off their stops, ports open, no speed within the friction's core, under
//! a current that holds. The reference is RK4 at 2 µs, whose own error is 1e-4 of the smallest one judged.

use govtwin_model::plant::steady::steady;
use govtwin_model::plant::{Drive, Plant};
use govtwin_model::solver::{Method, Solver};
use govtwin_model::state::State;

/// Length of the stretch, s.
const STRETCH_S: f64 = 0.008;

/// Where a method is after the stretch with steps of a given length, all states in units of their typical size.
fn end(method: impl Fn(f64) -> Method, step_s: f64) -> [f64; 9] {
    let plant = Plant::new(&govtwin_model::params::reference().parameters);
    let mut drive = Drive { esv_opening_pu: 1.0, tank_pressure_pa: 6.3e6, ..Drive::default() };
    let mut state = steady(&plant, 0.3, Some(0.004), &drive);
    // A little off balance, so that everything moves.
    state.pilot_position_pu = 0.2;
    state.spool_velocity_m_s = 0.03;
    drive.valve_current_pu = 0.4;
    let solver = Solver::new(method(step_s), &plant, step_s);
    for _ in 0..(STRETCH_S / step_s).round() as u32 {
        solver.advance(&plant, &mut state, &drive);
    }
    let State {
        pilot_position_pu: x_p,
        pilot_rate_pu_s: v_p,
        control_pressure_pa: p,
        spool_position_m: x,
        spool_velocity_m_s: v,
        opening_pressure_pa: p_1,
        closing_pressure_pa: p_2,
        servomotor_position_m: z,
        servomotor_velocity_m_s: w,
    } = state;
    assert!(x > 1e-3 && x < 0.011 && v > 1e-3 && w > 1e-3 && p_1 > 1e6 && p_2 > 1e6, "smooth: {state:?}");
    [x_p, v_p / 400.0, p / 1e6, x / 0.015, v / 0.1, p_1 / 1e6, p_2 / 1e6, z / 0.6, w / 0.1]
}

/// Errors at a step and its halves, the largest over all states.
fn errors(method: impl Fn(f64) -> Method + Copy, steps_s: [f64; 4]) -> [f64; 4] {
    let exact = end(|max_step_s| Method::Rk4 { max_step_s }, 2.0e-6);
    steps_s.map(|step_s| {
        end(method, step_s).iter().zip(exact).map(|(value, exact)| (value - exact).abs()).fold(0.0, f64::max)
    })
}

/// Asserts the order from each step to its half, and the size of the error at the smallest step.
fn converges(method: impl Fn(f64) -> Method + Copy, coarsest_s: f64, order: f64, finest: f64) {
    let steps_s = [1.0, 0.5, 0.25, 0.125].map(|share| share * coarsest_s);
    let errors = errors(method, steps_s);
    for pair in errors.windows(2) {
        let measured = (pair[0] / pair[1]).log2();
        assert!((measured - order).abs() < 0.25, "order {measured} of {order}: {errors:?} at {steps_s:?} s");
    }
    assert!(errors[3] < finest, "{errors:?} at {steps_s:?} s");
}

#[test]
fn the_split_method_is_of_order_2() {
    converges(|max_step_s| Method::Split { max_step_s }, 2.0e-4, 2.0, 1e-4);
}

#[test]
fn rk4_is_of_order_4() {
    converges(|max_step_s| Method::Rk4 { max_step_s }, 2.0e-4, 4.0, 1e-8);
}

#[test]
fn ros2_is_of_order_2() {
    converges(|max_step_s| Method::Rosenbrock { max_step_s }, 5.0e-5, 2.0, 1e-4);
}
