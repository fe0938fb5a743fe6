//! One row of what the residual may know: the inputs, the opening that the regulator reads, and the twin's own words.

use serde::{Deserialize, Serialize};

use govtwin_model::frame::{Estimate, EsvState, Frame};
use govtwin_model::signal::Signal;
use govtwin_model::stored::with_words;

with_words! {
    /// Where the guide-vane opening of a row comes from.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Opening: id {
        /// The twin runs in closed loop: its own servomotor.
        Simulated = "simulated",
        /// The measured servomotor feeds the twin's regulator (the paper's mode).
        Measured = "measured",
    }
}

with_words! {
    /// What drives the twin between two recorded rows: the option `--rate-of-inputs`.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum RateOfInputs: id {
        /// Inputs hold until the next row, as a live node holds its last inputs.
        #[default]
        Hold = "hold",
        /// Inputs run straight from row to row, as a node has them whose commands come fast.
        Linear = "linear",
    }
}

with_words! {
    /// One number of a row.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub enum RowChannel: id {
        /// Guide-vane opening command, pu.
        Command = "command_pu",
        /// Guide-vane opening, pu.
        Opening = "opening_pu",
        /// Oil pressure of the pressure tank, Pa.
        TankPressure = "tank_pressure_pa",
        /// Emergency shutdown valve: 1 normal, 0 shutdown.
        Esv = "esv",
        /// Command − opening, pu.
        Error = "error_pu",
        /// The twin's estimate of the signal to correct, in its unit.
        Model = "model",
        /// The twin's spool speed, m/s.
        SpoolSpeed = "model_spool_speed_m_s",
        /// The twin's servomotor speed, m/s.
        ServomotorSpeed = "model_servomotor_speed_m_s",
        /// The twin's pilot-valve position, pu.
        Pilot = "model_pilot_pu",
        /// The twin's control pressure, Pa.
        ControlPressure = "model_control_pressure_pa",
        /// The regulator's demand on the spool, pu.
        SpoolCommand = "model_spool_command_pu",
        /// The regulator's current to the proportional valve, pu.
        ValveCurrent = "model_valve_current_pu",
    }
}

impl RowChannel {
    /// Whether it is the twin's word and not an input.
    pub fn is_model(self) -> bool {
        self >= Self::Model
    }
}

/// The channels at one instant, in the order of [`RowChannel::ALL`]; NaN where there is none.
pub type ChannelRow = [f64; RowChannel::ALL.len()];

/// Makes rows of frames and estimates; a measured opening holds from one sample to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RowMaker {
    opening: Opening,
    signal: Signal,
    held_pu: f64,
}

impl RowMaker {
    /// Rows for correcting a signal, with the opening from where it comes.
    pub(crate) fn new(opening: Opening, signal: Signal) -> Self {
        Self { opening, signal, held_pu: f64::NAN }
    }

    /// Forgets the opening that it holds.
    pub(crate) fn reset(&mut self) {
        self.held_pu = f64::NAN;
    }

    /// The row of a frame and of the twin's estimate for it.
    pub(crate) fn row(&mut self, frame: &Frame, estimate: &Estimate) -> ChannelRow {
        let now_pu = match self.opening {
            Opening::Simulated => estimate.signals.servomotor_position_pu,
            Opening::Measured => frame.measured.servomotor_position_pu,
        };
        if self.opening == Opening::Simulated || !now_pu.is_nan() {
            self.held_pu = now_pu;
        }
        let inputs = &frame.inputs;
        [
            inputs.opening_command_pu,
            self.held_pu,
            inputs.tank_pressure_pa,
            f64::from(u8::from(inputs.esv == EsvState::Normal)),
            inputs.opening_command_pu - self.held_pu,
            self.signal.of(&estimate.signals),
            estimate.spool_velocity_m_s,
            estimate.servomotor_velocity_m_s,
            estimate.signals.pilot_valve_position_pu,
            estimate.signals.control_pressure_pa,
            estimate.spool_command_pu,
            estimate.valve_current_pu,
        ]
    }
}
