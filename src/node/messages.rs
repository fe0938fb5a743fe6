//! Estimates and inputs as the messages that leave the node.

use super::core::{InputState, Tick};
use super::health::{Health, HealthFlags};
use govtwin_bag::msg::{self, Header};
use govtwin_model::frame::{Estimate, Inputs};

/// Names of the two joints, in the order of [`joint_state`].
pub(crate) const JOINTS: [&str; 2] = ["spool", "servomotor"];

/// The simulated signals, in the units of a plant's own topic.
pub(crate) fn servo_state(estimate: &Estimate) -> msg::ServoState {
    msg::ServoState::of(estimate.time_ns, &estimate.signals)
}

/// What stands behind the state of a tick, and what is wrong with inputs and node.
pub(crate) fn status(tick: &Tick, health: HealthFlags) -> msg::TwinStatus {
    let state = match &tick.estimate {
        None => 0,
        Some(_) if tick.fail_safe => 3,
        Some(_) if tick.states.iter().any(|state| matches!(state, InputState::Held | InputState::Failed)) => 2,
        Some(_) => 1,
    };
    let [command, esv, tank_pressure, load] = tick.states.map(|state| state as u8);
    let [command_stamp, esv_stamp, tank_pressure_stamp, load_stamp] = tick.stamps_ns.map(msg::Time::from_nanos);
    msg::TwinStatus {
        header: Header::at(tick.frame.time_ns),
        state,
        command,
        esv,
        tank_pressure,
        load,
        command_clamped: tick.is_clamped(),
        residual_off: tick.correction.as_ref().is_some_and(|correction| correction.weight_share <= 0.0),
        command_stamp,
        esv_stamp,
        tank_pressure_stamp,
        load_stamp,
        health: health.all() | if tick.latched { Health::LATCHED } else { 0 },
    }
}

/// Spool and servomotor in metres and metres per second.
pub(crate) fn joint_state(estimate: &Estimate, [spool_stroke_m, servomotor_stroke_m]: [f64; 2]) -> msg::JointState {
    let spool_m = estimate.signals.spool_position_pu * spool_stroke_m;
    let servomotor_m = estimate.signals.servomotor_position_pu * servomotor_stroke_m;
    msg::JointState {
        header: Header::at(estimate.time_ns),
        name: JOINTS.map(str::to_owned).to_vec(),
        position: vec![spool_m, servomotor_m],
        velocity: vec![estimate.spool_velocity_m_s, estimate.servomotor_velocity_m_s],
        effort: Vec::new(),
    }
}

/// The command as a message stamped `time_ns`.
pub(crate) fn command(inputs: &Inputs, time_ns: i64) -> msg::GovernorCommand {
    msg::GovernorCommand { header: Header::at(time_ns), opening: inputs.opening_command_pu }
}

/// A load force as the joint command that asks for it, stamped `time_ns`.
pub(crate) fn load(load_n: f64, time_ns: i64) -> msg::JointState {
    msg::JointState {
        header: Header::at(time_ns),
        name: vec![JOINTS[1].to_owned()],
        effort: vec![load_n],
        ..msg::JointState::default()
    }
}

/// The ESV's state as a message stamped `time_ns`.
pub(crate) fn esv(inputs: &Inputs, time_ns: i64) -> msg::EsvState {
    msg::EsvState::of(time_ns, inputs.esv)
}

/// The tank pressure as a message stamped `time_ns`.
pub(crate) fn tank_pressure(inputs: &Inputs, time_ns: i64) -> msg::FluidPressure {
    msg::FluidPressure { header: Header::at(time_ns), fluid_pressure: inputs.tank_pressure_pa, variance: 0.0 }
}
