//! The running node: opens the bus, starts the threads, keeps the books, and leaves in the right order.

mod supervisor;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::time::Duration;

use futures::channel::oneshot;
use ros2_client::log::LogLevel;

use supervisor::Supervisor;

use super::arguments::Arguments;
use super::bus::{Bus, BusError};
use super::clock::{self, Watch};
use super::control::RunState;
use super::core::{Core, NodeInput};
use super::diagnostics;
use super::environment::Environment;
use super::intake::TopicCounts;
use super::integration::{Ends, Integrator};
use super::journal::{Journal, Names};
use super::listener::event::{NodeEvent, way};
use super::listener::{Listener, Loop, Subscriptions};
use super::parameters::ParameterStore;
use super::publishers::Publishers;
use super::realtime::{Until, claim, claim_as_carrier, monotonic_ns, resident_bytes};
use super::refit::Refit;
use super::services::ServiceContext;
use super::services::replies::Replies;
use super::settings::NodeSettings;
use super::stats::RunSummary;
use super::{qos, startup};
use crate::bag::BagError;
use crate::parameters::Unit;
use crate::residual::corrector::Corrector;
use crate::residual::model::{Model, ModelError};
use crate::residual::row::Opening;

/// Why a unit with a learned residual cannot be changed while the node runs.
const FIXED_UNIT: &str =
    "a learned residual is of the unit as it was at start: start anew with the changed unit, or without --residual";

/// Where words go.
pub type Say<'a> = &'a mut dyn FnMut(LogLevel, &str);

/// How the node is to run.
#[derive(Debug, Clone)]
pub struct RunOptions {
    /// The environment.
    pub environment: Environment,
    /// What stands behind `--ros-args`.
    pub arguments: Arguments,
    /// The unit to simulate.
    pub unit: Unit,
    /// A learned residual of that unit's twin.
    pub residual: Option<Model>,
    /// Whether it adapts to drift, by what `plant/servo_state` says.
    pub adapt: bool,
    /// Settings before `--ros-args`.
    pub settings: NodeSettings,
    /// End after so long.
    pub duration: Option<Duration>,
    /// Folder of the bag to write.
    pub bag: Option<PathBuf>,
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

/// Runs the node until `stop`, its duration or the fail-safe ends it.
///
/// # Errors
/// When the bus cannot be joined, a parameter is wrong or the bag cannot be written.
pub fn run(options: &RunOptions, stop: &AtomicBool, say: Say<'_>) -> Result<RunEnd, NodeError> {
    let store = parameters(options, say)?;
    let (settings, unit) = (store.settings(), store.unit().clone());
    let corrector = corrector(options, &unit)?;
    for remark in options.environment.remarks.iter().chain(&options.arguments.remarks) {
        say(LogLevel::Warn, remark);
    }
    let mut bus = Bus::open(&options.environment, options.arguments.clone())?;
    for (level, words) in startup::words(&bus, &options.environment, &settings) {
        say(level, &words);
    }
    // All endpoints are made before anything runs: announcements in a burst later may be lost.
    let subscriptions = Subscriptions::open(&mut bus, &options.environment, &settings, options.adapt)?;
    let publishers = Publishers::open(&mut bus, corrector.as_ref().map(Corrector::signal), settings.publish_clock)?;
    let health = bus.publish("/diagnostics", diagnostics::TYPE_NAME)?;
    for words in bus.idle_arguments() {
        say(LogLevel::Warn, &words);
    }
    let journal = options.bag.as_ref().map(|folder| Journal::create(folder, &names(&bus)?).map_err(NodeError::from));
    let journal = journal.transpose()?;
    for (level, words) in startup::claim(settings.wishes.priority) {
        say(level, &words);
    }
    let fixed_unit = corrector.is_some().then_some(FIXED_UNIT);
    let core = Core::of_refit(Refit::new(&unit), settings.policies()).with_corrector(corrector);
    let (integrator, ends) = Integrator::new(core, settings.pace(), 0);
    let Ends { events, refits, retired, outputs, answers } = ends;
    let replies = Replies::new(if settings.pace().paused { RunState::Paused } else { RunState::Playing });
    let clock = clock::ClockHeard::default();
    let least = AtomicU8::new(log_level(options.arguments.log_level) as u8);
    let counts = Mutex::new(<[TopicCounts; NodeInput::COUNT]>::default());
    let (node_events, heard) = way();
    let (stop_listening, listening) = oneshot::channel();
    let ending = AtomicBool::new(false);
    let (bus_ref, subscriptions_ref, publishers_ref, counts_ref, ending_ref) =
        (&bus, &subscriptions, &publishers, &counts, &ending);
    let (replies_ref, clock_ref, least_ref) = (&replies, &clock, &least);
    let state = || replies_ref.state();
    let mut supervisor = Supervisor {
        bus: bus_ref,
        health,
        counts: counts_ref,
        settings,
        journal,
        ended: None,
        strangers: BTreeSet::new(),
        clock: clock_ref,
        watch: Watch::new(monotonic_ns()),
        state: &state,
        competing_clock: false,
        least: least_ref,
        say,
    };

    let (stats, lost_publications) = std::thread::scope(|scope| {
        let environment = &options.environment;
        let telling = node_events.clone();
        let publishing = std::thread::Builder::new().name("publish".to_owned()).spawn_scoped(scope, move || {
            claim_as_carrier(settings.wishes.priority);
            publishers_ref.publish(outputs, answers, replies_ref, subscriptions_ref.action(), &telling)
        })?;
        let (publisher, stepper_events) = (publishing.thread().clone(), node_events.clone());
        let stepping = std::thread::Builder::new().name("step".to_owned()).spawn_scoped(scope, move || {
            for said in claim(settings.wishes) {
                let (level, words) = match said {
                    Ok(words) => (LogLevel::Info, words),
                    Err(words) => (LogLevel::Warn, words),
                };
                stepper_events.tell(NodeEvent::Said(level, words));
            }
            // From here on this thread touches nothing that can wait.
            drop(stepper_events);
            integrator.run(ending_ref, &publisher)
        })?;
        let integrator = Loop { events, refits, retired, thread: stepping.thread().clone() };
        let stepper = stepping.thread().clone();
        let hearing = std::thread::Builder::new().name("hear".to_owned()).spawn_scoped(scope, move || {
            claim_as_carrier(settings.wishes.priority);
            let listener = Listener::new(bus_ref, integrator, node_events, counts_ref, clock_ref);
            let mut context = ServiceContext::new(store, &environment.service_mappings, least_ref);
            context.fixed_unit = fixed_unit;
            listener.run(subscriptions_ref, &context, replies_ref, listening);
        })?;
        let until = Until::after(options.duration);
        let done = || stop.load(Ordering::Relaxed) || until.is_past() || stepping.is_finished();
        supervisor.keep(&heard, done);
        ending.store(true, Ordering::Relaxed);
        stepper.unpark();
        let _ = stop_listening.send(());
        let stats = stepping.join().unwrap_or_default();
        let lost_publications = publishing.join().unwrap_or(0);
        let _ = hearing.join();
        supervisor.drain(&heard);
        Ok::<_, std::io::Error>((stats, lost_publications))
    })?;
    let resident = resident_bytes();
    let (bags, bag_ended) = supervisor.close()?;
    drop(supervisor);
    // Endpoints first, then the node, then the participant: peers see each of them go.
    drop(replies);
    drop((subscriptions, publishers));
    drop(bus);
    let counts = counts.into_inner().unwrap_or_default();
    let by_fail_safe = !stop.load(Ordering::Relaxed) && stats.ended_by_fail_safe;
    Ok(RunEnd { summary: stats.summary(resident), counts, by_fail_safe, bags, bag_ended, lost_publications })
}

/// The learned residual, where there is one and it is of this unit.
fn corrector(options: &RunOptions, unit: &Unit) -> Result<Option<Corrector>, ModelError> {
    let corrector = options.residual.as_ref().map(|model| {
        model.check(unit, Opening::Simulated)?;
        let corrector = Corrector::new(model)?;
        if options.adapt { corrector.adapting(model) } else { Ok(corrector) }
    });
    corrector.transpose()
}

/// The node's parameters with what was given at start.
fn parameters(options: &RunOptions, say: Say<'_>) -> Result<ParameterStore, NodeError> {
    let mut store = ParameterStore::new(&options.settings, &options.unit);
    for (name, given) in &options.arguments.parameters {
        if name.starts_with(qos::PREFIX) {
            // The bus knows what to do with them.
        } else if store.value(name) == ros2_client::ParameterValue::NotSet {
            let reason = store.preset(name, given).err().unwrap_or_default();
            say(LogLevel::Warn, &format!("--ros-args -p {name}: {reason}"));
        } else {
            store.preset(name, given).map_err(NodeError::Parameter)?;
        }
    }
    store.check_unit().map_err(NodeError::Parameter)?;
    if store.settings().use_sim_time && store.settings().paused {
        say(
            LogLevel::Warn,
            "start_paused does nothing: a node that follows /clock (use_sim_time) stands until the clock goes",
        );
    }
    if store.settings().use_sim_time && store.settings().publish_clock {
        let words =
            "publish_clock:=true: a node that follows /clock (use_sim_time) cannot publish it too; give one of them";
        return Err(NodeError::Parameter(words.to_owned()));
    }
    Ok(store)
}

fn names(bus: &Bus) -> Result<Names, BusError> {
    let resolve = |topic: &str| bus.arguments().resolve(topic);
    let [command, esv, tank_pressure, load] = NodeInput::ALL.map(NodeInput::topic);
    Ok(Names {
        inputs: [resolve(command)?, resolve(esv)?, resolve(tank_pressure)?, resolve(load)?],
        servo_state: resolve("sim/servo_state")?,
        joint_states: resolve("sim/joint_states")?,
    })
}

fn log_level(level: ros2args::LogLevel) -> LogLevel {
    match level {
        ros2args::LogLevel::Debug => LogLevel::Debug,
        ros2args::LogLevel::Info => LogLevel::Info,
        ros2args::LogLevel::Warn => LogLevel::Warn,
        ros2args::LogLevel::Error => LogLevel::Error,
        ros2args::LogLevel::Fatal => LogLevel::Fatal,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::{Arguments, Environment, NodeError, NodeSettings, RunOptions, run};

    #[test]
    fn a_unit_that_a_file_may_not_describe_does_not_run_either() {
        let words = ["-p", "unit.distributing_valve.control_volume_m3:=1e-6"].map(str::to_owned);
        let options = RunOptions {
            environment: Environment::read(|_| None).unwrap(),
            arguments: Arguments::parse(&words, "govtwin").unwrap(),
            unit: crate::params::reference(),
            residual: None,
            adapt: false,
            settings: NodeSettings::default(),
            duration: None,
            bag: None,
        };
        let stop = AtomicBool::new(true);
        match run(&options, &stop, &mut |_, _| {}) {
            Err(NodeError::Parameter(reason)) => assert!(reason.contains("the control chamber would hold"), "{reason}"),
            other => panic!("{other:?}"),
        }
    }
}
