//! What an owner's expression may look at: names with units, and how far each usually ranges.

use crate::plant::term::View;

/// One name.
#[derive(Clone, Copy, Debug)]
pub struct Variable {
    /// As the expression writes it.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// What it is.
    pub doc: &'static str,
    /// Between which values expressions are tried, in the variable's unit.
    pub usual: (f64, f64),
    /// Its value, from the signal at the point and the view there.
    pub of: fn(f64, &View<'_>) -> f64,
}

const fn variable(
    name: &'static str,
    unit: &'static str,
    usual: (f64, f64),
    doc: &'static str,
    of: fn(f64, &View<'_>) -> f64,
) -> Variable {
    Variable { name, unit, doc, usual, of }
}

/// All names; the state is that at the start of the tick.
pub const VARIABLES: [Variable; 14] = [
    variable("signal", "of the point", (-1.2, 1.2), "what stands at the point before this term", |signal, _| signal),
    variable("time_s", "s", (0.0, 100.0), "time since the first row", |_, view| view.time_s),
    variable("tank_pressure_pa", "Pa", (2.0e6, 8.0e6), "tank pressure, gauge", |_, view| view.tank_pressure_pa),
    variable("spool_reading_pu", "pu", (-1.2, 1.2), "spool reading", |_, view| view.spool_reading_pu),
    variable("servomotor_reading_pu", "pu", (0.0, 1.0), "servomotor reading", |_, view| view.servomotor_reading_pu),
    variable("pilot_position_pu", "pu", (-1.0, 1.0), "pilot-valve position, + fills", |_, view| {
        view.state.pilot_position_pu
    }),
    variable("pilot_rate_pu_s", "pu/s", (-100.0, 100.0), "its rate", |_, view| view.state.pilot_rate_pu_s),
    variable("control_pressure_pa", "Pa", (0.0, 7.0e6), "control-chamber pressure, gauge", |_, view| {
        view.state.control_pressure_pa
    }),
    variable("spool_position_m", "m", (-0.02, 0.02), "spool position, + opens", |_, view| view.state.spool_position_m),
    variable("spool_velocity_m_s", "m/s", (-0.5, 0.5), "spool speed, + opens", |_, view| view.state.spool_velocity_m_s),
    variable("opening_pressure_pa", "Pa", (0.0, 7.0e6), "pressure in the opening chamber, gauge", |_, view| {
        view.state.opening_pressure_pa
    }),
    variable("closing_pressure_pa", "Pa", (0.0, 7.0e6), "pressure in the closing chamber, gauge", |_, view| {
        view.state.closing_pressure_pa
    }),
    variable("servomotor_position_m", "m", (0.0, 0.6), "piston position, 0 closed", |_, view| {
        view.state.servomotor_position_m
    }),
    variable("servomotor_velocity_m_s", "m/s", (-0.3, 0.3), "piston speed, + opens", |_, view| {
        view.state.servomotor_velocity_m_s
    }),
];

/// A place within the usual ranges, the same for the same number; 0 is at rest in the middle.
pub fn sample(number: usize) -> [f64; VARIABLES.len()] {
    std::array::from_fn(|k| {
        let (low, high) = VARIABLES[k].usual;
        if number == 0 && low < 0.0 {
            return 0.0;
        }
        // Additive recurrences with irrational steps fill a box evenly (Niederreiter 1992, section 3).
        let step = ((2 * k + 3) as f64).sqrt() + std::f64::consts::E * (k + 1) as f64;
        low + (high - low) * (0.5 + step * number as f64).fract()
    })
}
