//! What is wrong with inputs and node while it runs, as flags that the threads share: `sim/status` has them with each state.

use std::sync::atomic::{AtomicI64, AtomicU8, Ordering};

use super::core::NodeInput;
use super::realtime::monotonic_ns;
use govtwin_model::units::NANOS_PER_SECOND;

/// What was ignored shows for so long, ns.
const SHOWN_NS: i64 = 2 * NANOS_PER_SECOND;

/// The flags of each input and of the node.
#[derive(Debug, Default)]
pub(crate) struct Health {
    inputs: [AtomicU8; NodeInput::COUNT],
    node: AtomicU8,
    ignored_until_ns: AtomicI64,
}

/// The flags at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct HealthFlags {
    /// Of each input.
    pub inputs: [u8; NodeInput::COUNT],
    /// Of the node.
    pub node: u8,
}

impl Health {
    /// Two publishers of an input say different things.
    pub(crate) const COMPETING: u8 = 1;
    /// Stamps are older than `max_stamp_age`, or as far ahead; such samples are refused.
    pub(crate) const STAMP_OLD: u8 = 2;
    /// Samples arrive and their stamp stands still.
    pub(crate) const STAMP_STANDS: u8 = 4;
    /// Stamps are more than 10 s from the node's time.
    pub(crate) const STAMP_FAR: u8 = 8;
    /// Another node has this node's name.
    pub(crate) const NAME_TAKEN: u8 = 16;
    /// The fail-safe tripped, and the trip waits for `~/reset_trip`.
    pub(crate) const LATCHED: u8 = 32;
    /// Others than the commanders send inputs, or call for a change: they are ignored.
    pub(crate) const IGNORED: u8 = 64;

    /// Sets the flags of an input.
    pub(crate) fn set(&self, input: NodeInput, flags: u8) {
        self.inputs[input as usize].store(flags, Ordering::Relaxed);
    }

    /// Sets the flags of the node.
    pub(crate) fn set_node(&self, flags: u8) {
        self.node.store(flags, Ordering::Relaxed);
    }

    /// Notes that somebody who may not command was ignored at `now_ns` of the monotonic clock.
    pub(crate) fn note_ignored(&self, now_ns: i64) {
        self.ignored_until_ns.store(now_ns.saturating_add(SHOWN_NS), Ordering::Relaxed);
    }

    /// The flags now.
    pub(crate) fn flags(&self) -> HealthFlags {
        let inputs = NodeInput::ALL.map(|input| self.inputs[input as usize].load(Ordering::Relaxed));
        let ignored = if monotonic_ns() < self.ignored_until_ns.load(Ordering::Relaxed) { Self::IGNORED } else { 0 };
        HealthFlags { inputs, node: self.node.load(Ordering::Relaxed) | ignored }
    }
}

impl HealthFlags {
    /// All of them together.
    pub(crate) fn all(self) -> u8 {
        self.inputs.iter().fold(self.node, |all, flags| all | flags)
    }

    /// How bad the flags of an input are, and what they mean.
    pub(crate) fn of(self, input: NodeInput) -> Option<(u8, &'static str)> {
        let meanings = [
            (Health::COMPETING, 2, "two publishers say different things; the newest sample is used"),
            (Health::STAMP_OLD, 2, "stamps older than max_stamp_age, or as far ahead: refused"),
            (Health::STAMP_STANDS, 2, "samples arrive and their stamp stands still"),
            (Health::STAMP_FAR, 1, "stamps are more than 10 s from the node's time"),
        ];
        let flags = self.inputs[input as usize];
        meanings.into_iter().find(|(flag, ..)| flags & flag != 0).map(|(_, level, words)| (level, words))
    }
}
