//! Samples of topics that a map names: read by the map, and checked, counted and passed on as those of our own types are.

use std::collections::BTreeMap;

use futures::channel::mpsc::UnboundedReceiver;
use futures::stream::{LocalBoxStream, StreamExt};
use ros2_client::Gid;
use ros2_client::log::LogLevel;

use super::super::bus_map::subscriber::OpenedTopic;
use super::super::core::{InputEvent, NodeInput};
use super::super::intake::Refusal;
use super::super::intake::mapped::{checked, input_of, refusal_of};
use super::super::tap::TappedSample;
use super::samples::FARTHEST_PU;
use super::{Arrivals, Listener};
use govtwin_bag::import::{ImportedRow, MappedTopic, Target};

/// Senders of one topic that are remembered; beyond them each is looked up anew.
const MOST_SENDERS: usize = 256;

/// A topic that is heard.
struct HeardTopic {
    topic: MappedTopic,
    type_name: String,
    type_hash: String,
    /// The inputs that it drives.
    inputs: Vec<NodeInput>,
    /// Whether a sender announced another type.
    senders: BTreeMap<Gid, bool>,
    taken: u64,
}

impl Listener<'_> {
    /// What arrives on the topics of a map, from when each is subscribed to.
    pub(super) fn mapped(&self, opened: UnboundedReceiver<OpenedTopic>) -> Arrivals<'_> {
        opened.map(|opened| self.samples(opened)).flatten_unordered(None).boxed_local()
    }

    fn samples(&self, opened: OpenedTopic) -> LocalBoxStream<'_, ()> {
        let OpenedTopic { topic, tap, type_name, type_hash, ends } = opened;
        let inputs = topic.signals().filter_map(|(field, _)| input_of(field.target())).collect();
        let mut heard = HeardTopic { topic, type_name, type_hash, inputs, senders: BTreeMap::new(), taken: 0 };
        if self.esv_latched.get() {
            heard.topic.latch();
        }
        tap.into_stream().take_until(ends).map(move |sample| self.take_mapped(sample, &mut heard)).boxed_local()
    }

    fn take_mapped(&self, sample: Result<TappedSample, String>, heard: &mut HeardTopic) {
        let count = |heard: &HeardTopic, refusal| {
            for &input in &heard.inputs {
                self.gates.borrow_mut()[input as usize].refuse(refusal);
            }
        };
        match sample {
            Err(_) => heard.inputs.iter().for_each(|&input| self.refuse(input, Refusal::Undecodable)),
            Ok(sample) if self.is_other(sample.sender, heard) => count(heard, Refusal::ForeignType),
            Ok(sample) if !self.may_command(sample.sender, &self.label_of(heard)) => {
                count(heard, Refusal::NotCommander);
            }
            Ok(sample) => {
                let lost = self.numbers.borrow_mut().take(sample.sender, sample.number);
                heard.inputs.iter().for_each(|&input| self.gates.borrow_mut()[input as usize].miss(lost));
                heard.taken += 1;
                let row = heard.topic.take(&sample.data, sample.received_ns, heard.taken);
                self.esv_latched.set(self.esv_latched.get() || heard.topic.is_latched());
                self.pass_on(&row, &heard.topic, sample.sender);
            }
        }
        if let Ok(mut counts) = self.counts.lock() {
            let gates = self.gates.borrow();
            for &input in &heard.inputs {
                counts[input as usize] = gates[input as usize].counts();
            }
        }
    }

    /// Passes on what a message holds of inputs and of what is measured.
    fn pass_on(&self, row: &ImportedRow, topic: &MappedTopic, sender: Gid) {
        for (field, state) in topic.signals() {
            let Some(input) = input_of(field.target()) else { continue };
            if let Some(refusal) = refusal_of(state) {
                self.refuse(input, refusal);
                continue;
            }
            let Some(value) = row.value(field.target()) else { continue };
            let mut gates = self.gates.borrow_mut();
            let gate = &mut gates[input as usize];
            let stamp_ns = topic.stamp_ns();
            let looked = self.look(input, stamp_ns.unwrap_or_default(), gate);
            match looked.and_then(|()| checked(field.target(), value, stamp_ns, gate)) {
                Ok(event) => {
                    drop(gates);
                    self.compare(input, sender, value);
                    self.tell_stamped(event, stamp_ns.unwrap_or_default());
                }
                Err(refusal) => {
                    let is_first = gate.counts().refused(refusal) == 1;
                    drop(gates);
                    self.tell_refusal(input, refusal, is_first);
                }
            }
        }
        let position = |target| row.value(target).filter(|value| value.abs() <= FARTHEST_PU).unwrap_or(f64::NAN);
        let [spool_pu, servomotor_pu] = [Target::SpoolPosition, Target::ServomotorPosition].map(position);
        if !(spool_pu.is_nan() && servomotor_pu.is_nan()) {
            self.tell(InputEvent::Measured { spool_pu, servomotor_pu });
        }
    }

    /// The topic of a map in words.
    fn label_of(&self, heard: &HeardTopic) -> String {
        let input = heard.inputs.first().map(|&input| self.names.labels[input as usize].clone());
        input.unwrap_or_else(|| "measured positions of the map".to_owned())
    }

    fn refuse(&self, input: NodeInput, refusal: Refusal) {
        let is_first = self.gates.borrow_mut()[input as usize].refuse(refusal);
        self.tell_refusal(input, refusal, is_first);
    }

    /// Says why a sample is not used, the first time.
    pub(super) fn tell_refusal(&self, input: NodeInput, refusal: Refusal, is_first: bool) {
        if is_first {
            let (label, why) = (&self.names.labels[input as usize], refusal.words());
            self.say(LogLevel::Warn, format!("{label}: a sample was refused: {why}; more are only counted"));
        }
    }

    /// Whether a sender announced another type than the one that is heard; asked once for each sender.
    fn is_other(&self, sender: Gid, heard: &mut HeardTopic) -> bool {
        if let Some(&other) = heard.senders.get(&sender) {
            return other;
        }
        // Not listed yet: believed, and asked again at its next sample.
        let Some(offer) = self.bus.offers().into_iter().find(|offer| offer.sender == sender) else { return false };
        let other = !offer.is_of(&heard.type_name, &heard.type_hash);
        if heard.senders.len() < MOST_SENDERS {
            heard.senders.insert(sender, other);
        }
        other
    }
}
