//! The steady state at a servomotor position: every force balanced, no net flow anywhere.

use crate::plant::rates::confine;
use crate::plant::{Drive, Plant};
use crate::state::State;

/// The state at rest at a servomotor position and, for a plant on its way, at a spool position.
///
/// Without `spool_position_m` the spool rests where the small loop holds it for a demand of zero. The pilot
/// valve then passes exactly what leaks; the chambers balance the load, the closing one at half the
/// supply pressure: with the ports closed the sum of the two pressures is free, and this is the value that
/// equal leakage past both edges leaves. With the spool off neutral the piston moves at the speed at
/// which ports and load balance.
pub fn steady(plant: &Plant, servomotor_position_m: f64, spool_position_m: Option<f64>, drive: &Drive) -> State {
    let (spool, servo, supply) = (&plant.spool, &plant.servomotor, &plant.supply);
    let supply_pa = drive.tank_pressure_pa;
    let return_pa = supply.return_pressure_pa;
    let z = servomotor_position_m.clamp(0.0, servo.stroke_m);

    let mut x = spool_position_m.unwrap_or(0.0).clamp(spool.stroke_min_m, spool.stroke_max_m);
    let mut state = State { servomotor_position_m: z, ..State::default() };
    // The leak, and with it the current and the resting place, depend on the pressure that the place needs:
    // two passes settle to rounding because the leak is small.
    for _ in 0..4 {
        state.control_pressure_pa = spool.balance_pressure_pa(x, supply_pa);
        state.pilot_position_pu = resting_pilot_position_pu(plant, state.control_pressure_pa, supply_pa, return_pa);
        if spool_position_m.is_none() {
            let current_pu = state.pilot_position_pu / plant.proportional_valve.gain_pu;
            let reading_pu = plant.regulator.resting_reading_pu(0.0, current_pu);
            x = spool.position_m(reading_pu).clamp(spool.stroke_min_m, spool.stroke_max_m);
        }
    }
    state.spool_position_m = x;
    if drive.esv_opening_pu < 1.0 && x <= spool.stroke_min_m {
        state.control_pressure_pa = return_pa;
    }

    let travel_m = plant.main_ports.travel_m(x);
    let load_n = servo.load_n(z) - drive.servomotor_force_n;
    if travel_m == 0.0 {
        state.closing_pressure_pa = 0.5 * supply_pa;
        state.opening_pressure_pa =
            (load_n + servo.closing_area_m2 * state.closing_pressure_pa) / servo.opening_area_m2;
        confine(plant, &mut state);
        return state;
    }
    let w = moving_speed_m_s(plant, travel_m, z, drive);
    state.servomotor_velocity_m_s = w;
    let gain = if travel_m > 0.0 { plant.main_ports.opening_gain } else { plant.main_ports.closing_gain };
    let conductance = gain * travel_m.abs();
    let opening_root = servo.opening_area_m2 * w / conductance;
    let closing_root = servo.closing_area_m2 * w / conductance;
    if travel_m > 0.0 {
        state.opening_pressure_pa = supply_pa - opening_root * opening_root.abs();
        state.closing_pressure_pa = return_pa + closing_root * closing_root.abs();
    } else {
        state.opening_pressure_pa = return_pa - opening_root * opening_root.abs();
        state.closing_pressure_pa = supply_pa + closing_root * closing_root.abs();
    }
    // Without pressure in the tank a load may ask for less than a vacuum.
    confine(plant, &mut state);
    state
}

/// The pilot valve's position at which it passes exactly what leaks, pu.
fn resting_pilot_position_pu(plant: &Plant, control_pa: f64, supply_pa: f64, return_pa: f64) -> f64 {
    let valve = &plant.proportional_valve;
    let leaked_m3_s = plant.spool.leakage_m3_s(control_pa, supply_pa, return_pa) / plant.supply.viscosity(0.0);
    let wanted_m3_s = -leaked_m3_s;
    let full = valve.flow(1.0_f64.copysign(wanted_m3_s), control_pa, supply_pa, return_pa).m3_s;
    let share = if full == 0.0 { 0.0 } else { (wanted_m3_s / full).abs().min(1.0) };
    // Behind a restriction the flow saturates with the opening: s²/(1 + n² s²) = share²/(1 + n²), solved for s.
    let n = if wanted_m3_s > 0.0 { valve.filling_restriction * valve.conductance } else { 0.0 };
    let opening_pu = (share / (1.0 + n * n * (1.0 - share * share)).sqrt()).copysign(wanted_m3_s);
    let edge_pu = if wanted_m3_s == 0.0 { 0.0 } else { valve.overlap_pu.copysign(wanted_m3_s) };
    (opening_pu + edge_pu + valve.null_shift_pu).clamp(-1.0, 1.0)
}

/// The speed at which ports, load and friction balance, m/s; zero at an end stop and when friction holds.
fn moving_speed_m_s(plant: &Plant, travel_m: f64, z: f64, drive: &Drive) -> f64 {
    let servo = &plant.servomotor;
    let (supply_pa, return_pa) = (drive.tank_pressure_pa, plant.supply.return_pressure_pa);
    let direction = travel_m.signum();
    let load_n = servo.load_n(z) - drive.servomotor_force_n;
    let stalled_n = if direction > 0.0 {
        supply_pa * servo.opening_area_m2 - return_pa * servo.closing_area_m2 - load_n
    } else {
        supply_pa * servo.closing_area_m2 - return_pa * servo.opening_area_m2 + load_n
    };
    let drive_n = stalled_n - servo.friction.coulomb_n;
    let at_end = if direction > 0.0 { z >= servo.stroke_m } else { z <= 0.0 };
    if drive_n <= 0.0 || at_end {
        return 0.0;
    }
    let gain = if direction > 0.0 { plant.main_ports.opening_gain } else { plant.main_ports.closing_gain };
    let conductance = gain * travel_m.abs();
    // drive = a w² + b w
    let a = (servo.opening_area_m2.powi(3) + servo.closing_area_m2.powi(3)) / (conductance * conductance);
    let b = servo.viscous_damping_n_s_m;
    direction * 2.0 * drive_n / (b + (b * b + 4.0 * a * drive_n).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::rates::rates;
    use crate::plant::reference;

    fn drive(current_pu: f64) -> Drive {
        Drive { valve_current_pu: current_pu, esv_opening_pu: 1.0, tank_pressure_pa: 6.3e6, ..Drive::default() }
    }

    #[test]
    fn nothing_moves_at_rest_at_any_opening() {
        let plant = reference();
        for k in 0..=10 {
            let z = 0.06 * f64::from(k);
            let state = steady(&plant, z, None, &drive(0.0));
            let r = rates(&plant, &state, &drive(state.pilot_position_pu / plant.proportional_valve.gain_pu));
            assert!(r.control_pressure_pa.abs() < 1e-3, "{r:?}");
            assert!(r.spool_velocity_m_s.abs() < 1e-9, "{r:?}");
            assert!(r.opening_pressure_pa.abs() < 1e-3 && r.closing_pressure_pa.abs() < 1e-3, "{r:?}");
            assert!(r.servomotor_velocity_m_s.abs() < 1e-9, "{r:?}");
            assert!(r.pilot_rate_pu_s.abs() < 1e-9 && r.servomotor_position_m == 0.0 && r.spool_position_m == 0.0);
        }
    }

    #[test]
    fn a_moving_start_is_balanced_too() {
        let plant = reference();
        for x in [-0.012, -0.002, 0.002, 0.010] {
            let state = steady(&plant, 0.3, Some(x), &drive(0.0));
            let r = rates(&plant, &state, &drive(0.0));
            assert!(r.servomotor_velocity_m_s.abs() < 1e-6, "{r:?}");
            assert!(state.servomotor_velocity_m_s * x > 0.0);
        }
    }
}
