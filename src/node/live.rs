//! The running node, or several in one process: rounds of them, each from the opening of their endpoints to its end.

mod kept;
mod round;
mod station;
mod supervisor;

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use ros2_client::log::LogLevel;

use kept::{Bag, Kept};
use round::Process;
use station::{Parts, Station};

use super::arguments::Arguments;
use super::bus::{Bus, BusError};
use super::bus_map::BusMap;
use super::core::NodeInput;
use super::environment::Environment;
use super::intake::TopicCounts;
use super::realtime::Until;
use super::settings::NodeSettings;
use super::startup;
use super::stats::RunSummary;
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

/// Runs the node until `stop`, its duration or the fail-safe ends it.
///
/// # Errors
/// When the bus cannot be joined, a parameter is wrong or the bag cannot be written.
pub fn run(options: &RunOptions, stop: &AtomicBool, say: Say<'_>) -> Result<RunEnd, NodeError> {
    run_together(std::slice::from_ref(options), 1, stop, say).map(|mut ended| ended.swap_remove(0))
}

/// Runs several units, each a node, on one participant and with so many threads that integrate, until `stop`, the first one's duration, or the
/// fail-safe or a caller of one of them ends all. Where a caller sets `use_sim_time` of one, all begin anew. Returns how each ended, in their order.
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
    let say = RefCell::new(say);
    let tell = |level, words: &str| (say.borrow_mut())(level, words);
    let mut told = BTreeSet::new();
    // What is the same for all units, and in all rounds, is said once.
    let mut tell_once = |level, words: &str| {
        if told.insert(words.to_owned()) {
            tell(level, words);
        }
    };
    let begin = |one| Kept::begin(one, options.len() == 1, &mut tell_once);
    let mut kept = options.iter().map(begin).collect::<Result<Vec<_>, _>>()?;
    let mut opened = open(options, &mut kept, &mut tell_once)?;
    let process = Process { options, threads, stop, until: Until::after(first.duration), tell: &tell };
    while process.round(&mut kept, opened)? {
        opened = match open(options, &mut kept, &mut tell_once) {
            Ok(again) => again,
            Err(error) => {
                // What was recorded is kept.
                kept.into_iter().try_for_each(|kept| kept.end(stop).map(drop))?;
                return Err(error);
            }
        };
    }
    kept.into_iter().map(|kept| Ok(kept.end(stop)?)).collect()
}

/// Opens the nodes of all units on one participant, then begins their bags.
fn open(options: &[RunOptions], kept: &mut [Kept], say: Say<'_>) -> Result<(Vec<Station>, Vec<Parts>), NodeError> {
    let (mut stations, mut parts) = (Vec::<Station>::new(), Vec::<Parts>::new());
    for (options, kept) in options.iter().zip(&*kept) {
        let (station, of_threads) = Station::open(options, kept, stations.first().map(|first| &first.bus), say)?;
        stations.push(station);
        parts.push(of_threads);
    }
    let mapped = parts.iter().filter_map(|parts| Some(parts.subscriber.as_ref()?.bus()));
    for words in Bus::idle_arguments_of(&stations.iter().map(|station| &station.bus).chain(mapped).collect::<Vec<_>>())
    {
        say(LogLevel::Warn, &words);
    }
    for ((station, options), kept) in stations.iter().zip(options).zip(kept) {
        if let (Bag::None, Some(folder)) = (&kept.bag, &options.bag) {
            kept.bag = Bag::Written(Box::new(station.journal(folder)?));
        }
    }
    for (level, words) in startup::claim(stations[0].settings.wishes.priority) {
        say(level, &words);
    }
    Ok((stations, parts))
}
