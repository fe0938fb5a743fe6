//! The measured signals by name: name, unit, and place in a row of each.

use crate::frame::{Estimate, Signals};
use crate::parameters::{Sensor, Sensors};
use crate::stored::{held_by_id, with_words};

with_words! {
    /// One of the signals that a recording may hold and a twin simulates.
    ///
    /// ```
    /// use govtwin_model::{frame::Signals, signal::Signal};
    ///
    /// let row = Signal::SpoolPosition.with(Signals::NONE, 0.25);
    /// assert_eq!(Signal::SpoolPosition.of(&row), 0.25);
    /// assert_eq!((Signal::SpoolPosition.id(), Signal::SpoolPosition.unit()), ("spool_position_pu", "pu"));
    /// ```
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
    pub enum Signal: id {
        /// Servomotor position `Y`.
        ServomotorPosition = "servomotor_position_pu",
        /// Main distributing valve spool position `y`.
        SpoolPosition = "spool_position_pu",
        /// Proportional (pilot) valve position `x_p`.
        PilotValvePosition = "pilot_valve_position_pu",
        /// Control-chamber pressure `P_ctrl`.
        ControlPressure = "control_pressure_pa",
    }
}

impl Signal {
    /// The two positions that the twin publishes.
    pub const POSITIONS: [Self; 2] = [Self::ServomotorPosition, Self::SpoolPosition];

    /// The signal at each of a twin's estimates.
    pub fn of_estimates(self, estimates: &[Estimate]) -> Vec<f64> {
        estimates.iter().map(|estimate| self.of(&estimate.signals)).collect()
    }

    /// The name in words.
    pub fn title(self) -> &'static str {
        match self {
            Self::ServomotorPosition => "Servomotor position",
            Self::SpoolPosition => "Spool position",
            Self::PilotValvePosition => "Pilot-valve position",
            Self::ControlPressure => "Control pressure",
        }
    }

    /// The SI unit.
    pub fn unit(self) -> &'static str {
        match self {
            Self::ServomotorPosition | Self::SpoolPosition | Self::PilotValvePosition => "pu",
            Self::ControlPressure => "Pa",
        }
    }

    /// Its value in a row, in its unit.
    pub fn of(self, signals: &Signals) -> f64 {
        match self {
            Self::ServomotorPosition => signals.servomotor_position_pu,
            Self::SpoolPosition => signals.spool_position_pu,
            Self::PilotValvePosition => signals.pilot_valve_position_pu,
            Self::ControlPressure => signals.control_pressure_pa,
        }
    }

    /// The same row with this signal at `value`, in its unit.
    pub fn with(self, mut signals: Signals, value: f64) -> Signals {
        match self {
            Self::ServomotorPosition => signals.servomotor_position_pu = value,
            Self::SpoolPosition => signals.spool_position_pu = value,
            Self::PilotValvePosition => signals.pilot_valve_position_pu = value,
            Self::ControlPressure => signals.control_pressure_pa = value,
        }
        signals
    }

    /// Its transducer.
    pub fn sensor(self, sensors: &Sensors) -> Sensor {
        match self {
            Self::ServomotorPosition => sensors.servomotor_position_pu,
            Self::SpoolPosition => sensors.spool_position_pu,
            Self::PilotValvePosition => sensors.pilot_valve_position_pu,
            Self::ControlPressure => sensors.control_pressure_pa,
        }
    }
}

held_by_id!(Signal, "a measured signal");

/// The least and the greatest value so far, with one more; values that are not finite do not count.
pub fn widened(ends: Option<(f64, f64)>, value: f64) -> Option<(f64, f64)> {
    if !value.is_finite() {
        return ends;
    }
    Some(ends.map_or((value, value), |(low, high)| (low.min(value), high.max(value))))
}

/// Greatest less least of the finite values; nothing where there is none.
pub fn span(values: impl Iterator<Item = f64>) -> Option<f64> {
    values.fold(None, widened).map(|(low, high)| high - low)
}
