//! The publishers of the node's results, and the thread that feeds them.

use std::time::Duration;

use ros2_client::Publisher;
use rtrb::Consumer;

use super::bus::{Bus, BusError};
use super::corrected::Voice;
use super::integration::Output;
use super::listener::news::{News, Teller};
use super::messages;
use crate::msg::{Interface, JointState, ServoState, TwinStatus};
use crate::parameters::Parameters;
use crate::signal::Signal;

/// Everything that the node publishes at the state's rate.
pub struct Mouth {
    servo_state: Publisher<ServoState>,
    joint_states: Publisher<JointState>,
    status: Publisher<TwinStatus>,
    corrected: Option<Voice>,
}

impl Mouth {
    /// Opens all publishers; `corrected` is the signal that a learned residual corrects.
    ///
    /// # Errors
    /// When DDS refuses one.
    pub fn open(bus: &mut Bus, corrected: Option<Signal>) -> Result<Self, BusError> {
        Ok(Self {
            servo_state: bus.publish("sim/servo_state", ServoState::TYPE_NAME)?,
            joint_states: bus.publish("sim/joint_states", JointState::TYPE_NAME)?,
            status: bus.publish("sim/status", TwinStatus::TYPE_NAME)?,
            corrected: corrected.map(|signal| Voice::open(bus, signal)).transpose()?,
        })
    }

    /// Publishes results until the loop has gone, and hands them on to the keeper. Returns how many DDS did not take.
    pub fn publish(&self, mut outputs: Consumer<Output>, parameters: &Parameters, news: &Teller) -> u64 {
        let mut lost = 0;
        loop {
            let last = outputs.is_abandoned();
            while let Ok(output) = outputs.pop() {
                if output.publish || output.tick.estimate.is_none() {
                    lost += u64::from(self.status.publish(messages::status(&output.tick)).is_err());
                }
                if let (true, Some(estimate)) = (output.publish, &output.tick.estimate) {
                    let state = self.servo_state.publish(messages::servo_state(estimate)).is_err();
                    let joints = self.joint_states.publish(messages::joint_state(estimate, parameters)).is_err();
                    lost += u64::from(state) + u64::from(joints);
                    if let Some((voice, correction)) = self.corrected.as_ref().zip(output.tick.correction.as_ref()) {
                        lost += voice.say(estimate, correction);
                    }
                }
                news.tell(News::Output(Box::new(output)));
            }
            if last {
                return lost;
            }
            std::thread::park_timeout(Duration::from_millis(100));
        }
    }
}
