//! What callers want of the simulation, what became of it, and the clock on which ages are counted while it stands.

use super::policy::NodeInput;

/// Number by which an answer finds its caller.
pub type Ticket = u64;

/// What a caller wants of the simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Run with the clock.
    Play,
    /// Stand still.
    Pause,
    /// Stand still, set back to the start.
    Stop,
    /// While it stands: so many ticks, and stand still again.
    Step {
        /// How many.
        ticks: u64,
    },
    /// Set the twin back.
    Reset {
        /// The time too, where it is the node's own.
        time: bool,
    },
    /// End a fail-safe's trip that stays.
    ResetTrip,
    /// End the node.
    Quit,
}

/// Whether the simulation runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RunState {
    /// It stands at the start.
    Stopped,
    /// It runs with the clock.
    #[default]
    Playing,
    /// It stands.
    Paused,
}

/// What became of an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OrderOutcome {
    /// Done.
    Done,
    /// It was so already.
    Already,
    /// Steps are for a simulation that stands.
    NotPaused,
    /// Another caller's steps are under way.
    Busy,
    /// Another order ended the steps early.
    Interrupted,
    /// These inputs, of which the steps wait for a new sample, did not come in time; nothing was stepped.
    InputsMissing([bool; NodeInput::COUNT]),
}

/// The answer to an order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Of which order.
    pub ticket: Ticket,
    /// What became of it.
    pub outcome: OrderOutcome,
    /// The state from then on.
    pub state: RunState,
    /// Stamps of the samples that are in force, ns; 0 where there is none.
    pub stamps_ns: [i64; NodeInput::COUNT],
}

/// Steps under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Steps {
    /// For whom.
    pub ticket: Ticket,
    /// How many are left.
    pub left_count: u64,
}

/// The clock on which ages are counted: the machine's while the simulation runs, that of the steps while it stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct AgeClock {
    behind_ns: i64,
    stands_at_ns: Option<i64>,
}

impl AgeClock {
    /// The time on it at a time of the machine's clock, ns.
    pub(crate) fn at(&self, machine_ns: i64) -> i64 {
        self.stands_at_ns.unwrap_or(machine_ns - self.behind_ns)
    }

    /// Stops it.
    pub(crate) fn stop(&mut self, machine_ns: i64) {
        self.stands_at_ns = Some(self.at(machine_ns));
    }

    /// Lets it go on from where it stands.
    pub(crate) fn go_on(&mut self, machine_ns: i64) {
        if let Some(stands_at_ns) = self.stands_at_ns.take() {
            self.behind_ns = machine_ns - stands_at_ns;
        }
    }

    /// Moves it while it stands.
    pub(crate) fn step(&mut self, period_ns: i64) {
        if let Some(stands_at_ns) = &mut self.stands_at_ns {
            *stands_at_ns += period_ns;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::AgeClock;

    #[test]
    fn ages_do_not_grow_while_the_simulation_stands() {
        let mut clock = AgeClock::default();
        assert_eq!(clock.at(100), 100);
        clock.stop(100);
        clock.stop(150);
        assert_eq!(clock.at(5000), 100);
        clock.step(7);
        assert_eq!(clock.at(5000), 107);
        clock.go_on(5000);
        clock.go_on(6000);
        assert_eq!(clock.at(5010), 117);
        clock.step(7);
        assert_eq!(clock.at(5010), 117, "steps are for a clock that stands");
    }
}
