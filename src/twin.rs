//! The heart: one step of the twin, from a frame to an estimate.

mod hold;
mod readings;

use std::sync::Arc;

use crate::effects;
use crate::frame::{Estimate, EsvState, Frame, Inputs, Signals};
use crate::parameters::Unit;
use crate::plant::steady::steady;
use crate::plant::term::{Point, View};
use crate::plant::{Drive, Plant};
use crate::solver::{Method, Solver};
use crate::state::State;
use crate::units::{nanos_from_seconds, seconds_from_nanos};

use hold::Hold;
use readings::{piston_position_pu, spool_reading_pu, standing_in_pu};

/// Where recorded signals stand in for simulated ones, so that one stage is judged by its own input.
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

/// Blur of the port edges per standard deviation of the spool's demand: 0.8 for the shape of the blurred edge times
/// 0.4, the share of the demand's noise that the spool follows (measured on simulated units).
const CHATTER_BLUR: f64 = 0.32;

/// The simulated servo system of one unit.
///
/// Integration runs on a grid of whole small-loop periods (1 ms) counted from the first frame; a
/// tick uses the newest frame at or before it. Rows may therefore arrive at any rate, and rows that
/// repeat what already holds change nothing, to the last bit. Between two ticks positions follow their
/// speeds. Measured signals that stand in at a cut hold from row to row; a measured spool is
/// interpolated between two rows that both carry it.
#[derive(Clone, Debug)]
pub struct Twin {
    plant: Arc<Plant>,
    nominal_tank_pressure_pa: f64,
    cut: Cut,
    tick_ns: i64,
    tick_s: f64,
    solver: Solver,
    now: Now,
}

/// Everything that changes while a twin runs.
#[derive(Clone, Debug)]
struct Now {
    running: bool,
    state: State,
    memory: Vec<f64>,
    ticks: u64,
    time_ns: i64,
    inputs: Inputs,
    coming: Inputs,
    measured: Signals,
    measured_ns: i64,
    spool_command_pu: f64,
    spool_command_sd_pu: f64,
    hold: Hold,
    valve_current_pu: f64,
    servomotor_reading_pu: f64,
}

impl Twin {
    /// Builds the twin of a unit, closed loop. Its first frame sets it to the steady state there.
    #[must_use]
    pub fn new(unit: &Unit) -> Self {
        Self::with_method(unit, Method::default())
    }

    /// The same with a chosen integration method.
    #[must_use]
    pub fn with_method(unit: &Unit, method: Method) -> Self {
        let mut plant = Plant::new(&unit.parameters);
        effects::apply(unit, &mut plant);
        Self::of_plant(plant, unit.parameters.oil.tank_pressure_pa, method)
    }

    /// The same of a plant that no unit describes, such as one with terms of its own.
    #[must_use]
    pub fn of_plant(plant: Plant, nominal_tank_pressure_pa: f64, method: Method) -> Self {
        let tick_s = plant.regulator.small_loop_period_s();
        let solver = Solver::new(method, &plant, tick_s);
        let none = Inputs { opening_command_pu: 0.0, esv: EsvState::Normal, tank_pressure_pa: 0.0 };
        let now = Now {
            running: false,
            state: State::default(),
            memory: vec![0.0; plant.terms.memory_len()],
            ticks: 0,
            time_ns: 0,
            inputs: none,
            coming: none,
            measured: Signals::NONE,
            measured_ns: 0,
            spool_command_pu: 0.0,
            spool_command_sd_pu: 0.0,
            hold: Hold::default(),
            valve_current_pu: 0.0,
            servomotor_reading_pu: 0.0,
        };
        Self {
            plant: Arc::new(plant),
            nominal_tank_pressure_pa,
            cut: Cut::None,
            tick_ns: nanos_from_seconds(tick_s).max(1),
            tick_s,
            solver,
            now,
        }
    }

    /// The same twin with a cut.
    #[must_use]
    pub fn with_cut(mut self, cut: Cut) -> Self {
        self.cut = cut;
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
        self.now.hold = Hold::new(regulator.runs_per_hold_count(), regulator.large_loop_period_s());
        self
    }

    /// The plant that it simulates.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// Where recorded signals stand in for simulated ones.
    #[must_use]
    pub fn cut(&self) -> Cut {
        self.cut
    }

    /// The continuous state at the last tick.
    #[must_use]
    pub fn state(&self) -> &State {
        &self.now.state
    }

    /// Forgets everything; the next frame starts anew.
    pub fn reset(&mut self) {
        self.now.running = false;
    }

    /// Advances to the frame's time under the inputs held so far, then takes the frame's inputs.
    ///
    /// The estimate is for the frame's time. The first frame after `new` or `reset` starts at the
    /// steady state that its inputs and measured positions describe. A frame that is not later than
    /// its predecessor advances nothing. An input that is not finite leaves the last one in force; where
    /// there never was one, the command is the measured position and the tank pressure the sheet's.
    #[must_use]
    pub fn step(&mut self, frame: &Frame) -> Estimate {
        self.advance(frame);
        self.estimate(frame.time_ns)
    }

    /// The same without the estimate, for rows at which nobody looks.
    pub fn advance(&mut self, frame: &Frame) {
        if self.now.running {
            while frame.time_ns - self.now.time_ns >= self.tick_ns {
                self.tick(frame);
            }
            self.take(frame);
        } else {
            self.start(frame);
        }
    }

    /// Sets the steady state that a first frame describes.
    fn start(&mut self, frame: &Frame) {
        let plant = &*self.plant;
        let now = &mut self.now;
        now.running = true;
        now.ticks = 0;
        now.time_ns = frame.time_ns;
        now.measured = frame.measured;
        now.measured_ns = frame.time_ns;
        let measured_pu = frame.measured.servomotor_position_pu;
        now.inputs = Inputs {
            opening_command_pu: first_finite([frame.inputs.opening_command_pu, measured_pu, 0.0]),
            esv: frame.inputs.esv,
            tank_pressure_pa: first_finite([frame.inputs.tank_pressure_pa, self.nominal_tank_pressure_pa, 0.0]),
        };
        now.coming = now.inputs;
        let position_pu = first_finite([measured_pu, now.inputs.opening_command_pu, 0.0]).clamp(0.0, 1.0);

        // At rest when the error sits in the dead band; else on its way as measured.
        let error_pu = now.inputs.opening_command_pu - position_pu;
        let (lower_pu, upper_pu) = plant.regulator.deadband_pu();
        let shut = now.inputs.esv == EsvState::Shutdown;
        let rests = error_pu > lower_pu && error_pu < upper_pu && !shut && self.cut != Cut::Spool;
        let spool_position_m = if rests {
            None
        } else if frame.measured.spool_position_pu.is_finite() {
            Some(plant.spool.position_m(frame.measured.spool_position_pu))
        } else if shut {
            Some(plant.spool.stroke_min_m)
        } else {
            None
        };
        let drive = Drive {
            esv_opening_pu: f64::from(u8::from(!shut)),
            tank_pressure_pa: now.inputs.tank_pressure_pa,
            ..Drive::default()
        };
        now.state = steady(plant, position_pu * plant.servomotor.stroke_m, spool_position_m, &drive);
        now.valve_current_pu = (now.state.pilot_position_pu / plant.proportional_valve.gain_pu).clamp(-1.0, 1.0);
        (now.spool_command_pu, now.spool_command_sd_pu) = (0.0, 0.0);
        now.hold.reset();
        now.servomotor_reading_pu = position_pu;
        let terms = &plant.terms;
        for point in Point::ALL {
            let signal = match point {
                Point::Command => now.inputs.opening_command_pu,
                Point::EsvOpening => drive.esv_opening_pu,
                Point::ValveCurrent => now.valve_current_pu,
                Point::ServomotorReading | Point::RegulatorServomotor => position_pu,
                Point::RegulatorSpool => plant.spool.reading_pu(now.state.spool_position_m),
                _ => 0.0,
            };
            terms.reset(point, signal, &mut now.memory);
        }
    }

    /// Takes a frame's inputs and measured signals as far as they are finite.
    ///
    /// Inputs of a frame between two ticks wait for the later one.
    fn take(&mut self, frame: &Frame) {
        let now = &mut self.now;
        now.coming.renew(&frame.inputs);
        if frame.time_ns <= now.time_ns {
            now.inputs = now.coming;
        }
        let measured = &frame.measured;
        if measured.servomotor_position_pu.is_finite() {
            now.measured.servomotor_position_pu = measured.servomotor_position_pu;
        }
        if measured.spool_position_pu.is_finite() {
            now.measured.spool_position_pu = measured.spool_position_pu;
            now.measured_ns = frame.time_ns;
        }
    }

    /// Advances one period of the small loop.
    fn tick(&mut self, next: &Frame) {
        let plant = &*self.plant;
        let terms = &plant.terms;
        let now = &mut self.now;
        let time_s = seconds_from_ticks(now.ticks, self.tick_s);
        let spool_reading_pu = match self.cut {
            Cut::Spool => standing_in_pu(now.measured.spool_position_pu, now.measured_ns, next, now.time_ns),
            Cut::None | Cut::Servomotor => spool_reading_pu(plant, now, 0.0),
        };
        let servomotor_reading_pu = if self.cut == Cut::Servomotor && now.measured.servomotor_position_pu.is_finite() {
            now.measured.servomotor_position_pu
        } else {
            now.servomotor_reading_pu
        };
        let before = now.state;
        let view = View {
            time_s,
            tick_s: self.tick_s,
            state: &before,
            tank_pressure_pa: now.inputs.tank_pressure_pa,
            spool_reading_pu,
            servomotor_reading_pu,
        };
        let memory = &mut now.memory;
        let open = f64::from(u8::from(now.inputs.esv == EsvState::Normal));
        let esv_opening_pu = terms.apply(Point::EsvOpening, open, &view, memory);
        let command_pu = terms.apply(Point::Command, now.inputs.opening_command_pu, &view, memory);
        let servomotor_read_pu = terms.apply(Point::RegulatorServomotor, servomotor_reading_pu, &view, memory);
        let spool_read_pu = terms.apply(Point::RegulatorSpool, spool_reading_pu, &view, memory);
        let mut spool_command_pu = now.spool_command_pu;
        if let Some(share) = plant.regulator.large_loop_share(now.ticks) {
            let since_s = if self.cut == Cut::None { share * self.tick_s } else { 0.0 };
            let moved_pu = since_s * before.servomotor_velocity_m_s / plant.servomotor.stroke_m;
            let demand = plant.regulator.dithered_command_pu(command_pu, servomotor_read_pu + moved_pu);
            (now.spool_command_pu, now.spool_command_sd_pu) = now.hold.next(demand);
            // Until the large loop runs within the tick, its old output holds.
            spool_command_pu = now.spool_command_pu + share * (spool_command_pu - now.spool_command_pu);
        }
        now.valve_current_pu = plant.regulator.valve_current_pu(spool_command_pu, spool_read_pu);
        let drive = Drive {
            time_s,
            valve_current_pu: terms.apply(Point::ValveCurrent, now.valve_current_pu, &view, memory),
            esv_opening_pu,
            tank_pressure_pa: now.inputs.tank_pressure_pa,
            edge_blur_m: CHATTER_BLUR * now.spool_command_sd_pu * plant.spool.reference_stroke_m,
            spool_force_n: terms.apply(Point::SpoolForce, 0.0, &view, memory),
            chamber_flow_m3_s: terms.apply(Point::ChamberFlow, 0.0, &view, memory),
            servomotor_force_n: terms.apply(Point::ServomotorForce, 0.0, &view, memory),
            opening_flow_m3_s: terms.apply(Point::OpeningFlow, 0.0, &view, memory),
            closing_flow_m3_s: terms.apply(Point::ClosingFlow, 0.0, &view, memory),
        };
        if self.cut == Cut::Spool {
            let position_m = plant.spool.position_m(spool_reading_pu);
            now.state.spool_position_m = position_m.clamp(plant.spool.stroke_min_m, plant.spool.stroke_max_m);
            self.solver.advance_piston(plant, &mut now.state, &drive);
        } else {
            self.solver.advance(plant, &mut now.state, &drive);
        }
        now.ticks += 1;
        now.time_ns += self.tick_ns;
        now.inputs = now.coming;
        let position_pu = piston_position_pu(plant, now, 0.0);
        now.servomotor_reading_pu = terms.apply(Point::ServomotorReading, position_pu, &view, &mut now.memory);
    }

    /// What the twin says at a time less than a tick after the last one.
    fn estimate(&self, time_ns: i64) -> Estimate {
        let (plant, now) = (&*self.plant, &self.now);
        let since_s = seconds_from_nanos(time_ns - now.time_ns).max(0.0);
        let state = &now.state;
        let moving_s = if self.cut == Cut::Spool { 0.0 } else { since_s };
        let moved_pu = if since_s > 0.0 {
            piston_position_pu(plant, now, since_s) - piston_position_pu(plant, now, 0.0)
        } else {
            0.0
        };
        Estimate {
            time_ns,
            signals: Signals {
                spool_position_pu: spool_reading_pu(plant, now, moving_s),
                servomotor_position_pu: now.servomotor_reading_pu + moved_pu,
                pilot_valve_position_pu: state.pilot_position_pu,
                control_pressure_pa: state.control_pressure_pa,
            },
            spool_velocity_m_s: state.spool_velocity_m_s,
            servomotor_velocity_m_s: state.servomotor_velocity_m_s,
            opening_chamber_pressure_pa: state.opening_pressure_pa,
            closing_chamber_pressure_pa: state.closing_pressure_pa,
            spool_command_pu: now.spool_command_pu,
            spool_command_sd_pu: now.spool_command_sd_pu,
            valve_current_pu: now.valve_current_pu,
        }
    }
}

fn first_finite(candidates: [f64; 3]) -> f64 {
    candidates.into_iter().find(|value| value.is_finite()).unwrap_or(0.0)
}

#[expect(clippy::cast_precision_loss, reason = "2^53 ticks are 285,000 years")]
fn seconds_from_ticks(ticks: u64, tick_s: f64) -> f64 {
    ticks as f64 * tick_s
}
