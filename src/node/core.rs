//! The node without its bus: what was heard becomes frames, frames become estimates, silence becomes a fail-safe.
//!
//! The core reads no clock, knows no DDS, takes no memory and cannot fail; the threads around it hand
//! it what arrived and the time. The same calls therefore give the same estimates, live or in a test.

use crate::frame::{Estimate, EsvState, Frame, Inputs, Signals};
use crate::residual::corrector::{Correction, Corrector};
use crate::twin::Twin;

/// The three inputs of the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Input {
    /// `governor/command`.
    Command,
    /// `governor/esv`.
    Esv,
    /// `governor/tank_pressure`.
    TankPressure,
}

impl Input {
    /// All inputs, in the order of the arrays here.
    pub const ALL: [Self; 3] = [Self::Command, Self::Esv, Self::TankPressure];

    /// The topic's name before namespace and remapping.
    #[must_use]
    pub fn topic(self) -> &'static str {
        match self {
            Self::Command => "governor/command",
            Self::Esv => "governor/esv",
            Self::TankPressure => "governor/tank_pressure",
        }
    }

    fn bit(self) -> u16 {
        1 << (self as u16)
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
}

impl OnStale {
    /// All choices, as users write them.
    pub const NAMES: [&'static str; 3] = ["trip", "hold", "stop"];

    /// The name that users write.
    #[must_use]
    pub fn name(self) -> &'static str {
        Self::NAMES[self as usize]
    }

    /// The choice with this name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        [Self::Trip, Self::Hold, Self::Stop].into_iter().find(|choice| choice.name() == name)
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

/// Something heard, checked already: every number is finite and in range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Heard {
    /// Guide-vane opening command, pu.
    Command(f64),
    /// State of the emergency shutdown valve.
    Esv(EsvState),
    /// Tank pressure, Pa gauge.
    TankPressure(f64),
    /// Positions measured on the real unit, which only a learned residual that adapts looks at, pu.
    Measured {
        /// Spool.
        spool_pu: f64,
        /// Servomotor.
        servomotor_pu: f64,
    },
    /// Simulated time, ns since the epoch.
    Clock(i64),
    /// A new treatment of silence.
    Policy(Policy),
    /// A new publish period, ns.
    PublishPeriod(i64),
}

/// What happened in a tick that a person should hear of: a set of flags.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Notices(pub u16);

impl Notices {
    /// The twin was set to the steady state of the first complete inputs.
    pub const STARTED: Self = Self(1 << 6);
    /// The fail-safe began.
    pub const FAIL_SAFE: Self = Self(1 << 7);
    /// The fail-safe ended: all inputs are back.
    pub const RELEASED: Self = Self(1 << 8);
    /// Time ran backwards or leapt ahead: the twin forgot everything.
    pub const RESET: Self = Self(1 << 9);
    /// The adaptation's detector raised an alarm: the unit drifts away from twin and residual.
    pub const DRIFT: Self = Self(1 << 13);

    /// This input became stale.
    #[must_use]
    pub fn stale(input: Input) -> Self {
        Self(input.bit())
    }

    /// This input is back after it was stale.
    #[must_use]
    pub fn recovered(input: Input) -> Self {
        Self(input.bit() << 3)
    }

    /// This input was never heard and is overdue.
    #[must_use]
    pub fn missing(input: Input) -> Self {
        Self(input.bit() << 10)
    }

    /// Whether `other` is among them.
    #[must_use]
    pub fn has(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }

    /// Whether nothing happened.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    fn add(&mut self, other: Self) {
        self.0 |= other.0;
    }
}

/// The outcome of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// What the twin was given.
    pub frame: Frame,
    /// What it said; `None` while it waits for its first inputs.
    pub estimate: Option<Estimate>,
    /// What a learned residual makes of it; `None` without one.
    pub correction: Option<Correction>,
    /// Whether the frame's inputs differ from the previous frame's.
    pub inputs_changed: bool,
    /// What happened.
    pub notices: Notices,
    /// Whether the fail-safe is on.
    pub fail_safe: bool,
    /// The fail-safe asks the node to end.
    pub stop: bool,
    /// Ages of the inputs, ns; `None` for one never heard.
    pub ages_ns: [Option<i64>; 3],
}

#[derive(Clone, Copy, Debug)]
struct Held {
    heard_ns: Option<i64>,
    stale: bool,
}

/// The node's memory.
#[derive(Clone, Debug)]
pub struct Core {
    twin: Twin,
    corrector: Option<Corrector>,
    measured: Signals,
    policy: Policy,
    inputs: Inputs,
    held: [Held; 3],
    began_ns: Option<i64>,
    previous: Option<Inputs>,
    fail_safe: bool,
    reset: bool,
}

impl Core {
    /// A core that waits for its inputs; `tank_pressure_pa` stands in for a pressure never heard.
    #[must_use]
    pub fn new(twin: Twin, policy: Policy, tank_pressure_pa: f64) -> Self {
        let inputs = Inputs { opening_command_pu: 0.0, esv: EsvState::Normal, tank_pressure_pa };
        let held = [Held { heard_ns: None, stale: false }; 3];
        Self {
            twin,
            corrector: None,
            measured: Signals::NONE,
            policy,
            inputs,
            held,
            began_ns: None,
            previous: None,
            fail_safe: false,
            reset: false,
        }
    }

    /// The same with a learned residual.
    #[must_use]
    pub fn with_corrector(mut self, corrector: Option<Corrector>) -> Self {
        self.corrector = corrector;
        self
    }

    /// The learned residual, with what its guard and its adaptation did.
    #[must_use]
    pub fn corrector(&self) -> Option<&Corrector> {
        self.corrector.as_ref()
    }

    /// Takes what was heard at `now_ns`, a time that never runs backwards between two resets.
    pub fn hear(&mut self, heard: Heard, now_ns: i64) {
        let input = match heard {
            Heard::Command(opening_command_pu) => {
                self.inputs.opening_command_pu = opening_command_pu;
                Input::Command
            }
            Heard::Esv(esv) => {
                self.inputs.esv = esv;
                Input::Esv
            }
            Heard::TankPressure(tank_pressure_pa) => {
                self.inputs.tank_pressure_pa = tank_pressure_pa;
                Input::TankPressure
            }
            Heard::Policy(policy) => {
                self.policy = policy;
                return;
            }
            Heard::Measured { spool_pu, servomotor_pu } => {
                self.measured.spool_position_pu = spool_pu;
                self.measured.servomotor_position_pu = servomotor_pu;
                return;
            }
            Heard::Clock(_) | Heard::PublishPeriod(_) => return,
        };
        self.held[input as usize].heard_ns = Some(now_ns);
    }

    /// Counts what was heard so far as heard at `now_ns`, where the clock on which ages are counted begins.
    pub fn begin_ages(&mut self, now_ns: i64) {
        for held in &mut self.held {
            held.heard_ns = held.heard_ns.map(|_| now_ns);
        }
    }

    /// Forgets the twin's state and all that was heard, as after a jump in time.
    pub fn reset(&mut self) {
        self.twin.reset();
        if let Some(corrector) = &mut self.corrector {
            corrector.reset();
        }
        self.measured = Signals::NONE;
        self.held = [Held { heard_ns: None, stale: false }; 3];
        self.began_ns = None;
        self.previous = None;
        self.fail_safe = false;
        self.reset = true;
    }

    /// Advances the twin to `time_ns`, the model's time; `now_ns` is the time on which ages are counted.
    pub fn tick(&mut self, time_ns: i64, now_ns: i64) -> Tick {
        let began_ns = *self.began_ns.get_or_insert(now_ns);
        let mut notices = Notices::default();
        if std::mem::take(&mut self.reset) {
            notices.add(Notices::RESET);
        }
        let (mut complete, mut overdue, mut ages_ns) = (true, false, [None; 3]);
        for input in Input::ALL {
            let held = &mut self.held[input as usize];
            let age_ns = now_ns.saturating_sub(held.heard_ns.unwrap_or(began_ns));
            let stale = age_ns > self.policy.stale_after_ns;
            if stale != held.stale {
                held.stale = stale;
                notices.add(match (stale, held.heard_ns) {
                    (true, Some(_)) => Notices::stale(input),
                    (true, None) => Notices::missing(input),
                    (false, _) => Notices::recovered(input),
                });
            }
            complete &= held.heard_ns.is_some();
            overdue |= age_ns > self.policy.stale_after_ns.saturating_add(self.policy.hold_ns);
            ages_ns[input as usize] = held.heard_ns.map(|_| age_ns);
        }
        let fail_safe = overdue && self.policy.on_stale != OnStale::Hold;
        if fail_safe != self.fail_safe {
            self.fail_safe = fail_safe;
            notices.add(if fail_safe { Notices::FAIL_SAFE } else { Notices::RELEASED });
        }
        let mut inputs = self.inputs;
        if fail_safe && self.policy.on_stale == OnStale::Trip {
            inputs.esv = EsvState::Shutdown;
        }
        let frame = Frame { time_ns, inputs, measured: Signals::NONE };
        // Without a first set of inputs there is no steady state to start from, unless the fail-safe gives one.
        let runs = complete || self.previous.is_some() || (fail_safe && self.policy.on_stale == OnStale::Trip);
        let inputs_changed = runs && self.previous != Some(inputs);
        if runs && self.previous.is_none() {
            notices.add(Notices::STARTED);
        }
        let estimate = runs.then(|| self.twin.step(&frame));
        // A measured sample belongs to the tick that first sees it, and is no input of the twin.
        let seen = Frame { measured: std::mem::replace(&mut self.measured, Signals::NONE), ..frame };
        let corrector = self.corrector.as_mut();
        let correction = corrector.zip(estimate.as_ref()).map(|(corrector, said)| {
            let alarms = corrector.alarms();
            let correction = corrector.step(&seen, said);
            if corrector.alarms() > alarms {
                notices.add(Notices::DRIFT);
            }
            correction
        });
        if runs {
            self.previous = Some(inputs);
        }
        let stop = fail_safe && self.policy.on_stale == OnStale::Stop;
        Tick { frame, estimate, correction, inputs_changed, notices, fail_safe, stop, ages_ns }
    }
}

#[cfg(test)]
mod tests {
    use super::{Core, Heard, Input, Notices, OnStale, Policy};
    use crate::frame::EsvState;
    use crate::twin::Twin;

    const MS: i64 = 1_000_000;

    fn core(on_stale: OnStale) -> Core {
        let policy = Policy { stale_after_ns: 100 * MS, hold_ns: 50 * MS, on_stale };
        Core::new(Twin::new(&crate::params::reference()), policy, 6.3e6)
    }

    fn hear_all(core: &mut Core, now_ns: i64) {
        core.hear(Heard::Command(0.4), now_ns);
        core.hear(Heard::Esv(EsvState::Normal), now_ns);
        core.hear(Heard::TankPressure(6.2e6), now_ns);
    }

    #[test]
    fn waits_for_all_inputs_then_starts_at_their_steady_state() {
        let mut core = core(OnStale::Trip);
        core.hear(Heard::Command(0.4), 0);
        assert_eq!(core.tick(0, 0).estimate, None);
        hear_all(&mut core, 0);
        let tick = core.tick(MS, MS);
        assert!(tick.notices.has(Notices::STARTED) && tick.inputs_changed);
        let position_pu = tick.estimate.unwrap().signals.servomotor_position_pu;
        assert!((position_pu - 0.4).abs() < 1e-2, "{position_pu}");
        assert!(!core.tick(2 * MS, 2 * MS).inputs_changed);
    }

    #[test]
    fn silence_is_announced_held_tripped_and_released_once_each() {
        let mut core = core(OnStale::Trip);
        hear_all(&mut core, 0);
        let mut seen = Vec::new();
        for step in 0..400 {
            let now_ns = step * MS;
            if step >= 300 {
                hear_all(&mut core, now_ns);
            }
            let tick = core.tick(now_ns, now_ns);
            let tripped = (151..300).contains(&step);
            assert_eq!(tick.frame.inputs.esv == EsvState::Shutdown, tripped, "at {step} ms");
            if !tick.notices.is_empty() {
                seen.push((step, tick.notices));
            }
        }
        let steps: Vec<i64> = seen.iter().map(|(step, _)| *step).collect();
        assert_eq!(steps, [0, 101, 151, 300]);
        assert!(Input::ALL.into_iter().all(|input| seen[1].1.has(Notices::stale(input))));
        assert!(seen[2].1.has(Notices::FAIL_SAFE));
        assert!(seen[3].1.has(Notices::RELEASED) && seen[3].1.has(Notices::recovered(Input::Esv)));
    }

    #[test]
    fn hold_goes_on_and_stop_asks_to_end() {
        let mut holding = core(OnStale::Hold);
        let mut stopping = core(OnStale::Stop);
        hear_all(&mut holding, 0);
        hear_all(&mut stopping, 0);
        let far_ns = 10_000 * MS;
        let tick = holding.tick(far_ns, far_ns);
        assert!(tick.frame.inputs.esv == EsvState::Normal && !tick.stop);
        assert!(stopping.tick(far_ns, far_ns).stop);
    }

    #[test]
    fn without_any_input_the_fail_safe_starts_closed() {
        let mut core = core(OnStale::Trip);
        assert_eq!(core.tick(0, 0).estimate, None);
        let tick = core.tick(151 * MS, 151 * MS);
        assert_eq!(tick.frame.inputs.esv, EsvState::Shutdown);
        assert!(tick.estimate.unwrap().signals.servomotor_position_pu.abs() < 0.05);
    }

    #[test]
    fn a_reset_forgets_what_was_heard() {
        let mut core = core(OnStale::Trip);
        hear_all(&mut core, 0);
        assert!(core.tick(0, 0).estimate.is_some());
        core.reset();
        let tick = core.tick(0, 0);
        assert!(tick.notices.has(Notices::RESET) && tick.estimate.is_none());
    }
}
