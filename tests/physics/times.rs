//! How fast things move: the spool's stroke, the ESV's trip, the servomotor's closing time.

use govtwin_model::frame::{Estimate, EsvState, Frame, Inputs, Signals};
use govtwin_model::plant::steady::steady;
use govtwin_model::plant::{Drive, Plant};
use govtwin_model::solver::{Method, Solver};
use govtwin_model::twin::Twin;

use super::METHODS;
use super::rows::{TICK_NS, command, rows, run};

/// Rows every tick, the first of which says where spool and servomotor stand.
fn from(spool_pu: f64, servomotor_pu: f64, duration_s: f64, inputs: impl Fn(f64) -> Inputs) -> Vec<Frame> {
    let mut rows = rows(duration_s, TICK_NS, inputs);
    rows[0].measured = Signals { spool_position_pu: spool_pu, servomotor_position_pu: servomotor_pu, ..Signals::NONE };
    rows
}

/// Time of the first estimate for which `reached` holds, s.
fn when(estimates: &[Estimate], reached: impl Fn(&Estimate) -> bool) -> f64 {
    let first = estimates.iter().find(|estimate| reached(estimate));
    first.map_or(f64::NAN, |estimate| (estimate.time_ns - estimates[0].time_ns) as f64 * 1e-9)
}

fn reference(method: Method) -> Twin {
    Twin::with_method(&govtwin_model::params::reference(), method)
}

/// Time from neutral to a stop with the valve's current at a limit throughout, s.
///
/// The small loop eases its current off near the closing nut, so this drives the plant below the regulator.
fn spool_stroke_s(method: Method, current_pu: f64) -> f64 {
    let plant = Plant::new(&govtwin_model::params::reference().parameters);
    let drive =
        Drive { valve_current_pu: current_pu, esv_opening_pu: 1.0, tank_pressure_pa: 6.3e6, ..Drive::default() };
    let mut state = steady(&plant, 0.3, Some(0.0), &drive);
    let solver = Solver::new(method, &plant, 1.0e-3);
    let stop_m = if current_pu > 0.0 { plant.spool.stroke_max_m } else { plant.spool.stroke_min_m };
    let mut ticks = 0;
    while state.spool_position_m != stop_m && ticks < 1000 {
        solver.advance(&plant, &mut state, &drive);
        ticks += 1;
    }
    f64::from(ticks) * 1.0e-3
}

#[test]
fn the_spool_crosses_its_stroke_in_a_tenth_of_a_second_under_saturated_current() {
    for method in METHODS {
        // 15 mm to the closing nut; 12 mm to the opening one, counted in proportion.
        for (stroke_s, which) in
            [(spool_stroke_s(method, -1.0), "closing"), (spool_stroke_s(method, 1.0) / 0.8, "opening")]
        {
            assert!((0.10..=0.15).contains(&stroke_s), "{which} takes {stroke_s} s, {method:?}");
        }
    }
}

/// `A Δx / Q` with the valve fully open and the chamber at its balance pressure, plus the valve's own lag `2ζ/ω_n`.
#[test]
fn the_spool_time_is_the_chamber_volume_over_the_rated_flow() {
    let balance_pa = |x: f64| (6.3e6 * 2.5e-3 - 25.0 * 9.81 + 4.0e4 * (0.030 + x)) / 5.0e-3;
    let flow_m3_s = |drop_pa: f64| 6.67e-4 * f64::sqrt(drop_pa / 3.5e6);
    let lag_s = 2.0 * 0.75 / 377.0;
    let closing_s = 5.0e-3 * 0.015 / flow_m3_s(balance_pa(-0.0075) - 0.1e6) + lag_s;
    let opening_s = 5.0e-3 * 0.012 / flow_m3_s(6.3e6 - balance_pa(0.006)) + lag_s;
    for (measured_s, expected_s) in
        [(spool_stroke_s(Method::default(), -1.0), closing_s), (spool_stroke_s(Method::default(), 1.0), opening_s)]
    {
        assert!((measured_s / expected_s - 1.0).abs() < 0.03, "{measured_s} s against {expected_s} s");
    }
}

/// The regulator's own way there: the current saturates until the small loop's last eighth.
#[test]
fn a_large_command_saturates_the_current_up_to_the_nut() {
    let opening = run(&reference(Method::default()), &from(0.0, 0.5, 0.3, |_| command(1.0)));
    let opened_s = when(&opening, |e| e.signals.spool_position_pu >= 0.8);
    assert!((0.08..0.12).contains(&opened_s), "{opened_s} s");
    assert!(opening.iter().skip(1).take(80).all(|e| e.valve_current_pu == 1.0));
}

#[test]
fn an_esv_trip_closes_at_the_stroke_limit() {
    for method in METHODS {
        // The command stays open: the ESV alone closes, whatever the regulator asks for.
        let trip = |time_s: f64| Inputs {
            esv: if time_s >= 0.5 { EsvState::Shutdown } else { EsvState::Normal },
            ..command(0.8)
        };
        let estimates = run(&reference(method), &from(f64::NAN, 0.8, 8.0, trip));
        let tripped_s = when(&estimates, |e| e.signals.spool_position_pu <= -1.0) - 0.5;
        // A Δx over the drain's flow at the chamber's balance pressure: 0.07 s.
        assert!((0.05..0.09).contains(&tripped_s), "spool at its stop {tripped_s} s after the trip");
        for estimate in estimates.iter().filter(|e| e.time_ns > 600_000_000) {
            let y = estimate.signals.spool_position_pu;
            assert!((y + 1.0).abs() < 1e-12, "{method:?}: {y} pu, not at the nut");
        }
        for pair in estimates.windows(2) {
            let (a, b) = (pair[0].signals.servomotor_position_pu, pair[1].signals.servomotor_position_pu);
            assert!(b <= a + 1e-9, "{method:?}: opens from {a} to {b}");
        }
        let last = estimates[estimates.len() - 1];
        assert_eq!(last.signals.servomotor_position_pu, 0.0);
    }
}

/// Seconds from fully open to closed with the spool at the closing nut.
fn closing_time_s(method: Method) -> f64 {
    let shut = Inputs { esv: EsvState::Shutdown, ..command(0.0) };
    let estimates = run(&reference(method), &from(-1.0, 1.0, 10.0, |_| shut));
    when(&estimates, |e| e.signals.servomotor_position_pu <= 0.0)
}

/// The sheet's ports, areas and load give this time, by a closed form that knows no dynamics: at each position the
/// speed at which what the ports pass is what the piston sweeps, `K² x² (P − b w) = (A_o³ + A_c³) w²`.
#[test]
fn the_servomotor_closes_in_the_time_that_its_ports_give() {
    let k = 0.62 * 0.030 * f64::sqrt(2.0 / 870.0) * (0.015 - 2.0e-4);
    let n = 1000;
    let expected_s: f64 = (0..n)
        .map(|i| {
            let y = (f64::from(i) + 0.5) / f64::from(n);
            let push_n = 6.3e6 * 0.18 - 0.1e6 * 0.20 + 1.5e5 + 2.5e5 * y - 4.0e4;
            let a = (0.20_f64.powi(3) + 0.18_f64.powi(3)) / (k * k);
            let w = 2.0 * push_n / (4.0e5 + f64::sqrt(4.0e5_f64.powi(2) + 4.0 * a * push_n));
            0.60 / f64::from(n) / w
        })
        .sum();
    for method in METHODS {
        let measured_s = closing_time_s(method);
        assert!((measured_s - expected_s).abs() < 0.02, "{measured_s} s against {expected_s} s, {method:?}");
        assert!((4.0..=6.0).contains(&measured_s), "{measured_s} s");
    }
}

#[test]
fn a_drained_chamber_comes_to_the_pressure_of_the_return() {
    for method in METHODS {
        // Whether a stiff step swings between two pressures hangs on where the last one before the stop lands.
        for k in 0..20 {
            let mut unit = govtwin_model::params::reference();
            unit.parameters.esv.drain_area_m2 *= 0.9 + 0.01 * f64::from(k);
            let trip = |time_s: f64| Inputs {
                esv: if time_s >= 0.1 { EsvState::Shutdown } else { EsvState::Normal },
                ..command(0.8)
            };
            let estimates = run(&Twin::with_method(&unit, method), &from(f64::NAN, 0.8, 0.6, trip));
            for estimate in estimates.iter().filter(|e| e.time_ns > 400_000_000) {
                let off_pa = estimate.signals.control_pressure_pa - unit.parameters.oil.return_pressure_pa;
                // The leak from supply holds it a little above: well within the orifice's laminar core.
                assert!(
                    (0.0..1e3).contains(&off_pa),
                    "{method:?}, drain {k}: {off_pa} Pa off at {} ns",
                    estimate.time_ns
                );
            }
        }
    }
}
