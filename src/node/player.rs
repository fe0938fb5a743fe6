//! Publishing a recording over DDS with its timing.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ros2_client::Publisher;

use super::bus::{Bus, BusError};
use super::realtime::{Until, monotonic_ns, pause, sleep_until};
use crate::bag::{RawMessage, cdr};
use crate::msg::{Clock, EsvState, FluidPressure, GovernorCommand, Interface, JointState, ServoState, Time};
use crate::units::seconds_from_nanos;

/// Longest sleep before looking whether to stop, ns.
const NAP_NS: i64 = 20_000_000;

/// Once the first listener is there, others get so long to come too.
const SETTLE: Duration = Duration::from_millis(700);

/// How to play.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Speed, 1 for the recording's own.
    pub speed_ratio: f64,
    /// Start again at the end.
    pub repeat: bool,
    /// Publish `/clock` so often, Hz, and before each message.
    pub clock_hz: Option<f64>,
    /// Wait so long for somebody to listen.
    pub wait: Duration,
}

/// What was played.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Played {
    /// Messages by topic.
    pub messages: BTreeMap<String, u64>,
    /// Messages that do not decode, or that DDS did not take.
    pub lost: u64,
    /// Largest delay of a message behind its time, s.
    pub worst_delay_s: f64,
    /// Passes begun.
    pub passes: u64,
}

/// Where one topic's messages go.
trait Outlet {
    fn publish(&self, data: &[u8]) -> bool;
}

impl<M: Interface> Outlet for Publisher<M> {
    fn publish(&self, data: &[u8]) -> bool {
        cdr::decode::<M>(data).is_ok_and(|message| Publisher::publish(self, message).is_ok())
    }
}

/// Opens an outlet for a type that this crate knows.
fn outlet(bus: &mut Bus, topic: &str, type_name: &str) -> Result<Option<Box<dyn Outlet>>, BusError> {
    fn open<M: Interface + 'static>(bus: &mut Bus, topic: &str) -> Result<Option<Box<dyn Outlet>>, BusError> {
        Ok(Some(Box::new(bus.publish::<M>(topic, M::TYPE_NAME)?)))
    }
    match type_name {
        GovernorCommand::TYPE_NAME => open::<GovernorCommand>(bus, topic),
        EsvState::TYPE_NAME => open::<EsvState>(bus, topic),
        ServoState::TYPE_NAME => open::<ServoState>(bus, topic),
        FluidPressure::TYPE_NAME => open::<FluidPressure>(bus, topic),
        JointState::TYPE_NAME => open::<JointState>(bus, topic),
        _ => Ok(None),
    }
}

/// A recording ready to be played.
pub struct Player<'a> {
    outlets: BTreeMap<String, Box<dyn Outlet>>,
    clock: Option<Publisher<Clock>>,
    messages: &'a [RawMessage],
    /// Topics whose type this crate does not know; they are not played.
    pub left_out: Vec<String>,
}

impl<'a> Player<'a> {
    /// Opens a topic for each that the messages need. The messages must be in the order of their log times.
    ///
    /// # Errors
    /// When DDS refuses.
    pub fn open(bus: &mut Bus, messages: &'a [RawMessage], options: &Options) -> Result<Self, BusError> {
        let types: BTreeMap<&str, &str> =
            messages.iter().map(|message| (message.topic.name.as_str(), message.topic.type_name.as_str())).collect();
        let (mut outlets, mut left_out) = (BTreeMap::new(), Vec::new());
        for (topic, type_name) in types {
            match outlet(bus, topic, type_name)? {
                Some(outlet) => {
                    outlets.insert(topic.to_owned(), outlet);
                }
                None => left_out.push(format!("{topic} ({type_name})")),
            }
        }
        let clock = match options.clock_hz {
            Some(_) => Some(bus.publish("/clock", Clock::TYPE_NAME)?),
            None => None,
        };
        Ok(Self { outlets, clock, messages, left_out })
    }

    /// Waits until somebody listens. Returns whether somebody does.
    pub fn wait(&self, bus: &Bus, options: &Options, stop: &AtomicBool) -> bool {
        let until = Until::after(Some(options.wait));
        loop {
            let resolved = self.outlets.keys().filter_map(|topic| bus.arguments().resolve(topic).ok());
            let heard = resolved.map(|topic| bus.readers_of(&topic)).sum::<usize>() > 0;
            if heard {
                pause(SETTLE);
            }
            if heard || until.is_past() || stop.load(Ordering::Relaxed) {
                return heard;
            }
            pause(Duration::from_millis(20));
        }
    }

    /// Plays until the end, or until `stop`; `progress` hears the time in the recording, s.
    pub fn play(&self, options: &Options, stop: &AtomicBool, progress: &mut dyn FnMut(f64)) -> Played {
        let mut played = Played::default();
        let (Some(first), Some(last)) = (self.messages.first(), self.messages.last()) else { return played };
        loop {
            played.passes += 1;
            let begin_ns = monotonic_ns();
            #[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "days of nanoseconds fit")]
            let due = |time_ns: i64| begin_ns + ((time_ns - first.log_time_ns) as f64 / options.speed_ratio) as i64;
            let mut next_clock_ns = first.log_time_ns;
            for message in self.messages {
                if let (Some(clock), Some(hz)) = (&self.clock, options.clock_hz) {
                    while next_clock_ns < message.log_time_ns {
                        if !sleep_while(due(next_clock_ns), stop) {
                            return played;
                        }
                        tell_clock(clock, next_clock_ns);
                        next_clock_ns += crate::units::nanos_from_seconds(1.0 / hz).max(1);
                    }
                }
                let due_ns = due(message.log_time_ns);
                if !sleep_while(due_ns, stop) {
                    return played;
                }
                if let Some(clock) = &self.clock {
                    tell_clock(clock, message.log_time_ns);
                }
                if let Some(outlet) = self.outlets.get(&message.topic.name) {
                    if outlet.publish(&message.data) {
                        *played.messages.entry(message.topic.name.clone()).or_default() += 1;
                    } else {
                        played.lost += 1;
                    }
                }
                played.worst_delay_s = played.worst_delay_s.max(seconds_from_nanos(monotonic_ns() - due_ns));
                progress(seconds_from_nanos(message.log_time_ns - first.log_time_ns));
            }
            let nothing_to_repeat = last.log_time_ns == first.log_time_ns;
            if !options.repeat || nothing_to_repeat || stop.load(Ordering::Relaxed) {
                return played;
            }
        }
    }
}

fn tell_clock(clock: &Publisher<Clock>, time_ns: i64) {
    // A lost tick is followed by the next one.
    let _ = clock.publish(Clock { clock: Time::from_nanos(time_ns) });
}

/// Sleeps until `due_ns`; `false` where told to stop meanwhile.
fn sleep_while(due_ns: i64, stop: &AtomicBool) -> bool {
    loop {
        if stop.load(Ordering::Relaxed) {
            return false;
        }
        let now_ns = monotonic_ns();
        if now_ns >= due_ns {
            return true;
        }
        sleep_until(due_ns.min(now_ns + NAP_NS));
    }
}
