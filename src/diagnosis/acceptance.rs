//! Acceptance measures of a servo system: dead time, dead band, stroke times and the like, from command and position alone, each with an interval.
//!
//! The same [`measure`] is taken of what was measured, of the twin as found and of the twin without one of its faults ([`counterfactual`]), and
//! held against limits ([`limits`]). The measures are those of which IEC 60308, IEEE 125 and ASME PTC 29 speak; how each is computed here is stated
//! where it is computed, and no claim is made that a clause of a standard computes it so.
//!
//! Every interval holds the value nine times in ten, of the movements that were recorded: what a measure would be under another head or another oil
//! temperature is no part of it.

pub mod counterfactual;
pub(crate) mod deadband;
pub(crate) mod frequency;
pub mod limits;
pub mod limits_file;
pub(crate) mod movements;
pub mod series;
pub(crate) mod standard_tests;
pub(crate) mod statistics;
pub(crate) mod strokes;
pub mod summary;

use crate::result::Interval;

use frequency::Response;
use series::Series;

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Measure {
    /// From the command's departure to the position's.
    DeadTime,
    /// Width of the command's movement that the position does not follow.
    DeadBand,
    /// How far apart the positions of rising and falling commands are.
    Hysteresis,
    /// Full stroke at the full opening rate.
    OpeningTime,
    /// Full stroke at the full closing rate, by command.
    ClosingTime,
    /// Full stroke at the rate of an emergency shutdown.
    TripClosingTime,
    /// How long the last part of a closing stroke is slowed.
    CushionTime,
    /// How far the position goes beyond its final value.
    Overshoot,
    /// From the command's arrival until the position stays near its final value.
    SettlingTime,
    /// Command less position, RMS.
    TrackingError,
    /// Frequency at which the position has fallen to 0.707 of the command.
    Bandwidth,
}

impl Measure {
    /// All of them, in the order of reports.
    pub const ALL: [Self; 11] = [
        Self::DeadTime,
        Self::DeadBand,
        Self::Hysteresis,
        Self::OpeningTime,
        Self::ClosingTime,
        Self::TripClosingTime,
        Self::CushionTime,
        Self::Overshoot,
        Self::SettlingTime,
        Self::TrackingError,
        Self::Bandwidth,
    ];

    /// The key in limits, JSON and CSV, with its unit.
    pub fn id(self) -> &'static str {
        match self {
            Self::DeadTime => "dead_time_s",
            Self::DeadBand => "dead_band_pu",
            Self::Hysteresis => "hysteresis_pu",
            Self::OpeningTime => "opening_time_s",
            Self::ClosingTime => "closing_time_s",
            Self::TripClosingTime => "trip_closing_time_s",
            Self::CushionTime => "cushion_time_s",
            Self::Overshoot => "overshoot_share",
            Self::SettlingTime => "settling_time_s",
            Self::TrackingError => "tracking_error_pu",
            Self::Bandwidth => "bandwidth_hz",
        }
    }

    /// The measure with this key.
    pub fn find(id: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|measure| measure.id() == id)
    }

    /// The name in words.
    pub fn title(self) -> &'static str {
        match self {
            Self::DeadTime => "dead time",
            Self::DeadBand => "dead band",
            Self::Hysteresis => "hysteresis",
            Self::OpeningTime => "opening time",
            Self::ClosingTime => "closing time",
            Self::TripClosingTime => "closing time of a trip",
            Self::CushionTime => "cushion time",
            Self::Overshoot => "overshoot",
            Self::SettlingTime => "settling time",
            Self::TrackingError => "tracking error",
            Self::Bandwidth => "bandwidth",
        }
    }

    /// The unit: of seconds, Hz, pu of stroke, or a share.
    pub fn unit(self) -> &'static str {
        match self {
            Self::DeadBand | Self::Hysteresis | Self::TrackingError => "pu",
            Self::Overshoot => "1",
            Self::Bandwidth => "Hz",
            _ => "s",
        }
    }

    /// How it is computed, in a sentence.
    pub fn definition(self) -> &'static str {
        match self {
            Self::DeadTime => {
                "from the instant at which the command has moved by 0.1 % of stroke to the instant at which the position has; commands that start from rest at 2 %/s or faster"
            }
            Self::DeadBand => {
                "full width of the play that, together with a delay, maps the command to the position with the smallest error; movement slower than 1 %/s"
            }
            Self::Hysteresis => {
                "mean distance between the positions of falling and of rising commands at equal commands, movement slower than 1 %/s; includes lag"
            }
            Self::OpeningTime => {
                "full stroke divided by the opening speed where the command is more than 5 % ahead, without the cushion"
            }
            Self::ClosingTime => {
                "full stroke divided by the closing speed where the command is more than 5 % ahead, without the cushion"
            }
            Self::TripClosingTime => {
                "full stroke divided by the closing speed after a trip of the emergency shutdown valve"
            }
            Self::CushionTime => {
                "from the instant at which a full-rate closing stroke slows below 80 % of its speed to the instant at which it is within 0.2 % of closed"
            }
            Self::Overshoot => {
                "largest movement beyond the final position divided by the change; commands that come to rest after 1 % or more"
            }
            Self::SettlingTime => {
                "from the instant at which the command reaches its final value until the position stays within 2 % of the change, at least 0.1 % of stroke, of its final value"
            }
            Self::TrackingError => {
                "RMS of command − position where the command is less than 5 % ahead, without transducer noise"
            }
            Self::Bandwidth => {
                "frequency at which the position's amplitude is 0.707 of the command's, where the command excites it"
            }
        }
    }
}

/// One measure as found.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasureFound {
    /// What.
    pub measure: Measure,
    /// The value, in the measure's unit; none where the movements do not show it.
    pub value: Option<Interval>,
    /// Movements, strokes or stretches that it rests on.
    pub events: usize,
    /// Why there is none, or a note on it; empty otherwise.
    pub note: String,
}

/// All measures of some series.
#[derive(Clone, Debug, PartialEq)]
pub struct Measures {
    /// One for each of [`Measure::ALL`], in its order.
    pub found: Vec<MeasureFound>,
    /// The frequency response, where excited.
    pub response: Vec<Response>,
}

impl Measures {
    /// One of them.
    pub fn of(&self, measure: Measure) -> &MeasureFound {
        &self.found[measure as usize]
    }

    /// The value of one of them.
    pub fn value(&self, measure: Measure) -> Option<Interval> {
        self.of(measure).value
    }
}

/// Takes all measures of one unit's series.
pub fn measure(all: &[Series]) -> Measures {
    let (response, bandwidth) = frequency::response(all);
    let found = vec![
        movements::dead_time(all),
        deadband::dead_band(all),
        deadband::hysteresis(all),
        strokes::stroke_time(all, Measure::OpeningTime),
        strokes::stroke_time(all, Measure::ClosingTime),
        strokes::stroke_time(all, Measure::TripClosingTime),
        strokes::cushion_time(all),
        movements::overshoot(all),
        movements::settling_time(all),
        movements::tracking_error(all),
        bandwidth,
    ];
    Measures { found, response }
}
