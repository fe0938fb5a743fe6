//! Hearing topics of any type as bytes, and writing them into a bag.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ros2_client::Gid;

use super::bus::{Bus, BusError};
use super::definitions::Definitions;
use super::intake::Numbering;
use super::offer::{Offer, silence};
use super::qos::{latched, recorded};
use super::realtime::{Until, pause};
use super::tap::{Tap, TappedSample};
use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Interface, JointState, ServoState};
use govtwin_bag::{BagError, RawMessage, TopicInfo, Writer, WriterOptions};

/// Topics recorded where none are named, with their types.
pub const DEFAULT_TOPICS: [(&str, &str); 6] = [
    ("governor/command", GovernorCommand::TYPE_NAME),
    ("governor/esv", EsvState::TYPE_NAME),
    ("governor/tank_pressure", FluidPressure::TYPE_NAME),
    ("plant/servo_state", ServoState::TYPE_NAME),
    ("sim/servo_state", ServoState::TYPE_NAME),
    ("sim/joint_states", JointState::TYPE_NAME),
];

/// How a recording is written: nothing is replaced, and what was heard is kept.
pub const OPTIONS: WriterOptions = WriterOptions { mark: None, keep_unfinished: true };

/// Samples are taken so far apart; each carries the time at which it came.
const ROUND: Duration = Duration::from_millis(4);

/// Publishers are looked for so far apart.
const LOOK: Duration = Duration::from_millis(200);

/// A topic that nobody publishes is told after so long.
const SILENCE: Duration = Duration::from_secs(10);

/// Samples of one topic taken in one round; the rest waits for the next.
const MOST_TAKEN: usize = 4096;

/// More topics than this are not recorded: no system has them, but a stranger may announce them.
const MOST_TOPICS: usize = 2000;

/// What is to be recorded.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Selection {
    /// Topics, each with its type where it is known; otherwise that of its first publisher is taken.
    pub topics: Vec<(String, Option<String>)>,
    /// Every topic that anybody publishes, too, hidden ones (`/_…`) apart.
    pub all: bool,
    /// Folders with definitions of types, `package/msg/Type.msg`.
    pub definitions: Vec<PathBuf>,
}

/// A recording cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The bag.
    #[error(transparent)]
    Bag(#[from] BagError),
}

/// What was recorded.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Recorded {
    /// Messages by topic; 0 for one that stayed silent.
    pub messages: BTreeMap<String, u64>,
    /// Senders of another type, whose samples were left out: topic and type.
    pub foreign: Vec<(String, String)>,
    /// Topics whose messages were recorded without a definition of their type: topic and type.
    pub undefined: Vec<(String, String)>,
    /// Samples in a layout that is not known, which were left out.
    pub unreadable: u64,
    /// Samples that senders numbered and that never came.
    pub lost: u64,
    /// The disk was full, and the recording ended there.
    pub disk_full: bool,
    /// The bag.
    pub bag: PathBuf,
}

impl Recorded {
    /// What to say of topics from which nothing came, one sentence each; `domain` is the DDS domain listened on.
    pub fn silence(&self, domain: u16) -> Vec<String> {
        let foreign = |topic: &String| self.foreign.iter().any(|(heard, _)| heard == topic);
        let silent = self.messages.iter().filter(|(topic, count)| **count == 0 && !foreign(topic));
        let words = |topic| {
            format!(
                "{topic}: nothing was heard, so nothing is recorded; check the name, and that `ros2 topic list` \
                 knows it with ROS_DOMAIN_ID {domain}, where this was listening"
            )
        };
        silent.map(|(topic, _)| words(topic)).collect()
    }
}

/// One topic that is recorded.
struct TopicTape {
    /// Full name.
    name: String,
    /// What opens it: the name that was given, which remappings change.
    given: String,
    type_name: Option<String>,
    tap: Option<Tap>,
    /// What the bag says of it, once that is known; until then samples wait in the transport.
    topic: Option<Arc<TopicInfo>>,
    senders: BTreeMap<Gid, bool>,
    said_silent: bool,
}

/// Takes what is heard.
pub trait Sink {
    /// Takes a message.
    ///
    /// # Errors
    /// Where it cannot be kept, and listening is of no use any more.
    fn take(&mut self, message: RawMessage) -> Result<(), BagError>;

    /// Is called once a second; `lost` are the samples that senders numbered and that never came, since the beginning.
    ///
    /// # Errors
    /// As [`Sink::take`].
    fn second(&mut self, lost: u64) -> Result<(), BagError>;

    /// Whether no more can be taken.
    fn is_full(&self) -> bool;
}

impl Sink for Writer {
    fn take(&mut self, message: RawMessage) -> Result<(), BagError> {
        self.copy(&message)
    }

    fn second(&mut self, _: u64) -> Result<(), BagError> {
        self.flush()
    }

    fn is_full(&self) -> bool {
        Writer::is_full(self)
    }
}

/// What listens.
struct RecordingSession<'a> {
    bus: &'a mut Bus,
    sink: &'a mut dyn Sink,
    numbers: Numbering<Gid>,
    definitions: Definitions,
    tapes: Vec<TopicTape>,
    recorded: Recorded,
    tell: &'a mut dyn FnMut(&str),
}

/// Records until `stop` or for `duration`, or until the disk is full; `tell` is given what a user should read meanwhile, first that
/// it records, once everything known is open.
///
/// # Errors
/// When the bus or the bag refuses; what was heard before stays in the bag's `.unfinished` folder.
pub fn record(
    bus: &mut Bus,
    selection: &Selection,
    folder: &Path,
    duration: Option<Duration>,
    stop: &AtomicBool,
    tell: &mut dyn FnMut(&str),
) -> Result<Recorded, RecordError> {
    let mut writer = Writer::create(folder, OPTIONS)?;
    let (mut recorded, topics) = hear(bus, selection, &mut writer, duration, stop, tell)?;
    if recorded.disk_full {
        tell("the disk is full: the recording ends here, and is completed in room that was kept for it");
    } else {
        for topic in &topics {
            writer.announce(topic)?;
        }
    }
    recorded.bag = writer.finish()?;
    Ok(recorded)
}

/// Hears until `stop` or for `duration`, or until the sink is full, and hands on what comes; `tell` is given what a user should read
/// meanwhile. Also gives the topics that anybody published.
///
/// # Errors
/// When the bus or the sink refuses.
pub fn hear(
    bus: &mut Bus,
    selection: &Selection,
    sink: &mut dyn Sink,
    duration: Option<Duration>,
    stop: &AtomicBool,
    tell: &mut dyn FnMut(&str),
) -> Result<(Recorded, Vec<Arc<TopicInfo>>), RecordError> {
    let definitions = Definitions::new(&selection.definitions);
    let (tapes, recorded, numbers) = (Vec::new(), Recorded::default(), Numbering::default());
    let mut deck = RecordingSession { bus, sink, numbers, definitions, tapes, recorded, tell };
    for (given, type_name) in &selection.topics {
        deck.add(given, type_name.clone())?;
    }
    (deck.tell)("recording");
    let (until, silent) = (Until::after(duration), Until::after(Some(SILENCE)));
    let mut look = Until::after(Some(Duration::ZERO));
    let mut flush = Until::after(Some(Duration::from_secs(1)));
    loop {
        let is_over = stop.load(Ordering::Relaxed) || until.is_past();
        if look.comes_round(LOOK) || is_over {
            deck.look(selection.all, is_over, silent.is_past())?;
        }
        deck.take()?;
        if flush.comes_round(Duration::from_secs(1)) {
            deck.sink.second(deck.recorded.lost)?;
        }
        deck.recorded.disk_full = deck.sink.is_full();
        if is_over || deck.recorded.disk_full {
            break;
        }
        pause(ROUND);
    }
    let RecordingSession { tapes, mut recorded, .. } = deck;
    for tape in &tapes {
        recorded.messages.entry(tape.name.clone()).or_default();
    }
    Ok((recorded, tapes.into_iter().filter_map(|tape| tape.topic).collect()))
}

impl RecordingSession<'_> {
    /// A topic to be recorded; it is opened now where its type is known.
    fn add(&mut self, given: &str, type_name: Option<String>) -> Result<(), BusError> {
        let name = self.bus.arguments().resolve(given)?;
        let tap = type_name.as_deref().map(|type_name| self.bus.tap(given, type_name, &recorded())).transpose()?;
        self.tapes.push(TopicTape {
            name,
            given: given.to_owned(),
            type_name,
            tap,
            topic: None,
            senders: BTreeMap::new(),
            said_silent: false,
        });
        Ok(())
    }

    /// Looks who publishes: opens topics whose type is known by that, and finds what the bag should say of each.
    fn look(&mut self, all: bool, is_over: bool, is_late: bool) -> Result<(), BusError> {
        let offers = self.bus.offers();
        if all {
            for offer in &offers {
                let is_hidden = offer.topic.contains("/_");
                if !is_hidden
                    && self.tapes.len() < MOST_TOPICS
                    && self.tapes.iter().all(|tape| tape.name != offer.topic)
                {
                    self.add(&offer.topic, None)?;
                }
            }
        }
        for tape in &mut self.tapes {
            let here: Vec<&Offer> = offers.iter().filter(|offer| offer.topic == tape.name).collect();
            if here.is_empty() {
                if is_late && tape.tap.is_none() && !std::mem::replace(&mut tape.said_silent, true) {
                    (self.tell)(&silence(&tape.name, &offers));
                }
                continue;
            }
            if tape.tap.is_none() {
                let type_name = here[0].type_name.clone();
                let is_latched = here.iter().all(|offer| offer.is_latched);
                let qos = if is_latched { latched() } else { recorded() };
                tape.tap = Some(self.bus.tap(&tape.given, &type_name, &qos)?);
                tape.type_name = Some(type_name);
            }
            let type_name = tape.type_name.clone().unwrap_or_default();
            let own: Vec<&&Offer> = here.iter().filter(|offer| offer.type_name == type_name).collect();
            let Some(first) = own.first().filter(|_| tape.topic.is_none()) else { continue };
            let known = self.definitions.get(first, self.bus);
            // At the end it is recorded with what is known.
            let Some(known) = known.or_else(|| is_over.then(Default::default)) else { continue };
            if known.schema.is_empty() {
                self.recorded.undefined.push((tape.name.clone(), type_name.clone()));
                (self.tell)(&format!(
                    "{}: nobody knows the definition of `{type_name}`; its messages are recorded as bytes without one (give \
                     --definitions DIR with {type_name}.msg)",
                    tape.name
                ));
            }
            let mut profiles: Vec<&str> = own.iter().map(|offer| offer.profile.as_str()).collect();
            profiles.dedup();
            tape.topic = Some(Arc::new(known.topic(&tape.name, &type_name, profiles.join("\n"))));
        }
        Ok(())
    }

    /// Takes what has come.
    fn take(&mut self) -> Result<(), BagError> {
        for tape in &mut self.tapes {
            let (Some(tap), Some(topic)) = (&tape.tap, &tape.topic) else { continue };
            let type_name = tape.type_name.as_deref().unwrap_or_default();
            for _ in 0..MOST_TAKEN {
                let TappedSample { sender, received_ns, sent_ns, number, data } = match tap.take() {
                    None => break,
                    Some(Ok(sample)) => sample,
                    Some(Err(_)) => {
                        self.recorded.unreadable += 1;
                        continue;
                    }
                };
                let (right, other) = believes(&mut tape.senders, sender, self.bus, (type_name, &topic.type_hash));
                if let Some(other) = other {
                    (self.tell)(&format!(
                        "{}: a sender publishes {other}, expected `{type_name}`; it is not heard",
                        tape.name
                    ));
                    self.recorded.foreign.push((tape.name.clone(), other));
                }
                if !right {
                    continue;
                }
                self.recorded.lost += self.numbers.take(sender, number);
                let topic = Arc::clone(topic);
                let times = (received_ns, sent_ns);
                let message = RawMessage { topic, log_time_ns: times.0, publish_time_ns: times.1, sequence: 0, data };
                self.sink.take(message)?;
                *self.recorded.messages.entry(tape.name.clone()).or_default() += 1;
            }
        }
        Ok(())
    }
}

/// Whether a sender announced the type, and the definition of it, that the topic has; asked once for each, and the first time what it announced
/// instead.
fn believes(
    senders: &mut BTreeMap<Gid, bool>,
    sender: Gid,
    bus: &Bus,
    (expected, hash): (&str, &str),
) -> (bool, Option<String>) {
    if let Some(&right) = senders.get(&sender) {
        return (right, None);
    }
    let Some(offer) = bus.offers().into_iter().find(|offer| offer.sender == sender) else { return (true, None) };
    let right = offer.is_of(expected, hash);
    senders.insert(sender, right);
    (right, (!right).then(|| offer.otherwise(expected)))
}

#[cfg(test)]
mod tests {
    use super::Recorded;

    #[test]
    fn a_topic_that_stayed_silent_is_named_with_the_way_out() {
        let messages = [("/governor/command", 3), ("/governor/esv", 0), ("/plant/servo_state", 0)];
        let recorded = Recorded {
            messages: messages.map(|(topic, count)| (topic.to_owned(), count)).into(),
            foreign: vec![("/plant/servo_state".to_owned(), "other/msg/Type".to_owned())],
            ..Recorded::default()
        };
        let said = recorded.silence(42);
        assert_eq!(said.len(), 1, "a topic heard from a sender of another type has words of its own");
        for words in ["/governor/esv", "ros2 topic list", "ROS_DOMAIN_ID 42"] {
            assert!(said[0].contains(words), "{said:?}");
        }
    }
}
