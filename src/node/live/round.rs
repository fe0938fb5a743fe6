//! One round of the nodes of a process: threads run between the endpoints that were opened, and all leave in the right order.

use std::rc::Rc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{ScopedJoinHandle, Thread};
use std::time::Duration;

use futures::channel::mpsc::UnboundedReceiver;
use futures::channel::oneshot;
use ros2_client::ServiceMapping;
use ros2_client::log::LogLevel;
use rtrb::{Consumer, Producer};

use super::super::bus_map::InputNames;
use super::super::bus_map::subscriber::OpenedTopic;
use super::super::commanders::{AllowList, Commanders};
use super::super::integration::{Ends, TimedEvent, pool};
use super::super::journal::Journal;
use super::super::listener::event::{NodeEvent, Teller, way};
use super::super::listener::{Arrivals, Listener, Loop, hear};
use super::super::parameters::ParameterStore;
use super::super::publishers::{Outlet, publish};
use super::super::realtime::{Until, Wishes, claim, claim_as_carrier, pause, resident_bytes};
use super::super::refit::Refit;
use super::super::services::ServiceContext;
use super::super::services::replies::Replies;
use super::super::stats::Stats;
use super::kept::{Bag, Kept};
use super::station::{Parts, Station};
use super::supervisor::Supervisor;
use super::{NodeError, RunOptions};

/// How often the books are kept.
const BOOKS: Duration = Duration::from_millis(20);

/// How long nodes that begin anew wait for the response to whoever asked for it to arrive, and how often they look.
const ANSWERED: Duration = Duration::from_secs(1);
const BETWEEN_LOOKS: Duration = Duration::from_millis(1);

/// What is the same in all rounds.
pub(super) struct Process<'a> {
    pub(super) options: &'a [RunOptions],
    /// How many threads integrate.
    pub(super) threads: usize,
    pub(super) stop: &'a AtomicBool,
    pub(super) until: Until,
    pub(super) tell: &'a dyn Fn(LogLevel, &str),
}

impl Process<'_> {
    /// Runs the nodes that were opened; returns whether they are to begin anew, as a caller set another time.
    pub(super) fn round(
        &self,
        kept: &mut [Kept],
        (stations, parts): (Vec<Station>, Vec<Parts>),
    ) -> Result<bool, NodeError> {
        let (options, first) = (self.options, &self.options[0]);
        let wishes = stations[0].settings.wishes;
        let replies: Vec<Replies<'_>> = stations.iter().map(|station| Replies::new(station.begins())).collect();
        let (mut outlets, mut loops, mut hearers, mut supervisors) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (((station, parts), kept), replies) in stations.iter().zip(parts).zip(&mut *kept).zip(&replies) {
            let Parts { health, allowed, integrator, ends, subscriber, opened, names } = parts;
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
            let heard = (health, std::mem::replace(&mut kept.bag, Bag::None), heard);
            supervisors.push(Supervisor::new(station, heard, state, (prefix, names.clone(), subscriber), self.tell));
            let ways = (events, refits, retired);
            let (mapped, store) = ((names, opened), kept.store.clone());
            hearers.push(Hearer { station, replies, store, allowed, node_events, ways, mapped });
        }

        let share = loops.len().div_ceil(self.threads.max(1));
        let ending = AtomicBool::new(false);
        let ending_ref = &ending;
        let (stop_listening, listening) = oneshot::channel();
        let (counted, stores, begins_anew) = std::thread::scope(|scope| {
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
                hear_all(hearers, (&threads, share), service, listening)
            })?;
            let begins_anew = self.keep_books(&mut supervisors, &stepping);
            ending.store(true, Ordering::Relaxed);
            steppers.iter().for_each(Thread::unpark);
            let stats = stepping.into_iter().map(|one| one.join().unwrap_or_else(|_| vec![Stats::default(); share]));
            let stats: Vec<Stats> = stats.flatten().collect();
            let lost = publishing.join().unwrap_or_else(|_| vec![0; options.len()]);
            if begins_anew {
                let until = Until::after(Some(ANSWERED));
                while !stations.iter().all(|station| station.subscriptions.is_answered()) && !until.is_past() {
                    pause(BETWEEN_LOOKS);
                }
            }
            let _ = stop_listening.send(());
            let stores = hearing.join().unwrap_or_default();
            supervisors.iter_mut().for_each(Supervisor::drain);
            Ok::<_, std::io::Error>((stats.into_iter().zip(lost), stores, begins_anew))
        })?;
        let resident_bytes = resident_bytes();
        for ((kept, station), supervisor) in kept.iter_mut().zip(&stations).zip(&mut supervisors) {
            if begins_anew {
                supervisor.write(Journal::begin_another);
            }
            kept.bag = supervisor.take_bag();
            let counts = station.counts.lock().map(|counts| *counts).unwrap_or_default();
            kept.counts.iter_mut().zip(&counts).for_each(|(kept, counts)| kept.add(counts));
            kept.least = station.least.load(Ordering::Relaxed);
            kept.resident_bytes = resident_bytes;
        }
        for (kept, store) in kept.iter_mut().zip(stores) {
            kept.store = store;
        }
        for (kept, (stats, lost)) in kept.iter_mut().zip(counted) {
            kept.stats.add(&stats);
            kept.lost_publications += lost;
        }
        Ok(begins_anew)
    }

    /// Keeps the books until the round ends; returns whether the nodes begin anew then.
    fn keep_books(&self, supervisors: &mut [Supervisor<'_>], stepping: &[ScopedJoinHandle<'_, Vec<Stats>>]) -> bool {
        loop {
            if self.stop.load(Ordering::Relaxed)
                || self.until.is_past()
                || stepping.iter().any(ScopedJoinHandle::is_finished)
            {
                return false;
            }
            supervisors.iter_mut().for_each(Supervisor::turn);
            if supervisors.iter().any(Supervisor::has_another_time) {
                supervisors.iter_mut().for_each(Supervisor::tell_of_beginning);
                return true;
            }
            pause(BOOKS);
        }
    }
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

/// Hears for all units, each for the thread that integrates it, until told to stop; returns their parameters as they stand then.
fn hear_all(
    hearers: Vec<Hearer<'_, '_>>,
    (threads, share): (&[Thread], usize),
    service: (ServiceMapping, bool),
    stop: oneshot::Receiver<()>,
) -> Vec<ParameterStore> {
    let units = hearers.into_iter().enumerate().map(|(n, one)| one.into_hearing(&threads[n / share], service));
    let units: Vec<_> = units.collect();
    hear(units.iter().flat_map(UnitHearing::arrivals).collect(), stop);
    units.into_iter().map(|unit| unit.services.store.into_inner()).collect()
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
