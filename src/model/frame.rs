//! One row of data: what a twin reads and what it estimates, at one instant.

/// State of the emergency shutdown valve (ESV).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum EsvState {
    /// The solenoid has switched: the control chamber drains to return.
    Shutdown,
    /// The rest state: pilot oil passes to the control chamber.
    Normal,
}

/// What acts on the servo system from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inputs {
    /// Guide-vane opening command `Y_pid`, pu of full servomotor stroke.
    pub opening_command_pu: f64,
    /// State of the emergency shutdown valve.
    pub esv: EsvState,
    /// Oil pressure of the pressure tank, Pa gauge.
    pub tank_pressure_pa: f64,
    /// Force on the servomotor's piston besides the sheet's load, such as that of a coupled water column, N, + opens.
    pub piston_force_n: f64,
}

/// Positions and pilot signals of the servo system, measured or simulated; NaN where not available.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Signals {
    /// Main distributing valve spool position `y`, pu of the reference stroke, + opens.
    pub spool_position_pu: f64,
    /// Servomotor position `Y`, pu of full stroke, 0 closed.
    pub servomotor_position_pu: f64,
    /// Proportional (pilot) valve position `x_p`, pu of full stroke, + fills the control chamber.
    pub pilot_valve_position_pu: f64,
    /// Control-chamber pressure `P_ctrl`, Pa gauge.
    pub control_pressure_pa: f64,
}

impl Signals {
    /// No signal available.
    pub const NONE: Self = Self {
        spool_position_pu: f64::NAN,
        servomotor_position_pu: f64::NAN,
        pilot_valve_position_pu: f64::NAN,
        control_pressure_pa: f64::NAN,
    };
}

/// One row: the inputs in force from this instant on, and what was measured at it.
///
/// Inputs hold from the frame's time until the next frame (zero-order hold). `measured` is NaN in
/// every signal for which no sample carries this very stamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Time of the row, ns since an epoch that all rows of a recording share.
    pub time_ns: i64,
    /// Inputs from this instant on.
    pub inputs: Inputs,
    /// Signals sampled at this instant.
    pub measured: Signals,
}

/// The state of the servo system that a twin estimates for one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Time for which it holds, ns; equal to the frame's.
    pub time_ns: i64,
    /// The simulated signals, as the plant's own transducers would show them.
    pub signals: Signals,
    /// Spool speed, m/s, + opens.
    pub spool_velocity_m_s: f64,
    /// Servomotor piston speed, m/s, + opens.
    pub servomotor_velocity_m_s: f64,
    /// Pressure in the servomotor's opening chamber, Pa gauge.
    pub opening_chamber_pressure_pa: f64,
    /// Pressure in the servomotor's closing chamber, Pa gauge.
    pub closing_chamber_pressure_pa: f64,
    /// The regulator's demand on the spool `u_y`, pu of the reference stroke.
    pub spool_command_pu: f64,
    /// Standard deviation of that demand over the noise of the reading, and over when a slowed large loop runs, pu; 0 unless the twin is a mean.
    pub spool_command_sd_pu: f64,
    /// The regulator's current to the proportional valve `u`, pu.
    pub valve_current_pu: f64,
}
