//! The newest value of each stream as its messages come in: rows without order or interpolation, for who must not wait.

use super::collect::Collected;
use super::topic::{RawMessage, RawView};
use super::{ReadOptions, Stream};
use govtwin_model::frame::{EsvState, Frame, Inputs};

/// Follows the streams message by message, in memory that does not grow.
pub struct Newest {
    collected: Collected,
    inputs: Inputs,
}

impl std::fmt::Debug for Newest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Newest").field("inputs", &self.inputs).finish_non_exhaustive()
    }
}

impl Newest {
    /// Nothing has come: command and pressure are NaN, the ESV is normal, no force acts.
    pub fn new(options: &ReadOptions) -> Self {
        let inputs = Inputs {
            opening_command_pu: f64::NAN,
            esv: EsvState::Normal,
            tank_pressure_pa: f64::NAN,
            piston_force_n: 0.0,
        };
        Self { collected: Collected::new(options), inputs }
    }

    /// Takes a message; a measured state gives a row with the inputs that came last before it. Its time is that of the stamp, or of
    /// recording where a sender without a clock leaves it at 0.
    pub fn take(&mut self, message: &RawMessage) -> Option<Frame> {
        let RawMessage { topic, log_time_ns, publish_time_ns, sequence, data } = message;
        let view =
            RawView { topic, log_time_ns: *log_time_ns, publish_time_ns: *publish_time_ns, sequence: *sequence, data };
        if !self.collected.take(view) {
            return None;
        }
        let Collected { command, esv, tank_pressure, servo_state, load, .. } = &mut self.collected;
        if let Some(sample) = command.samples.pop() {
            self.inputs.opening_command_pu = sample.value.0;
        }
        if let Some(sample) = esv.samples.pop() {
            self.inputs.esv = sample.value;
        }
        if let Some(sample) = tank_pressure.samples.pop() {
            self.inputs.tank_pressure_pa = sample.value.0;
        }
        if let Some(sample) = load.samples.pop() {
            self.inputs.piston_force_n = sample.value.0;
        }
        let state = servo_state.samples.pop()?;
        let time_ns = if state.stamp_ns == 0 { state.log_time_ns } else { state.stamp_ns };
        Some(Frame { time_ns, inputs: self.inputs, measured: state.value })
    }

    /// Messages of a stream that came, and those of them that could not be used.
    pub fn counts(&self, stream: Stream) -> (u64, u64) {
        let all = self.collected.all();
        let health = all.iter().find(|one| one.stream() == stream).map(|one| one.health());
        health.map_or((0, 0), |health| {
            let refused = health.undecodable + health.bad_stamps + health.bad_messages;
            (health.messages, refused.min(health.messages))
        })
    }
}
