//! Checks on what peers send: every number finite and in range, stamps in order, types as agreed.

pub(crate) mod competing_publishers;
pub mod joints;
pub mod mapped;
pub mod stamps;

use std::collections::BTreeMap;

use govtwin_bag::msg::{self, Header};
use govtwin_model::frame::EsvState;
use govtwin_model::stored::with_words;
use govtwin_model::units::NANOS_PER_SECOND;

use super::core::{InputEvent, NodeInput};

/// Opening commands beyond these are no commands, pu; the regulator itself limits what lies between.
const OPENING_RANGE_PU: (f64, f64) = (-0.5, 1.5);

/// Tank pressures beyond these are no pressures, Pa gauge.
const PRESSURE_RANGE_PA: (f64, f64) = (0.0, 1.0e8);

/// A stamp further back than this is a source that started again, not a sample that came late, ns.
const RESTART_NS: i64 = NANOS_PER_SECOND;

with_words! {
    /// Why a sample was not used.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Refusal: words {
        /// Not a finite number.
        NotFinite = "not a finite number",
        /// A number that cannot be.
        OutOfRange = "out of range",
        /// `nanosec` of a second or more.
        BadStamp = "a stamp that is no time",
        /// Older than the sample before it.
        Late = "older than the sample before it",
        /// Its bytes are not of the agreed type.
        Undecodable = "not of the agreed type",
        /// Its sender announced another type on the topic.
        ForeignType = "from a sender of another type",
        /// A joint command without position or effort of the servomotor.
        NothingAsked = "without position or effort of the joint `servomotor`",
        /// A message without the field that a map names.
        FieldAbsent = "without the field that the map names",
        /// Nobody can tell which of two elements is meant.
        Twice = "with the joint `servomotor`, or the element that the map names, twice",
        /// A text in a field that a map takes for a number.
        Text = "text, where the map expects a number",
        /// Its stamp is older than the node takes, or as far ahead.
        Old = "a stamp older than max_stamp_age, or as far ahead",
        /// Its sender is not among the commanders.
        NotCommander = "from a sender that is not among the commanders",
    }
}

/// Counts of one topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TopicCounts {
    /// Samples used.
    pub used: u64,
    /// Times at which the source started again.
    pub restarts: u64,
    /// Samples that a sender numbered and that never came.
    pub lost: u64,
    refused: [u64; Refusal::ALL.len()],
}

impl TopicCounts {
    /// Samples refused for this reason.
    pub fn refused(&self, refusal: Refusal) -> u64 {
        self.refused[refusal as usize]
    }

    /// Samples refused.
    pub fn all_refused(&self) -> u64 {
        self.refused.iter().sum()
    }

    /// Adds what was counted after the node began anew.
    pub(crate) fn add(&mut self, later: &Self) {
        self.used += later.used;
        self.restarts += later.restarts;
        self.lost += later.lost;
        for (count, later) in self.refused.iter_mut().zip(later.refused) {
            *count += later;
        }
    }
}

/// The gate of one topic.
#[derive(Clone, Debug, Default)]
pub(crate) struct TopicGate {
    counts: TopicCounts,
    newest_ns: Option<i64>,
}

impl TopicGate {
    /// Counts so far.
    pub(crate) fn counts(&self) -> TopicCounts {
        self.counts
    }

    /// Counts samples that were sent and never came.
    pub(crate) fn miss(&mut self, samples: u64) {
        self.counts.lost += samples;
    }

    /// Counts a sample that never became a message. Returns whether it is the first of its kind.
    pub(crate) fn refuse(&mut self, refusal: Refusal) -> bool {
        let count = &mut self.counts.refused[refusal as usize];
        *count += 1;
        *count == 1
    }

    /// Lets a stamped value through or refuses it.
    fn pass<Value>(&mut self, header: &Header, heard: Result<Value, Refusal>) -> Result<Value, Refusal> {
        let stamp_ns = header.stamp.nanos().ok_or(Refusal::BadStamp);
        self.pass_at(stamp_ns.unwrap_or(0), heard.and_then(|heard| stamp_ns.map(|_| heard)))
    }

    /// The same with a stamp that is a time, ns; 0 where there is none.
    fn pass_at<Value>(&mut self, stamp_ns: i64, heard: Result<Value, Refusal>) -> Result<Value, Refusal> {
        let outcome = heard.and_then(|heard| {
            // Senders without a clock leave the stamp at zero.
            if stamp_ns != 0 {
                let behind_ns = self.newest_ns.map_or(0, |newest_ns| newest_ns.saturating_sub(stamp_ns));
                if behind_ns > RESTART_NS {
                    self.counts.restarts += 1;
                } else if behind_ns > 0 {
                    return Err(Refusal::Late);
                }
                self.newest_ns = Some(stamp_ns);
            }
            Ok(heard)
        });
        match outcome {
            Ok(_) => self.counts.used += 1,
            Err(refusal) => self.counts.refused[refusal as usize] += 1,
        }
        outcome
    }
}

/// A message that the node listens to.
pub(crate) trait Intake {
    /// The input that it feeds.
    const INPUT: NodeInput;

    /// Checks a message against what may be.
    ///
    /// # Errors
    /// With the reason for which it is not used.
    fn check(&self, gate: &mut TopicGate) -> Result<InputEvent, Refusal>;

    /// Its stamp, ns; 0 where it has none.
    fn stamp_ns(&self) -> i64;
}

impl Intake for msg::GovernorCommand {
    const INPUT: NodeInput = NodeInput::Command;

    fn check(&self, gate: &mut TopicGate) -> Result<InputEvent, Refusal> {
        gate.pass(&self.header, in_range(self.opening, OPENING_RANGE_PU).map(InputEvent::Command))
    }

    fn stamp_ns(&self) -> i64 {
        self.header.stamp.nanos().unwrap_or_default()
    }
}

impl Intake for msg::EsvState {
    const INPUT: NodeInput = NodeInput::Esv;

    fn check(&self, gate: &mut TopicGate) -> Result<InputEvent, Refusal> {
        let state = match self.state {
            Self::SHUTDOWN => Ok(EsvState::Shutdown),
            Self::NORMAL => Ok(EsvState::Normal),
            _ => Err(Refusal::OutOfRange),
        };
        gate.pass(&self.header, state.map(InputEvent::Esv))
    }

    fn stamp_ns(&self) -> i64 {
        self.header.stamp.nanos().unwrap_or_default()
    }
}

impl Intake for msg::FluidPressure {
    const INPUT: NodeInput = NodeInput::TankPressure;

    fn check(&self, gate: &mut TopicGate) -> Result<InputEvent, Refusal> {
        gate.pass(&self.header, in_range(self.fluid_pressure, PRESSURE_RANGE_PA).map(InputEvent::TankPressure))
    }

    fn stamp_ns(&self) -> i64 {
        self.header.stamp.nanos().unwrap_or_default()
    }
}

fn in_range(value: f64, (least, largest): (f64, f64)) -> Result<f64, Refusal> {
    match value {
        value if !value.is_finite() => Err(Refusal::NotFinite),
        value if value < least || value > largest => Err(Refusal::OutOfRange),
        value => Ok(value),
    }
}

/// Most senders whose numbers are remembered; beyond them counting starts anew.
const MOST_SENDERS: usize = 256;

/// The numbers that senders give their samples: what is left out between two was lost on the way.
#[derive(Clone, Debug)]
pub(crate) struct Numbering<Sender>(BTreeMap<Sender, i64>);

impl<Sender> Default for Numbering<Sender> {
    fn default() -> Self {
        Self(BTreeMap::new())
    }
}

impl<Sender: Ord> Numbering<Sender> {
    /// Takes the number of a sample; returns how many before it never came. A number that is not above the one before it is a
    /// sample that came late or again.
    pub(crate) fn take(&mut self, sender: Sender, number: i64) -> u64 {
        if self.0.len() >= MOST_SENDERS && !self.0.contains_key(&sender) {
            self.0.clear();
        }
        let newest = self.0.entry(sender).or_insert(number);
        let left_out = number.saturating_sub(*newest).saturating_sub(1);
        *newest = (*newest).max(number);
        u64::try_from(left_out).unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::{any, proptest};

    use super::{Intake, MOST_SENDERS, Numbering, Refusal, TopicGate};
    use crate::core::InputEvent;
    use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Header, Time};

    fn command(sec: i32, nanosec: u32, opening: f64) -> GovernorCommand {
        GovernorCommand { header: Header { stamp: Time { sec, nanosec }, frame_id: String::new() }, opening }
    }

    #[test]
    fn numbers_that_cannot_be_are_refused_and_counted() {
        let mut gate = TopicGate::default();
        assert_eq!(command(1, 0, 0.5).check(&mut gate), Ok(InputEvent::Command(0.5)));
        for (opening, refusal) in
            [(f64::NAN, Refusal::NotFinite), (f64::INFINITY, Refusal::NotFinite), (7.0, Refusal::OutOfRange)]
        {
            assert_eq!(command(2, 0, opening).check(&mut gate), Err(refusal));
        }
        let esv = EsvState { header: Header::default(), state: 2 };
        assert_eq!(esv.check(&mut TopicGate::default()), Err(Refusal::OutOfRange));
        let pressure = FluidPressure { fluid_pressure: -1.0, ..FluidPressure::default() };
        assert_eq!(pressure.check(&mut TopicGate::default()), Err(Refusal::OutOfRange));
        let counts = gate.counts();
        assert_eq!((counts.used, counts.refused(Refusal::NotFinite), counts.all_refused()), (1, 2, 3));
    }

    #[test]
    fn samples_left_out_are_counted_for_each_sender() {
        let mut numbering = Numbering::default();
        let lost: Vec<u64> =
            [(1, 7), (1, 8), (2, 100), (1, 12), (1, 10), (1, 13), (2, 101), (2, i64::MAX), (3, i64::MIN)]
                .into_iter()
                .map(|(sender, number)| numbering.take(sender, number))
                .collect();
        assert_eq!(lost, [0, 0, 0, 3, 0, 0, 0, i64::MAX as u64 - 102, 0]);
        for sender in 10..2 * MOST_SENDERS {
            assert_eq!(numbering.take(sender, 1), 0);
        }
        assert!(numbering.0.len() <= MOST_SENDERS);
    }

    #[test]
    fn stamps_keep_their_order_and_a_long_way_back_is_a_restart() {
        let mut gate = TopicGate::default();
        assert!(command(100, 0, 0.1).check(&mut gate).is_ok());
        assert!(command(100, 0, 0.2).check(&mut gate).is_ok(), "an equal stamp is no step back");
        assert_eq!(command(99, 900_000_000, 0.3).check(&mut gate), Err(Refusal::Late));
        assert_eq!(command(100, 1_000_000_000, 0.3).check(&mut gate), Err(Refusal::BadStamp));
        assert!(command(10, 0, 0.4).check(&mut gate).is_ok());
        assert_eq!(gate.counts().restarts, 1);
        assert!(command(0, 0, 0.4).check(&mut gate).is_ok(), "no stamp, no order");
    }

    proptest! {
        #[test]
        fn whatever_comes_is_used_in_range_or_counted(sec: i32, nanosec: u32, opening in any::<f64>()) {
            let mut gate = TopicGate::default();
            match command(sec, nanosec, opening).check(&mut gate) {
                Ok(InputEvent::Command(value)) => assert!(value.is_finite() && value.abs() <= 1.5),
                Ok(other) => panic!("{other:?}"),
                Err(refusal) => assert_eq!(gate.counts().refused(refusal), 1),
            }
        }
    }
}
