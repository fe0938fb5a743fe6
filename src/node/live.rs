//! The running node, or several in one process: opens the bus, starts the threads, keeps the books, and leaves in the right order.

mod station;
mod supervisor;

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Thread;
use std::time::Duration;

use futures::channel::mpsc::UnboundedReceiver;
use futures::channel::oneshot;
use ros2_client::ServiceMapping;
use ros2_client::log::LogLevel;
use rtrb::{Consumer, Producer};

use station::{Parts, Station};
use supervisor::Supervisor;

use super::arguments::Arguments;
use super::bus::{Bus, BusError};
use super::bus_map::subscriber::OpenedTopic;
use super::bus_map::{BusMap, InputNames};
use super::commanders::{AllowList, Commanders};
use super::core::NodeInput;
use super::environment::Environment;
use super::intake::TopicCounts;
use super::integration::{Ends, TimedEvent, pool};
use super::journal::Journal;
use super::listener::event::{NodeEvent, Teller, way};
use super::listener::{Arrivals, Listener, Loop, hear};
use super::parameters::ParameterStore;
use super::publishers::{Outlet, publish};
use super::realtime::{Until, Wishes, claim, claim_as_carrier, pause, resident_bytes};
use super::refit::Refit;
use super::services::ServiceContext;
use super::services::replies::Replies;
use super::settings::NodeSettings;
use super::startup;
use super::stats::{RunSummary, Stats};
use govtwin_bag::BagError;
use govtwin_correction::model::{Model, ModelError};
use govtwin_model::parameters::Unit;

/// Where words go.
pub type Say<'a> = &'a mut dyn FnMut(LogLevel, &str);

/// How the node is to run.
#[derive(Debug, Clone)]
pub struct RunOptions {
    /// The environment.
    pub environment: Environment,
    /// What stands behind `--ros-args`.
    pub arguments: Arguments,
    /// Where the inputs come from, where they are not of our own types.
    pub map: Option<BusMap>,
    /// The unit to simulate.
    pub unit: Unit,
    /// A learned residual of that unit's twin.
    pub residual: NodeResidual,
    /// Whether it adapts to drift, by what `plant/servo_state` says, or the map.
    pub adapt: bool,
    /// Settings before `--ros-args`.
    pub settings: NodeSettings,
    /// Callers may ask, and change nothing.
    pub read_only: bool,
    /// Who may command, between commas; all where it is empty.
    pub commanders: String,
    /// End after so long.
    pub duration: Option<Duration>,
    /// Folder of the bag to write.
    pub bag: Option<PathBuf>,
}

/// Where a node's learned residual comes from.
#[derive(Debug, Clone, Default)]
pub enum NodeResidual {
    /// Nothing is corrected.
    #[default]
    None,
    /// The shipped one, if it is of the unit with the parameters behind `--ros-args`.
    Shipped,
    /// This one, which must be of the unit.
    Given(Box<Model>),
}

/// How a run ended.
#[derive(Debug, Clone)]
pub struct RunEnd {
    /// The integration thread's figures.
    pub summary: RunSummary,
    /// What came in, for each input.
    pub counts: [TopicCounts; NodeInput::COUNT],
    /// Whether the fail-safe ended the node.
    pub by_fail_safe: bool,
    /// The bags that were written.
    pub bags: Vec<PathBuf>,
    /// Why the bag ended before the node, where it did.
    pub bag_ended: Option<String>,
    /// Published states that DDS did not take at once.
    pub lost_publications: u64,
}

/// The node cannot run.
#[derive(Debug, thiserror::Error)]
pub enum NodeError {
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// The bag.
    #[error(transparent)]
    Bag(#[from] BagError),
    /// The residual is not for this unit.
    #[error("--residual: {0}")]
    Residual(#[from] ModelError),
    /// A parameter behind `--ros-args`.
    #[error("--ros-args -p {0}")]
    Parameter(String),
    /// A thread could not be started.
    #[error("cannot start a thread: {0}")]
    Thread(#[from] std::io::Error),
}

/// How often the books are kept.
const BOOKS: Duration = Duration::from_millis(20);

/// Runs the node until `stop`, its duration or the fail-safe ends it.
///
/// # Errors
/// When the bus cannot be joined, a parameter is wrong or the bag cannot be written.
pub fn run(options: &RunOptions, stop: &AtomicBool, say: Say<'_>) -> Result<RunEnd, NodeError> {
    run_together(std::slice::from_ref(options), 1, stop, say).map(|mut ended| ended.swap_remove(0))
}

/// Runs several units, each a node, on one participant and with so many threads that integrate, until `stop`, the first one's duration, or the
/// fail-safe or a caller of one of them ends all. Returns how each ended, in their order.
///
/// # Errors
/// As [`run`].
pub fn run_together(
    options: &[RunOptions],
    threads: usize,
    stop: &AtomicBool,
    say: Say<'_>,
) -> Result<Vec<RunEnd>, NodeError> {
    let Some(first) = options.first() else { return Ok(Vec::new()) };
    let (stations, parts, journals) = open(options, say)?;
    let wishes = stations.first().map(|first| first.settings.wishes).unwrap_or_default();
    for (level, words) in startup::claim(wishes.priority) {
        say(level, &words);
    }
    let replies: Vec<Replies<'_>> = stations.iter().map(|station| Replies::new(station.begins())).collect();
    let say = RefCell::new(say);
    let tell = |level, words: &str| (say.borrow_mut())(level, words);
    let (mut outlets, mut loops, mut hearers, mut supervisors) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (((station, parts), journal), replies) in stations.iter().zip(parts).zip(journals).zip(&replies) {
        let Parts { health, store, allowed, integrator, ends, subscriber, opened, names } = parts;
        let Ends { events, refits, retired, outputs, answers } = ends;
        let (node_events, heard) = way();
        let action = station.subscriptions.action();
        outlets.push(Outlet::new(
            (&station.publishers, &station.health),
            (outputs, answers),
            (replies, action),
            node_events.clone(),
        ));
        loops.push(integrator);
        let name = station.bus.arguments().full_name();
        let prefix = if options.len() > 1 { format!("{name}: ") } else { String::new() };
        let state = Box::new(|| replies.state());
        let heard = (health, journal, heard);
        supervisors.push(Supervisor::new(station, heard, state, (prefix, names.clone(), subscriber), &tell));
        let ways = (events, refits, retired);
        let mapped = (names, opened);
        hearers.push(Hearer { station, replies, store, allowed, node_events, ways, mapped });
    }

    let share = loops.len().div_ceil(threads.max(1));
    let ending = AtomicBool::new(false);
    let ending_ref = &ending;
    let (stop_listening, listening) = oneshot::channel();
    let (stats, lost) = std::thread::scope(|scope| {
        let publishing = std::thread::Builder::new().name("publish".to_owned()).spawn_scoped(scope, move || {
            claim_as_carrier(wishes.priority);
            publish(outlets)
        })?;
        let (mut stepping, mut loops) = (Vec::new(), loops.into_iter());
        for (thread, hearers) in hearers.chunks(share).enumerate() {
            let loops: Vec<_> = loops.by_ref().take(share).collect();
            let (publisher, node_events) = (publishing.thread().clone(), hearers[0].node_events.clone());
            let wishes = Wishes { cpu: wishes.cpu.map(|cpu| cpu + thread), ..wishes };
            stepping.push(std::thread::Builder::new().name("step".to_owned()).spawn_scoped(scope, move || {
                tell_claims(wishes, &node_events);
                // From here on this thread touches nothing that can wait.
                drop(node_events);
                pool::run(loops, ending_ref, &publisher)
            })?);
        }
        let steppers: Vec<_> = stepping.iter().map(|stepping| stepping.thread().clone()).collect();
        let (threads, service) = (steppers.clone(), (first.environment.service_layout, first.read_only));
        let hearing = std::thread::Builder::new().name("hear".to_owned()).spawn_scoped(scope, move || {
            claim_as_carrier(wishes.priority);
            let units: Vec<_> = hearers
                .into_iter()
                .enumerate()
                .map(|(n, one)| one.into_hearing(&threads[n / share], service))
                .collect();
            hear(units.iter().flat_map(UnitHearing::arrivals).collect(), listening);
        })?;
        let until = Until::after(first.duration);
        while !stop.load(Ordering::Relaxed)
            && !until.is_past()
            && !stepping.iter().any(std::thread::ScopedJoinHandle::is_finished)
        {
            supervisors.iter_mut().for_each(Supervisor::turn);
            pause(BOOKS);
        }
        ending.store(true, Ordering::Relaxed);
        steppers.iter().for_each(std::thread::Thread::unpark);
        let _ = stop_listening.send(());
        let counted = stepping.into_iter().map(|one| one.join().unwrap_or_else(|_| vec![Stats::default(); share]));
        let stats: Vec<Stats> = counted.flatten().collect();
        let lost = publishing.join().unwrap_or_else(|_| vec![0; options.len()]);
        let _ = hearing.join();
        supervisors.iter_mut().for_each(Supervisor::drain);
        Ok::<_, std::io::Error>((stats, lost))
    })?;
    let resident = resident_bytes();
    let bags: Vec<_> = supervisors.iter_mut().map(Supervisor::close).collect();
    drop(supervisors);
    drop(replies);
    let counts: Vec<_> =
        stations.iter().map(|station| station.counts.lock().map(|counts| *counts).unwrap_or_default()).collect();
    drop(stations);
    let is_stopped = stop.load(Ordering::Relaxed);
    let ends = stats.iter().zip(lost).zip(bags).zip(counts).map(|(((stats, lost_publications), bags), counts)| {
        let (bags, bag_ended) = bags?;
        let by_fail_safe = !is_stopped && stats.ended_by_fail_safe;
        Ok(RunEnd { summary: stats.summary(resident), counts, by_fail_safe, bags, bag_ended, lost_publications })
    });
    ends.collect()
}

/// What is open of each unit: what its threads share, what each of them takes, and its bag.
type Opened = (Vec<Station>, Vec<Parts>, Vec<Option<Journal>>);

/// Opens the nodes of all units, then begins their bags.
fn open(options: &[RunOptions], say: Say<'_>) -> Result<Opened, NodeError> {
    let mut told = BTreeSet::new();
    // What is the same for all units is said once.
    let mut say_once = |level, words: &str| {
        if told.insert(words.to_owned()) {
            say(level, words);
        }
    };
    let (mut stations, mut parts, mut journals) = (Vec::<Station>::new(), Vec::new(), Vec::new());
    for options in options {
        let (station, of_threads) = Station::open(options, stations.first().map(|first| &first.bus), &mut say_once)?;
        stations.push(station);
        parts.push(of_threads);
    }
    let mapped = parts.iter().filter_map(|parts: &Parts| Some(parts.subscriber.as_ref()?.bus()));
    for words in Bus::idle_arguments_of(&stations.iter().map(|station| &station.bus).chain(mapped).collect::<Vec<_>>())
    {
        say_once(LogLevel::Warn, &words);
    }
    for (station, options) in stations.iter().zip(options) {
        journals.push(options.bag.as_ref().map(|folder| station.journal(folder)).transpose()?);
    }
    Ok((stations, parts, journals))
}

/// Asks for what a thread that integrates wishes and tells what was granted.
fn tell_claims(wishes: Wishes, node_events: &Teller) {
    for said in claim(wishes) {
        let (level, words) = match said {
            Ok(words) => (LogLevel::Info, words),
            Err(words) => (LogLevel::Warn, words),
        };
        node_events.tell(NodeEvent::Said(level, words));
    }
}

/// What the thread that hears takes of a unit.
struct Hearer<'a, 'p> {
    station: &'p Station,
    replies: &'a Replies<'p>,
    store: ParameterStore,
    allowed: AllowList,
    node_events: Teller,
    ways: Ways,
    mapped: (InputNames, Option<UnboundedReceiver<OpenedTopic>>),
}

/// The ways to the loop and back.
type Ways = (Producer<TimedEvent>, Producer<Box<Refit>>, Consumer<Box<Refit>>);

/// A unit as it hears.
struct UnitHearing<'a, 'p> {
    station: &'p Station,
    replies: &'a Replies<'p>,
    listener: Listener<'p>,
    services: ServiceContext<'p>,
}

impl<'a, 'p> Hearer<'a, 'p> {
    fn into_hearing(self, stepper: &Thread, (layout, read_only): (ServiceMapping, bool)) -> UnitHearing<'a, 'p> {
        let Self { station, replies, store, allowed, node_events, ways, mapped: (names, opened) } = self;
        let (events, refits, retired) = ways;
        let integrator = Loop { events, refits, retired, thread: stepper.clone() };
        let commanders = Rc::new(Commanders::new(allowed, station.subscriptions.graph(), &station.health));
        let shared = (&station.clock, &station.health);
        let listener =
            Listener::new(&station.bus, integrator, node_events, &station.counts, shared, Rc::clone(&commanders))
                .with_map(names, opened);
        let mut services = ServiceContext::new(store, layout, &station.least);
        services.read_only = read_only;
        services.commanders = Some(commanders);
        UnitHearing { station, replies, listener, services }
    }
}

impl UnitHearing<'_, '_> {
    fn arrivals(&self) -> Vec<Arrivals<'_>> {
        self.listener.arrivals(&self.station.subscriptions, &self.services, self.replies)
    }
}
