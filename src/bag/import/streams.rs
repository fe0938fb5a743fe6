//! A row as messages of this project's own types, as bags and the bus hold them.

use super::row::{ImportedRow, Target};
use crate::msg::{EsvState, FluidPressure, GovernorCommand, Header, ServoState};
use govtwin_model::frame;

/// The messages of one row, each where the row has something for it.
#[derive(Clone, Debug, PartialEq)]
pub struct RowMessages {
    /// Opening command.
    pub command: Option<GovernorCommand>,
    /// State of the ESV.
    pub esv: Option<EsvState>,
    /// Tank pressure.
    pub tank_pressure: Option<FluidPressure>,
    /// Measured state; what of it the row does not hold is NaN.
    pub servo_state: Option<ServoState>,
}

impl RowMessages {
    /// The messages of a row, stamped with its time.
    pub fn of(row: &ImportedRow) -> Self {
        let header = || Header::at(row.time_ns);
        let state = |state| match state {
            frame::EsvState::Shutdown => EsvState::SHUTDOWN,
            frame::EsvState::Normal => EsvState::NORMAL,
        };
        let measured =
            [Target::SpoolPosition, Target::ServomotorPosition, Target::PilotValvePosition, Target::ControlPressure]
                .map(|target| row.value(target));
        let [spool_position, servomotor_position, pilot_valve_position, control_pressure] =
            measured.map(|value| value.unwrap_or(f64::NAN));
        Self {
            command: row.value(Target::OpeningCommand).map(|opening| GovernorCommand { header: header(), opening }),
            esv: row.esv().map(|esv| EsvState { header: header(), state: state(esv) }),
            tank_pressure: row.value(Target::TankPressure).map(|fluid_pressure| FluidPressure {
                header: header(),
                fluid_pressure,
                variance: 0.0,
            }),
            servo_state: measured.iter().any(Option::is_some).then(|| ServoState {
                header: header(),
                spool_position,
                servomotor_position,
                pilot_valve_position,
                control_pressure,
            }),
        }
    }
}
