//! Decoding of the four streams: bytes to samples, with values that cannot be dropped and counted.

use super::{StreamHealth, cdr};
use crate::frame::{EsvState, Signals};
use crate::msg::{self, Interface, Time};

/// A physically possible range.
#[derive(Clone, Copy, Debug)]
struct Limits {
    what: &'static str,
    unit: &'static str,
    least: f64,
    most: f64,
}

/// A command outside this range asks for no guide-vane opening that exists, overshoot included.
const COMMAND: Limits = Limits { what: "opening", unit: "pu", least: -0.5, most: 1.5 };
/// From vacuum to ten times the pressure of any governor's tank.
const PRESSURE: Limits = Limits { what: "pressure", unit: "Pa", least: -1.1e5, most: 1.0e8 };
/// Positions in pu; a transducer may overshoot its span, not multiply it.
const POSITION: Limits = Limits { what: "position", unit: "pu", least: -10.0, most: 10.0 };

impl Limits {
    fn check(self, value: f64) -> Result<f64, String> {
        let Self { what, unit, least, most } = self;
        if (least..=most).contains(&value) {
            Ok(value)
        } else {
            Err(format!("{what} is {value} {unit}, expected {least} to {most} {unit}"))
        }
    }

    /// NaN says "not available" and passes.
    fn check_signal(self, value: f64, faults: &mut Vec<String>) -> f64 {
        if value.is_nan() {
            return value;
        }
        self.check(value).unwrap_or_else(|fault| {
            faults.push(fault);
            f64::NAN
        })
    }
}

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

    /// Takes the value out, or says why it cannot be one. Parts that are dropped go to `faults`.
    fn of(message: &Self::Message, faults: &mut Vec<String>) -> Result<Self, String>;

    /// Equal to the last bit: a repeated message, not a new one.
    fn same(self, other: Self) -> bool;
}

/// Opening command, pu.
#[derive(Clone, Copy, Debug)]
pub(super) struct Command(pub(super) f64);

impl Value for Command {
    type Message = msg::GovernorCommand;

    fn of(message: &Self::Message, _: &mut Vec<String>) -> Result<Self, String> {
        COMMAND.check(message.opening).map(Self)
    }

    fn same(self, other: Self) -> bool {
        self.0.to_bits() == other.0.to_bits()
    }
}

/// Tank pressure, Pa.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pressure(pub(super) f64);

impl Value for Pressure {
    type Message = msg::FluidPressure;

    fn of(message: &Self::Message, _: &mut Vec<String>) -> Result<Self, String> {
        PRESSURE.check(message.fluid_pressure).map(Self)
    }

    fn same(self, other: Self) -> bool {
        self.0.to_bits() == other.0.to_bits()
    }
}

impl Value for EsvState {
    type Message = msg::EsvState;

    fn of(message: &Self::Message, _: &mut Vec<String>) -> Result<Self, String> {
        match message.state {
            msg::EsvState::SHUTDOWN => Ok(Self::Shutdown),
            msg::EsvState::NORMAL => Ok(Self::Normal),
            other => Err(format!("ESV state is {other}, expected 0 (shutdown) or 1 (normal)")),
        }
    }

    fn same(self, other: Self) -> bool {
        self == other
    }
}

impl Value for Signals {
    type Message = msg::ServoState;

    fn of(message: &Self::Message, faults: &mut Vec<String>) -> Result<Self, String> {
        Ok(Self {
            spool_position_pu: POSITION.check_signal(message.spool_position, faults),
            servomotor_position_pu: POSITION.check_signal(message.servomotor_position, faults),
            pilot_valve_position_pu: POSITION.check_signal(message.pilot_valve_position, faults),
            control_pressure_pa: PRESSURE.check_signal(message.control_pressure, faults),
        })
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
pub(super) fn decode<V: Value>(data: &[u8], log_time_ns: i64, health: &mut StreamHealth) -> Option<Sample<V>> {
    health.messages += 1;
    let message: V::Message = match cdr::decode(data) {
        Ok(message) => message,
        Err(error) => {
            health.undecodable += 1;
            note(health, log_time_ns, &error.to_string());
            return None;
        }
    };
    let Some(stamp_ns) = message.stamp().and_then(Time::nanos) else {
        health.bad_stamps += 1;
        note(health, log_time_ns, "stamp is no time: its nanoseconds reach a whole second");
        return None;
    };
    let mut faults = vec![];
    let value = V::of(&message, &mut faults).map_err(|fault| faults.push(fault)).ok();
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
