//! What can be set on the node, from the command line, by `--ros-args` or by parameter services.

use super::integration::{AwaitedInputs, LoopPace, TimeSource};
use super::policy::{NodeInput, OnStale, Policies, Policy, Rule};
use super::realtime::Wishes;
use govtwin_model::frame::EsvState;
use govtwin_model::units::nanos_from_seconds;

/// What is set for one input; what is `None` is as for all.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InputSettings {
    /// Whether the twin waits for it.
    pub required: bool,
    /// When it is stale, s.
    pub stale_after_s: Option<f64>,
    /// How long it is held, s.
    pub hold_s: Option<f64>,
    /// Its fail-safe.
    pub on_stale: Option<OnStale>,
}

impl Default for InputSettings {
    fn default() -> Self {
        Self { required: true, stale_after_s: None, hold_s: None, on_stale: None }
    }
}

/// The node's settings.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "independent settings")]
pub struct NodeSettings {
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
    /// What differs from that for each input.
    pub inputs: [InputSettings; NodeInput::COUNT],
    /// Command that stands in for one never heard, pu.
    pub default_command_pu: f64,
    /// Whether the ESV counts as tripped until it is heard.
    pub default_esv: EsvState,
    /// Tank pressure that stands in for one never heard, Pa gauge; the unit's own where there is none.
    pub default_tank_pressure_pa: Option<f64>,
    /// Whether the model follows `/clock`.
    pub use_sim_time: bool,
    /// Whether the node's own time, from 0 on, is published as `/clock`.
    pub publish_clock: bool,
    /// Whether the simulation stands at first.
    pub paused: bool,
    /// A sample whose stamp is older, or as far ahead, is refused, s; `None` for no limit.
    pub max_stamp_age_s: Option<f64>,
    /// Whether the trip of a fail-safe stays until it is reset.
    pub latch_trip: bool,
    /// Inputs of which each order to step waits for a new sample.
    pub step_inputs: [bool; NodeInput::COUNT],
    /// How long it waits, s.
    pub step_timeout_s: f64,
    /// What the integration thread asks of the system.
    pub wishes: Wishes,
}

impl Default for NodeSettings {
    fn default() -> Self {
        Self {
            rate_hz: 1000.0,
            publish_rate_hz: 100.0,
            // The ESV state comes at least once a second: two may be lost.
            stale_after_s: 2.5,
            hold_s: 1.0,
            on_stale: OnStale::Trip,
            inputs: NodeInput::ALL
                .map(|input| InputSettings { required: input != NodeInput::Load, ..InputSettings::default() }),
            default_command_pu: 0.0,
            default_esv: EsvState::Normal,
            default_tank_pressure_pa: None,
            use_sim_time: false,
            publish_clock: false,
            paused: false,
            max_stamp_age_s: None,
            latch_trip: true,
            step_inputs: [false; NodeInput::COUNT],
            step_timeout_s: 1.0,
            wishes: Wishes { cpu: None, priority: 80 },
        }
    }
}

impl NodeSettings {
    /// The treatment of silence.
    pub(crate) fn policies(&self) -> Policies {
        let rule = |input: InputSettings| Rule {
            policy: Policy {
                stale_after_ns: nanos_from_seconds(input.stale_after_s.unwrap_or(self.stale_after_s)),
                hold_ns: nanos_from_seconds(input.hold_s.unwrap_or(self.hold_s)),
                on_stale: input.on_stale.unwrap_or(self.on_stale),
            },
            required: input.required,
        };
        Policies {
            rules: self.inputs.map(rule),
            default_command_pu: self.default_command_pu,
            default_esv: self.default_esv,
            default_tank_pressure_pa: self.default_tank_pressure_pa,
        }
    }

    /// The loop's pace.
    pub(crate) fn pace(&self) -> LoopPace {
        LoopPace {
            period_ns: nanos_from_seconds(1.0 / self.rate_hz).max(1),
            publish_period_ns: self.publish_period_ns(),
            time: match (self.use_sim_time, self.publish_clock) {
                (true, _) => TimeSource::Follow,
                (false, true) => TimeSource::Own,
                (false, false) => TimeSource::Wall,
            },
            paused: self.paused && !self.use_sim_time,
        }
    }

    /// A sample whose stamp is older, or as far ahead, is refused, ns; `None` for no limit.
    pub(crate) fn max_stamp_age_ns(&self) -> Option<i64> {
        self.max_stamp_age_s.map(nanos_from_seconds)
    }

    /// What a step waits for.
    pub(crate) fn awaited(&self) -> AwaitedInputs {
        AwaitedInputs { of: self.step_inputs, timeout_ns: nanos_from_seconds(self.step_timeout_s) }
    }

    /// Time between two published results, ns.
    pub(crate) fn publish_period_ns(&self) -> i64 {
        nanos_from_seconds(1.0 / self.publish_rate_hz).max(1)
    }
}
