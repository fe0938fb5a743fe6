//! How silence is treated, input by input: what must come, how old it may be, and what stands in for it.

use govtwin_model::frame::{EsvState, Inputs};
use govtwin_model::units::seconds_from_nanos;

/// Topic of joint commands, whose positions are opening commands and whose efforts are load forces.
pub(crate) const JOINT_COMMANDS: &str = "sim/joint_commands";

/// The inputs of the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeInput {
    /// `governor/command`.
    Command,
    /// `governor/esv`.
    Esv,
    /// `governor/tank_pressure`.
    TankPressure,
    /// Force on the piston besides the sheet's load: `effort` of `sim/joint_commands`.
    Load,
}

impl NodeInput {
    /// All inputs, in the order of the arrays here.
    pub const ALL: [Self; Self::COUNT] = [Self::Command, Self::Esv, Self::TankPressure, Self::Load];

    /// How many there are.
    pub const COUNT: usize = 4;

    /// The name that parameters and options have for it.
    pub const NAMES: [&'static str; Self::COUNT] = ["command", "esv", "tank_pressure", "load"];

    /// The topic's name before namespace and remapping.
    pub fn topic(self) -> &'static str {
        match self {
            Self::Command => "governor/command",
            Self::Esv => "governor/esv",
            Self::TankPressure => "governor/tank_pressure",
            Self::Load => JOINT_COMMANDS,
        }
    }

    pub(super) fn bit(self) -> u32 {
        1 << (self as u32)
    }
}

/// What to do when an input stays away for longer than the hold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnStale {
    /// Treat it as an ESV trip: the servomotor closes.
    #[default]
    Trip,
    /// Go on with the last value for ever.
    Hold,
    /// End the node.
    Stop,
    /// Go back to the input's default.
    Default,
}

impl OnStale {
    /// All choices, as users write them.
    pub const NAMES: [&'static str; 4] = ["trip", "hold", "stop", "default"];

    /// The name that users write.
    pub(crate) fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// The choice with this name.
    pub fn named(name: &str) -> Option<Self> {
        [Self::Trip, Self::Hold, Self::Stop, Self::Default].into_iter().find(|choice| choice.name() == name)
    }
}

/// How silence is treated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Policy {
    /// An input older than this is stale, ns.
    pub stale_after_ns: i64,
    /// A stale input is held for so long before the fail-safe, ns.
    pub hold_ns: i64,
    /// The fail-safe.
    pub on_stale: OnStale,
}

impl Policy {
    /// When an input is stale and how long it is held then, s, to the millisecond; for people.
    pub(crate) fn limits_s(&self) -> [f64; 2] {
        [self.stale_after_ns, self.hold_ns].map(|limit_ns| (seconds_from_nanos(limit_ns) * 1e3).round() / 1e3)
    }
}

/// The treatment of one input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule {
    /// What its silence means once it was heard, or while it is awaited.
    pub policy: Policy,
    /// Whether the twin waits for it. One that is not required has its default until it is heard.
    pub required: bool,
}

/// The treatment of all inputs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Policies {
    /// For each input.
    pub rules: [Rule; NodeInput::COUNT],
    /// Opening command that stands in for one never heard, pu.
    pub default_command_pu: f64,
    /// ESV state that stands in for one never heard.
    pub default_esv: EsvState,
    /// Tank pressure that stands in for one never heard, Pa gauge; the unit's own where there is none.
    pub default_tank_pressure_pa: Option<f64>,
}

impl From<Policy> for Policies {
    /// All inputs are treated alike, and all but the load are required.
    fn from(policy: Policy) -> Self {
        Self {
            rules: NodeInput::ALL.map(|input| Rule { policy, required: input != NodeInput::Load }),
            default_command_pu: 0.0,
            default_esv: EsvState::Normal,
            default_tank_pressure_pa: None,
        }
    }
}

/// What stands behind an input at a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum InputState {
    /// Its default: it was never heard.
    #[default]
    Default,
    /// A value heard in time.
    Fresh,
    /// Its last value, which is stale.
    Held,
    /// Its fail-safe.
    Failed,
}

impl Policies {
    /// The inputs for a tick: the last values, the defaults where a fail-safe goes back to them, and an ESV trip.
    /// A force whose source is silent for too long is none.
    pub(crate) fn inputs(&self, last: &Inputs, states: [InputState; NodeInput::COUNT], trip: bool) -> Inputs {
        let back = |input: NodeInput| {
            let policy = self.rules[input as usize].policy;
            states[input as usize] == InputState::Failed && policy.on_stale == OnStale::Default
        };
        let mut inputs = *last;
        if back(NodeInput::Command) {
            inputs.opening_command_pu = self.default_command_pu;
        }
        if back(NodeInput::Esv) {
            inputs.esv = self.default_esv;
        }
        if let (true, Some(tank_pressure_pa)) = (back(NodeInput::TankPressure), self.default_tank_pressure_pa) {
            inputs.tank_pressure_pa = tank_pressure_pa;
        }
        if trip {
            inputs.esv = EsvState::Shutdown;
        }
        if states[NodeInput::Load as usize] == InputState::Failed {
            inputs.piston_force_n = 0.0;
        }
        inputs
    }
}
