//! Subscribes to the topics of a map as their publishers come: type and definition are known by them alone.
//!
//! The supervisor's thread looks; what it opens goes to the thread that hears.

use std::collections::BTreeSet;
use std::time::Duration;

use futures::channel::{mpsc, oneshot};
use ros2_client::Gid;
use ros2_client::log::LogLevel;

use super::BusMap;
use crate::bus::{Bus, BusError};
use crate::definitions::Definitions;
use crate::offer::{Offer, silence};
use crate::qos::{best_effort, newest_latched};
use crate::realtime::Until;
use crate::tap::Tap;
use govtwin_bag::import::{Map, MappedField, MappedTopic, topics_of};

/// Publishers are looked for so far apart.
const LOOK: Duration = Duration::from_millis(200);

/// A topic that nobody publishes is told after so long.
const SILENCE: Duration = Duration::from_secs(10);

/// A type that nobody describes is told after so long: who describes types may be found later than who publishes.
const PATIENCE: Duration = Duration::from_secs(4);

/// Then it is looked up again so far apart.
const AGAIN: Duration = Duration::from_secs(30);

/// A topic whose type has changed so often is not followed any more.
const MOST_CHANGES: u32 = 100;

/// A topic that is subscribed to, on its way to the thread that hears.
pub(crate) struct OpenedTopic {
    /// How its messages are read.
    pub(crate) topic: MappedTopic,
    /// Its samples.
    pub(crate) tap: Tap,
    /// Its type.
    pub(crate) type_name: String,
    /// The hash of its type, empty where its publisher announces none.
    pub(crate) type_hash: String,
    /// Ends the subscription, once its other half is dropped.
    pub(crate) ends: oneshot::Receiver<()>,
}

/// What is known of a topic.
enum TopicState {
    /// Nobody published it so far.
    Awaited,
    /// Nobody describes its type so far.
    Undescribed { patience: Until, is_told: bool },
    /// Its messages cannot be used: type and hash.
    Refused(String, String),
    /// It is heard: type, hash, and what ends that.
    Heard(
        String,
        String,
        #[expect(dead_code, reason = "ends the subscription when it is dropped")] oneshot::Sender<()>,
    ),
}

struct MapTopic {
    /// As the map names it.
    given: String,
    /// Full name.
    name: String,
    state: TopicState,
    is_silence_told: bool,
    changes: u32,
}

/// The subscriptions of a map.
pub(crate) struct MapSubscriber {
    bus: Bus,
    map: Map,
    fields: Vec<MappedField>,
    definitions: Definitions,
    topics: Vec<MapTopic>,
    opened: mpsc::UnboundedSender<OpenedTopic>,
    look: Until,
    silent: Until,
    told: BTreeSet<Gid>,
}

type Words = Vec<(LogLevel, String)>;

impl MapSubscriber {
    /// Awaits the topics of a map; `bus` is a node of its own, since the node's is shared by threads.
    pub(crate) fn new(
        mut bus: Bus,
        map: &BusMap,
        opened: mpsc::UnboundedSender<OpenedTopic>,
    ) -> Result<Self, BusError> {
        let mut topics = vec![];
        for given in topics_of(&map.fields) {
            let name = bus.await_topic(&given)?;
            topics.push(MapTopic { given, name, state: TopicState::Awaited, is_silence_told: false, changes: 0 });
        }
        Ok(Self {
            bus,
            map: map.map.clone(),
            fields: map.fields.clone(),
            definitions: Definitions::new(&map.definitions),
            topics,
            opened,
            look: Until::after(Some(Duration::ZERO)),
            silent: Until::after(Some(SILENCE)),
            told: BTreeSet::new(),
        })
    }

    /// Its node.
    pub(crate) fn bus(&self) -> &Bus {
        &self.bus
    }

    /// Looks now and then who publishes; gives what a user should read.
    pub(crate) fn turn(&mut self) -> Words {
        let mut said = vec![];
        if !self.look.comes_round(LOOK) {
            return said;
        }
        let offers = self.bus.offers();
        for index in 0..self.topics.len() {
            self.look_at(index, &offers, &mut said);
        }
        for (endpoint, words) in self.bus.incompatible() {
            if self.told.insert(endpoint) {
                said.push((LogLevel::Warn, format!("{words}; nothing passes between them (see `qos_overrides`)")));
            }
        }
        said
    }

    fn look_at(&mut self, index: usize, offers: &[Offer], said: &mut Words) {
        let topic = &mut self.topics[index];
        let here: Vec<&Offer> = offers.iter().filter(|offer| offer.topic == topic.name).collect();
        if here.is_empty() {
            let is_awaited = matches!(topic.state, TopicState::Awaited);
            if is_awaited && self.silent.is_past() && !std::mem::replace(&mut topic.is_silence_told, true) {
                said.push((LogLevel::Warn, silence(&topic.name, offers)));
            }
            return;
        }
        let offer = match &topic.state {
            TopicState::Heard(type_name, hash, _) if here.iter().any(|offer| offer.is_of(type_name, hash)) => {
                for offer in here.iter().filter(|offer| !offer.is_of(type_name, hash)) {
                    if self.told.insert(offer.sender) {
                        let (name, other) = (&topic.name, offer.otherwise(type_name));
                        let words =
                            format!("{name}: a sender publishes {other}, expected `{type_name}`; it is not heard");
                        said.push((LogLevel::Error, words));
                    }
                }
                return;
            }
            TopicState::Refused(type_name, hash) => {
                // Another publisher may have what the map needs.
                let same = |offer: &Offer| offer.type_name == *type_name && offer.type_hash == *hash;
                here.into_iter().find(|offer| !same(offer))
            }
            TopicState::Undescribed { patience, is_told: true } if !patience.is_past() => None,
            _ => here.first().copied(),
        };
        let Some(offer) = offer.cloned() else { return };
        let is_latched = offers.iter().filter(|other| other.topic == offer.topic).all(|other| other.is_latched);
        self.open(index, &offer, is_latched, said);
    }

    /// Subscribes to what somebody offers, where its definition is known and holds the fields.
    fn open(&mut self, index: usize, offer: &Offer, is_latched: bool, said: &mut Words) {
        let Offer { type_name, type_hash, .. } = offer;
        let Some(known) = self.definitions.get(offer, &mut self.bus) else { return };
        if known.schema.is_empty() {
            return self.undescribed(index, offer, said);
        }
        let topic = &mut self.topics[index];
        if topic.changes >= MOST_CHANGES {
            return;
        }
        topic.changes += 1;
        let info = known.topic(&topic.name, type_name, offer.profile.clone());
        let mapped = MappedTopic::new(&topic.given, &info, &self.fields, &self.map);
        let qos = if is_latched { newest_latched() } else { best_effort() };
        let opened = mapped.and_then(|mapped| {
            let tap = self.bus.tap(&topic.given, type_name, &qos).map_err(|error| error.to_string())?;
            Ok((mapped, tap))
        });
        let (mapped, tap) = match opened {
            Ok(opened) => opened,
            Err(problem) => {
                let words = format!("{}: it is not heard: {problem}; mend the map, and start anew", topic.name);
                said.push((LogLevel::Error, words));
                topic.state = TopicState::Refused(type_name.clone(), type_hash.clone());
                return;
            }
        };
        if let TopicState::Heard(before, ..) = &topic.state {
            let before =
                if before == type_name { "another definition of it".to_owned() } else { format!("`{before}`") };
            let words = format!("{}: its type has changed, now `{type_name}` instead of {before}", topic.name);
            said.push((LogLevel::Warn, words));
        }
        let signals = mapped.signals().map(|(field, _)| format!("{} from `{}`", field.target().id(), field.place()));
        let signals: Vec<String> = signals.collect();
        said.push((LogLevel::Info, format!("{} is a `{type_name}`: {}", topic.name, signals.join(", "))));
        let (end, ends) = oneshot::channel();
        let (type_name, type_hash) = (type_name.clone(), type_hash.clone());
        topic.state = TopicState::Heard(type_name.clone(), type_hash.clone(), end);
        // Nobody takes it where the node is about to end.
        let _ = self.opened.unbounded_send(OpenedTopic { topic: mapped, tap, type_name, type_hash, ends });
    }

    /// Nobody describes a type so far.
    fn undescribed(&mut self, index: usize, offer: &Offer, said: &mut Words) {
        let Offer { type_name, type_hash, .. } = offer;
        self.definitions.forget(type_name, type_hash);
        let topic = &mut self.topics[index];
        let TopicState::Undescribed { patience, is_told } = &mut topic.state else {
            topic.state = TopicState::Undescribed { patience: Until::after(Some(PATIENCE)), is_told: false };
            return;
        };
        if patience.is_past() && !std::mem::replace(is_told, true) {
            said.push((
                LogLevel::Error,
                format!(
                    "{}: it is not heard: nobody knows the definition of `{type_name}`, by which its fields are found; give --definitions DIR \
                     with {type_name}.msg",
                    topic.name
                ),
            ));
        }
        if *is_told {
            *patience = Until::after(Some(AGAIN));
        }
    }
}
