//! The publishers of the node's results, and the thread that feeds them.

use std::time::Duration;

use ros2_client::{Publisher, WriteError};
use rtrb::Consumer;
use serde::Serialize;

use super::bus::{Bus, BusError};
use super::control::Answer;
use super::corrected::CorrectedPublishers;
use super::health::Health;
use super::integration::TickOutput;
use super::listener::event::{NodeEvent, Teller};
use super::messages;
use super::realtime::{monotonic_ns, pause};
use super::services::replies::Replies;
use super::services::steps::StepsAction;
use govtwin_bag::msg::{Clock, Interface, JointState, ServoState, Time, TwinStatus};
use govtwin_model::signal::Signal;

/// A clock that stands is told again after so long, ns.
const CLOCK_AGAIN_NS: i64 = 200_000_000;

/// How often and how far apart a message is offered to a reader that is behind, while the loop waits too.
const MOST_TRIES: u32 = 100;
const BETWEEN_TRIES: Duration = Duration::from_micros(200);

/// Everything that the node publishes at the state's rate.
pub(crate) struct Publishers {
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
    pub(crate) fn open(bus: &mut Bus, corrected: Option<Signal>, clock: bool) -> Result<Self, BusError> {
        Ok(Self {
            servo_state: bus.publish("sim/servo_state", ServoState::TYPE_NAME)?,
            joint_states: bus.publish("sim/joint_states", JointState::TYPE_NAME)?,
            status: bus.publish("sim/status", TwinStatus::TYPE_NAME)?,
            corrected: corrected.map(|signal| CorrectedPublishers::open(bus, signal)).transpose()?,
            clock: if clock { Some(bus.publish("/clock", Clock::TYPE_NAME)?) } else { None },
        })
    }

    fn tell_clock(&self, time_ns: i64) -> u64 {
        let lost = |clock: &Publisher<Clock>| clock.publish(Clock { clock: Time::from_nanos(time_ns) }).is_err();
        self.clock.as_ref().map_or(0, |clock| u64::from(lost(clock)))
    }
}

/// The way of one unit's results out.
pub(crate) struct Outlet<'a, 's> {
    publishers: &'a Publishers,
    outputs: Consumer<TickOutput>,
    answers: Consumer<Answer>,
    replies: &'a Replies<'s>,
    action: &'a StepsAction,
    node_events: Teller,
    health: &'a Health,
    time_ns: i64,
    told_ns: i64,
    lost: u64,
}

impl<'a, 's> Outlet<'a, 's> {
    /// Results and answers of one loop, for those who subscribe, who called, and the supervisor.
    pub(crate) fn new(
        (publishers, health): (&'a Publishers, &'a Health),
        (outputs, answers): (Consumer<TickOutput>, Consumer<Answer>),
        (replies, action): (&'a Replies<'s>, &'a StepsAction),
        node_events: Teller,
    ) -> Self {
        Self { publishers, outputs, answers, replies, action, node_events, health, time_ns: 0, told_ns: 0, lost: 0 }
    }

    /// Publishes what is there and hands it on to the supervisor; callers are answered once what they ordered is published.
    /// Returns whether the loop has gone and nothing is left.
    fn turn(&mut self) -> bool {
        let is_last = self.outputs.is_abandoned();
        // Taken before the results: all that led to these answers is among them.
        let done: Vec<Answer> = std::iter::from_fn(|| self.answers.pop().ok()).collect();
        while let Ok(output) = self.outputs.pop() {
            self.pass(Box::new(output));
        }
        for answer in done {
            self.replies.answer(answer);
        }
        if !is_last && monotonic_ns() - self.told_ns > CLOCK_AGAIN_NS {
            // While the simulation stands, for those who come late.
            self.told_ns = monotonic_ns();
            self.lost += self.publishers.tell_clock(self.time_ns);
        }
        is_last
    }

    fn pass(&mut self, output: Box<TickOutput>) {
        let Publishers { servo_state, joint_states, status, corrected, .. } = self.publishers;
        self.time_ns = output.tick.frame.time_ns;
        if output.publish || output.tick.estimate.is_none() {
            self.told_ns = monotonic_ns();
            self.lost += self.publishers.tell_clock(self.time_ns);
            self.lost += send(status, messages::status(&output.tick, self.health.flags()), output.patient);
        }
        if let (true, Some(estimate)) = (output.publish, &output.tick.estimate) {
            let joints = messages::joint_state(estimate, output.tick.strokes_m);
            self.lost += send(servo_state, messages::servo_state(estimate), output.patient);
            self.lost += send(joint_states, joints, output.patient);
            if let Some((voice, correction)) = corrected.as_ref().zip(output.tick.correction.as_ref()) {
                self.lost += voice.say(estimate, correction);
            }
        }
        if output.patient {
            self.action.progress(output.steps_left);
        }
        self.node_events.tell(NodeEvent::Output(output));
    }
}

/// Publishes the results of all units until their loops have gone. Returns how many messages of each DDS did not take.
pub(crate) fn publish(mut outlets: Vec<Outlet<'_, '_>>) -> Vec<u64> {
    loop {
        let mut are_last = true;
        for outlet in &mut outlets {
            are_last &= outlet.turn();
        }
        if are_last {
            return outlets.iter().map(|outlet| outlet.lost).collect();
        }
        std::thread::park_timeout(Duration::from_millis(100));
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
