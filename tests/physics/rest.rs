//! Rest: at every opening the twin stays where it starts, with no net flow anywhere.

use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::solver::Method;
use govtwin_model::twin::Twin;

use super::METHODS;
use super::rows::{command, rows, run};

/// A minute at one opening with an error inside the dead band.
fn minute(opening_pu: f64, error_pu: f64) -> Vec<Frame> {
    let measured = Signals { servomotor_position_pu: opening_pu, ..Signals::NONE };
    rows(60.0, 100_000_000, |_| command(opening_pu + error_pu))
        .into_iter()
        .map(|row| Frame { measured, ..row })
        .collect()
}

fn holds(method: Method, opening_pu: f64, error_pu: f64) {
    let unit = govtwin_model::params::reference();
    let estimates = run(&Twin::with_method(&unit, method), &minute(opening_pu, error_pu));
    let first = estimates[0];
    assert_eq!(first.signals.servomotor_position_pu, opening_pu);
    for estimate in &estimates {
        let near = |a: f64, b: f64, bound: f64, what: &str| {
            assert!((a - b).abs() <= bound, "{method:?} at {opening_pu} pu: {what} is {a}, was {b}, {estimate:?}");
        };
        near(estimate.signals.servomotor_position_pu, opening_pu, 1e-9, "Y");
        near(estimate.signals.spool_position_pu, first.signals.spool_position_pu, 1e-9, "y");
        near(estimate.signals.pilot_valve_position_pu, first.signals.pilot_valve_position_pu, 1e-9, "x_p");
        near(estimate.spool_velocity_m_s, 0.0, 1e-10, "spool speed");
        near(estimate.servomotor_velocity_m_s, 0.0, 1e-10, "piston speed");
        // Pressures that stay say that no chamber has a net flow. 1 Pa is 1e-6 of the smallest.
        near(estimate.signals.control_pressure_pa, first.signals.control_pressure_pa, 1.0, "P_ctrl");
        near(estimate.opening_chamber_pressure_pa, first.opening_chamber_pressure_pa, 1.0, "P_1");
        near(estimate.closing_chamber_pressure_pa, first.closing_chamber_pressure_pa, 1.0, "P_2");
    }
}

#[test]
fn every_opening_holds_for_a_minute() {
    for k in 0..=20 {
        holds(Method::default(), f64::from(k) / 20.0, 0.0);
    }
}

#[test]
fn every_method_holds_with_an_error_inside_the_dead_band() {
    for method in METHODS {
        for (opening_pu, error_pu) in [(0.0, 4.9e-4), (0.37, -4.9e-4), (1.0, -4.9e-4)] {
            holds(method, opening_pu, error_pu);
        }
    }
}

#[test]
fn a_valve_whose_null_is_off_rests_off_neutral_and_holds() {
    let mut unit = govtwin_model::params::reference();
    unit.parameters.regulator.current_reference_pu = 0.01;
    let estimates = run(&Twin::new(&unit), &minute(0.5, 0.0));
    // With no flow the small loop's current is the leak's, so that y = (I_r − u)/K2.
    for estimate in &estimates {
        let expected_pu = (0.01 - estimate.signals.pilot_valve_position_pu) / 8.0;
        assert!((estimate.signals.spool_position_pu - expected_pu).abs() < 1e-9);
        assert!((estimate.signals.servomotor_position_pu - 0.5).abs() < 1e-9);
    }
}

#[test]
fn the_pilot_passes_the_leak_and_the_forces_balance() {
    let unit = govtwin_model::params::reference();
    let first = run(&Twin::new(&unit), &minute(0.4, 0.0))[0];
    let (p_s, p_t, p) = (6.3e6, 0.1e6, first.signals.control_pressure_pa);
    let x = first.signals.spool_position_pu * 0.015;
    assert!((p * 5.0e-3 - p_s * 2.5e-3 + 25.0 * 9.81 - 4.0e4 * (0.030 + x)).abs() < 1e-6);
    let leak_m3_s = 2.0e-13 * (p_s - p);
    let pilot_m3_s = 6.67e-4 * first.signals.pilot_valve_position_pu * ((p - p_t) / 3.5e6).sqrt();
    assert!((leak_m3_s + pilot_m3_s).abs() < 1e-9 * leak_m3_s);
    let load_n = first.opening_chamber_pressure_pa * 0.20 - first.closing_chamber_pressure_pa * 0.18;
    assert!((load_n - (1.5e5 + 2.5e5 * 0.4)).abs() < 1e-6);
}

#[test]
fn a_start_outside_the_dead_band_goes_on_as_measured() {
    let unit = govtwin_model::params::reference();
    let mut row = rows(0.0, 1, |_| Inputs { esv: EsvState::Normal, ..command(0.9) })[0];
    row.measured = Signals { servomotor_position_pu: 0.5, spool_position_pu: 0.6, ..Signals::NONE };
    let estimate = run(&Twin::new(&unit), &[row])[0];
    assert!((estimate.signals.spool_position_pu - 0.6).abs() < 1e-12);
    assert!((estimate.signals.servomotor_position_pu - 0.5).abs() < 1e-12);
    assert!(estimate.servomotor_velocity_m_s > 0.05, "on its way at {} m/s", estimate.servomotor_velocity_m_s);
}
