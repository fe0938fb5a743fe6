//! Writing what is heard on DDS into a bag.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use futures::channel::oneshot;
use futures::stream::{LocalBoxStream, StreamExt, select_all};
use ros2_client::{Gid, Subscription};

use super::bus::{Bus, BusError};
use super::realtime::{Until, pause, wall_ns};
use crate::bag::{BagError, Qos, Topic, Writer, WriterOptions};
use crate::msg::{EsvState, FluidPressure, GovernorCommand, Interface, JointState, ServoState};

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

/// A recording cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The bag.
    #[error(transparent)]
    Bag(#[from] BagError),
    /// A type whose definition this crate does not carry.
    #[error("`{topic}` is of type `{type_name}`; only {known} can be recorded")]
    UnknownType {
        /// The topic.
        topic: String,
        /// Its type.
        type_name: String,
        /// The types that can be.
        known: String,
    },
    /// The thread could not be started.
    #[error("cannot start a thread: {0}")]
    Thread(std::io::Error),
}

/// What was recorded.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Recorded {
    /// Messages by topic; 0 for one that stayed silent.
    pub messages: BTreeMap<String, u64>,
    /// Samples that did not decode.
    pub undecodable: u64,
    /// Senders of another type, whose samples were left out: topic and type.
    pub foreign: Vec<(String, String)>,
    /// The bag.
    pub bag: PathBuf,
}

impl Recorded {
    /// What to say of topics from which nothing came, one sentence each; `domain` is the DDS domain listened on.
    #[must_use]
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

/// The bag in the making, shared by all tracks.
struct Deck<'a> {
    bus: &'a Bus,
    writer: Writer,
    recorded: Recorded,
    senders: BTreeMap<Gid, bool>,
    failed: Option<BagError>,
}

/// One topic that is recorded.
trait Track: Send {
    fn name(&self) -> &str;
    fn tape<'a>(&'a self, deck: &'a RefCell<Deck<'_>>) -> LocalBoxStream<'a, ()>;
}

struct Tape<M> {
    name: String,
    subscription: Subscription<M>,
    topic: Topic<M>,
}

impl<M: Interface + Send + 'static> Track for Tape<M> {
    fn name(&self) -> &str {
        &self.name
    }

    fn tape<'a>(&'a self, deck: &'a RefCell<Deck<'_>>) -> LocalBoxStream<'a, ()> {
        let samples = self.subscription.async_stream().map(move |sample| {
            let mut deck = deck.borrow_mut();
            match sample {
                Ok((message, info)) if deck.believes(info.publisher_gid(), &self.name, M::TYPE_NAME) => {
                    deck.write(&self.name, self.topic, &message);
                }
                Ok(_) => {}
                Err(_) => deck.recorded.undecodable += 1,
            }
        });
        samples.boxed_local()
    }
}

impl Deck<'_> {
    /// Whether a sender announced the type that the topic should have; asked once for each.
    fn believes(&mut self, sender: Gid, name: &str, expected: &str) -> bool {
        if let Some(&right) = self.senders.get(&sender) {
            return right;
        }
        let Some((_, found)) = self.bus.writers().remove(&sender) else { return true };
        let right = found == expected;
        self.senders.insert(sender, right);
        if !right {
            self.recorded.foreign.push((name.to_owned(), found));
        }
        right
    }

    fn write<M: Interface>(&mut self, name: &str, topic: Topic<M>, message: &M) {
        match self.writer.write(topic, wall_ns(), message) {
            Ok(()) => *self.recorded.messages.entry(name.to_owned()).or_default() += 1,
            Err(error) => self.failed = self.failed.take().or(Some(error)),
        }
    }
}

/// Records `topics`, names with types, until `stop` or for `duration`; `ready` is called once all subscriptions are open.
///
/// # Errors
/// When the bus or the bag refuses; what was heard before stays in the bag's `.unfinished` folder.
pub fn record(
    bus: &mut Bus,
    topics: &[(String, String)],
    folder: &Path,
    duration: Option<Duration>,
    stop: &AtomicBool,
    ready: &mut dyn FnMut(),
) -> Result<Recorded, RecordError> {
    let mut writer = Writer::create(folder, OPTIONS)?;
    let tracks = topics.iter().map(|(topic, type_name)| track(bus, &mut writer, topic, type_name));
    let tracks = tracks.collect::<Result<Vec<_>, _>>()?;
    ready();
    let until = Until::after(duration);
    let bus = &*bus;
    let (stop_taping, taping) = oneshot::channel();
    let (writer, mut recorded) = std::thread::scope(|scope| {
        let tape = std::thread::Builder::new()
            .name("tape".to_owned())
            .spawn_scoped(scope, move || run(bus, &tracks, writer, taping))
            .map_err(RecordError::Thread)?;
        while !stop.load(Ordering::Relaxed) && !until.is_past() && !tape.is_finished() {
            pause(Duration::from_millis(20));
        }
        let _ = stop_taping.send(());
        let thread_died = || RecordError::Thread(std::io::Error::other("the recording thread ended early"));
        let (writer, recorded) = tape.join().map_err(|_| thread_died())??;
        Ok::<_, RecordError>((writer, recorded))
    })?;
    recorded.bag = writer.finish()?;
    Ok(recorded)
}

/// Tapes all tracks until told to stop, closing a chunk each second.
fn run(
    bus: &Bus,
    tracks: &[Box<dyn Track>],
    writer: Writer,
    stop: oneshot::Receiver<()>,
) -> Result<(Writer, Recorded), BagError> {
    let messages = tracks.iter().map(|track| (track.name().to_owned(), 0)).collect();
    let recorded = Recorded { messages, ..Recorded::default() };
    let deck = RefCell::new(Deck { bus, writer, recorded, senders: BTreeMap::new(), failed: None });
    let second = Duration::from_secs(1);
    let mut next = Until::after(Some(second));
    {
        // A ticker is not needed: with nothing heard there is nothing to flush.
        let mut heard = select_all(tracks.iter().map(|track| track.tape(&deck))).take_until(stop);
        futures::executor::block_on(async {
            while heard.next().await.is_some() {
                let mut deck = deck.borrow_mut();
                if next.comes_round(second) {
                    deck.failed = deck.failed.take().or(deck.writer.flush().err());
                }
                if deck.failed.is_some() {
                    break;
                }
            }
        });
    }
    let deck = deck.into_inner();
    match deck.failed {
        Some(error) => Err(error),
        None => Ok((deck.writer, deck.recorded)),
    }
}

/// Opens a track for a type that this crate knows.
fn track(bus: &mut Bus, writer: &mut Writer, topic: &str, type_name: &str) -> Result<Box<dyn Track>, RecordError> {
    fn open<M: Interface + Send + 'static>(
        bus: &mut Bus,
        writer: &mut Writer,
        topic: &str,
    ) -> Result<Box<dyn Track>, RecordError> {
        let name = bus.arguments().resolve(topic).map_err(BusError::from)?;
        Ok(Box::new(Tape { subscription: bus.record::<M>(topic)?, topic: writer.topic(&name, Qos::DEFAULT)?, name }))
    }
    match type_name {
        GovernorCommand::TYPE_NAME => open::<GovernorCommand>(bus, writer, topic),
        EsvState::TYPE_NAME => open::<EsvState>(bus, writer, topic),
        ServoState::TYPE_NAME => open::<ServoState>(bus, writer, topic),
        FluidPressure::TYPE_NAME => open::<FluidPressure>(bus, writer, topic),
        JointState::TYPE_NAME => open::<JointState>(bus, writer, topic),
        _ => Err(RecordError::UnknownType {
            topic: topic.to_owned(),
            type_name: type_name.to_owned(),
            known: [
                GovernorCommand::TYPE_NAME,
                EsvState::TYPE_NAME,
                ServoState::TYPE_NAME,
                FluidPressure::TYPE_NAME,
                JointState::TYPE_NAME,
            ]
            .join(", "),
        }),
    }
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
