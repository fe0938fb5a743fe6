//! Samples as they come: checked, counted, compared with what others say, passed on.

use ros2_client::log::LogLevel;
use ros2_client::{Gid, MessageInfo, ReadError};

use super::super::commanders::hexadecimal;
use super::super::core::{InputEvent, NodeInput};
use super::super::intake::{Intake, Refusal, TopicGate, joints};
use super::super::realtime::monotonic_ns;
use super::Listener;
use govtwin_bag::msg::{Interface, JointState, ServoState};

/// A measured position beyond this is no position, pu of stroke.
pub(super) const FARTHEST_PU: f64 = 10.0;

impl Listener<'_> {
    /// Checks one sample and passes it on.
    pub(super) fn sample<M: Interface + Intake>(&self, sample: Result<(M, MessageInfo), ReadError>) {
        self.check(M::INPUT, M::TYPE_NAME, sample, |message, sender, gate| {
            let stamp_ns = message.stamp_ns();
            self.look(M::INPUT, stamp_ns, gate)?;
            let heard = message.check(gate)?;
            match heard {
                InputEvent::Command(said) | InputEvent::TankPressure(said) => self.compare(M::INPUT, sender, said),
                InputEvent::Esv(state) => self.compare(M::INPUT, sender, f64::from(state as u8)),
                _ => {}
            }
            self.tell_stamped(heard, stamp_ns);
            Ok(())
        });
    }

    /// Checks a joint command and passes on what it asks for.
    pub(super) fn asked(&self, sample: Result<(JointState, MessageInfo), ReadError>) {
        self.check(NodeInput::Load, JointState::TYPE_NAME, sample, |message, sender, gate| {
            let stamp_ns = message.header.stamp.nanos().unwrap_or_default();
            self.look(NodeInput::Load, stamp_ns, gate)?;
            let asked = joints::asked(message, self.stroke_m.get(), gate)?;
            if let Some(opening_command_pu) = asked.opening_command_pu {
                self.compare(NodeInput::Command, sender, opening_command_pu);
                self.tell_stamped(InputEvent::Command(opening_command_pu), stamp_ns);
            }
            if let Some(load_n) = asked.load_n {
                self.compare(NodeInput::Load, sender, load_n);
                self.tell_stamped(InputEvent::Load(load_n), stamp_ns);
            }
            Ok(())
        });
    }

    /// Counts a sample of an input's topic, and says why it is not used where `take` refuses it.
    fn check<M>(
        &self,
        input: NodeInput,
        type_name: &str,
        sample: Result<(M, MessageInfo), ReadError>,
        take: impl FnOnce(&M, Gid, &mut TopicGate) -> Result<(), Refusal>,
    ) {
        let mut gates = self.gates.borrow_mut();
        let gate = &mut gates[input as usize];
        if let Ok((_, info)) = &sample {
            gate.miss(self.numbers.borrow_mut().take(info.publisher_gid(), info.sequence_number()));
        }
        let refused = match sample {
            Err(ReadError::Deserialization { .. }) => Some((Refusal::Undecodable, gate.refuse(Refusal::Undecodable))),
            Err(error) => {
                self.say(LogLevel::Warn, format!("{}: {error}", self.names.labels[input as usize]));
                None
            }
            Ok((_, info)) if self.is_foreign(info.publisher_gid(), type_name) => {
                gate.refuse(Refusal::ForeignType);
                None
            }
            Ok((_, info)) if !self.may_command(info.publisher_gid(), &self.names.labels[input as usize]) => {
                gate.refuse(Refusal::NotCommander);
                None
            }
            Ok((message, info)) => {
                let refusal = take(&message, info.publisher_gid(), gate).err();
                refusal.map(|refusal| (refusal, gate.counts().refused(refusal) == 1))
            }
        };
        if let Some((refusal, true)) = refused {
            self.tell_refusal(input, refusal, true);
        }
        if let Ok(mut counts) = self.counts.lock() {
            counts[input as usize] = gate.counts();
        }
    }

    /// Looks at a sample's stamp; one that must not be used is counted.
    pub(super) fn look(&self, input: NodeInput, stamp_ns: i64, gate: &mut TopicGate) -> Result<(), Refusal> {
        self.look_at_stamp(input, stamp_ns).inspect_err(|&refusal| {
            gate.refuse(refusal);
        })
    }

    /// Tells of a second sender that says something else on the same input.
    pub(super) fn compare(&self, input: NodeInput, sender: Gid, said: f64) {
        let rival = self.competing.borrow_mut()[input as usize].take(sender, said, monotonic_ns());
        if let Some((other, before)) = rival {
            let name = NodeInput::NAMES[input as usize];
            let words = format!(
                "{name}: two publishers say different things, {said} by {} and {before} by {}; the newest sample counts, \
                 whoever sent it (`ros2 topic info -v {}` shows who they are)",
                hexadecimal(sender),
                hexadecimal(other),
                self.names.topics[input as usize]
            );
            self.say(LogLevel::Error, words);
        }
    }

    /// Passes a measured state on; one that cannot be is left out, since the adaptation lives well without it.
    pub(super) fn measured(&self, sample: Result<(ServoState, MessageInfo), ReadError>) {
        let Ok((state, info)) = sample else { return };
        let [spool_pu, servomotor_pu] = [state.spool_position, state.servomotor_position]
            .map(|position_pu| if position_pu.abs() <= FARTHEST_PU { position_pu } else { f64::NAN });
        let sender = info.publisher_gid();
        if !self.is_foreign(sender, ServoState::TYPE_NAME) && self.may_command(sender, super::MEASURED) {
            self.tell(InputEvent::Measured { spool_pu, servomotor_pu });
        }
    }

    /// Whether a sender announced another type than ours; asked once for each sender.
    fn is_foreign(&self, sender: Gid, expected: &str) -> bool {
        if let Some(&foreign) = self.senders.borrow().get(&sender) {
            return foreign;
        }
        // Not listed yet: believed, and asked again at its next sample.
        let Some((_, found)) = self.bus.writers().remove(&sender) else { return false };
        let foreign = found != expected;
        self.senders.borrow_mut().insert(sender, foreign);
        foreign
    }
}
