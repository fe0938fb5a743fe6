//! The running node: opens the bus, starts the threads, keeps the books, and leaves in the right order.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::RecvTimeoutError;
use std::time::Duration;

use futures::channel::oneshot;
use ros2_client::log::LogLevel;
use ros2_client::{Gid, Publisher, RosoutRaw};

use super::arguments::Arguments;
use super::bus::{Bus, BusError};
use super::core::{Core, Input};
use super::diagnostics::{self, DiagnosticArray};
use super::environment::Environment;
use super::intake::Counts;
use super::integration::Integrator;
use super::journal::{Journal, Names};
use super::listener::news::{News, Taker, way};
use super::listener::{Ears, Listener};
use super::mouth::Mouth;
use super::parameters::Store;
use super::realtime::{Until, claim, claim_as_carrier, resident_bytes, wall_ns};
use super::settings::Settings;
use super::stats::Summary;
use super::{qos, startup, words};
use crate::bag::BagError;
use crate::msg::{EsvState, FluidPressure, GovernorCommand, Interface};
use crate::parameters::{Parameters, Unit};
use crate::residual::corrector::Corrector;
use crate::residual::model::{Model, ModelError};
use crate::residual::row::Opening;
use crate::twin::Twin;

/// Where words go.
pub type Say<'a> = &'a mut dyn FnMut(LogLevel, &str);

/// How the node is to run.
#[derive(Debug, Clone)]
pub struct Options {
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
    pub settings: Settings,
    /// End after so long.
    pub duration: Option<Duration>,
    /// Folder of the bag to write.
    pub bag: Option<PathBuf>,
}

/// How a run ended.
#[derive(Debug, Clone)]
pub struct Ended {
    /// The integration thread's figures.
    pub summary: Summary,
    /// What came in, for each input.
    pub counts: [Counts; 3],
    /// Whether the fail-safe ended the node.
    pub by_fail_safe: bool,
    /// The bags that were written.
    pub bags: Vec<PathBuf>,
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
pub fn run(options: &Options, stop: &AtomicBool, say: Say<'_>) -> Result<Ended, NodeError> {
    let least = log_level(options.arguments.log_level);
    let store = parameters(options, say)?;
    let (settings, unit) = (store.settings(), store.unit().clone());
    let corrector = options.residual.as_ref().map(|model| {
        model.check(&unit, Opening::Simulated)?;
        let corrector = Corrector::new(model)?;
        if options.adapt { corrector.adapting(model) } else { Ok(corrector) }
    });
    let corrector = corrector.transpose()?;
    for remark in options.environment.remarks.iter().chain(&options.arguments.remarks) {
        say(LogLevel::Warn, remark);
    }
    let mut bus = Bus::open(&options.environment, options.arguments.clone())?;
    for (level, words) in startup::words(&bus, &options.environment, &settings) {
        say(level, &words);
    }
    // All endpoints are made before anything runs: announcements in a burst later may be lost.
    let ears = Ears::open(&mut bus, &options.environment, &settings, options.adapt)?;
    let mouth = Mouth::open(&mut bus, corrector.as_ref().map(Corrector::signal))?;
    let health = bus.publish("/diagnostics", diagnostics::TYPE_NAME)?;
    let journal = options.bag.as_ref().map(|folder| Journal::create(folder, &names(&bus)?).map_err(NodeError::from));
    let journal = journal.transpose()?;
    for (level, words) in startup::claim(settings.wishes.priority) {
        say(level, &words);
    }
    let core = Core::new(Twin::new(&unit), settings.policies(), unit.parameters.oil.tank_pressure_pa);
    let core = core.with_corrector(corrector);
    let (integrator, ends) = Integrator::new(core, settings.pace(), 0);
    let counts = Mutex::new(<[Counts; 3]>::default());
    let (news, heard) = way();
    let (stop_listening, listening) = oneshot::channel();
    let ending = AtomicBool::new(false);
    let (bus_ref, ears_ref, mouth_ref, counts_ref, ending_ref) = (&bus, &ears, &mouth, &counts, &ending);
    let mut keeper = Keeper {
        bus: bus_ref,
        health,
        counts: counts_ref,
        settings,
        parameters: unit.parameters,
        journal,
        strangers: BTreeSet::new(),
        least,
        say,
    };

    let (stats, lost_publications, outcome) = std::thread::scope(|scope| {
        let listener = Listener::new(bus_ref, ends.events, news.clone(), counts_ref);
        let environment = &options.environment;
        let hearing = std::thread::Builder::new().name("hear".to_owned()).spawn_scoped(scope, move || {
            claim_as_carrier(settings.wishes.priority);
            listener.run(ears_ref, store, environment, listening);
        })?;
        let (outputs, telling) = (ends.outputs, news.clone());
        let publishing = std::thread::Builder::new().name("publish".to_owned()).spawn_scoped(scope, move || {
            claim_as_carrier(settings.wishes.priority);
            mouth_ref.publish(outputs, &unit.parameters, &telling)
        })?;
        let publisher = publishing.thread().clone();
        let stepping = std::thread::Builder::new().name("step".to_owned()).spawn_scoped(scope, move || {
            for said in claim(settings.wishes) {
                let (level, words) = match said {
                    Ok(words) => (LogLevel::Info, words),
                    Err(words) => (LogLevel::Warn, words),
                };
                news.tell(News::Said(level, words));
            }
            // From here on this thread touches nothing that can wait.
            drop(news);
            integrator.run(ending_ref, &publisher)
        })?;
        let until = Until::after(options.duration);
        let done = || stop.load(Ordering::Relaxed) || until.is_past() || stepping.is_finished();
        let mut outcome = keeper.keep(&heard, done);
        ending.store(true, Ordering::Relaxed);
        let _ = stop_listening.send(());
        let stats = stepping.join().unwrap_or_default();
        let lost_publications = publishing.join().unwrap_or(0);
        let _ = hearing.join();
        outcome = outcome.and(keeper.drain(&heard));
        Ok::<_, std::io::Error>((stats, lost_publications, outcome))
    })?;
    outcome?;
    let resident = resident_bytes();
    let bags = keeper.journal.take().map(Journal::finish).transpose()?.unwrap_or_default();
    drop(keeper);
    // Endpoints first, then the node, then the participant: peers see each of them go.
    drop((ears, mouth));
    drop(bus);
    let counts = counts.into_inner().unwrap_or_default();
    let by_fail_safe = !stop.load(Ordering::Relaxed) && stats.ended_by_fail_safe;
    Ok(Ended { summary: stats.summary(resident), counts, by_fail_safe, bags, lost_publications })
}

/// The node's parameters with what was given at start.
fn parameters(options: &Options, say: Say<'_>) -> Result<Store, NodeError> {
    let mut store = Store::new(&options.settings, &options.unit);
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
    Ok(store)
}

fn names(bus: &Bus) -> Result<Names, BusError> {
    let resolve = |topic: &str| bus.arguments().resolve(topic);
    let [command, esv, tank_pressure] = Input::ALL.map(Input::topic);
    Ok(Names {
        inputs: [resolve(command)?, resolve(esv)?, resolve(tank_pressure)?],
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

/// The books: words, bag, diagnostics.
struct Keeper<'a> {
    bus: &'a Bus,
    health: Publisher<DiagnosticArray>,
    counts: &'a Mutex<[Counts; 3]>,
    settings: Settings,
    parameters: Parameters,
    journal: Option<Journal>,
    strangers: BTreeSet<Gid>,
    least: LogLevel,
    say: Say<'a>,
}

impl Keeper<'_> {
    /// Keeps the books until `done`.
    fn keep(&mut self, news: &Taker, done: impl Fn() -> bool) -> Result<(), NodeError> {
        let second = Duration::from_secs(1);
        let mut next = Until::after(Some(second));
        let (mut newest, mut reported) = (None, <[Counts; 3]>::default());
        while !done() {
            match news.take(Duration::from_millis(20)) {
                Ok(item) => {
                    if let News::Output(output) = &item {
                        newest = Some(**output);
                    }
                    self.take(&item)?;
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            self.catch_up(news);
            if next.comes_round(second) {
                if let Some(journal) = &mut self.journal {
                    journal.flush()?;
                }
                self.look_for_strangers();
                self.look_for_mismatches();
                let counts = self.counts.lock().map(|counts| *counts).unwrap_or_default();
                let name = self.bus.arguments().full_name();
                let array = diagnostics::compile(
                    &name,
                    wall_ns(),
                    newest.as_ref(),
                    &self.settings.policies(),
                    &counts,
                    &std::mem::replace(&mut reported, counts),
                );
                // Nobody may be listening; the next second brings the next one.
                let _ = self.health.publish(array);
            }
        }
        Ok(())
    }

    /// Tells of senders that announce another type on an input's topic; some middlewares match them, none can be used.
    fn look_for_strangers(&mut self) {
        let types = [GovernorCommand::TYPE_NAME, EsvState::TYPE_NAME, FluidPressure::TYPE_NAME];
        let names = Input::ALL.map(|input| self.bus.arguments().resolve(input.topic()).unwrap_or_default());
        for (sender, (topic, found)) in self.bus.writers() {
            let expected = names.iter().zip(types).find(|(name, _)| **name == topic).map(|(_, expected)| expected);
            if expected.is_some_and(|expected| expected != found) && self.strangers.insert(sender) {
                let expected = expected.unwrap_or_default();
                let words = format!("{topic}: a sender publishes `{found}`, expected `{expected}`; it is not heard");
                self.tell(LogLevel::Error, &words);
            }
        }
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
    fn drain(&mut self, news: &Taker) -> Result<(), NodeError> {
        let taken = news.rest().try_for_each(|item| self.take(&item));
        self.catch_up(news);
        taken
    }

    /// What found no room on the way here.
    fn catch_up(&mut self, news: &Taker) {
        if let Some(settings) = news.settings() {
            self.settings = settings;
        }
        let left_out = news.left_out();
        if left_out > 0 {
            let words = format!("the books stood still: {left_out} results or words are missing in log and bag");
            self.tell(LogLevel::Error, &words);
        }
    }

    fn take(&mut self, item: &News) -> Result<(), NodeError> {
        for (level, words) in words::of(item, &mut self.settings) {
            self.tell(level, &words);
        }
        match (item, &mut self.journal) {
            (News::Output(output), Some(journal)) => Ok(journal.write(&output.tick, &self.parameters)?),
            _ => Ok(()),
        }
    }

    fn tell(&mut self, level: LogLevel, words: &str) {
        if level < self.least {
            return;
        }
        (self.say)(level, words);
        let stamp = ros2_client::builtin_interfaces::Time::from_nanos(wall_ns());
        self.bus.node().rosout_raw(stamp, level, &self.bus.arguments().name, words, file!(), "", line!());
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use super::{Arguments, Environment, NodeError, Options, Settings, run};

    #[test]
    fn a_unit_that_a_file_may_not_describe_does_not_run_either() {
        let words = ["-p", "unit.distributing_valve.control_volume_m3:=1e-6"].map(str::to_owned);
        let options = Options {
            environment: Environment::read(|_| None).unwrap(),
            arguments: Arguments::parse(&words, "govtwin").unwrap(),
            unit: crate::params::reference(),
            residual: None,
            adapt: false,
            settings: Settings::default(),
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
