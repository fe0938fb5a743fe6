//! The books of a running node: words, bag, diagnostics, and what is wrong with its peers.

use std::collections::BTreeSet;
use std::sync::atomic::Ordering;
use std::time::Duration;

use ros2_client::log::LogLevel;
use ros2_client::{Gid, Publisher, RosoutRaw};

use super::super::bus::Bus;
use super::super::bus_map::InputNames;
use super::super::bus_map::subscriber::MapSubscriber;
use super::super::clock::Watch;
use super::super::control::RunState;
use super::super::core::NodeInput;
use super::super::diagnostics::{self, DiagnosticArray, TimeKeeping};
use super::super::health::Health;
use super::super::intake::TopicCounts;
use super::super::integration::TickOutput;
use super::super::journal::Journal;
use super::super::listener::event::{NodeEvent, Taker};
use super::super::realtime::{Until, monotonic_ns, wall_ns};
use super::super::settings::NodeSettings;
use super::super::startup::INPUTS;
use super::super::words;
use super::kept::Bag;
use super::station::Station;
use govtwin_bag::BagError;

/// How often it looks around.
const SECOND: Duration = Duration::from_secs(1);

/// Most events that are taken in at a go.
const MOST_EVENTS: usize = 4096;

/// The books of one unit: words, bag, diagnostics.
pub(super) struct Supervisor<'a> {
    station: &'a Station,
    bus: &'a Bus,
    diagnostics: Publisher<DiagnosticArray>,
    settings: NodeSettings,
    bag: Bag,
    strangers: BTreeSet<Gid>,
    watch: Watch,
    state: Box<dyn Fn() -> RunState + 'a>,
    competing_clock: bool,
    is_name_taken: bool,
    heard: Taker,
    second: Until,
    newest: Option<TickOutput>,
    reported: [TopicCounts; NodeInput::COUNT],
    /// Stands before each word, where there are several units.
    prefix: String,
    names: InputNames,
    subscriber: Option<MapSubscriber>,
    say: &'a dyn Fn(LogLevel, &str),
}

impl<'a> Supervisor<'a> {
    /// The books of a unit that begins; `state` says whether its simulation runs.
    pub(super) fn new(
        station: &'a Station,
        (diagnostics, bag, heard): (Publisher<DiagnosticArray>, Bag, Taker),
        state: Box<dyn Fn() -> RunState + 'a>,
        (prefix, names, subscriber): (String, InputNames, Option<MapSubscriber>),
        say: &'a dyn Fn(LogLevel, &str),
    ) -> Self {
        Self {
            station,
            bus: &station.bus,
            diagnostics,
            settings: station.settings,
            bag,
            strangers: BTreeSet::new(),
            watch: Watch::new(monotonic_ns()),
            state,
            competing_clock: false,
            is_name_taken: false,
            heard,
            second: Until::after(Some(SECOND)),
            newest: None,
            reported: <[TopicCounts; NodeInput::COUNT]>::default(),
            prefix,
            names,
            subscriber,
            say,
        }
    }

    /// Takes in what was told; once a second flushes the bag, looks around and reports.
    pub(super) fn turn(&mut self) {
        for _ in 0..MOST_EVENTS {
            let Some(item) = self.heard.next() else { break };
            self.take(&item);
            if let NodeEvent::Output(output) = item {
                self.newest = Some(*output);
            }
        }
        self.catch_up();
        let news = self.subscriber.as_mut().map(MapSubscriber::turn);
        news.into_iter().flatten().for_each(|(level, words)| self.tell(level, &words));
        if !self.second.comes_round(SECOND) {
            return;
        }
        self.write(Journal::flush);
        self.look_for_strangers();
        self.look_for_mismatches();
        self.look_at_the_clock();
        self.look_for_namesakes();
        let counts = self.station.counts.lock().map(|counts| *counts).unwrap_or_default();
        let array = diagnostics::compile(
            &self.bus.arguments().full_name(),
            wall_ns(),
            self.newest.as_ref(),
            &self.settings.policies(),
            &counts,
            &std::mem::replace(&mut self.reported, counts),
            TimeKeeping {
                state: (self.state)(),
                clock: self.settings.use_sim_time.then(|| self.watch.state()),
                bag: self.bag.state(),
                health: self.station.health.flags(),
            },
        );
        // Nobody may be listening; the next second brings the next one.
        let _ = self.diagnostics.publish(array);
    }

    /// Writes to the bag; where that ends, it is told, and the node goes on without it.
    pub(super) fn write(&mut self, act: impl FnOnce(&mut Journal) -> Result<(), BagError>) {
        if let Some(words) = self.bag.write(act) {
            self.tell(LogLevel::Error, &words);
        }
    }

    /// Gives the bag away.
    pub(super) fn take_bag(&mut self) -> Bag {
        std::mem::replace(&mut self.bag, Bag::None)
    }

    /// Whether a caller set another time than that by which the node was opened.
    pub(super) fn has_another_time(&self) -> bool {
        self.settings.use_sim_time != self.station.settings.use_sim_time
    }

    /// Tells that this node begins anew with the others of its process.
    pub(super) fn tell_of_beginning(&mut self) {
        self.tell(LogLevel::Warn, "use_sim_time was changed: the nodes of this process begin anew");
    }

    /// Tells of senders that announce another type on an input's topic; some middlewares match them, none can be used.
    fn look_for_strangers(&mut self) {
        let names = NodeInput::ALL.map(|input| self.bus.arguments().resolve(input.topic()).unwrap_or_default());
        for (sender, (topic, found)) in self.bus.writers() {
            let input = NodeInput::ALL.into_iter().find(|input| names[*input as usize] == topic);
            let Some(input) = input else { continue };
            if self.subscriber.is_some() && input != NodeInput::Load {
                self.look_beside_the_map(input, &topic, sender);
                continue;
            }
            let (expected, _) = INPUTS[input as usize];
            if expected != found && self.strangers.insert(sender) {
                let words = format!("{topic}: a sender publishes `{found}`, expected `{expected}`; it is not heard");
                self.tell(LogLevel::Error, &words);
            }
        }
    }

    /// Tells of a sender on the topic of an input that comes by the map.
    fn look_beside_the_map(&mut self, input: NodeInput, topic: &str, sender: Gid) {
        let (label, from) = (&self.names.labels[input as usize], &self.names.topics[input as usize]);
        let is_heard = label != input.topic() && self.bus.arguments().resolve(from).is_ok_and(|from| from == topic);
        if !is_heard && self.strangers.insert(sender) {
            let name = NodeInput::NAMES[input as usize];
            let words = format!("{topic} is published and not heard: {name} comes as the map says");
            self.tell(LogLevel::Warn, &words);
        }
    }

    /// Tells of a clock that is followed and does not go, or of others beside the node's own.
    fn look_at_the_clock(&mut self) {
        let writers = self.bus.arguments().resolve("/clock").map_or(0, |name| self.bus.writers_of(&name));
        if self.settings.use_sim_time {
            if let Some((level, words)) = self.watch.look(&self.station.clock, writers, monotonic_ns()) {
                self.tell(level, &words);
            }
        } else if self.settings.publish_clock && writers > 0 && !std::mem::replace(&mut self.competing_clock, true) {
            self.tell(LogLevel::Error, "/clock: another node publishes it beside this one; whoever follows it jumps");
        }
    }

    /// Tells of another node with this node's name, which answers its callers too.
    fn look_for_namesakes(&mut self) {
        let name = self.bus.arguments().full_name();
        let is_taken = self.bus.servers_of(&format!("{name}/get_parameters")) > 0;
        self.station.health.set_node(if is_taken { Health::NAME_TAKEN } else { 0 });
        if is_taken && !std::mem::replace(&mut self.is_name_taken, is_taken) {
            let words = format!(
                "another node is called {name}: both answer its callers; start one of them with `-r __node:=OTHER`"
            );
            self.tell(LogLevel::Error, &words);
        }
        self.is_name_taken = is_taken;
    }

    /// Tells of endpoints that cannot be matched.
    fn look_for_mismatches(&mut self) {
        for (endpoint, words) in self.bus.incompatible() {
            if self.strangers.insert(endpoint) {
                self.tell(LogLevel::Warn, &format!("{words}; nothing passes between them (see `qos_overrides`)"));
            }
        }
    }

    /// Takes what is left once all threads have ended.
    pub(super) fn drain(&mut self) {
        while let Some(item) = self.heard.next() {
            self.take(&item);
        }
        self.catch_up();
    }

    /// What found no room on the way here.
    fn catch_up(&mut self) {
        if let Some(settings) = self.heard.settings() {
            self.settings = settings;
        }
        let left_out = self.heard.left_out();
        if left_out > 0 {
            let words = format!("the books stood still: {left_out} results or words are missing in log and bag");
            self.tell(LogLevel::Error, &words);
        }
    }

    fn take(&mut self, item: &NodeEvent) {
        for (level, words) in words::of(item, &mut self.settings, &self.names.labels) {
            self.tell(level, &words);
        }
        if let NodeEvent::Output(output) = item {
            self.write(|journal| journal.write(&output.tick));
        }
    }

    fn tell(&mut self, level: LogLevel, words: &str) {
        if (level as u8) < self.station.least.load(Ordering::Relaxed) {
            return;
        }
        (self.say)(level, &format!("{}{words}", self.prefix));
        let stamp = ros2_client::builtin_interfaces::Time::from_nanos(wall_ns());
        self.bus.node().rosout_raw(stamp, level, &self.bus.arguments().name, words, file!(), "", line!());
    }
}
