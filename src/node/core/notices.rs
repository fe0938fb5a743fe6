//! What a tick has to tell, as flags that a thread without memory of its own can set.

use super::NodeInput;

/// What happened in a tick that a person should hear of: a set of flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Notices(pub u32);

impl Notices {
    /// The twin was set to the steady state of the first complete inputs.
    pub const STARTED: Self = Self(1 << 24);
    /// The fail-safe began.
    pub const FAIL_SAFE: Self = Self(1 << 25);
    /// The fail-safe ended: all inputs are back.
    pub(crate) const RELEASED: Self = Self(1 << 26);
    /// Time ran backwards or leapt ahead: the twin forgot everything.
    pub const RESET: Self = Self(1 << 27);
    /// The adaptation's detector raised an alarm: the unit drifts away from twin and residual.
    pub const DRIFT: Self = Self(1 << 28);
    /// The twin was set back on request; what was heard is kept.
    pub const RESTARTED: Self = Self(1 << 29);
    /// The unit's parameters or effects changed between two ticks.
    pub const REFITTED: Self = Self(1 << 30);
    /// With it ended the learned residual, which is of the unit as it was.
    pub const UNCORRECTED: Self = Self(1 << 31);

    /// This input became stale.
    pub(crate) fn stale(input: NodeInput) -> Self {
        Self(input.bit())
    }

    /// This input is back after it was stale.
    pub(crate) fn recovered(input: NodeInput) -> Self {
        Self(input.bit() << 8)
    }

    /// This input was never heard and is overdue.
    pub(crate) fn missing(input: NodeInput) -> Self {
        Self(input.bit() << 16)
    }

    /// Whether `other` is among them.
    pub fn has(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    pub(super) fn add(&mut self, other: Self) {
        self.0 |= other.0;
    }
}
