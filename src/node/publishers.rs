//! The publishers of the node's results, and the thread that feeds them.

use std::time::Duration;

use ros2_client::{Publisher, WriteError};
use rtrb::Consumer;
use serde::Serialize;

use super::bus::{Bus, BusError};
use super::control::Answer;
use super::corrected::CorrectedPublishers;
use super::integration::TickOutput;
use super::listener::event::{NodeEvent, Teller};
use super::messages;
use super::realtime::{monotonic_ns, pause};
use super::services::replies::Replies;
use super::services::steps::StepsAction;
use crate::msg::{Clock, Interface, JointState, ServoState, Time, TwinStatus};
use crate::signal::Signal;

/// A clock that stands is told again after so long, ns.
const CLOCK_AGAIN_NS: i64 = 200_000_000;

/// How often and how far apart a message is offered to a reader that is behind, while the loop waits too.
const MOST_TRIES: u32 = 100;
const BETWEEN_TRIES: Duration = Duration::from_micros(200);

/// Everything that the node publishes at the state's rate.
pub struct Publishers {
    servo_state: Publisher<ServoState>,
    joint_states: Publisher<JointState>,
    status: Publisher<TwinStatus>,
    corrected: Option<CorrectedPublishers>,
    clock: Option<Publisher<Clock>>,
}

impl Publishers {
    /// Opens all publishers; `corrected` is the signal that a learned residual corrects, `clock` whether the model's time is told.
    ///
    /// # Errors
    /// When DDS refuses one.
    pub fn open(bus: &mut Bus, corrected: Option<Signal>, clock: bool) -> Result<Self, BusError> {
        Ok(Self {
            servo_state: bus.publish("sim/servo_state", ServoState::TYPE_NAME)?,
            joint_states: bus.publish("sim/joint_states", JointState::TYPE_NAME)?,
            status: bus.publish("sim/status", TwinStatus::TYPE_NAME)?,
            corrected: corrected.map(|signal| CorrectedPublishers::open(bus, signal)).transpose()?,
            clock: if clock { Some(bus.publish("/clock", Clock::TYPE_NAME)?) } else { None },
        })
    }

    /// Publishes results until the loop has gone, and hands them on to the supervisor; callers are answered once what they ordered
    /// is published. Returns how many messages DDS did not take.
    pub fn publish(
        &self,
        mut outputs: Consumer<TickOutput>,
        mut answers: Consumer<Answer>,
        replies: &Replies<'_>,
        action: &StepsAction,
        node_events: &Teller,
    ) -> u64 {
        let mut lost = 0;
        let (mut time_ns, mut told_ns) = (0, 0);
        loop {
            let last = outputs.is_abandoned();
            // Taken before the results: all that led to these answers is among them.
            let done: Vec<Answer> = std::iter::from_fn(|| answers.pop().ok()).collect();
            while let Ok(output) = outputs.pop() {
                time_ns = output.tick.frame.time_ns;
                if output.publish || output.tick.estimate.is_none() {
                    told_ns = monotonic_ns();
                    lost += self.tell_clock(time_ns);
                    lost += send(&self.status, messages::status(&output.tick), output.patient);
                }
                if let (true, Some(estimate)) = (output.publish, &output.tick.estimate) {
                    let joints = messages::joint_state(estimate, output.tick.strokes_m);
                    lost += send(&self.servo_state, messages::servo_state(estimate), output.patient);
                    lost += send(&self.joint_states, joints, output.patient);
                    if let Some((voice, correction)) = self.corrected.as_ref().zip(output.tick.correction.as_ref()) {
                        lost += voice.say(estimate, correction);
                    }
                }
                if output.patient {
                    action.progress(output.steps_left);
                }
                node_events.tell(NodeEvent::Output(Box::new(output)));
            }
            for answer in done {
                replies.answer(answer);
            }
            if last {
                return lost;
            }
            if monotonic_ns() - told_ns > CLOCK_AGAIN_NS {
                // While the simulation stands, for those who come late.
                told_ns = monotonic_ns();
                lost += self.tell_clock(time_ns);
            }
            std::thread::park_timeout(Duration::from_millis(100));
        }
    }

    fn tell_clock(&self, time_ns: i64) -> u64 {
        let lost = |clock: &Publisher<Clock>| clock.publish(Clock { clock: Time::from_nanos(time_ns) }).is_err();
        self.clock.as_ref().map_or(0, |clock| u64::from(lost(clock)))
    }
}

/// Publishes a message; waits a little for a reader that is behind where `patient`. Returns how many were lost: none or one.
fn send<M: Serialize>(publisher: &Publisher<M>, mut message: M, patient: bool) -> u64 {
    let mut tries = if patient { MOST_TRIES } else { 1 };
    loop {
        match publisher.publish(message) {
            Ok(()) => return 0,
            Err(WriteError::WouldBlock { data }) if tries > 1 => {
                tries -= 1;
                message = data;
                pause(BETWEEN_TRIES);
            }
            Err(_) => return 1,
        }
    }
}
