//! What a learned residual adds to what the node says: the corrected state, and the edges of its band.
//!
//! `sim/servo_state` stays the twin's own word. Beside it, with the same stamp, `sim/corrected/servo_state` is that state with its
//! signal corrected; `sim/corrected/lower` and `sim/corrected/upper` hold the band's edges of that signal, and NaN for everything else and
//! where the guard is off.

use ros2_client::Publisher;

use super::bus::{Bus, BusError};
use super::messages;
use govtwin_bag::msg::{Interface, ServoState};
use govtwin_correction::corrector::Correction;
use govtwin_model::frame::{Estimate, Signals};
use govtwin_model::signal::Signal;

/// The publishers of one corrected signal.
pub(crate) struct CorrectedPublishers {
    signal: Signal,
    state: Publisher<ServoState>,
    lower: Publisher<ServoState>,
    upper: Publisher<ServoState>,
}

impl CorrectedPublishers {
    /// Opens the three topics.
    ///
    /// # Errors
    /// As [`Bus::publish`].
    pub(crate) fn open(bus: &mut Bus, signal: Signal) -> Result<Self, BusError> {
        Ok(Self {
            signal,
            state: bus.publish("sim/corrected/servo_state", ServoState::TYPE_NAME)?,
            lower: bus.publish("sim/corrected/lower", ServoState::TYPE_NAME)?,
            upper: bus.publish("sim/corrected/upper", ServoState::TYPE_NAME)?,
        })
    }

    /// Says a correction; returns how many messages DDS did not take.
    pub(crate) fn say(&self, estimate: &Estimate, correction: &Correction) -> u64 {
        let edge = |by: f64| {
            let signals = self.signal.with(Signals::NONE, correction.corrected + by);
            messages::servo_state(&Estimate { signals, ..*estimate })
        };
        let corrected = Estimate { signals: self.signal.with(estimate.signals, correction.corrected), ..*estimate };
        let half_width = correction.half_width;
        u64::from(self.state.publish(messages::servo_state(&corrected)).is_err())
            + u64::from(self.lower.publish(edge(-half_width)).is_err())
            + u64::from(self.upper.publish(edge(half_width)).is_err())
    }
}
