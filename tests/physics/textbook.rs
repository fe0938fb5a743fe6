//! The plant's laws once more, from Liu et al. 2025 and Merritt 1967, for balances taken from outside.
//!
//! Numbers are the reference unit's.

use govtwin_model::frame::{Estimate, EsvState, Inputs};

pub const BULK_MODULUS_PA: f64 = 1.0e9;
pub const RETURN_PA: f64 = 0.1e6;
pub const SPOOL_STROKE_M: f64 = 0.015;
pub const CONTROL_AREA_M2: f64 = 5.0e-3;
pub const OPENING_AREA_M2: f64 = 0.20;
pub const CLOSING_AREA_M2: f64 = 0.18;
pub const STROKE_M: f64 = 0.60;
pub const MOVING_MASS_KG: f64 = 8000.0;
pub const SPOOL_MASS_KG: f64 = 25.0;

/// Root of a pressure drop with its sign, √Pa; below 10 kPa the flow turns laminar, which a chamber at a stop lives in.
fn root(drop_pa: f64) -> f64 {
    if drop_pa.abs() < 1.0e4 {
        return 1.25e-2 * drop_pa - 0.25e-10 * drop_pa.powi(3);
    }
    drop_pa.abs().sqrt().copysign(drop_pa)
}

/// Flow into the control chamber, leakage included, m³/s.
pub fn control_flow_m3_s(estimate: &Estimate, inputs: &Inputs) -> f64 {
    let (p_s, p) = (inputs.tank_pressure_pa, estimate.signals.control_pressure_pa);
    let x_p = estimate.signals.pilot_valve_position_pu;
    let pilot = if x_p >= 0.0 { x_p * root(p_s - p) } else { x_p * root(p - RETURN_PA) } * 6.67e-4 / f64::sqrt(3.5e6);
    let drain = -0.62 * 2.0e-5 * f64::sqrt(2.0 / 870.0) * root(p - RETURN_PA);
    let passed = if inputs.esv == EsvState::Normal { pilot } else { drain };
    passed + 2.0e-13 * (p_s - p)
}

/// Volume of the control chamber, m³.
pub fn control_volume_m3(estimate: &Estimate) -> f64 {
    5.0e-4 + CONTROL_AREA_M2 * spool_m(estimate)
}

/// Flows of the main ports, m³/s.
pub struct Ports {
    /// Into the opening chamber.
    pub opening: f64,
    /// Into the closing chamber.
    pub closing: f64,
    /// Power that the edges turn into heat, W.
    pub heat_w: f64,
    /// Power from the tank less power into the return, W.
    pub supplied_w: f64,
}

/// The main ports' flows.
pub fn ports(estimate: &Estimate, inputs: &Inputs) -> Ports {
    let p_s = inputs.tank_pressure_pa;
    let (p_1, p_2) = (estimate.opening_chamber_pressure_pa, estimate.closing_chamber_pressure_pa);
    let x = spool_m(estimate);
    let x_eff = if x > 2.0e-4 {
        x - 2.0e-4
    } else if x < -2.0e-4 {
        x + 2.0e-4
    } else {
        0.0
    };
    let flow = |drop_pa: f64| 0.62 * 0.030 * x_eff.abs() * f64::sqrt(2.0 / 870.0) * root(drop_pa);
    let (fed_pa, drained_pa) = if x_eff >= 0.0 { (p_1, p_2) } else { (p_2, p_1) };
    let (fed, drained) = (flow(p_s - fed_pa), flow(drained_pa - RETURN_PA));
    let (opening, closing) = if x_eff >= 0.0 { (fed, -drained) } else { (-drained, fed) };
    Ports {
        opening,
        closing,
        heat_w: fed * (p_s - fed_pa) + drained * (drained_pa - RETURN_PA),
        supplied_w: fed * p_s - drained * RETURN_PA,
    }
}

/// Volume of the opening chamber, m³.
pub fn opening_volume_m3(estimate: &Estimate) -> f64 {
    0.02 + OPENING_AREA_M2 * piston_m(estimate)
}

/// Volume of the closing chamber, m³.
pub fn closing_volume_m3(estimate: &Estimate) -> f64 {
    0.02 + CLOSING_AREA_M2 * (STROKE_M - piston_m(estimate))
}

/// Force of the guide vanes against opening, N.
pub fn load_n(estimate: &Estimate) -> f64 {
    1.5e5 + 2.5e5 * estimate.signals.servomotor_position_pu
}

/// Coulomb and viscous friction of the piston, N.
///
/// Below 0.2 mm/s the twin's friction is viscous; see `govtwin_model::plant::friction`.
pub fn piston_friction_n(estimate: &Estimate) -> f64 {
    let w = estimate.servomotor_velocity_m_s;
    4.0e4 * (w / 2.0e-4).clamp(-1.0, 1.0) + 4.0e5 * w
}

/// Forces on the spool but for the chamber's: constant pressure, weight, spring, damping, N, + opens.
pub fn spool_force_n(estimate: &Estimate, inputs: &Inputs) -> f64 {
    -inputs.tank_pressure_pa * 2.5e-3 + SPOOL_MASS_KG * 9.81
        - 4.0e4 * (0.030 + spool_m(estimate))
        - 1500.0 * estimate.spool_velocity_m_s
}

/// Spool position, m.
pub fn spool_m(estimate: &Estimate) -> f64 {
    estimate.signals.spool_position_pu * SPOOL_STROKE_M
}

/// Piston position, m.
pub fn piston_m(estimate: &Estimate) -> f64 {
    estimate.signals.servomotor_position_pu * STROKE_M
}
