//! What happens in a process, and when: set points, limits, breaker and trip, drawn within what plants do.

use crate::generate::noise::{Purpose, RandomStreams};
use govtwin_model::recording::Process;

/// A set point of the opening that the operator gives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetPoint {
    /// When, s from the start.
    pub time_s: f64,
    /// The opening wanted, pu.
    pub opening_pu: f64,
}

/// The course of one process; times that never come are infinite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProcessScript {
    /// Opening at the start, pu.
    pub initial_opening_pu: f64,
    /// Opening at which the machine turns at nominal speed without load, pu.
    pub no_load_opening_pu: f64,
    /// Starting time of rotor and turbine at rated torque, s.
    pub mechanical_time_s: f64,
    /// Starting time of the water, s.
    pub water_time_s: f64,
    /// Whether the machine is at standstill at the start; else it is on the grid.
    pub stands_still: bool,
    /// Start order, s.
    pub start_s: f64,
    /// Opening limit of the start-up, pu.
    pub start_opening_pu: f64,
    /// Set points on the grid, in time.
    pub steps: [SetPoint; 3],
    /// How far the grid's frequency walks, over an ordinary grid's.
    pub grid_unrest_ratio: f64,
    /// Rate at which set point and start-up limit move, pu/s.
    pub ramp_pu_s: f64,
    /// Fastest closing that the governor commands, pu/s.
    pub closing_pu_s: f64,
    /// Breaker opens, s.
    pub breaker_opens_s: f64,
    /// The emergency shutdown valve trips, s.
    pub trip_s: f64,
}

/// A set point that never comes.
const NEVER: SetPoint = SetPoint { time_s: f64::INFINITY, opening_pu: 0.0 };

impl ProcessScript {
    /// Draws the course of a process over a recording of `duration_s`.
    pub fn new(process: Process, duration_s: f64, random: &RandomStreams) -> Self {
        let mut machine = random.of(Purpose::Machine);
        let no_load_opening_pu = machine.between(0.10, 0.13);
        let mechanical_time_s = machine.between(5.5, 8.0);
        let water_time_s = machine.between(0.8, 1.6);
        let mut draws = random.of(Purpose::Script);
        let begin_s = draws.between(2.0, 5.0);
        let mut script = Self {
            initial_opening_pu: 0.0,
            no_load_opening_pu,
            mechanical_time_s,
            water_time_s,
            stands_still: false,
            start_s: f64::INFINITY,
            start_opening_pu: draws.between(0.24, 0.29),
            steps: [NEVER; 3],
            grid_unrest_ratio: draws.between(-0.8, 1.0).max(0.0),
            ramp_pu_s: draws.between(0.04, 0.07),
            closing_pu_s: draws.between(0.42, 0.52),
            breaker_opens_s: f64::INFINITY,
            trip_s: f64::INFINITY,
        };
        let step = |time_s, opening_pu| SetPoint { time_s, opening_pu };
        match process {
            Process::Startup => {
                script.stands_still = true;
                script.start_s = begin_s;
            }
            Process::LoadIncrease => {
                script.grid_unrest_ratio = draws.between(0.7, 1.3);
                let (low_pu, high_pu) = (draws.between(0.22, 0.32), draws.between(0.55, 0.72));
                let top_pu = high_pu + draws.between(0.08, 0.15);
                script.initial_opening_pu = low_pu;
                script.steps = [
                    step(begin_s, high_pu),
                    step(duration_s * draws.between(0.45, 0.52), top_pu),
                    step(duration_s * draws.between(0.75, 0.80), top_pu - draws.between(0.04, 0.08)),
                ];
            }
            Process::Shutdown => {
                let load_pu = draws.between(0.40, 0.65);
                let trip_s = duration_s * draws.between(0.57, 0.63);
                script.initial_opening_pu = load_pu;
                script.steps[0] = step(begin_s, no_load_opening_pu + draws.between(0.005, 0.02));
                script.breaker_opens_s = trip_s;
                script.trip_s = trip_s;
            }
            Process::LoadRejection => {
                script.initial_opening_pu = draws.between(0.60, 0.85);
                script.breaker_opens_s = begin_s;
            }
        }
        script
    }
}
