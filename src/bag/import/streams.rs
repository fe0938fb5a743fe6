//! A row as messages of this project's own types, as bags and the bus hold them.

use super::row::{ImportedRow, Target};
use crate::msg::{EsvState, FluidPressure, GovernorCommand, Header, ServoState};
use govtwin_model::frame::Signals;
use govtwin_model::signal::Signal;

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
        let signal = |target| row.value(target).unwrap_or(f64::NAN);
        let signals = Signals {
            spool_position_pu: signal(Target::SpoolPosition),
            servomotor_position_pu: signal(Target::ServomotorPosition),
            pilot_valve_position_pu: signal(Target::PilotValvePosition),
            control_pressure_pa: signal(Target::ControlPressure),
        };
        Self {
            command: row.value(Target::OpeningCommand).map(|opening| GovernorCommand { header: header(), opening }),
            esv: row.esv().map(|esv| EsvState::of(row.time_ns, esv)),
            tank_pressure: row.value(Target::TankPressure).map(|fluid_pressure| FluidPressure {
                header: header(),
                fluid_pressure,
                variance: 0.0,
            }),
            servo_state: Signal::ALL
                .iter()
                .any(|signal| !signal.of(&signals).is_nan())
                .then(|| ServoState::of(row.time_ns, &signals)),
        }
    }
}
