//! Wire types: the ROS 2 messages that the twin reads and writes, as `serde` structs in field order.

pub mod action;
pub mod definition;
pub mod service;
pub mod simulation;
pub mod type_hash;
pub mod upkeep;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use govtwin_model::frame;
use govtwin_model::units::NANOS_PER_SECOND;

/// A ROS 2 message type: what it is called and how it is defined, beside its Rust struct.
pub trait Interface: Serialize + DeserializeOwned {
    /// Full ROS 2 name, `package/msg/Type`.
    const TYPE_NAME: &'static str;

    /// The time of the value, where the message carries a header.
    fn stamp(&self) -> Option<Time>;
}

/// Ties a struct with a header to its ROS 2 name.
macro_rules! stamped {
    ($($type:ident = $name:literal),+ $(,)?) => {$(
        impl Interface for $type {
            const TYPE_NAME: &'static str = $name;

            fn stamp(&self) -> Option<Time> {
                Some(self.header.stamp)
            }
        }

        #[cfg(feature = "ros2")]
        impl ros2_client::Message for $type {}
    )+};
}

stamped! {
    GovernorCommand = "governor_msgs/msg/GovernorCommand",
    EsvState = "governor_msgs/msg/EsvState",
    ServoState = "governor_msgs/msg/ServoState",
    TwinStatus = "governor_msgs/msg/TwinStatus",
    UnitVerdict = "governor_msgs/msg/UnitVerdict",
    FluidPressure = "sensor_msgs/msg/FluidPressure",
    JointState = "sensor_msgs/msg/JointState",
}

/// `rosgraph_msgs/msg/Clock`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Clock {
    /// Simulated time.
    pub clock: Time,
}

impl Interface for Clock {
    const TYPE_NAME: &'static str = "rosgraph_msgs/msg/Clock";

    fn stamp(&self) -> Option<Time> {
        Some(self.clock)
    }
}

/// `builtin_interfaces/msg/Time`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds within the second.
    pub nanosec: u32,
}

impl Time {
    /// Nanoseconds since the epoch; `None` where `nanosec` is not below one second.
    pub fn nanos(self) -> Option<i64> {
        let nanosec = i64::from(self.nanosec);
        (nanosec < NANOS_PER_SECOND).then(|| i64::from(self.sec) * NANOS_PER_SECOND + nanosec)
    }

    /// From nanoseconds since the epoch; times that `sec` cannot hold (before 1901, after 2038) stop at its ends.
    pub fn from_nanos(time_ns: i64) -> Self {
        let nanosec = u32::try_from(time_ns.rem_euclid(NANOS_PER_SECOND)).unwrap_or_default();
        match i32::try_from(time_ns.div_euclid(NANOS_PER_SECOND)) {
            Ok(sec) => Self { sec, nanosec },
            Err(_) if time_ns < 0 => Self { sec: i32::MIN, nanosec: 0 },
            Err(_) => Self { sec: i32::MAX, nanosec: 999_999_999 },
        }
    }
}

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Time of the value.
    pub stamp: Time,
    /// Coordinate frame or device.
    pub frame_id: String,
}

impl Header {
    /// A header with this time and no frame.
    pub fn at(time_ns: i64) -> Self {
        Self { stamp: Time::from_nanos(time_ns), frame_id: String::new() }
    }
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
    /// Of a state at a time since the Unix epoch.
    pub fn of(time_ns: i64, state: frame::EsvState) -> Self {
        let state = match state {
            frame::EsvState::Shutdown => Self::SHUTDOWN,
            frame::EsvState::Normal => Self::NORMAL,
        };
        Self { header: Header::at(time_ns), state }
    }

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

impl ServoState {
    /// Of signals at a time since the Unix epoch.
    pub fn of(time_ns: i64, signals: &frame::Signals) -> Self {
        Self {
            header: Header::at(time_ns),
            spool_position: signals.spool_position_pu,
            servomotor_position: signals.servomotor_position_pu,
            pilot_valve_position: signals.pilot_valve_position_pu,
            control_pressure: signals.control_pressure_pa,
        }
    }
}

/// `governor_msgs/msg/TwinStatus`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct TwinStatus {
    /// The model's time.
    pub header: Header,
    /// 0 waiting, 1 running, 2 holding, 3 fail-safe.
    pub state: u8,
    /// 0 default, 1 fresh, 2 held, 3 failed.
    pub command: u8,
    /// The same of the ESV state.
    pub esv: u8,
    /// The same of the tank pressure.
    pub tank_pressure: u8,
    /// The same of the load force.
    pub load: u8,
    /// Whether the regulator limits the command.
    pub command_clamped: bool,
    /// Whether a learned correction is loaded and not applied.
    pub residual_off: bool,
    /// Stamp of the command in force, 0 where it has none.
    pub command_stamp: Time,
    /// The same of the ESV state.
    pub esv_stamp: Time,
    /// The same of the tank pressure.
    pub tank_pressure_stamp: Time,
    /// The same of the load force.
    pub load_stamp: Time,
    /// What is wrong with inputs and node: a sum of 1 competing publishers, 2 old stamps, 4 a stamp that stands still, 8 stamps far from the
    /// node's time, 16 another node of this name, 32 a latched trip.
    pub health: u8,
}

/// `governor_msgs/msg/FaultSize`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FaultSize {
    /// When the process began.
    pub stamp: Time,
    /// Its kind.
    pub process: String,
    /// The fault.
    pub effect: String,
    /// Its parameter.
    pub parameter: String,
    /// Unit of value, interval and mean.
    pub unit: String,
    /// Estimate.
    pub value: f64,
    /// Lower end of its interval of nine in ten.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether the verdict names the fault.
    pub named: bool,
    /// Mean of the estimates before, of the same kind of process.
    pub mean_before: f64,
    /// Cumulative sum for growth, standard deviations.
    pub growth: f64,
    /// Cumulative sum for shrinkage, standard deviations.
    pub shrinkage: f64,
    /// The sums at which the size counts as moved, standard deviations.
    pub limit: f64,
    /// Whether it has moved.
    pub moved: bool,
}

/// `governor_msgs/msg/UnitVerdict`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UnitVerdict {
    /// When the process began, and the unit's name.
    pub header: Header,
    /// Its kind.
    pub process: String,
    /// Its length, s.
    pub duration: f64,
    /// The verdict's word.
    pub verdict: String,
    /// Share of the gap that the named faults close; NaN where there is none.
    pub closure: f64,
    /// Every size that the history follows.
    pub sizes: Vec<FaultSize>,
    /// What has moved, in sentences.
    pub warnings: Vec<String>,
    /// Processes in the history.
    pub processes: u32,
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

impl JointState {
    /// The place of a joint; none where it is absent.
    ///
    /// # Errors
    /// In words, where it is there twice: nobody can tell which is meant.
    pub fn joint(&self, name: &str) -> Result<Option<usize>, String> {
        let mut places = self.name.iter().enumerate().filter(|(_, known)| *known == name).map(|(place, _)| place);
        match (places.next(), places.next()) {
            (Some(_), Some(_)) => Err(format!("a joint command with the joint `{name}` twice")),
            (place, _) => Ok(place),
        }
    }
}
