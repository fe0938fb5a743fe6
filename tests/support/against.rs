//! The default method against the reference method on a recording: how far apart, and whether the dead band decided alike.

use govtwin_model::frame::{Frame, Signals};
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::solver::Method;
use govtwin_model::twin::{Cut, Twin};

/// The reference: its own error is below 1e-7 pu.
pub const REFERENCE: Method = Method::Rk4 { max_step_s: 5.0e-5 };

/// Period of the regulator's large loop and of its decisions, ns.
const PERIOD_NS: i64 = 10_000_000;

/// The difference of two methods over a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// Root mean square over the rows: spool and servomotor, pu.
    pub rms_pu: [f64; 2],
    /// Decisions of the large loop (open, hold, close) that came out otherwise.
    pub flips: usize,
}

/// Where a run is at every row, and what its large loop decided every 10 ms.
struct Path {
    positions_pu: Vec<[f64; 2]>,
    decisions: Vec<i8>,
}

/// Runs a method over a recording, looking between the rows as well: rows that say nothing new change nothing.
fn run(unit: &Unit, method: Method, cut: Cut, recording: &Recording) -> Path {
    let mut twin = Twin::with_method(unit, method).with_cut(cut);
    let mut path = Path { positions_pu: Vec::new(), decisions: Vec::new() };
    let Some(first) = recording.frames.first() else { return path };
    // A millisecond after each of the large loop's instants its output is in force.
    let mut look_ns = first.time_ns + PERIOD_NS / 10;
    let mut in_force = *first;
    for frame in &recording.frames {
        // A measured spool runs straight to its next row, which a look between the two would not know.
        while cut != Cut::Spool && look_ns < frame.time_ns {
            let look = Frame { time_ns: look_ns, measured: Signals::NONE, ..in_force };
            let demand_pu = twin.step(&look).spool_command_pu;
            path.decisions.push(if demand_pu == 0.0 { 0 } else { demand_pu.signum() as i8 });
            look_ns += PERIOD_NS;
        }
        in_force = *frame;
        let signals = twin.step(frame).signals;
        path.positions_pu.push([signals.spool_position_pu, signals.servomotor_position_pu]);
    }
    path
}

/// How far the default method is from the reference on a recording.
pub fn apart(unit: &Unit, cut: Cut, recording: &Recording) -> Apart {
    let (one, other) = (run(unit, Method::default(), cut, recording), run(unit, REFERENCE, cut, recording));
    let rms_pu = |signal: usize| {
        let square = |(a, b): (&[f64; 2], &[f64; 2])| (a[signal] - b[signal]).powi(2);
        let sum: f64 = one.positions_pu.iter().zip(&other.positions_pu).map(square).sum();
        (sum / one.positions_pu.len() as f64).sqrt()
    };
    Apart {
        rms_pu: [rms_pu(0), rms_pu(1)],
        flips: one.decisions.iter().zip(&other.decisions).filter(|(a, b)| a != b).count(),
    }
}
