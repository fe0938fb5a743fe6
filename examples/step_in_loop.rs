//! The twin in a loop of yours: a speed governor, a turbine with its rotor, and a load that steps.
//!
//! ```sh
//! cargo run --release --example step_in_loop
//! ```

use govtwin::{EsvState, Frame, Inputs, Signals, Twin, reference_unit};

/// Time between two rows: the governor runs at 100 Hz.
const PERIOD_NS: i64 = 10_000_000;
const PERIOD_S: f64 = 0.01;
/// Time that the rated torque takes to bring the rotor to its rated speed, s.
const STARTING_TIME_S: f64 = 8.0;
/// Gains of the speed governor: pu of opening for each pu of speed, and for each pu s.
const PROPORTIONAL: f64 = 2.0;
const INTEGRAL_PER_S: f64 = 0.3;

pub fn main() {
    let course = load_step(90.0);
    for row in course.iter().step_by(500) {
        println!("{:5.1} s: speed {:.4} pu, opening {:.3} pu", row.time_s, row.speed_pu, row.opening_pu);
    }
    let lowest = course.iter().map(|row| row.speed_pu).fold(f64::INFINITY, f64::min);
    println!("lowest speed {lowest:.4} pu");
}

/// One instant of the loop.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    pub time_s: f64,
    pub speed_pu: f64,
    pub opening_pu: f64,
}

/// At 5 s the load of an islanded unit steps from 50 % to 55 %.
pub fn load_step(length_s: f64) -> Vec<Row> {
    let mut twin = Twin::new(&reference_unit());
    let (mut speed_pu, mut opening_pu, mut integral_pu) = (1.0, 0.5, 0.5);
    let mut course = Vec::new();
    let mut time_ns = 0;
    loop {
        let time_s = time_ns as f64 * 1e-9;
        if time_s > length_s {
            return course;
        }
        let error_pu = 1.0 - speed_pu;
        integral_pu += INTEGRAL_PER_S * error_pu * PERIOD_S;
        let inputs = Inputs {
            opening_command_pu: (integral_pu + PROPORTIONAL * error_pu).clamp(0.0, 1.0),
            esv: EsvState::Normal,
            tank_pressure_pa: 6.0e6,
            piston_force_n: 0.0,
        };
        // The first frame says where the unit stands; after it the twin knows.
        let measured =
            if time_ns == 0 { Signals { servomotor_position_pu: opening_pu, ..Signals::NONE } } else { Signals::NONE };
        opening_pu = twin.step(&Frame { time_ns, inputs, measured }).signals.servomotor_position_pu;
        let load_pu = if time_s < 5.0 { 0.50 } else { 0.55 };
        speed_pu += (opening_pu - load_pu) / STARTING_TIME_S * PERIOD_S;
        course.push(Row { time_s, speed_pu, opening_pu });
        time_ns += PERIOD_NS;
    }
}
