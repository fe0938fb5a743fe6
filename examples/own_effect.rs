//! An effect that the catalogue lacks: an expression in the state, added at one point of the chain.
//!
//! ```sh
//! cargo run --release --example own_effect
//! ```
//! A parameter file can say the same: see `docs/own_effect.md`.

use std::error::Error;

use govtwin::{EsvState, Frame, Inputs, OwnEffect, OwnParameter, Signals, Twin, Unit, reference_unit};

pub fn main() -> Result<(), Box<dyn Error>> {
    let nominal = reference_unit();
    let sticky = nominal.clone().with_own_effect(stiction())?;
    for height_n in [0.0, 1.0e4, 3.0e4] {
        let unit = sticky.clone().with_effect("dry_bushings", &[("height_n", height_n)])?;
        println!("height {height_n:6.0} N: farthest from the nominal twin {:.5} pu", farthest_pu(&unit, &nominal));
    }
    Ok(())
}

/// Dry guide-vane bushings: a force that holds at low speed and fades as they slide.
pub fn stiction() -> OwnEffect {
    let parameter = |name: &str, unit: &str, [neutral, min, max, typical]: [f64; 4], doc: &str| OwnParameter {
        name: name.to_owned(),
        unit: unit.to_owned(),
        neutral,
        min,
        max,
        typical,
        doc: doc.to_owned(),
    };
    OwnEffect {
        id: "dry_bushings".to_owned(),
        doc: "Dry bushings that hold at low speed".to_owned(),
        at: "servomotor_force_n".to_owned(),
        stage: String::new(), // that of the point
        expression: "-height_n*tanh(servomotor_velocity_m_s/width_m_s)".to_owned(),
        parameters: vec![
            parameter("height_n", "N", [0.0, 0.0, 5.0e4, 5.0e3], "height of the hump"),
            parameter("width_m_s", "m/s", [0.02, 1.0e-3, 0.1, 0.01], "speed at which it has faded in"),
        ],
    }
}

/// How far apart the servomotors of two units are at most, over a ramp of the command from 30 % to 60 % within 6 s, pu of stroke.
pub fn farthest_pu(one: &Unit, other: &Unit) -> f64 {
    let (mut one, mut other) = (Twin::new(one), Twin::new(other));
    let mut farthest_pu: f64 = 0.0;
    for row in 0..1000 {
        let time_s = f64::from(row) * 0.01;
        let opening_command_pu = 0.3 + 0.3 * ((time_s - 1.0) / 6.0).clamp(0.0, 1.0);
        let inputs = Inputs { opening_command_pu, esv: EsvState::Normal, tank_pressure_pa: 6.0e6, piston_force_n: 0.0 };
        let frame = Frame { time_ns: i64::from(row) * 10_000_000, inputs, measured: Signals::NONE };
        let position_pu = |twin: &mut Twin| twin.step(&frame).signals.servomotor_position_pu;
        farthest_pu = farthest_pu.max((position_pu(&mut one) - position_pu(&mut other)).abs());
    }
    farthest_pu
}
