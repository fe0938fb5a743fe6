//! What a unit keeps where the nodes of its process begin anew: its parameters, its counts and its bags.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use ros2_client::ParameterValue;
use ros2_client::log::LogLevel;

use super::super::arguments::ParameterOverride;
use super::super::core::NodeInput;
use super::super::intake::TopicCounts;
use super::super::journal::Journal;
use super::super::parameters::ParameterStore;
use super::super::qos;
use super::super::stats::Stats;
use super::{NodeError, NodeResidual, RunEnd, RunOptions, Say};
use govtwin_bag::BagError;
use govtwin_model::parameters::Unit;

/// What one round leaves to the next, and the last one to the end of the run.
pub(super) struct Kept {
    pub(super) store: ParameterStore,
    /// The unit at start, which a learned residual is of.
    unit: Unit,
    /// The level below which nothing is told.
    pub(super) least: u8,
    pub(super) counts: [TopicCounts; NodeInput::COUNT],
    pub(super) stats: Stats,
    pub(super) lost_publications: u64,
    pub(super) resident_bytes: u64,
    pub(super) bag: Bag,
}

impl Kept {
    /// A unit before its first round, with the parameters that were given.
    pub(super) fn begin(options: &RunOptions, is_alone: bool, say: Say<'_>) -> Result<Self, NodeError> {
        let store = parameters(options, say)?;
        if !is_alone && store.settings().publish_clock {
            let words = "publish_clock:=true: several units of one process would tell several clocks; leave it out";
            return Err(NodeError::Parameter(words.to_owned()));
        }
        Ok(Self {
            unit: store.unit().clone(),
            store,
            least: log_level(options.arguments.log_level) as u8,
            counts: <[TopicCounts; NodeInput::COUNT]>::default(),
            stats: Stats::default(),
            lost_publications: 0,
            resident_bytes: 0,
            bag: Bag::None,
        })
    }

    /// The learned residual; none where a caller changed the unit.
    pub(super) fn residual<'a>(&self, options: &'a RunOptions) -> &'a NodeResidual {
        if *self.store.unit() == self.unit { &options.residual } else { &NodeResidual::None }
    }

    /// How the run ended.
    pub(super) fn end(self, stop: &AtomicBool) -> Result<RunEnd, BagError> {
        let (bags, bag_ended) = self.bag.finish()?;
        Ok(RunEnd {
            summary: self.stats.summary(self.resident_bytes),
            counts: self.counts,
            by_fail_safe: !stop.load(Ordering::Relaxed) && self.stats.ended_by_fail_safe,
            bags,
            bag_ended,
            lost_publications: self.lost_publications,
        })
    }
}

/// A unit's bag.
pub(super) enum Bag {
    /// None is wanted.
    None,
    /// It is written.
    Written(Box<Journal>),
    /// It ended before the node: what is complete of it, and why.
    Ended(Vec<PathBuf>, String),
}

impl Bag {
    /// Writes to the bag. Where the disk is full, or the system refuses, it ends; returns that in words.
    pub(super) fn write(&mut self, act: impl FnOnce(&mut Journal) -> Result<(), BagError>) -> Option<String> {
        let Self::Written(journal) = self else { return None };
        let written = act(journal);
        if written.is_ok() && !journal.is_full() {
            return None;
        }
        let Self::Written(journal) = std::mem::replace(self, Self::None) else { return None };
        let (bags, words) = match written.and_then(|()| journal.finish()) {
            Ok(bags) => (bags, "the disk is full: the bag ends here, complete; the node runs on without it".to_owned()),
            Err(error) => {
                let saved = "`govtwin recover` saves what is in its .unfinished folder";
                (Vec::new(), format!("the bag ends here ({error}); {saved}; the node runs on without it"))
            }
        };
        *self = Self::Ended(bags, words.clone());
        Some(words)
    }

    /// How it stands, for diagnostics: how bad, and what; `None` where none is wanted.
    pub(super) fn state(&self) -> Option<(u8, &'static str)> {
        match self {
            Self::None => None,
            Self::Written(_) => Some((0, "written")),
            Self::Ended(..) => Some((2, "ended; what comes now is not recorded")),
        }
    }

    /// Completes the bag; gives all bags, and why they ended before the node, where they did.
    fn finish(self) -> Result<(Vec<PathBuf>, Option<String>), BagError> {
        match self {
            Self::None => Ok((Vec::new(), None)),
            Self::Written(journal) => Ok((journal.finish()?, None)),
            Self::Ended(bags, words) => Ok((bags, Some(words))),
        }
    }
}

/// The node's parameters with what was given at start.
fn parameters(options: &RunOptions, say: Say<'_>) -> Result<ParameterStore, NodeError> {
    let settings = options.map.as_ref().map_or(options.settings, |map| map.settings(options.settings));
    let mut store = ParameterStore::new(&settings, &options.unit);
    store.preset("commanders", &ParameterOverride::Text(options.commanders.clone())).map_err(NodeError::Parameter)?;
    for (name, given) in &options.arguments.parameters {
        if name.starts_with(qos::PREFIX) {
            // The bus knows what to do with them.
        } else if store.value(name) == ParameterValue::NotSet {
            let reason = store.preset(name, given).err().unwrap_or_default();
            say(LogLevel::Warn, &format!("--ros-args -p {name}: {reason}"));
        } else {
            store.preset(name, given).map_err(NodeError::Parameter)?;
        }
    }
    store.check_together().map_err(NodeError::Parameter)?;
    Ok(store)
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
