//! The whole continuous plant as one system of ordinary differential equations, for methods that need it in this form.

use crate::plant::{Drive, Plant};
use crate::state::State;

/// Rate of change of every state under a drive that holds.
///
/// At a stop a speed into it counts as zero. The units are the state's per second.
pub fn rates(plant: &Plant, state: &State, drive: &Drive) -> State {
    let supply = &plant.supply;
    let return_pa = supply.return_pressure_pa;
    let (spool, ports, servo) = (&plant.spool, &plant.main_ports, &plant.servomotor);
    let viscosity = supply.viscosity(drive.time_s);
    let fluidity = 1.0 / viscosity;

    let x = state.spool_position_m.clamp(spool.stroke_min_m, spool.stroke_max_m);
    let v = inward(state.spool_velocity_m_s, state.spool_position_m, spool.stroke_min_m, spool.stroke_max_m);
    let z = state.servomotor_position_m.clamp(0.0, servo.stroke_m);
    let w = inward(state.servomotor_velocity_m_s, state.servomotor_position_m, 0.0, servo.stroke_m);
    let (p_1, p_2) = (state.opening_pressure_pa, state.closing_pressure_pa);

    let p = state.control_pressure_pa;
    let travel_m = ports.travel_m(x + spool.stop_yield_m(x, p, drive.tank_pressure_pa));
    let flows = ports.flows(travel_m, p_1, p_2, drive.tank_pressure_pa, supply);
    let supply_pa = supply.pressure_pa(drive.tank_pressure_pa, flows.drawn_m3_s);

    let valve = &plant.proportional_valve;
    let (pilot_rate, mut pilot_pull) =
        valve.rates(state.pilot_position_pu, state.pilot_rate_pu_s, drive.valve_current_pu);
    let pilot_rate = inward(pilot_rate, state.pilot_position_pu, -1.0, 1.0);
    pilot_pull = inward(pilot_pull, state.pilot_position_pu, -1.0, 1.0);

    let pilot = valve.flow(valve.opening_pu(state.pilot_position_pu.clamp(-1.0, 1.0)), p, supply_pa, return_pa);
    let q_e = plant.esv.flow(drive.esv_opening_pu, pilot, p, return_pa).m3_s;
    let net_m3_s = q_e + fluidity * spool.leakage_m3_s(p, supply_pa, return_pa) + drive.chamber_flow_m3_s
        - spool.control_area_m2 * v;
    let spool_force_n = spool.static_force_n(x, p, supply_pa)
        + ports.flow_force_n(travel_m, p_1, p_2, supply_pa, return_pa)
        + drive.spool_force_n
        - spool.viscous_damping_n_s_m * viscosity * v
        - spool.friction.force_n(v);

    let cross_m3_s = fluidity * servo.cross_leakage_m3_s_pa * (p_1 - p_2);
    let opening_m3_s = flows.opening.m3_s - cross_m3_s + drive.opening_flow_m3_s;
    let closing_m3_s = flows.closing.m3_s + cross_m3_s + drive.closing_flow_m3_s;
    let piston_force_n = p_1 * servo.opening_area_m2 - p_2 * servo.closing_area_m2 - servo.load_n(z)
        + drive.servomotor_force_n
        - servo.damping_n_s_m(z, w, viscosity) * w
        - servo.friction.force_n(w);

    State {
        pilot_position_pu: pilot_rate,
        pilot_rate_pu_s: pilot_pull,
        control_pressure_pa: net_m3_s / spool.compliance_m3_pa(x, p),
        spool_position_m: v,
        spool_velocity_m_s: inward(
            spool_force_n / spool.mass_kg,
            state.spool_position_m,
            spool.stroke_min_m,
            spool.stroke_max_m,
        ),
        opening_pressure_pa: (opening_m3_s - servo.opening_area_m2 * w) / servo.opening_compliance_m3_pa(z),
        closing_pressure_pa: (closing_m3_s + servo.closing_area_m2 * w) / servo.closing_compliance_m3_pa(z),
        servomotor_position_m: w,
        servomotor_velocity_m_s: inward(
            piston_force_n / servo.mass_kg,
            state.servomotor_position_m,
            0.0,
            servo.stroke_m,
        ),
    }
}

/// A law of change, whole or in part.
pub type Rates = fn(&Plant, &State, &Drive) -> State;

/// The same of the servomotor alone, with pilot valve and spool at given positions.
pub(crate) fn piston_rates(plant: &Plant, state: &State, drive: &Drive) -> State {
    State {
        pilot_position_pu: 0.0,
        pilot_rate_pu_s: 0.0,
        control_pressure_pa: 0.0,
        spool_position_m: 0.0,
        spool_velocity_m_s: 0.0,
        ..rates(plant, state, drive)
    }
}

/// Puts a state back inside its stops: no position beyond one, no speed into one, no pressure below vacuum.
pub fn confine(plant: &Plant, state: &mut State) {
    let (spool, servo) = (&plant.spool, &plant.servomotor);
    hold(&mut state.pilot_position_pu, &mut state.pilot_rate_pu_s, -1.0, 1.0);
    hold(&mut state.spool_position_m, &mut state.spool_velocity_m_s, spool.stroke_min_m, spool.stroke_max_m);
    hold(&mut state.servomotor_position_m, &mut state.servomotor_velocity_m_s, 0.0, servo.stroke_m);
    for pressure_pa in [&mut state.control_pressure_pa, &mut state.opening_pressure_pa, &mut state.closing_pressure_pa]
    {
        *pressure_pa = pressure_pa.max(VACUUM_PA);
    }
}

/// Absolute vacuum as a gauge pressure, Pa.
pub const VACUUM_PA: f64 = -101_325.0;

fn inward(rate: f64, position: f64, min: f64, max: f64) -> f64 {
    if (position <= min && rate < 0.0) || (position >= max && rate > 0.0) { 0.0 } else { rate }
}

fn hold(position: &mut f64, velocity: &mut f64, min: f64, max: f64) {
    if *position <= min {
        *position = min;
        *velocity = velocity.max(0.0);
    } else if *position >= max {
        *position = max;
        *velocity = velocity.min(0.0);
    }
}
