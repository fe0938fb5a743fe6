//! What can be set on the node, from the command line, by `--ros-args` or by parameter services.

use super::core::{OnStale, Policy};
use super::integration::Pace;
use super::realtime::Wishes;
use crate::units::nanos_from_seconds;

/// The node's settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Ticks per second.
    pub rate_hz: f64,
    /// Published results per second.
    pub publish_rate_hz: f64,
    /// An input older than this is stale, s.
    pub stale_after_s: f64,
    /// A stale input is held for so long before the fail-safe, s.
    pub hold_s: f64,
    /// The fail-safe.
    pub on_stale: OnStale,
    /// Whether the model follows `/clock`.
    pub use_sim_time: bool,
    /// What the integration thread asks of the system.
    pub wishes: Wishes,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            rate_hz: 1000.0,
            publish_rate_hz: 100.0,
            // The ESV state comes at least once a second: two may be lost.
            stale_after_s: 2.5,
            hold_s: 1.0,
            on_stale: OnStale::Trip,
            use_sim_time: false,
            wishes: Wishes { cpu: None, priority: 80 },
        }
    }
}

impl Settings {
    /// The treatment of silence.
    #[must_use]
    pub fn policy(&self) -> Policy {
        Policy {
            stale_after_ns: nanos_from_seconds(self.stale_after_s),
            hold_ns: nanos_from_seconds(self.hold_s),
            on_stale: self.on_stale,
        }
    }

    /// The loop's pace.
    #[must_use]
    pub fn pace(&self) -> Pace {
        Pace {
            period_ns: nanos_from_seconds(1.0 / self.rate_hz).max(1),
            publish_period_ns: self.publish_period_ns(),
            simulated: self.use_sim_time,
        }
    }

    /// Time between two published results, ns.
    #[must_use]
    pub fn publish_period_ns(&self) -> i64 {
        nanos_from_seconds(1.0 / self.publish_rate_hz).max(1)
    }
}
