//! Decoding of the streams: bytes to samples, with values that cannot be dropped and counted.

use super::evidence::StreamEvidence;
use super::qualification::{
    ANY_COMMAND_LIMITS, ANY_LIMITS, COMMAND_LIMITS, FORCE_LIMITS, POSITION_LIMITS, PRESSURE_LIMITS, check_tank_pressure,
};
use super::topic::RawView;
use super::{Positions, StreamHealth, cdr};
use crate::msg::{self, Interface, Time};
use govtwin_model::frame::{EsvState, Signals};
use govtwin_model::parameters::{ChannelReading, ChannelReadings};

/// The joint whose effort is the force on the piston.
const SERVOMOTOR: &str = "servomotor";

/// One decoded value with its times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Sample<V> {
    /// `header.stamp`, ns.
    pub(super) stamp_ns: i64,
    /// Time of recording, ns; only orders arrival.
    pub(super) log_time_ns: i64,
    /// The value.
    pub(super) value: V,
}

/// A value that one of the streams carries.
pub(super) trait Value: Copy + Sized {
    /// The message that carries it.
    type Message: Interface;

    /// Takes the value out, or returns why it is none. Parts that are dropped go to `faults`.
    fn of(message: &Self::Message, positions: Positions, faults: &mut Vec<String>) -> Result<Self, String>;

    /// Equal to the last bit: a repeated message, not a new one.
    fn same(self, other: Self) -> bool {
        self.number().to_bits() == other.number().to_bits()
    }

    /// The sender by the message's own statement.
    fn frame_id(message: &Self::Message) -> &str;

    /// A number of it, NaN where it has none.
    fn number(self) -> f64;
}

/// Opening command, pu.
#[derive(Clone, Copy, Debug)]
pub(super) struct OpeningCommand(pub(super) f64);

impl Value for OpeningCommand {
    type Message = msg::GovernorCommand;

    fn of(message: &Self::Message, positions: Positions, _: &mut Vec<String>) -> Result<Self, String> {
        // Where nobody states what positions are recorded in, nobody states it of what is asked for.
        let limits = if positions == Positions::AnyUnit { ANY_COMMAND_LIMITS } else { COMMAND_LIMITS };
        limits.check(message.opening).map(Self)
    }

    fn frame_id(message: &Self::Message) -> &str {
        &message.header.frame_id
    }

    fn number(self) -> f64 {
        self.0
    }
}

/// Force on the piston, N, + opens; NaN where a joint command asks for none, so that the last one holds.
#[derive(Clone, Copy, Debug)]
pub(super) struct PistonForce(pub(super) f64);

impl Value for PistonForce {
    type Message = msg::JointState;

    fn of(message: &Self::Message, _: Positions, faults: &mut Vec<String>) -> Result<Self, String> {
        let index = message.joint(SERVOMOTOR)?;
        let index = index.ok_or_else(|| format!("a joint command without the joint `{SERVOMOTOR}`"))?;
        if message.position.get(index).is_some_and(|position_m| !position_m.is_nan()) {
            faults.push(
                "a joint command for a position, which no replay takes: it reads openings from the command's topic; \
                         `govtwin run --bag` writes them there"
                    .to_owned(),
            );
        }
        let force_n = message.effort.get(index).copied().unwrap_or(f64::NAN);
        Ok(Self(FORCE_LIMITS.check_signal(force_n, faults)))
    }

    fn frame_id(message: &Self::Message) -> &str {
        &message.header.frame_id
    }

    fn number(self) -> f64 {
        self.0
    }
}

/// Tank pressure, Pa.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pressure(pub(super) f64);

impl Value for Pressure {
    type Message = msg::FluidPressure;

    fn of(message: &Self::Message, _: Positions, _: &mut Vec<String>) -> Result<Self, String> {
        check_tank_pressure(message.fluid_pressure).map(Self)
    }

    fn frame_id(message: &Self::Message) -> &str {
        &message.header.frame_id
    }

    fn number(self) -> f64 {
        self.0
    }
}

impl Value for EsvState {
    type Message = msg::EsvState;

    fn of(message: &Self::Message, _: Positions, _: &mut Vec<String>) -> Result<Self, String> {
        match message.state {
            msg::EsvState::SHUTDOWN => Ok(Self::Shutdown),
            msg::EsvState::NORMAL => Ok(Self::Normal),
            other => Err(format!("ESV state is {other}, expected 0 (shutdown) or 1 (normal)")),
        }
    }

    fn frame_id(message: &Self::Message) -> &str {
        &message.header.frame_id
    }

    fn number(self) -> f64 {
        f64::NAN
    }

    fn same(self, other: Self) -> bool {
        self == other
    }
}

impl Value for Signals {
    type Message = msg::ServoState;

    fn of(message: &Self::Message, positions: Positions, faults: &mut Vec<String>) -> Result<Self, String> {
        let mut position = |reading: fn(&ChannelReadings) -> ChannelReading, recorded: f64| match positions {
            Positions::Pu => POSITION_LIMITS.check_signal(recorded, faults),
            Positions::Recorded(channels) => {
                POSITION_LIMITS.check_signal(reading(&channels).position_pu(recorded), faults)
            }
            // An infinity is no position in any unit.
            Positions::AnyUnit => ANY_LIMITS.check_signal(recorded, faults),
        };
        Ok(Self {
            spool_position_pu: position(|channels| channels.spool_position, message.spool_position),
            servomotor_position_pu: position(|channels| channels.servomotor_position, message.servomotor_position),
            pilot_valve_position_pu: POSITION_LIMITS.check_signal(message.pilot_valve_position, faults),
            control_pressure_pa: PRESSURE_LIMITS.check_signal(message.control_pressure, faults),
        })
    }

    fn frame_id(message: &Self::Message) -> &str {
        &message.header.frame_id
    }

    fn number(self) -> f64 {
        let all = [
            self.spool_position_pu,
            self.servomotor_position_pu,
            self.pilot_valve_position_pu,
            self.control_pressure_pa,
        ];
        all.into_iter().find(|number| number.is_finite()).unwrap_or(f64::NAN)
    }

    fn same(self, other: Self) -> bool {
        let bits = |signals: Self| {
            [
                signals.spool_position_pu,
                signals.servomotor_position_pu,
                signals.pilot_valve_position_pu,
                signals.control_pressure_pa,
            ]
            .map(f64::to_bits)
        };
        bits(self) == bits(other)
    }
}

/// Decodes one message into a sample; what cannot be used is counted.
pub(super) fn decode<V: Value>(
    view: RawView<'_>,
    positions: Positions,
    health: &mut StreamHealth,
    evidence: &mut StreamEvidence,
) -> Option<Sample<V>> {
    let log_time_ns = view.log_time_ns;
    health.messages += 1;
    let message: V::Message = match cdr::decode(view.data) {
        Ok(message) => message,
        Err(error) => {
            health.undecodable += 1;
            note(health, log_time_ns, &error.to_string());
            return None;
        }
    };
    evidence.message(view, V::frame_id(&message));
    let Some(stamp_ns) = message.stamp().and_then(Time::nanos) else {
        health.bad_stamps += 1;
        note(health, log_time_ns, "stamp is no time: its nanoseconds reach a whole second");
        return None;
    };
    let mut faults = vec![];
    let value = V::of(&message, positions, &mut faults).map_err(|fault| faults.push(fault)).ok();
    health.bad_values += faults.len() as u64;
    if let Some(fault) = faults.first() {
        health.bad_messages += 1;
        note(health, log_time_ns, fault);
    }
    value.map(|value| Sample { stamp_ns, log_time_ns, value })
}

/// Keeps the first fault of a stream with its place.
pub(super) fn note(health: &mut StreamHealth, log_time_ns: i64, fault: &str) {
    if health.first_fault.is_none() {
        health.first_fault = Some(format!("{fault} (logged at {log_time_ns} ns)"));
    }
}
