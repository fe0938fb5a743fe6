//! A rig on its bench: regulator, governor, machine, transducers, and the streams that a recorder would get.

use std::collections::VecDeque;

use crate::battery::draws::Draw;
use crate::battery::faults::Faults;
use crate::battery::laws::{rounded_loop, sagging, spanned};
use crate::battery::mismatch::Mismatch;
use crate::battery::rig::{Hand, Rig};
use govtwin_diagnosis::generate::governor::Governor;
use govtwin_diagnosis::generate::machine::Machine;
use govtwin_diagnosis::generate::noise::{Purpose, RandomStreams, Transducer};
use govtwin_diagnosis::generate::script::ProcessScript;
use govtwin_diagnosis::generate::streams::GeneratedStreams;
use govtwin_diagnosis::result::test_script::TestScript;
use govtwin_model::frame::{EsvState, Inputs, Signals};
use govtwin_model::parameters::{Parameters, Sensor, Sensors};
use govtwin_model::recording::Process;
use govtwin_model::units::{TICK_NS, nanos_from_seconds};

/// Ticks of 1 ms in which a rig comes to rest before the recording starts.
const SETTLING_TICKS: i64 = 2000;
/// Ticks between two commands.
const CONTROL_TICKS: i64 = 10;
/// Ticks between two readings of the tank.
const TANK_TICKS: i64 = 50;
/// Ticks between two reports of the ESV.
const ESV_TICKS: i64 = 1000;
/// Stamp of the first row of the first process, ns since 1970; the others follow an hour apart.
const EPOCH_NS: i64 = 1_700_000_000_000_000_000;

/// One plant, ready to go through its processes.
#[derive(Clone, Debug)]
pub(crate) struct TestRig {
    /// Parameters as they truly are.
    pub parameters: Parameters,
    /// Transducers.
    pub sensors: Sensors,
    /// What is wrong.
    pub faults: Faults,
    /// What is odd.
    pub odd: Mismatch,
    /// Readings of the servomotor of which the regulator takes the mean: the fewer, the more it chatters.
    pub readings: u32,
    /// Ticks between two rows.
    pub row_ticks: i64,
    /// Whether the pilot signals are recorded.
    pub rich: bool,
    /// Length of a recording in ticks.
    pub ticks: i64,
    /// Decides course, noise and clocks.
    pub seed: u64,
}

/// Where a run gets its inputs.
enum RigInputs<'a> {
    /// From governor and machine, as in a recording.
    Loop(Box<(Governor, Machine)>),
    /// From an earlier run or a script, by command period.
    Given(&'a [Inputs]),
}

/// What a run leaves behind.
struct RigRun {
    streams: GeneratedStreams,
    /// Inputs by command period.
    inputs: Vec<Inputs>,
    /// True readings by command period.
    readings: Vec<Signals>,
}

impl TestRig {
    /// Records a process.
    pub(crate) fn record(&self, process: Process) -> (GeneratedStreams, Vec<Inputs>) {
        let random = RandomStreams { seed: self.seed, process };
        let script = self.script(process);
        let governor = Governor::new(script, random.of(Purpose::Command));
        let machine = Machine::new(&self.parameters, &script, random.of(Purpose::Grid));
        let start_pu = script.initial_opening_pu;
        let run = self.run(process, RigInputs::Loop(Box::new((governor, machine))), start_pu, &self.sensors);
        (run.streams, run.inputs)
    }

    /// Records what the plant does under a test, brought to its first opening before.
    pub(crate) fn answer(&self, test: &TestScript) -> GeneratedStreams {
        let tank_pressure_pa = self.parameters.oil.tank_pressure_pa;
        let inputs: Vec<Inputs> = test.frames(tank_pressure_pa).iter().map(|frame| frame.inputs).collect();
        self.run(Process::LoadIncrease, RigInputs::Given(&inputs), test.start_pu, &self.sensors).streams
    }

    /// What the transducers would show without noise under given inputs, every 10 ms.
    pub(crate) fn readings(&self, process: Process, inputs: &[Inputs]) -> Vec<Signals> {
        let start_pu = self.script(process).initial_opening_pu;
        self.run(process, RigInputs::Given(inputs), start_pu, &Sensors::default()).readings
    }

    fn script(&self, process: Process) -> ProcessScript {
        ProcessScript::new(process, self.ticks as f64 * 1e-3, &RandomStreams { seed: self.seed, process })
    }

    #[expect(clippy::too_many_lines, reason = "one timetable of a tick, in its order")]
    fn run(&self, process: Process, mut source: RigInputs<'_>, start_pu: f64, sensors: &Sensors) -> RigRun {
        let random = RandomStreams { seed: self.seed, process };
        let place = 1 + process as u64;
        let transducer = |sensor: Sensor, purpose| Transducer::new(sensor, random.of(purpose));
        let mut spool = transducer(sensors.spool_position_pu, Purpose::Spool);
        let mut servomotor = transducer(sensors.servomotor_position_pu, Purpose::Servomotor);
        let mut pilot_valve = transducer(sensors.pilot_valve_position_pu, Purpose::PilotValve);
        let mut control_pressure = transducer(sensors.control_pressure_pa, Purpose::ControlPressure);
        let mut tank = transducer(sensors.tank_pressure_pa, Purpose::TankPressure);
        let mut controller = Controller {
            servomotor: transducer(sensors.servomotor_position_pu, Purpose::RegulatorServomotor),
            spool: transducer(sensors.spool_position_pu, Purpose::RegulatorSpool),
            draw: Draw::new(self.seed, crate::battery::draws::Question::Time, place),
            sent: VecDeque::new(),
            arrived_pu: start_pu,
            next_tick: -SETTLING_TICKS,
            demand_pu: 0.0,
            plays_pu: [0.0; 4],
            gap_until: 0,
        };
        let mut clock = Draw::new(self.seed, crate::battery::draws::Question::Time, 16 + place);
        let mut rig = Rig::new(&self.parameters, &self.faults, &self.odd, start_pu);
        let mut inputs = Inputs {
            opening_command_pu: start_pu,
            esv: EsvState::Normal,
            tank_pressure_pa: self.parameters.oil.tank_pressure_pa,
            piston_force_n: 0.0,
        };
        let begin_ns = EPOCH_NS + 3_600_000_000_000 * (1 + process as i64);
        let offset_s = self.faults.clock_offset_s;
        let mut run = RigRun { streams: GeneratedStreams::default(), inputs: vec![], readings: vec![] };
        let (mut tripped_at, mut esv_due) = (None, 0);
        for tick in -SETTLING_TICKS..=self.ticks {
            let time_s = tick as f64 * 1e-3;
            if tick >= 0 {
                let time_ns = begin_ns + tick * TICK_NS;
                let jitter_s = if offset_s == 0.0 { 0.0 } else { 2e-4 * clock.normal().clamp(-3.0, 3.0) };
                let stamp_ns = time_ns + nanos_from_seconds(offset_s * (1.0 + 2e-4 * time_s) + jitter_s);
                if tick % CONTROL_TICKS == 0 {
                    let before = inputs.esv;
                    match &mut source {
                        RigInputs::Loop(around) => {
                            let (governor, machine) = &mut **around;
                            machine.advance(rig.opening_pu(), rig.piston_m_s(), governor.is_on_grid());
                            let command = governor.command(time_s, machine.speed_pu);
                            inputs = Inputs {
                                opening_command_pu: command.opening_pu,
                                esv: command.esv,
                                tank_pressure_pa: machine.tank_pressure_pa,
                                piston_force_n: 0.0,
                            };
                        }
                        RigInputs::Given(given) => {
                            let last = given.len().saturating_sub(1);
                            let at = usize::try_from(tick / CONTROL_TICKS).map_or(0, |at| at.min(last));
                            inputs = given.get(at).copied().unwrap_or(inputs);
                        }
                    }
                    if inputs.esv != before {
                        // A slow recorder writes a change down with its next row.
                        esv_due = tick + (self.row_ticks - tick % self.row_ticks) % self.row_ticks;
                        tripped_at = (inputs.esv == EsvState::Shutdown).then_some(tick);
                    }
                    run.inputs.push(inputs);
                    run.readings.push(Signals {
                        spool_position_pu: rig.spool_reading_pu(),
                        servomotor_position_pu: rig.servomotor_reading_pu(),
                        pilot_valve_position_pu: rig.pilot_position_pu(),
                        control_pressure_pa: rig.control_pressure_pa(),
                    });
                }
                if tick == esv_due {
                    esv_due += ESV_TICKS;
                    run.streams.esv.push((stamp_ns, inputs.esv));
                }
                if tick % TANK_TICKS.max(self.row_ticks) == 0 {
                    run.streams.tank_pressure.push((time_ns, tank.read(inputs.tank_pressure_pa)));
                }
                if tick % self.row_ticks == 0 {
                    let mut measured = Signals {
                        spool_position_pu: spool.read(rig.spool_reading_pu()),
                        servomotor_position_pu: servomotor.read(rig.servomotor_reading_pu()),
                        ..Signals::NONE
                    };
                    if self.rich {
                        measured.pilot_valve_position_pu = pilot_valve.read(rig.pilot_position_pu());
                        measured.control_pressure_pa = control_pressure.read(rig.control_pressure_pa());
                    }
                    run.streams.command.push((stamp_ns, inputs.opening_command_pu));
                    run.streams.servo_state.push((time_ns, measured));
                }
            }
            let current_pu = controller.current_pu(self, &rig, tick, inputs.opening_command_pu);
            let since_s = tripped_at.map(|at| (tick - at) as f64 * 1e-3 - self.dead_time_s());
            let esv_open = since_s.is_none_or(|since_s| since_s < 0.0);
            rig.tick(&Hand {
                time_s,
                current_pu,
                esv_open,
                tripped_s: since_s.unwrap_or(0.0).max(0.0),
                tank_pa: inputs.tank_pressure_pa,
            });
        }
        run.streams.fill_start(begin_ns);
        run
    }

    /// Dead time of the ESV, s: its slide takes the rest of the labelled time.
    fn dead_time_s(&self) -> f64 {
        (self.faults.esv_delay_s - 0.5 * self.odd.esv_travel_s).max(0.0)
    }
}

/// The digital regulator with its clock, its queue of commands and its transducers.
struct Controller {
    servomotor: Transducer,
    spool: Transducer,
    draw: Draw,
    sent: VecDeque<f64>,
    arrived_pu: f64,
    next_tick: i64,
    demand_pu: f64,
    plays_pu: [f64; 4],
    gap_until: i64,
}

impl Controller {
    /// The current to the pilot valve in a tick, pu.
    fn current_pu(&mut self, bench: &TestRig, rig: &Rig, tick: i64, command_pu: f64) -> f64 {
        let (p, faults) = (&bench.parameters.regulator, &bench.faults);
        self.arrive(faults, tick, command_pu);
        let spool_pu = self.spool.read(rig.spool_reading_pu());
        if tick >= self.next_tick {
            let extra = faults.cycle_extra_s * 1e3 * self.draw.between(0.9, 1.1);
            #[expect(clippy::cast_possible_truncation, reason = "a period in ticks")]
            let period = (p.large_loop_period_s * 1e3 + extra).round().max(1.0) as i64;
            self.next_tick = tick + period;
            let readings_pu = (0..bench.readings).map(|_| self.servomotor.read(rig.servomotor_reading_pu()));
            let error_pu =
                spanned(self.arrived_pu, faults.command_gain) - readings_pu.sum::<f64>() / f64::from(bench.readings);
            let jump_pu = if error_pu >= p.deadband_upper_pu {
                p.compensation_positive_pu
            } else if error_pu <= p.deadband_lower_pu {
                p.compensation_negative_pu
            } else {
                -p.position_gain * error_pu
            };
            self.demand_pu =
                (p.position_gain * error_pu + jump_pu).clamp(p.spool_command_min_pu, p.spool_command_max_pu);
        }
        let wanted_pu = p.spool_gain * (self.demand_pu - spool_pu - p.spool_reference_pu) + p.current_reference_pu;
        let mut current_pu = wanted_pu.clamp(-1.0, 1.0);
        if faults.current_limit_pu < 0.0 {
            current_pu = sagging(current_pu, 1.0 + faults.current_limit_pu, tick as f64 * 1e-3);
        }
        if faults.pv_hysteresis_pu > 0.0 {
            rounded_loop(current_pu, &mut self.plays_pu, faults.pv_hysteresis_pu)
        } else {
            current_pu
        }
    }

    /// The command's way to the regulator: dead time, a lag, gaps.
    fn arrive(&mut self, faults: &Faults, tick: i64, command_pu: f64) {
        self.sent.push_back(command_pu);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a delay in ticks")]
        let wait = (faults.command_delay_s * 700.0).round().max(0.0) as usize;
        while self.sent.len() > wait + 1 {
            self.sent.pop_front();
        }
        let coming_pu = self.sent.front().copied().unwrap_or(command_pu);
        if faults.dropout_s > 0.0 {
            if tick < self.gap_until {
                return;
            }
            // A gap begins every other second or so.
            if tick % CONTROL_TICKS == 0 && self.draw.chance(0.01) {
                #[expect(clippy::cast_possible_truncation, reason = "a length in ticks")]
                let length = (faults.dropout_s * 1e3 * self.draw.between(0.5, 1.5)).round() as i64;
                self.gap_until = tick + length;
            }
        }
        let lag_s = 0.3 * faults.command_delay_s;
        self.arrived_pu = if lag_s > 0.0 {
            self.arrived_pu + (coming_pu - self.arrived_pu) * (-(-1e-3 / lag_s).exp_m1())
        } else {
            coming_pu
        };
    }
}
