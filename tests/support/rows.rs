//! Rows for twins under test: inputs as functions of time, the four processes, and a run through a twin.

use govtwin_model::frame::{Estimate, EsvState, Frame, Inputs, Signals};
use govtwin_model::recording::Process;
use govtwin_model::twin::Twin;

/// One millisecond, the small loop's period.
pub const TICK_NS: i64 = 1_000_000;

/// Rows every `period_ns` from 0 up to `duration_s`, with nothing measured.
pub fn rows(duration_s: f64, period_ns: i64, inputs: impl Fn(f64) -> Inputs) -> Vec<Frame> {
    let row = |time_ns: i64| Frame { time_ns, inputs: inputs(time_ns as f64 * 1e-9), measured: Signals::NONE };
    (0..).map(|k| k * period_ns).take_while(|time_ns| *time_ns as f64 * 1e-9 <= duration_s + 1e-12).map(row).collect()
}

/// Inputs with the ESV at rest and the sheet's tank pressure.
pub fn command(opening_command_pu: f64) -> Inputs {
    Inputs { opening_command_pu, esv: EsvState::Normal, tank_pressure_pa: 6.3e6, piston_force_n: 0.0 }
}

/// A process as a command, an ESV and a tank that sags while oil is drawn; it starts at rest.
pub fn process(process: Process, time_s: f64) -> Inputs {
    let ramp = |from_s: f64, to_s: f64| ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
    let (opening_command_pu, tripped) = match process {
        Process::Startup => {
            (0.24 * ramp(0.5, 2.0) - 0.09 * ramp(4.0, 6.0) + 0.004 * (1.7 * time_s).sin() * ramp(6.0, 7.0), false)
        }
        Process::LoadIncrease => (0.2 + 0.45 * ramp(0.5, 6.5) + 0.02 * (0.9 * time_s).sin() * ramp(0.5, 2.0), false),
        Process::Shutdown => (0.6 * (1.0 - ramp(1.5, 4.0)), time_s >= 1.2),
        Process::LoadRejection => (0.85 - 0.7 * ramp(0.8, 1.0) + 0.05 * ramp(5.0, 7.0), false),
    };
    let esv = if tripped { EsvState::Shutdown } else { EsvState::Normal };
    Inputs {
        opening_command_pu,
        esv,
        tank_pressure_pa: 6.3e6 - 1.5e5 * ramp(0.5, 4.0) + 0.8e5 * ramp(5.0, 9.0),
        piston_force_n: 0.0,
    }
}

/// Runs rows through a twin from its start.
pub fn run(twin: &Twin, rows: &[Frame]) -> Vec<Estimate> {
    let mut twin = twin.clone();
    twin.reset();
    rows.iter().map(|row| twin.step(row)).collect()
}
