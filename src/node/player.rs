//! Publishing a recording over DDS with its timing: topics of any type, byte by byte as they were recorded.
//!
//! With a clock, a tick goes out only once the messages before it have arrived: whoever follows the clock then has them in time, however busy the
//! machine is.

pub(super) mod outlet;
pub mod tape;

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ros2_client::Publisher;

use outlet::Outlet;
pub use outlet::PATIENCE;
use tape::Tape;

use super::bus::{Bus, BusError};
use super::offer::is_hash;
use super::realtime::{Until, monotonic_ns, pause, sleep_until, wall_ns};
use super::spout::Encoded;
use govtwin_bag::msg::{Clock, Interface, Time};
use govtwin_bag::{BagError, RawMessage, TopicInfo};
use govtwin_model::units::seconds_from_nanos;

/// Where time is told.
const CLOCK: &str = "/clock";

/// Longest sleep before looking whether to stop, ns.
const NAP_NS: i64 = 20_000_000;

/// After the last message, so that readers who lost it can ask for it again.
const LINGER: Duration = Duration::from_millis(500);

/// Stamps farther than this from the time of recording are of another clock, such as that of a simulation, ns.
const OTHER_CLOCK_NS: i64 = 10_000_000_000;

/// Once the first listener is there, others get so long to come too.
const SETTLE: Duration = Duration::from_millis(700);

/// How to play.
#[derive(Debug, Clone, PartialEq)]
pub struct PlayOptions {
    /// Speed, 1 for the recording's own.
    pub speed_ratio: f64,
    /// Start again at the end.
    pub repeat: bool,
    /// Publish `/clock` so often, Hz, and before each message.
    pub clock_hz: Option<f64>,
    /// Wait so long for somebody to listen.
    pub wait: Duration,
    /// Which stamps the messages have.
    pub stamps: Stamps,
}

/// Which stamps played messages have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stamps {
    /// Those of the recording: its time is that of `/clock`.
    Recorded,
    /// As if the recording were made now: each header keeps its distance from the others, over the speed.
    Now,
}

/// What was played.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Played {
    /// Messages by topic.
    pub messages: BTreeMap<String, u64>,
    /// Messages in another layout than little-endian CDR, or that DDS did not take.
    pub lost: u64,
    /// Topics whose subscribers did not acknowledge what was published within [`PATIENCE`], so that the clock went on without them: ticks by topic.
    pub unacknowledged: BTreeMap<String, u64>,
    /// Largest delay of a message behind its time, s.
    pub worst_delay_s: f64,
    /// Passes begun.
    pub passes: u64,
}

/// A recording ready to be played.
pub struct Player {
    outlets: BTreeMap<String, Outlet>,
    clock: Option<Publisher<Clock>>,
    /// Topics that are not played, and why.
    pub left_out: Vec<(String, &'static str)>,
}

impl Player {
    /// Opens each topic of the recording under its type, with the hash that is recorded of it and as its publishers offered it.
    ///
    /// # Errors
    /// When DDS refuses.
    pub fn open(bus: &mut Bus, tape: &Tape, options: &PlayOptions) -> Result<Self, BusError> {
        let (mut outlets, mut left_out) = (BTreeMap::<String, _>::new(), Vec::new());
        for topic in tape.topics() {
            let reason = if topic.encoding != "cdr" || topic.type_name.is_empty() {
                "its messages are not those of ROS 2"
            } else if options.clock_hz.is_some() && bus.arguments().resolve(&topic.name).is_ok_and(|name| name == CLOCK)
            {
                "--clock tells the time instead"
            } else if outlets.contains_key(&topic.name) {
                "it was recorded with another type as well"
            } else {
                let kind = (topic.type_name.as_str(), Some(topic.type_hash.as_str()).filter(|hash| is_hash(hash)));
                let how = (topic.offered_qos_profiles.as_str(), begins_with_header(topic), options.clock_hz.is_some());
                match Outlet::open(bus, &topic.name, kind, how) {
                    Ok(outlet) => {
                        outlets.insert(topic.name.clone(), outlet);
                        continue;
                    }
                    Err(BusError::Name { .. }) => "its name is none of ROS 2",
                    Err(error) => return Err(error),
                }
            };
            left_out.push((format!("{} ({})", topic.name, topic.type_name), reason));
        }
        let clock = match options.clock_hz {
            Some(_) => Some(bus.publish(CLOCK, Clock::TYPE_NAME)?),
            None => None,
        };
        Ok(Self { outlets, clock, left_out })
    }

    /// Waits until somebody listens. Returns whether somebody does.
    pub fn wait(&self, bus: &Bus, options: &PlayOptions, stop: &AtomicBool) -> bool {
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
    ///
    /// # Errors
    /// Where the bag cannot be read on.
    pub fn play(
        &self,
        tape: &Tape,
        options: &PlayOptions,
        stop: &AtomicBool,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Played, BagError> {
        let mut played = Played::default();
        let (first_ns, last_ns) = tape.span_ns();
        loop {
            played.passes += 1;
            let (begin_ns, begin_wall_ns) = (monotonic_ns(), wall_ns());
            let speed_ratio = options.speed_ratio;
            let pass = Pass { begin_ns, begin_wall_ns, first_ns, speed_ratio, shift_ns: OnceCell::new() };
            tape.run(|messages| self.pass(messages, &pass, options, stop, &mut played, progress))?;
            if !options.repeat || last_ns == first_ns || stop.load(Ordering::Relaxed) {
                pause(LINGER);
                return Ok(played);
            }
        }
    }

    /// Plays the recording once.
    fn pass(
        &self,
        messages: &mut dyn Iterator<Item = RawMessage>,
        pass: &Pass,
        options: &PlayOptions,
        stop: &AtomicBool,
        played: &mut Played,
        progress: &mut dyn FnMut(f64),
    ) {
        let mut next_clock_ns = pass.first_ns;
        for message in messages {
            if let (Some(clock), Some(hz)) = (&self.clock, options.clock_hz) {
                while next_clock_ns < message.log_time_ns {
                    if !sleep_while(pass.due_ns(next_clock_ns), stop) {
                        return;
                    }
                    self.tell_clock(clock, next_clock_ns, played);
                    next_clock_ns += govtwin_model::units::nanos_from_seconds(1.0 / hz).max(1);
                }
            }
            let due_ns = pass.due_ns(message.log_time_ns);
            if !sleep_while(due_ns, stop) {
                return;
            }
            if let Some(clock) = &self.clock {
                self.tell_clock(clock, message.log_time_ns, played);
            }
            if let Some(outlet) = self.outlets.get(&message.topic.name) {
                let fresh = options.stamps == Stamps::Now && outlet.has_header;
                let sample = Encoded::of(message.data).map(|mut sample| {
                    if fresh {
                        sample.restamp(|stamp| pass.stamp_now(stamp, message.log_time_ns));
                    }
                    sample
                });
                if sample.is_some_and(|sample| outlet.publish(sample)) {
                    *played.messages.entry(message.topic.name.clone()).or_default() += 1;
                } else {
                    played.lost += 1;
                }
            }
            played.worst_delay_s = played.worst_delay_s.max(seconds_from_nanos(monotonic_ns() - due_ns));
            progress(seconds_from_nanos(message.log_time_ns - pass.first_ns));
        }
    }

    /// Sends a tick of the clock once the messages before it have arrived, or have been waited for.
    fn tell_clock(&self, clock: &Publisher<Clock>, time_ns: i64, played: &mut Played) {
        for (topic, _) in self.outlets.iter().filter(|(_, outlet)| !outlet.has_arrived()) {
            *played.unacknowledged.entry(topic.clone()).or_default() += 1;
        }
        // A lost tick is followed by the next one.
        let _ = clock.publish(Clock { clock: Time::from_nanos(time_ns) });
    }
}

/// Where the times of a recording lie on the machine's clock while it is played once.
struct Pass {
    begin_ns: i64,
    begin_wall_ns: i64,
    first_ns: i64,
    speed_ratio: f64,
    /// From the stamps' clock to the recorder's, by the first stamp; 0 where they are one.
    shift_ns: OnceCell<i64>,
}

impl Pass {
    /// When a message of this log time is due.
    #[expect(clippy::cast_possible_truncation, reason = "days of nanoseconds fit")]
    fn due_ns(&self, time_ns: i64) -> i64 {
        self.begin_ns + ((time_ns - self.first_ns) as f64 / self.speed_ratio) as i64
    }

    /// The stamp of a message as if it were recorded now: as long before its log time as it was, or of the time of its recording where the stamps
    /// are of another clock. One without a time stays so.
    #[expect(clippy::cast_possible_truncation, reason = "days of nanoseconds fit")]
    fn stamp_now(&self, stamp: Time, log_time_ns: i64) -> Time {
        let Some(stamp_ns) = stamp.nanos().filter(|stamp_ns| *stamp_ns != 0) else { return stamp };
        let delay_ns = log_time_ns.saturating_sub(stamp_ns);
        let is_other = delay_ns.saturating_abs() > OTHER_CLOCK_NS;
        let shift_ns = *self.shift_ns.get_or_init(|| if is_other { delay_ns } else { 0 });
        let since_first_ns = stamp_ns.saturating_add(shift_ns).saturating_sub(self.first_ns);
        Time::from_nanos(self.begin_wall_ns + (since_first_ns as f64 / self.speed_ratio) as i64)
    }
}

/// Whether messages of a topic begin with a header, by the definition that the bag keeps.
fn begins_with_header(topic: &TopicInfo) -> bool {
    let text = String::from_utf8_lossy(&topic.schema);
    let mut fields = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
    // Constants are no fields.
    let first = fields.find(|line| !line.is_empty() && !line.contains('='));
    first.is_some_and(|field| {
        matches!(field.split_whitespace().next(), Some("std_msgs/Header" | "std_msgs/msg/Header" | "Header"))
    })
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

#[cfg(test)]
mod tests {
    use super::{OnceCell, Pass, Time, TopicInfo, begins_with_header};

    fn pass(first_ns: i64) -> Pass {
        Pass { begin_ns: 0, begin_wall_ns: 1_000_000_000_000, first_ns, speed_ratio: 2.0, shift_ns: OnceCell::new() }
    }

    #[test]
    fn fresh_stamps_keep_their_distances_over_the_speed() {
        let pass = pass(50_000_000_000);
        let at = |stamp_ns, log_ns| pass.stamp_now(Time::from_nanos(stamp_ns), log_ns).nanos().unwrap();
        assert_eq!(at(50_000_000_000, 50_000_000_000), 1_000_000_000_000);
        assert_eq!(at(52_000_000_000, 52_010_000_000), 1_001_000_000_000);
        assert_eq!(at(0, 52_000_000_000), 0, "no stamp, no time");
    }

    #[test]
    fn stamps_of_another_clock_become_those_of_now_together() {
        let pass = pass(50_000_000_000);
        let at = |stamp_ns, log_ns| pass.stamp_now(Time::from_nanos(stamp_ns), log_ns).nanos().unwrap();
        assert_eq!(at(7_000_000_000, 50_000_000_000), 1_000_000_000_000);
        // Later ones keep their distance from it, however late they were recorded.
        assert_eq!(at(9_000_000_000, 52_500_000_000), 1_001_000_000_000);
    }

    #[test]
    fn a_header_is_known_by_the_definition() {
        let begins =
            |schema: &str| begins_with_header(&TopicInfo { schema: schema.as_bytes().into(), ..TopicInfo::default() });
        assert!(begins("# what\nuint8 CODE=3\nstd_msgs/Header header # when\nfloat64 opening\n"));
        assert!(!begins("float64 data\nstd_msgs/Header header\n"));
        assert!(!begins(""));
    }
}
