//! The governor around the servo system: start-up limit, PID with temporary and permanent droop, trip.
//!
//! Off the grid `u = K_p e + ∫ K_i e + K_d e'`, `e = 1 − n`, `K_p = 1/b_t`, `K_i = 1/(b_t T_d)`, `K_d = T_n/b_t`; on it `u = c + y`,
//! `y = K_p (1 − n) + ∫ K_i (1 − n − b_p y)`: temporary droop b_t, permanent droop b_p, dashpot time T_d, set point c
//! (IEEE Working Group 1992, IEEE Transactions on Power Systems 7(1), 167–179). The command is limited in
//! rate and carries the white noise of its line.

use crate::generate::noise::Draws;
use crate::generate::script::ProcessScript;
use govtwin_model::frame::EsvState;

/// Time between two commands, s.
const PERIOD_S: f64 = 0.010;
/// Temporary droop `b_t`, speed per opening.
const TEMPORARY_DROOP: f64 = 0.25;
/// Permanent droop `b_p`, speed per opening.
const PERMANENT_DROOP: f64 = 0.04;
/// Dashpot time `T_d`, s.
const DASHPOT_TIME_S: f64 = 5.0;
/// Derivative time `T_n`, s.
const DERIVATIVE_TIME_S: f64 = 0.3;
/// Filter of the derivative, s.
const DERIVATIVE_FILTER_S: f64 = 0.2;
/// Speed at which the start-up limit hands over to speed control, pu.
const HANDOVER_SPEED_PU: f64 = 0.95;
/// Fastest opening under speed control, pu/s.
const OPENING_PU_S: f64 = 0.12;
/// Noise of the command line, one standard deviation, pu.
const COMMAND_NOISE_PU: f64 = 1.0e-4;

/// The output of the governor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GovernorOutput {
    /// Guide-vane opening, pu.
    pub opening_pu: f64,
    /// State of the emergency shutdown valve.
    pub esv: EsvState,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Standing,
    Starting,
    OnGrid,
    Speed,
    Tripped,
}

/// The governor and its memory.
#[derive(Clone, Debug)]
pub struct Governor {
    script: ProcessScript,
    draws: Draws,
    mode: Mode,
    set_pu: f64,
    opening_pu: f64,
    integral_pu: f64,
    filtered_speed_pu: f64,
}

impl Governor {
    /// A governor at the start of its script.
    pub fn new(script: ProcessScript, draws: Draws) -> Self {
        let (mode, speed_pu) = if script.stands_still { (Mode::Standing, 0.0) } else { (Mode::OnGrid, 1.0) };
        Self {
            script,
            draws,
            mode,
            set_pu: script.initial_opening_pu,
            opening_pu: script.initial_opening_pu,
            integral_pu: 0.0,
            filtered_speed_pu: speed_pu,
        }
    }

    /// Whether the breaker is closed.
    pub fn is_on_grid(&self) -> bool {
        self.mode == Mode::OnGrid
    }

    /// The command at a time and a speed; called every 10 ms.
    pub fn command(&mut self, time_s: f64, speed_pu: f64) -> GovernorOutput {
        self.filtered_speed_pu += (speed_pu - self.filtered_speed_pu) * PERIOD_S / (PERIOD_S + DERIVATIVE_FILTER_S);
        self.change_mode(time_s, speed_pu);
        match self.mode {
            Mode::Standing => {}
            Mode::Starting => {
                self.opening_pu =
                    (self.opening_pu + self.script.ramp_pu_s * PERIOD_S).min(self.script.start_opening_pu);
            }
            Mode::OnGrid => self.follow_grid(time_s, speed_pu),
            Mode::Speed => self.hold_speed(speed_pu),
            Mode::Tripped => self.opening_pu = 0.0,
        }
        if self.mode == Mode::Tripped {
            return GovernorOutput { opening_pu: 0.0, esv: EsvState::Shutdown };
        }
        let noise_pu = COMMAND_NOISE_PU * self.draws.normal();
        GovernorOutput { opening_pu: self.opening_pu + noise_pu, esv: EsvState::Normal }
    }

    fn change_mode(&mut self, time_s: f64, speed_pu: f64) {
        self.mode = match self.mode {
            Mode::Standing if time_s >= self.script.start_s => Mode::Starting,
            Mode::Starting if speed_pu >= HANDOVER_SPEED_PU => {
                // Bumpless: speed control takes over at the opening that it finds.
                self.integral_pu = self.opening_pu - self.proportional_pu(speed_pu);
                Mode::Speed
            }
            Mode::OnGrid | Mode::Speed if time_s >= self.script.trip_s => Mode::Tripped,
            Mode::OnGrid if time_s >= self.script.breaker_opens_s => {
                self.integral_pu = self.script.no_load_opening_pu;
                Mode::Speed
            }
            unchanged => unchanged,
        };
    }

    fn follow_grid(&mut self, time_s: f64, speed_pu: f64) {
        if let Some(step) = self.script.steps.iter().rfind(|step| time_s >= step.time_s) {
            let reach_pu = self.script.ramp_pu_s * PERIOD_S;
            self.set_pu += (step.opening_pu - self.set_pu).clamp(-reach_pu, reach_pu);
        }
        let correction_pu = (1.0 - speed_pu) / TEMPORARY_DROOP + self.integral_pu;
        self.integral_pu +=
            (1.0 - speed_pu - PERMANENT_DROOP * correction_pu) * PERIOD_S / (TEMPORARY_DROOP * DASHPOT_TIME_S);
        self.opening_pu = (self.set_pu + correction_pu).clamp(0.0, 1.0);
    }

    fn hold_speed(&mut self, speed_pu: f64) {
        let error = 1.0 - speed_pu;
        let wanted_pu = self.proportional_pu(speed_pu) + self.integral_pu;
        let lowest_pu = (self.opening_pu - self.script.closing_pu_s * PERIOD_S).max(0.0);
        let highest_pu = (self.opening_pu + OPENING_PU_S * PERIOD_S).min(1.0);
        self.opening_pu = wanted_pu.clamp(lowest_pu, highest_pu);
        // No windup while a limit holds.
        if self.opening_pu == wanted_pu {
            self.integral_pu += error * PERIOD_S / (TEMPORARY_DROOP * DASHPOT_TIME_S);
        }
    }

    /// Proportional and derivative part, pu.
    fn proportional_pu(&self, speed_pu: f64) -> f64 {
        let rate_1_s = (speed_pu - self.filtered_speed_pu) / DERIVATIVE_FILTER_S;
        (1.0 - speed_pu - DERIVATIVE_TIME_S * rate_1_s) / TEMPORARY_DROOP
    }
}
