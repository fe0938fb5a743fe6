//! Limits: whatever comes in, every state stays within its stops and every number is a number.

use govtwin_model::frame::{Estimate, EsvState, Frame, Inputs, Signals};
use govtwin_model::parameters::{ENTRIES, Unit};
use govtwin_model::solver::Method;
use govtwin_model::twin::{Cut, Twin};
use proptest::prelude::{Just, ProptestConfig, Strategy, TestCaseError, prop};
use proptest::sample::select;
use proptest::{prop_assert, prop_assert_eq, prop_oneof, proptest};

use super::METHODS;

/// Gauge pressure of a vacuum, Pa.
const VACUUM_PA: f64 = -101_325.0;

/// No pressure that the supply and a blow of the moving mass could make is above this, Pa.
///
/// A blow at `w` m/s adds `w √(m β/V)/A`, less than 10 MPa at 0.3 m/s.
const HIGHEST_PA: f64 = 2.0e8;

/// Ordinary values, the edges of what is sensible, and what is not.
fn odd(ordinary: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => ordinary,
        1 => select(vec![0.0, -0.0, 1.0, -1.0, 1e-300, -5.0, 7.0, 1e4, -1e4]),
        1 => select(vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY]),
    ]
}

fn frame() -> impl Strategy<Value = (i64, Frame)> {
    let step_ns = prop_oneof![Just(1_000_000), Just(10_000_000), Just(200_000_000), 0i64..50_000_000, -5_000_000i64..0];
    let pressure_pa = prop_oneof![6 => odd(5.5e6..6.8e6), 2 => 0.0..5.0e7, 1 => -2.0e5..0.0];
    (step_ns, odd(-0.2..1.2), prop::bool::weighted(0.85), pressure_pa, odd(-1.2..1.2), odd(-0.1..1.1)).prop_map(
        |(step_ns, opening_command_pu, normal, tank_pressure_pa, spool_position_pu, servomotor_position_pu)| {
            let esv = if normal { EsvState::Normal } else { EsvState::Shutdown };
            let measured = Signals { spool_position_pu, servomotor_position_pu, ..Signals::NONE };
            (
                step_ns,
                Frame {
                    time_ns: 0,
                    inputs: Inputs { opening_command_pu, esv, tank_pressure_pa, piston_force_n: 0.0 },
                    measured,
                },
            )
        },
    )
}

fn frames() -> impl Strategy<Value = Vec<Frame>> {
    prop::collection::vec(frame(), 1..60).prop_map(|steps| {
        let mut time_ns = 1_700_000_000_000_000_000;
        let place = |(step_ns, frame): (i64, Frame)| {
            time_ns += step_ns;
            Frame { time_ns, ..frame }
        };
        steps.into_iter().map(place).collect()
    })
}

fn within(estimate: &Estimate, unit: &Unit) -> Result<(), TestCaseError> {
    let valve = &unit.parameters.distributing_valve;
    let (y_min, y_max) = (valve.stroke_min_m / valve.reference_stroke_m, valve.stroke_max_m / valve.reference_stroke_m);
    let regulator = &unit.parameters.regulator;
    for (value, min, max, what) in [
        (estimate.signals.spool_position_pu, y_min - 1e-12, y_max + 1e-12, "y"),
        (estimate.signals.servomotor_position_pu, 0.0, 1.0, "Y"),
        (estimate.signals.pilot_valve_position_pu, -1.0, 1.0, "x_p"),
        (estimate.signals.control_pressure_pa, VACUUM_PA, HIGHEST_PA, "P_ctrl"),
        (estimate.opening_chamber_pressure_pa, VACUUM_PA, HIGHEST_PA, "P_1"),
        (estimate.closing_chamber_pressure_pa, VACUUM_PA, HIGHEST_PA, "P_2"),
        (estimate.spool_velocity_m_s, -20.0, 20.0, "spool speed"),
        (estimate.servomotor_velocity_m_s, -20.0, 20.0, "piston speed"),
        (estimate.spool_command_pu, regulator.spool_command_min_pu, regulator.spool_command_max_pu, "u_y"),
        (estimate.valve_current_pu, -1.0, 1.0, "u"),
    ] {
        // NaN lies in no range.
        prop_assert!((min..=max).contains(&value), "{} = {} is outside {}..={}: {:?}", what, value, min, max, estimate);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nothing_leaves_its_limits(
        rows in frames(), method in select(METHODS.to_vec()), cut in select(vec![Cut::None, Cut::Servomotor, Cut::Spool]),
    ) {
        let unit = govtwin_model::params::reference();
        let mut twin = Twin::with_method(&unit, method).with_cut(cut);
        for row in &rows {
            let estimate = twin.step(row);
            prop_assert_eq!(estimate.time_ns, row.time_ns);
            within(&estimate, &unit)?;
        }
    }

    /// Units drawn from twice and half the sheet's values, one by one.
    #[test]
    fn nor_does_it_in_another_unit(rows in frames(), factors in prop::collection::vec(0.5..2.0, ENTRIES.len())) {
        let mut unit = govtwin_model::params::reference();
        for (entry, factor) in ENTRIES.iter().zip(factors) {
            let period = entry.key.ends_with("_period_s");
            let value = (entry.get)(&unit.parameters) * if period { 1.0 } else { factor };
            (entry.set)(&mut unit.parameters, value.clamp(entry.min, entry.max));
        }
        // A chamber that would have no volume left with the spool on its stop is no unit.
        let valve = &unit.parameters.distributing_valve;
        let least_m3 = valve.control_volume_m3 + valve.control_area_m2 * valve.stroke_min_m;
        proptest::prop_assume!(least_m3 > 0.1 * valve.control_volume_m3);
        let mut twin = Twin::with_method(&unit, Method::default());
        for row in &rows {
            within(&twin.step(row), &unit)?;
        }
    }
}
