//! Wire types: the ROS 2 messages that the twin reads and writes, as `serde` structs in field order.

use serde::{Deserialize, Serialize};

/// `builtin_interfaces/msg/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds within the second.
    pub nanosec: u32,
}

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Time of the value.
    pub stamp: Time,
    /// Coordinate frame or device.
    pub frame_id: String,
}

/// `governor_msgs/msg/GovernorCommand`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GovernorCommand {
    /// When the regulator issued the command.
    pub header: Header,
    /// Guide-vane opening command, pu.
    pub opening: f64,
}

/// `governor_msgs/msg/EsvState`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct EsvState {
    /// When the state was read.
    pub header: Header,
    /// [`EsvState::SHUTDOWN`] or [`EsvState::NORMAL`].
    pub state: u8,
}

impl EsvState {
    /// The control chamber drains to return.
    pub const SHUTDOWN: u8 = 0;
    /// Pilot oil passes to the control chamber.
    pub const NORMAL: u8 = 1;
}

/// `governor_msgs/msg/ServoState`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ServoState {
    /// When the values were valid.
    pub header: Header,
    /// Spool position, pu of the reference stroke.
    pub spool_position: f64,
    /// Servomotor position, pu of full stroke.
    pub servomotor_position: f64,
    /// Pilot-valve position, pu of full stroke.
    pub pilot_valve_position: f64,
    /// Control-chamber pressure, Pa gauge.
    pub control_pressure: f64,
}

/// `sensor_msgs/msg/FluidPressure`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FluidPressure {
    /// When the pressure was read.
    pub header: Header,
    /// Pressure, Pa.
    pub fluid_pressure: f64,
    /// Variance, Pa²; 0 where unknown.
    pub variance: f64,
}

/// `sensor_msgs/msg/JointState`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    /// When the values were valid.
    pub header: Header,
    /// Joint names.
    pub name: Vec<String>,
    /// Positions, m.
    pub position: Vec<f64>,
    /// Velocities, m/s.
    pub velocity: Vec<f64>,
    /// Efforts, N.
    pub effort: Vec<f64>,
}
