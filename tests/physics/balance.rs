//! Balances over a manoeuvre: oil that flows in is oil that is there, and work that goes in is stored, lost or done.
//!
//! Flows and forces are the textbook's, taken at the twin's own states every 0.1 ms (a small loop that fast is set for this) and
//! integrated by the trapezoidal rule, which errs by (ωh)²/12 = 2e-3 of what rings in the spool's oil column (1,400 rad/s); ringing
//! has no mean, so that 1e-6 of the turnover is left. A blow on a stop ends a speed within one step,
//! and each method has its own way to place it there: up to a step of full flow a blow.

use govtwin_model::frame::{Estimate, Frame};
use govtwin_model::recording::Process;
use govtwin_model::solver::Method;
use govtwin_model::twin::Twin;

use super::METHODS;
use super::rows::{process, rows, run};
use super::textbook::{
    BULK_MODULUS_PA, CLOSING_AREA_M2, CONTROL_AREA_M2, MOVING_MASS_KG, OPENING_AREA_M2, SPOOL_MASS_KG,
    closing_volume_m3, control_flow_m3_s, control_volume_m3, load_n, opening_volume_m3, piston_friction_n, piston_m,
    ports, spool_force_n, spool_m,
};

/// Step of the small loop and of the rows, s.
const STEP_S: f64 = 1.0e-4;

/// A process with a small loop of 0.1 ms.
fn fine(method: Method, which: Process) -> (Vec<Frame>, Vec<Estimate>) {
    let mut unit = govtwin_model::params::reference();
    unit.parameters.regulator.small_loop_period_s = STEP_S;
    let rows = rows(9.0, 100_000, |time_s| process(which, time_s));
    let estimates = run(&Twin::with_method(&unit, method), &rows);
    (rows, estimates)
}

/// ∫ f dt by the trapezoidal rule.
fn over_time(rows: &[Frame], estimates: &[Estimate], f: impl Fn(&Estimate, &Frame) -> f64) -> f64 {
    // A row's inputs hold from it on, so that both ends of a step use those of its start.
    (1..rows.len()).map(|k| 0.5 * STEP_S * (f(&estimates[k - 1], &rows[k - 1]) + f(&estimates[k], &rows[k - 1]))).sum()
}

/// ∫ f dg by the trapezoidal rule.
fn over(estimates: &[Estimate], f: impl Fn(&Estimate) -> f64, g: impl Fn(&Estimate) -> f64) -> f64 {
    estimates.windows(2).map(|pair| 0.5 * (f(&pair[0]) + f(&pair[1])) * (g(&pair[1]) - g(&pair[0]))).sum()
}

fn span(estimates: &[Estimate], f: impl Fn(&Estimate) -> f64) -> f64 {
    f(&estimates[estimates.len() - 1]) - f(&estimates[0])
}

/// Asserts `a = b` within a share of the larger `scale`.
fn balanced(a: f64, b: f64, scale: f64, share: f64, what: &str) {
    eprintln!("{what}: {:e}", (a - b).abs() / scale);
    assert!((a - b).abs() <= 1.0 + share * scale, "{what}: {a} against {b}, {:e} of {scale}", (a - b).abs() / scale);
}

/// The share of its turnover within which a chamber's volume is balanced: spool and piston strike their stops or not.
fn share(which: Process, method: Method) -> f64 {
    match (which, method) {
        (Process::LoadIncrease | Process::LoadRejection, _) => 2e-6,
        (_, Method::Rosenbrock { .. }) => 2e-2,
        _ => 1e-3,
    }
}

#[test]
fn volume_is_balanced_in_every_chamber() {
    for method in METHODS {
        for which in Process::ALL {
            let (rows, estimates) = fine(method, which);
            let bound = share(which, method);
            let name = |chamber: &str| format!("{chamber}, {}, {method:?}", which.id());

            let inflow = over_time(&rows, &estimates, |e, row| control_flow_m3_s(e, &row.inputs));
            let turnover = over_time(&rows, &estimates, |e, row| control_flow_m3_s(e, &row.inputs).abs());
            let squeezed =
                over(&estimates, |e| control_volume_m3(e) / BULK_MODULUS_PA, |e| e.signals.control_pressure_pa);
            let swept = CONTROL_AREA_M2 * span(&estimates, spool_m);
            balanced(inflow, swept + squeezed, turnover, bound, &name("control"));

            let inflow = over_time(&rows, &estimates, |e, row| ports(e, &row.inputs).opening);
            let turnover = over_time(&rows, &estimates, |e, row| ports(e, &row.inputs).opening.abs());
            let squeezed =
                over(&estimates, |e| opening_volume_m3(e) / BULK_MODULUS_PA, |e| e.opening_chamber_pressure_pa);
            let swept = OPENING_AREA_M2 * span(&estimates, piston_m);
            balanced(inflow, swept + squeezed, turnover, bound, &name("opening"));

            let inflow = over_time(&rows, &estimates, |e, row| ports(e, &row.inputs).closing);
            let turnover = over_time(&rows, &estimates, |e, row| ports(e, &row.inputs).closing.abs());
            let squeezed =
                over(&estimates, |e| closing_volume_m3(e) / BULK_MODULUS_PA, |e| e.closing_chamber_pressure_pa);
            let swept = -CLOSING_AREA_M2 * span(&estimates, piston_m);
            balanced(inflow, swept + squeezed, turnover, bound, &name("closing"));
        }
    }
}

#[test]
fn energy_is_balanced_in_the_servomotor() {
    for method in METHODS {
        // Not to the stops, where a blow turns kinetic energy into heat at once.
        for which in [Process::Startup, Process::LoadIncrease, Process::LoadRejection] {
            let (rows, estimates) = fine(method, which);
            let supplied = over_time(&rows, &estimates, |e, row| ports(e, &row.inputs).supplied_w);
            let heat = over_time(&rows, &estimates, |e, row| ports(e, &row.inputs).heat_w)
                + over_time(&rows, &estimates, |e, _| piston_friction_n(e) * e.servomotor_velocity_m_s);
            let kinetic = span(&estimates, |e| 0.5 * MOVING_MASS_KG * e.servomotor_velocity_m_s.powi(2));
            let compressed = over(
                &estimates,
                |e| e.opening_chamber_pressure_pa * opening_volume_m3(e) / BULK_MODULUS_PA,
                |e| e.opening_chamber_pressure_pa,
            ) + over(
                &estimates,
                |e| e.closing_chamber_pressure_pa * closing_volume_m3(e) / BULK_MODULUS_PA,
                |e| e.closing_chamber_pressure_pa,
            );
            let load = over(&estimates, load_n, piston_m);
            let name = format!("{}, {method:?}", which.id());
            balanced(supplied, kinetic + compressed + heat + load, heat.abs() + load.abs(), 1e-6, &name);
        }
    }
}

#[test]
fn work_is_balanced_at_the_spool() {
    for method in METHODS {
        for which in [Process::Startup, Process::LoadIncrease] {
            let (rows, estimates) = fine(method, which);
            let power = |e: &Estimate, row: &Frame| {
                (e.signals.control_pressure_pa * CONTROL_AREA_M2 + spool_force_n(e, &row.inputs)) * e.spool_velocity_m_s
            };
            let chamber = over_time(&rows, &estimates, |e, _| {
                (e.signals.control_pressure_pa * CONTROL_AREA_M2 * e.spool_velocity_m_s).abs()
            });
            let work = over_time(&rows, &estimates, power);
            let kinetic = span(&estimates, |e| 0.5 * SPOOL_MASS_KG * e.spool_velocity_m_s.powi(2));
            balanced(work, kinetic, chamber, 1e-5, &format!("spool, {}, {method:?}", which.id()));
        }
    }
}
