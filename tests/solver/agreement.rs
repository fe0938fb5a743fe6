//! Agreement: every method gives the same trajectory within a stated bound, in every process.

use govtwin_model::frame::Estimate;
use govtwin_model::recording::Process;
use govtwin_model::solver::Method;
use govtwin_model::twin::Twin;

use super::rows::{TICK_NS, process, rows, run};

/// Every method at a step that resolves the chain.
pub const METHODS: [Method; 3] = [
    Method::Split { max_step_s: govtwin_model::solver::split::SPOOL_STEP_S },
    Method::Rk4 { max_step_s: 5.0e-5 },
    Method::Rosenbrock { max_step_s: 1.0e-4 },
];

/// Greatest difference of a signal over a process, and its bound.
fn close(which: Process, method: Method, signal: fn(&Estimate) -> f64, bound: f64) {
    let unit = govtwin_model::params::reference();
    let rows = rows(9.0, TICK_NS, |time_s| process(which, time_s));
    let reference = run(&Twin::with_method(&unit, Method::Rk4 { max_step_s: 2.5e-5 }), &rows);
    let estimates = run(&Twin::with_method(&unit, method), &rows);
    let apart = estimates.iter().zip(&reference).map(|(a, b)| (signal(a) - signal(b)).abs()).fold(0.0, f64::max);
    assert!(apart <= bound, "{}, {method:?}: {apart:e}", which.id());
}

/// The reference unit's methods follow each other's servomotor to a few millionths of its stroke at every tick.
///
/// ROS2 linearises friction at a step's start and so starts late from rest.
#[test]
fn every_method_moves_the_servomotor_alike() {
    for which in Process::ALL {
        for (method, bound) in METHODS.into_iter().zip([5e-6, 1e-8, 2e-4]) {
            close(which, method, |e| e.signals.servomotor_position_pu, bound);
        }
    }
}
