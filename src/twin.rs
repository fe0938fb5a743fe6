//! The heart: one step of the twin, from a frame to an estimate.

use crate::frame::{Estimate, Frame, Signals};
use crate::parameters::Unit;
use crate::units::seconds_from_nanos;

/// Where recorded signals stand in for simulated ones, so that one stage is judged by its own input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cut {
    /// Closed loop: everything is simulated; what the node does.
    #[default]
    None,
    /// The measured servomotor position feeds the regulator (the paper's mode).
    Servomotor,
    /// The measured spool position drives the servomotor stage.
    Spool,
}

/// The simulated servo system of one unit.
///
/// Integration runs on a grid of whole small-loop periods (1 ms) counted from the first frame; a
/// tick uses the newest frame at or before it. Rows may therefore arrive at any rate, and rows that
/// repeat what already holds change nothing, to the last bit.
#[derive(Clone, Debug)]
pub struct Twin {
    cut: Cut,
    position_pu: f64,
    previous: Option<Frame>,
}

impl Twin {
    /// Builds the twin of a unit, closed loop. Its first frame sets it to the steady state there.
    #[must_use]
    pub fn new(_unit: &Unit) -> Self {
        Self { cut: Cut::None, position_pu: 0.0, previous: None }
    }

    /// The same twin with a cut.
    #[must_use]
    pub fn with_cut(mut self, cut: Cut) -> Self {
        self.cut = cut;
        self
    }

    /// Forgets everything; the next frame starts anew.
    pub fn reset(&mut self) {
        self.previous = None;
    }

    /// Advances to the frame's time under the inputs held so far, then takes the frame's inputs.
    ///
    /// The estimate is for the frame's time. The first frame after `new` or `reset` starts at the
    /// steady state that its inputs and measured positions describe. A frame that is not later than
    /// its predecessor advances nothing.
    #[must_use]
    pub fn step(&mut self, frame: &Frame) -> Estimate {
        // A stand-in first-order servo until the plant is in place.
        if let Some(previous) = self.previous {
            let dt_s = seconds_from_nanos(frame.time_ns - previous.time_ns).max(0.0);
            let gain = 1.0 - (-5.0 * dt_s).exp();
            self.position_pu += gain * (previous.inputs.opening_command_pu - self.position_pu);
        } else {
            self.position_pu = frame.inputs.opening_command_pu;
        }
        self.previous = Some(*frame);
        Estimate {
            time_ns: frame.time_ns,
            signals: Signals { servomotor_position_pu: self.position_pu, spool_position_pu: 0.0, ..Signals::NONE },
            spool_velocity_m_s: 0.0,
            servomotor_velocity_m_s: 0.0,
            opening_chamber_pressure_pa: 0.0,
            closing_chamber_pressure_pa: 0.0,
            spool_command_pu: 0.0,
            valve_current_pu: 0.0,
        }
    }
}
