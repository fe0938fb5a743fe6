//! The node without its bus: what was heard becomes frames, frames become estimates, silence becomes a fail-safe.
//!
//! The core reads no clock, knows no DDS, takes no memory and cannot fail; the threads around it hand
//! it what arrived and the time. The same calls therefore give the same estimates, live or in a test.

pub mod notices;

pub use self::notices::Notices;
use super::control::{Order, Ticket};
pub use super::policy::{InputState, NodeInput, OnStale, Policies, Policy, Rule};
use super::refit::Refit;
use govtwin_correction::corrector::{Correction, Corrector};
use govtwin_model::frame::{Estimate, EsvState, Frame, Inputs, Signals};
use govtwin_model::twin::Twin;

/// Something heard, checked already: every number is finite and in range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InputEvent {
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
    /// Force on the piston besides the sheet's load, N, + opens.
    Load(f64),
    /// Simulated time, ns since the epoch.
    Clock(i64),
    /// What a caller wants of the simulation.
    Order(Order, Ticket),
    /// A twin of changed parameters waits on its own ring.
    Refit,
    /// A new treatment of one input's silence.
    Rule(NodeInput, Rule),
    /// A new publish period, ns.
    PublishPeriod(i64),
}

/// The outcome of one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "independent facts of one tick")]
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
    /// Whether its trip stays until it is reset.
    pub latched: bool,
    /// The fail-safe asks the node to end.
    pub stop: bool,
    /// What stands behind each input.
    pub states: [InputState; NodeInput::COUNT],
    /// Spool's reference stroke and servomotor's stroke, by which positions become metres.
    pub strokes_m: [f64; 2],
    /// Ages of the inputs, ns; `None` for one never heard.
    pub ages_ns: [Option<i64>; NodeInput::COUNT],
    /// Stamps of the samples in force, ns; 0 for one never heard, or without a stamp.
    pub stamps_ns: [i64; NodeInput::COUNT],
}

impl Tick {
    /// Whether the command lies outside the stroke, so that the regulator limits it.
    pub(crate) fn is_clamped(&self) -> bool {
        !(0.0..=1.0).contains(&self.frame.inputs.opening_command_pu)
    }
}

#[derive(Clone, Copy, Debug)]
struct HeldInput {
    heard_ns: Option<i64>,
    stale: bool,
    /// A sample came since the last tick.
    is_new: bool,
    stamp_ns: i64,
}

impl HeldInput {
    const NEVER: Self = Self { heard_ns: None, stale: false, is_new: false, stamp_ns: 0 };
}

/// The node's memory.
#[derive(Clone, Debug)]
pub struct Core {
    twin: Twin,
    strokes_m: [f64; 2],
    corrector: Option<Corrector>,
    measured: Signals,
    policies: Policies,
    inputs: Inputs,
    held: [HeldInput; NodeInput::COUNT],
    began_ns: Option<i64>,
    previous: Option<Inputs>,
    fail_safe: bool,
    latches: bool,
    latched: bool,
    pending: Notices,
}

impl Core {
    /// A core that waits for the inputs that `policies` require; `tank_pressure_pa` is the default of a pressure whose
    /// policy names none.
    pub fn new(twin: Twin, policies: impl Into<Policies>, tank_pressure_pa: f64) -> Self {
        let mut policies: Policies = policies.into();
        let tank_pressure_pa = *policies.default_tank_pressure_pa.get_or_insert(tank_pressure_pa);
        let inputs = Inputs {
            opening_command_pu: policies.default_command_pu,
            esv: policies.default_esv,
            tank_pressure_pa,
            piston_force_n: 0.0,
        };
        let held = [HeldInput::NEVER; NodeInput::COUNT];
        let plant = twin.plant();
        let strokes_m = [plant.spool.reference_stroke_m, plant.servomotor.stroke_m];
        Self {
            twin,
            strokes_m,
            corrector: None,
            measured: Signals::NONE,
            policies,
            inputs,
            held,
            began_ns: None,
            previous: None,
            fail_safe: false,
            latches: false,
            latched: false,
            pending: Notices::default(),
        }
    }

    /// The same for a unit that may be exchanged for another.
    pub fn of_refit(refit: Refit, policies: impl Into<Policies>) -> Self {
        let Refit { twin, strokes_m, tank_pressure_pa, .. } = refit;
        Self { strokes_m, ..Self::new(twin, policies, tank_pressure_pa) }
    }

    /// The same with a learned residual.
    #[must_use]
    pub fn with_corrector(mut self, corrector: Option<Corrector>) -> Self {
        self.corrector = corrector;
        self
    }

    /// The same whose fail-safe trip stays until it is reset.
    pub(crate) fn latching(mut self, latches: bool) -> Self {
        self.latches = latches;
        self
    }

    /// Ends a trip that stays, where its inputs are back; returns whether there was one to end.
    pub(crate) fn reset_trip(&mut self) -> bool {
        std::mem::take(&mut self.latched)
    }

    /// The learned residual, with what its guard and its adaptation did.
    pub(crate) fn corrector(&self) -> Option<&Corrector> {
        self.corrector.as_ref()
    }

    /// Which of the wanted inputs have no sample since the last tick.
    pub(crate) fn missing(&self, wanted: [bool; NodeInput::COUNT]) -> [bool; NodeInput::COUNT] {
        NodeInput::ALL.map(|input| wanted[input as usize] && !self.held[input as usize].is_new)
    }

    /// Stamps of the samples in force, ns; 0 where there is none.
    pub(crate) fn stamps_ns(&self) -> [i64; NodeInput::COUNT] {
        self.held.map(|held| held.stamp_ns)
    }

    /// Takes what was heard at `now_ns`, a time that never runs backwards between two resets.
    pub fn hear(&mut self, heard: InputEvent, now_ns: i64) {
        self.take(heard, now_ns, 0);
    }

    /// The same with the stamp of the sample, ns; 0 where it has none.
    pub(crate) fn take(&mut self, heard: InputEvent, now_ns: i64, stamp_ns: i64) {
        let input = match heard {
            InputEvent::Command(opening_command_pu) => {
                self.inputs.opening_command_pu = opening_command_pu;
                NodeInput::Command
            }
            InputEvent::Esv(esv) => {
                self.inputs.esv = esv;
                NodeInput::Esv
            }
            InputEvent::TankPressure(tank_pressure_pa) => {
                self.inputs.tank_pressure_pa = tank_pressure_pa;
                NodeInput::TankPressure
            }
            InputEvent::Rule(input, rule) => {
                self.policies.rules[input as usize] = rule;
                return;
            }
            InputEvent::Measured { spool_pu, servomotor_pu } => {
                // Two topics may hold one each: neither forgets what the other said before the same tick.
                if !spool_pu.is_nan() {
                    self.measured.spool_position_pu = spool_pu;
                }
                if !servomotor_pu.is_nan() {
                    self.measured.servomotor_position_pu = servomotor_pu;
                }
                return;
            }
            InputEvent::Load(load_n) => {
                self.inputs.piston_force_n = load_n;
                NodeInput::Load
            }
            InputEvent::Clock(_) | InputEvent::PublishPeriod(_) | InputEvent::Order(..) | InputEvent::Refit => return,
        };
        let stale = self.held[input as usize].stale;
        self.held[input as usize] = HeldInput { heard_ns: Some(now_ns), stale, is_new: true, stamp_ns };
    }

    /// Counts what was heard so far as heard at `now_ns`, where the clock on which ages are counted begins.
    pub(crate) fn begin_ages(&mut self, now_ns: i64) {
        for held in &mut self.held {
            held.heard_ns = held.heard_ns.map(|_| now_ns);
        }
    }

    /// Forgets the twin's state and all that was heard, as after a jump in time.
    pub(crate) fn reset(&mut self) {
        self.twin.reset();
        if let Some(corrector) = &mut self.corrector {
            corrector.reset();
        }
        self.measured = Signals::NONE;
        self.held = [HeldInput::NEVER; NodeInput::COUNT];
        self.began_ns = None;
        self.inputs.piston_force_n = 0.0;
        self.previous = None;
        self.fail_safe = false;
        self.latched = false;
        self.pending.add(Notices::RESET);
    }

    /// Sets the twin back on request: its next tick starts from the steady state of what was heard last.
    pub(crate) fn restart(&mut self) {
        self.twin.reset();
        if let Some(corrector) = &mut self.corrector {
            corrector.reset();
        }
        self.previous = None;
        self.fail_safe = false;
        self.latched = false;
        self.pending.add(Notices::RESTARTED);
    }

    /// Goes on with another twin from where this one is, and leaves this one in `refit`, with the learned residual, which was of its unit.
    pub fn refit(&mut self, refit: &mut Refit) {
        self.twin.go_on_as(&mut refit.twin);
        refit.corrector = self.corrector.take();
        if refit.corrector.is_some() {
            self.pending.add(Notices::UNCORRECTED);
        }
        std::mem::swap(&mut self.strokes_m, &mut refit.strokes_m);
        self.pending.add(Notices::REFITTED);
    }

    /// Advances the twin to `time_ns`, the model's time; `now_ns` is the time on which ages are counted.
    pub fn tick(&mut self, time_ns: i64, now_ns: i64) -> Tick {
        let began_ns = *self.began_ns.get_or_insert(now_ns);
        let mut notices = std::mem::take(&mut self.pending);
        let (mut complete, mut ages_ns) = (true, [None; NodeInput::COUNT]);
        let mut states = [InputState::Default; NodeInput::COUNT];
        for input in NodeInput::ALL {
            let rule = self.policies.rules[input as usize];
            let held = &mut self.held[input as usize];
            held.is_new = false;
            let age_ns = now_ns.saturating_sub(held.heard_ns.unwrap_or(began_ns));
            let awaited = held.heard_ns.is_some() || rule.required;
            let stale = awaited && age_ns > rule.policy.stale_after_ns;
            if stale != held.stale {
                held.stale = stale;
                notices.add(match (stale, held.heard_ns) {
                    (true, Some(_)) => Notices::stale(input),
                    (true, None) => Notices::missing(input),
                    (false, _) => Notices::recovered(input),
                });
            }
            complete &= held.heard_ns.is_some() || !rule.required;
            let overdue = stale && age_ns > rule.policy.stale_after_ns.saturating_add(rule.policy.hold_ns);
            states[input as usize] = match (held.heard_ns, stale) {
                (Some(_), false) => InputState::Fresh,
                (Some(_), true) if overdue && rule.policy.on_stale != OnStale::Hold => InputState::Failed,
                (Some(_), true) => InputState::Held,
                (None, _) => InputState::Default,
            };
            ages_ns[input as usize] = held.heard_ns.map(|_| age_ns);
        }
        // Without a first set of inputs there is no steady state to start from: the twin waits, and nothing trips.
        let runs = complete || self.previous.is_some();
        let failed = |choice: OnStale| {
            let of = |input: &NodeInput| self.policies.rules[*input as usize].policy.on_stale == choice;
            runs && NodeInput::ALL.iter().any(|input| states[*input as usize] == InputState::Failed && of(input))
        };
        self.latched |= self.latches && failed(OnStale::Trip);
        let (trip, stop) = (failed(OnStale::Trip) || self.latched, failed(OnStale::Stop));
        let fail_safe = trip || stop || failed(OnStale::Default);
        if fail_safe != self.fail_safe {
            self.fail_safe = fail_safe;
            notices.add(if fail_safe { Notices::FAIL_SAFE } else { Notices::RELEASED });
        }
        let inputs = self.policies.inputs(&self.inputs, states, trip);
        let frame = Frame { time_ns, inputs, measured: Signals::NONE };
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
        Tick {
            frame,
            estimate,
            correction,
            inputs_changed,
            notices,
            fail_safe,
            latched: self.latched,
            stop,
            states,
            strokes_m: self.strokes_m,
            ages_ns,
            stamps_ns: self.stamps_ns(),
        }
    }
}

#[cfg(test)]
mod tests;
