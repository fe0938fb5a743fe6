//! The heart: one step of the twin, from a frame to an estimate.

pub mod batch;
mod hold;
mod now;
mod readings;
#[cfg(test)]
mod tests;
mod tick;

use std::sync::Arc;

use crate::effects;
use crate::frame::{Estimate, EsvState, Frame, Signals};
use crate::parameters::Unit;
use crate::plant::regulator::SmallLoop;
use crate::plant::steady::steady;
use crate::plant::term::Point;
use crate::plant::{Blocks, Drive, Plant};
use crate::solver::{Method, Solver};
use crate::state::State;
use crate::units::nanos_from_seconds;

use hold::Hold;
use now::{Acting, Demand, Now, esv_opening_pu};
use readings::{piston_reading_pu, positions_pu};
use tick::{Chain, Seen, Setting, TickReads, large_loop, tick};

/// Where recorded signals replace simulated ones, so that one stage is evaluated with its own input.
///
/// ```
/// use govtwin_model::params::reference;
/// use govtwin_model::twin::{Cut, Twin};
///
/// assert_eq!(Twin::new(&reference()).with_cut(Cut::Spool).cut(), Cut::Spool);
/// ```
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
/// repeat what already holds change nothing, to the last bit. Between two ticks positions follow their
/// speeds. Measured signals that stand in at a cut hold from row to row; a measured spool is
/// interpolated between two rows that both carry it, and the piston behind it is where it is first measured.
///
/// Frames have the clock of the recording; a unit's [`ChannelReadings::clock_ratio`](crate::parameters::ChannelReadings) says how fast its own runs beside it.
///
/// A step allocates nothing, cannot fail and takes about 1/8000 of the time that it simulates. Twins are cheap to clone: plants are shared.
///
/// ```
/// use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
/// use govtwin_model::{params::reference, twin::Twin};
///
/// let mut twin = Twin::new(&reference());
/// let frame = |time_s: i64, esv| Frame {
///     time_ns: time_s * 1_000_000_000,
///     inputs: Inputs { opening_command_pu: 0.6, esv, tank_pressure_pa: 6.0e6, piston_force_n: 0.0 },
///     measured: Signals::NONE,
/// };
/// let open = twin.step(&frame(0, EsvState::Normal)).signals.servomotor_position_pu;
/// assert!((open - 0.6).abs() < 1e-9); // the first frame sets the steady state
/// let _ = twin.step(&frame(1, EsvState::Shutdown)); // the valve trips at 1 s
/// let shut = twin.step(&frame(60, EsvState::Shutdown)).signals.servomotor_position_pu;
/// assert!(shut < 0.01);
/// ```
#[derive(Clone, Debug)]
pub struct Twin {
    plant: Arc<Plant>,
    nominal_tank_pressure_pa: f64,
    setting: Setting,
    solver: Solver,
    running: bool,
    now: Now,
    memory: Vec<f64>,
    hold: Hold,
}

/// Where a piston begins that nothing places, pu: far from both ends.
const HALF_OPEN_PU: f64 = 0.5;

impl Twin {
    /// Builds the twin of a unit, closed loop. Its first frame sets it to the steady state there.
    pub fn new(unit: &Unit) -> Self {
        Self::with_method(unit, Method::default())
    }

    /// The same with a chosen integration method.
    pub fn with_method(unit: &Unit, method: Method) -> Self {
        let mut plant = Plant::new(&unit.parameters);
        effects::apply(unit, &mut plant);
        let mut twin = Self::of_plant(plant, unit.parameters.oil.tank_pressure_pa, method);
        let (setting, clock_ratio) = (&mut twin.setting, unit.recorded.clock_ratio);
        (setting.tick_ns, setting.clock_ratio) = (tick_ns(setting.tick_s / clock_ratio), clock_ratio);
        twin
    }

    /// The same of a plant that no unit describes, such as one with terms of its own.
    pub fn of_plant(plant: Plant, nominal_tank_pressure_pa: f64, method: Method) -> Self {
        let tick_s = plant.regulator.small_loop_period_s();
        let solver = Solver::new(method, &plant, tick_s);
        let none = Acting { opening_command_pu: 0.0, esv_opening_pu: 1.0, tank_pressure_pa: 0.0, piston_force_n: 0.0 };
        let now = Now {
            state: State::default(),
            ticks: 0,
            time_ns: 0,
            inputs: none,
            coming: none,
            measured: Signals::NONE,
            measured_ns: 0,
            demand: Demand { spool_command_pu: 0.0, sd_pu: 0.0 },
            valve_current_pu: 0.0,
            servomotor_reading_pu: 0.0,
            is_placed: true,
        };
        Self {
            memory: vec![0.0; plant.terms.memory_len()],
            plant: Arc::new(plant),
            nominal_tank_pressure_pa,
            setting: Setting { cut: Cut::None, tick_ns: tick_ns(tick_s), tick_s, clock_ratio: 1.0 },
            solver,
            running: false,
            now,
            hold: Hold::default(),
        }
    }

    /// The same twin with a cut.
    #[must_use]
    pub fn with_cut(mut self, cut: Cut) -> Self {
        self.setting.cut = cut;
        self
    }

    /// The same twin as the mean over transducer noise inside the loop, one standard deviation in pu of stroke.
    ///
    /// The dead band decides on a noisy reading; its mean is smooth in every parameter, which a search
    /// needs, and the estimate then carries the demand's standard deviation.
    #[must_use]
    pub fn with_dither(mut self, servomotor_noise_pu: f64) -> Self {
        let regulator = &mut Arc::make_mut(&mut self.plant).regulator;
        regulator.dither_pu = servomotor_noise_pu;
        self.hold = Hold::new(regulator.runs_per_hold_count(), regulator.large_loop_period_s());
        self
    }

    /// The plant that it simulates.
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Where recorded signals stand in for simulated ones.
    pub fn cut(&self) -> Cut {
        self.setting.cut
    }

    /// The continuous state at the last tick.
    pub fn state(&self) -> &State {
        &self.now.state
    }

    /// Forgets everything; the next frame starts anew.
    pub fn reset(&mut self) {
        self.running = false;
    }

    /// Advances to the frame's time under the inputs held so far, then takes the frame's inputs.
    ///
    /// The estimate is for the frame's time. The first frame after `new` or `reset` starts at the
    /// steady state that its inputs and measured positions describe. A frame that is not later than
    /// its predecessor advances nothing. With an input that is not finite the last one stays in force; where
    /// there never was one, the command is the measured position, the tank pressure the sheet's, and no force acts.
    #[must_use]
    pub fn step(&mut self, frame: &Frame) -> Estimate {
        self.advance(frame);
        self.estimate(frame.time_ns)
    }

    /// The same without the estimate, for rows whose estimate is not used.
    pub fn advance(&mut self, frame: &Frame) {
        if self.running {
            self.run_to(frame);
            self.take(frame);
        } else {
            self.start(frame, None);
        }
    }

    /// Places the piston where a frame is the first to measure it. What drove it before stays in memory: a spool that acts late, and on which side of a gap its
    /// reading is.
    fn place(&mut self, frame: &Frame) {
        let piston_pu = piston_reading_pu(&self.plant.blocks(), &self.now.state, 0.0);
        let reading_pu = self.plant.terms.settled(Point::ServomotorReading, piston_pu, &self.memory);
        self.start(frame, Some(reading_pu - piston_pu));
    }

    /// Sets the steady state that a first frame describes, or that one behind a history, of which it keeps how far the reading is off the piston, pu.
    fn start(&mut self, frame: &Frame, reading_off_pu: Option<f64>) {
        let plant = &*self.plant;
        let now = &mut self.now;
        self.running = true;
        now.ticks = 0;
        now.time_ns = frame.time_ns;
        now.measured = frame.measured;
        now.measured_ns = frame.time_ns;
        let measured_pu = frame.measured.servomotor_position_pu;
        now.inputs = Acting {
            opening_command_pu: first_finite([frame.inputs.opening_command_pu, measured_pu, 0.0]),
            esv_opening_pu: esv_opening_pu(frame.inputs.esv),
            tank_pressure_pa: first_finite([frame.inputs.tank_pressure_pa, self.nominal_tank_pressure_pa, 0.0]),
            piston_force_n: first_finite([frame.inputs.piston_force_n, 0.0, 0.0]),
        };
        now.coming = now.inputs;
        let wanted_pu = plant.regulator.command_gain * now.inputs.opening_command_pu;
        let bias_pu = plant.servomotor.reading_bias_pu;
        now.is_placed = self.setting.cut != Cut::Spool || measured_pu.is_finite();
        let unmeasured_pu = if now.is_placed || (0.0..=1.0).contains(&wanted_pu) { wanted_pu } else { HALF_OPEN_PU };
        let off_pu = reading_off_pu.unwrap_or(0.0);
        let position_pu = (first_finite([measured_pu, unmeasured_pu, 0.0]) - bias_pu - off_pu).clamp(0.0, 1.0);
        let reading_pu = position_pu + bias_pu + off_pu;

        // At rest when the error sits in the dead band; else on its way as measured.
        let error_pu = wanted_pu - reading_pu;
        let (lower_pu, upper_pu) = plant.regulator.deadband_pu();
        let shut = frame.inputs.esv == EsvState::Shutdown;
        let idle_segments = error_pu > lower_pu && error_pu < upper_pu && !shut && self.setting.cut != Cut::Spool;
        let spool_position_m = if idle_segments {
            None
        } else if frame.measured.spool_position_pu.is_finite() {
            Some(plant.spool.position_m(frame.measured.spool_position_pu))
        } else if shut {
            Some(plant.spool.stroke_min_m)
        } else {
            None
        };
        let drive = Drive {
            esv_opening_pu: now.inputs.esv_opening_pu,
            tank_pressure_pa: now.inputs.tank_pressure_pa,
            servomotor_force_n: now.inputs.piston_force_n,
            ..Drive::default()
        };
        now.state = steady(plant, position_pu * plant.servomotor.stroke_m, spool_position_m, &drive);
        let limit_pu = plant.regulator.current_limit_pu;
        now.valve_current_pu =
            (now.state.pilot_position_pu / plant.proportional_valve.gain_pu).clamp(-limit_pu, limit_pu);
        now.demand = Demand { spool_command_pu: 0.0, sd_pu: 0.0 };
        self.hold.reset();
        now.servomotor_reading_pu = reading_pu;
        self.settle(reading_off_pu.map(|_| Point::DrivingSpool));
    }

    /// Sets the memories of all terms, but those at one point, to their steady state at the present signals.
    fn settle(&mut self, but: Option<Point>) {
        let Self { plant, now, memory, .. } = self;
        for point in Point::ALL.into_iter().filter(|point| Some(*point) != but) {
            let signal = match point {
                Point::Command => now.inputs.opening_command_pu,
                Point::EsvOpening => now.inputs.esv_opening_pu,
                Point::SupplyPressure => now.inputs.tank_pressure_pa,
                Point::ServomotorForce => now.inputs.piston_force_n,
                Point::ValveCurrent => now.valve_current_pu,
                Point::ServomotorReading | Point::RegulatorServomotor => now.servomotor_reading_pu,
                Point::RegulatorSpool => plant.spool.reading_pu(now.state.spool_position_m),
                Point::DrivingSpool => now.state.spool_position_m,
                _ => 0.0,
            };
            plant.terms.reset(point, signal, memory);
        }
    }

    /// Goes on as `next`, a twin with other parameters or effects, from where this one is; `next` becomes what this one was.
    ///
    /// Terms go on with what they remember where both twins have the same places for it; otherwise they start as if the signals of now had
    /// long been what they are. Takes no memory.
    pub fn go_on_as(&mut self, next: &mut Self) {
        if self.running {
            next.running = true;
            next.now = self.now;
            if next.plant.terms.remember_like(&self.plant.terms) {
                next.memory.copy_from_slice(&self.memory);
            } else {
                next.settle(None);
            }
        }
        std::mem::swap(self, next);
    }

    /// Takes a frame's inputs and measured signals as far as they are finite.
    ///
    /// Inputs of a frame between two ticks wait for the later one.
    fn take(&mut self, frame: &Frame) {
        self.now.coming.renew(&frame.inputs);
        self.now.take(frame);
        if self.now.is_placed_by(frame) {
            self.place(frame);
        }
    }

    /// Advances by all ticks up to a frame.
    fn run_to(&mut self, frame: &Frame) {
        let Self { plant, solver, memory, hold, setting, .. } = self;
        let mut single = Single { plant, solver, memory, hold };
        // Local variables stay in registers from tick to tick.
        let mut now = self.now;
        while frame.time_ns - now.time_ns >= setting.tick_ns {
            tick(&mut single, *setting, &mut now, frame);
        }
        self.now = now;
    }

    /// The estimate at a time less than a tick after the last one.
    fn estimate(&self, time_ns: i64) -> Estimate {
        let now = &self.now;
        estimate(time_ns, positions_pu(&self.plant.blocks(), now, self.setting, time_ns), now)
    }
}

fn tick_ns(tick_s: f64) -> i64 {
    nanos_from_seconds(tick_s).max(1)
}

/// A single plant with its memories.
///
/// Calls that are not inlined get copies, so that what they borrow need not stand in memory where they are not made.
struct Single<'a> {
    plant: &'a Plant,
    solver: &'a Solver,
    memory: &'a mut [f64],
    hold: &'a mut Hold,
}

impl Chain<f64> for Single<'_> {
    #[inline(always)]
    fn blocks(&self) -> Blocks<'_> {
        self.plant.blocks()
    }

    #[inline(always)]
    fn small_loop(&self) -> SmallLoop {
        self.plant.regulator.small_loop()
    }

    #[inline(always)]
    fn apply(&mut self, point: Point, signal: f64, seen: &Seen) -> f64 {
        if self.plant.terms.is_empty_at(point) {
            return signal;
        }
        let seen = *seen;
        self.plant.terms.apply(point, signal, &seen.view(), self.memory)
    }

    #[inline(always)]
    fn large_loop(&mut self, ticks: u64, moving_s: f64, read: &TickReads, demand: &mut Demand) -> f64 {
        large_loop(self.plant, self.hold, ticks, moving_s, read, demand)
    }

    #[inline(always)]
    fn advance(&self, state: &mut State, drive: &Drive) {
        if let Solver::Split(split) = self.solver {
            split.advance(&self.plant.blocks(), state, drive);
        } else {
            let (mut copy, drive) = (*state, *drive);
            self.solver.advance(self.plant, &mut copy, &drive);
            *state = copy;
        }
    }

    #[inline(always)]
    fn advance_piston(&self, state: &mut State, drive: &Drive) {
        if let Solver::Split(split) = self.solver {
            split.advance_piston(&self.plant.blocks(), state, drive);
        } else {
            let (mut copy, drive) = (*state, *drive);
            self.solver.advance_piston(self.plant, &mut copy, &drive);
            *state = copy;
        }
    }
}

/// An estimate from both positions as shown and all else as it was at the last tick.
fn estimate(time_ns: i64, (spool_position_pu, servomotor_position_pu): (f64, f64), now: &Now) -> Estimate {
    let state = &now.state;
    Estimate {
        time_ns,
        signals: Signals {
            spool_position_pu,
            servomotor_position_pu,
            pilot_valve_position_pu: state.pilot_position_pu,
            control_pressure_pa: state.control_pressure_pa,
        },
        spool_velocity_m_s: state.spool_velocity_m_s,
        servomotor_velocity_m_s: state.servomotor_velocity_m_s,
        opening_chamber_pressure_pa: state.opening_pressure_pa,
        closing_chamber_pressure_pa: state.closing_pressure_pa,
        spool_command_pu: now.demand.spool_command_pu,
        spool_command_sd_pu: now.demand.sd_pu,
        valve_current_pu: now.valve_current_pu,
    }
}

fn first_finite(candidates: [f64; 3]) -> f64 {
    candidates.into_iter().find(|value| value.is_finite()).unwrap_or(0.0)
}
