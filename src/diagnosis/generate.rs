//! Recordings made by the twin itself: the four processes through an outer loop, with effects, spread and sensor noise.
//!
//! For trying a bench or a diagnosis. What comes out is synthetic, and made with the very equations of the twin and of
//! its effects: a diagnosis that does well on it has proved little about real units.

pub mod governor;
pub mod machine;
pub mod noise;
pub mod script;
pub mod streams;

use crate::generate::governor::Governor;
use crate::generate::machine::Machine;
use crate::generate::noise::{Purpose, RandomStreams, Transducer};
use crate::generate::script::ProcessScript;
use crate::generate::streams::GeneratedStreams;
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::parameters::{ENTRIES, Tolerance, Unit};
use govtwin_model::recording::{Process, Recording};
use govtwin_model::solver::Method;
use govtwin_model::twin::Twin;
use govtwin_model::units::{nanos_from_seconds, seconds_from_nanos};

/// Period at which the governor issues commands, ns.
const CONTROL_PERIOD_NS: i64 = 10_000_000;
/// Greatest rate at which the tank pressure is recorded, Hz.
const TANK_RATE_HZ: f64 = 20.0;
/// Period at which the ESV reports when nothing changes, ns.
const ESV_PERIOD_NS: i64 = 1_000_000_000;
/// Stamp of the first row of the first process, ns since 1970; the others follow an hour apart.
pub const EPOCH_NS: i64 = 1_700_000_000_000_000_000;
/// Draws from a tolerance stay within this many standard deviations.
const WIDEST_DRAW: f64 = 3.0;

/// What to record.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// The unit as it truly is: parameters, transducers, effects.
    pub unit: Unit,
    /// The process that it goes through.
    pub process: Process,
    /// Rate of command and servo state, Hz.
    pub rate_hz: f64,
    /// Length of the recording, s; below 30 s not every process comes to its end.
    pub duration_s: f64,
    /// Whether the pilot signals are recorded too.
    pub rich: bool,
    /// Decides every draw; processes of one seed belong to one machine.
    pub seed: u64,
}

/// The recording of a scenario, as a reader of its bag would align it.
pub fn recording(scenario: &Scenario) -> Recording {
    Recording::new(scenario.process.id(), streams(scenario).rows())
}

/// The messages of a scenario, stream by stream.
pub fn streams(scenario: &Scenario) -> GeneratedStreams {
    let Scenario { unit, process, .. } = scenario;
    let random = RandomStreams { seed: scenario.seed, process: *process };
    let sensors = &unit.sensors;
    let plant = noise::hearing(unit, &random, scenario.duration_s);
    let lookahead_ns = nanos_from_seconds(plant.lookahead_s);
    let script = ProcessScript::new(*process, scenario.duration_s, &random);
    let mut governor = Governor::new(script, random.of(Purpose::Command));
    let mut machine = Machine::new(&unit.parameters, &script, random.of(Purpose::Grid));
    let mut spool = Transducer::new(sensors.spool_position_pu, random.of(Purpose::Spool));
    let mut servomotor = Transducer::new(sensors.servomotor_position_pu, random.of(Purpose::Servomotor));
    let mut pilot_valve = Transducer::new(sensors.pilot_valve_position_pu, random.of(Purpose::PilotValve));
    let mut control_pressure = Transducer::new(sensors.control_pressure_pa, random.of(Purpose::ControlPressure));
    let mut tank = Transducer::new(sensors.tank_pressure_pa, random.of(Purpose::TankPressure));

    let stroke_m = plant.servomotor.stroke_m;
    let mut twin = Twin::of_plant(plant, unit.parameters.oil.tank_pressure_pa, Method::default());
    let begin_ns = EPOCH_NS + 3_600_000_000_000 * process_index(*process);
    let mut inputs = Inputs {
        opening_command_pu: script.initial_opening_pu,
        esv: EsvState::Normal,
        tank_pressure_pa: machine.tank_pressure_pa,
        piston_force_n: 0.0,
    };
    let start = Signals { servomotor_position_pu: script.initial_opening_pu, ..Signals::NONE };
    twin.advance(&Frame { time_ns: begin_ns, inputs, measured: start });

    let mut streams = GeneratedStreams::default();
    let row_period_s = 1.0 / scenario.rate_hz;
    let tank_period_s = 1.0 / scenario.rate_hz.min(TANK_RATE_HZ);
    let (mut rows, mut tank_rows) = (0_u32, 0_u32);
    let (mut control_ns, mut esv_ns) = (0, 0);
    let end_ns = nanos_from_seconds(scenario.duration_s);
    loop {
        let row_ns = nanos_from_seconds(f64::from(rows) * row_period_s);
        let tank_ns = nanos_from_seconds(f64::from(tank_rows) * tank_period_s);
        let now_ns = row_ns.min(tank_ns).min(control_ns).min(esv_ns);
        if now_ns > end_ns {
            break;
        }
        let time_ns = begin_ns + now_ns;
        let stamp_ns = time_ns + lookahead_ns;
        let estimate = twin.step(&Frame { time_ns, inputs, measured: Signals::NONE });
        if now_ns == control_ns {
            control_ns += CONTROL_PERIOD_NS;
            let opening_pu = twin.state().servomotor_position_m / stroke_m;
            machine.advance(opening_pu, estimate.servomotor_velocity_m_s, governor.is_on_grid());
            let esv_before = inputs.esv;
            let command = governor.command(seconds_from_nanos(now_ns), machine.speed_pu);
            inputs = Inputs {
                opening_command_pu: command.opening_pu,
                esv: command.esv,
                tank_pressure_pa: machine.tank_pressure_pa,
                piston_force_n: 0.0,
            };
            twin.advance(&Frame { time_ns, inputs, measured: Signals::NONE });
            if inputs.esv != esv_before {
                esv_ns = now_ns;
            }
        }
        if now_ns == esv_ns {
            esv_ns += ESV_PERIOD_NS;
            streams.esv.push((stamp_ns, inputs.esv));
        }
        if now_ns == tank_ns {
            tank_rows += 1;
            streams.tank_pressure.push((time_ns, tank.read(machine.tank_pressure_pa)));
        }
        if now_ns == row_ns {
            rows += 1;
            let signals = &estimate.signals;
            let mut measured = Signals {
                spool_position_pu: spool.read(signals.spool_position_pu),
                servomotor_position_pu: servomotor.read(signals.servomotor_position_pu),
                ..Signals::NONE
            };
            if scenario.rich {
                measured.pilot_valve_position_pu = pilot_valve.read(signals.pilot_valve_position_pu);
                measured.control_pressure_pa = control_pressure.read(signals.control_pressure_pa);
            }
            streams.command.push((stamp_ns, inputs.opening_command_pu));
            streams.servo_state.push((time_ns, measured));
        }
    }
    streams.fill_start(begin_ns);
    streams
}

/// A unit of the same type as this one: each parameter drawn from its tolerance, effects kept.
pub fn spread(unit: &Unit, seed: u64) -> Unit {
    let mut drawn = unit.clone();
    let mut random = RandomStreams { seed, process: Process::Startup }.of(Purpose::Unit);
    for (entry, tolerance) in ENTRIES.iter().zip(&unit.tolerances) {
        let z = random.normal().clamp(-WIDEST_DRAW, WIDEST_DRAW);
        let value = (entry.get)(&unit.parameters);
        let value = match tolerance {
            None => continue,
            Some(Tolerance::Relative(spread)) => value * (1.0 + spread * z),
            Some(Tolerance::Absolute(spread)) => value + spread * z,
            Some(Tolerance::LogNormal(spread)) => value * (spread * z).exp(),
        };
        (entry.set)(&mut drawn.parameters, value.clamp(entry.min, entry.max));
    }
    drawn
}

fn process_index(process: Process) -> i64 {
    Process::ALL.iter().zip(0..).find(|(other, _)| **other == process).map_or(0, |(_, index)| index)
}
