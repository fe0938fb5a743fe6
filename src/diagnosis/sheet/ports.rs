//! How fast a servomotor moves through its main ports, and which ports make it move that fast.
//!
//! At steady speed `v` the flow `A_o v` passes one edge and `A_c v` the other, each with the drop `ρ/2 (Q / (C_d w x))²`, so that the forces on
//! the piston balance where `ρ/2 (v / (C_d w x))² (A_o³ + A_c³) = F − B v`. `F` is what supply, return, load and friction leave to move it
//! (Merritt 1967, *Hydraulic Control Systems*, section 6.5).

use govtwin_model::parameters::Parameters;

/// Steps of the stroke over which a time is summed.
const STEPS: u32 = 40;
/// Halvings of an interval of areas, in logarithms.
const HALVINGS: u32 = 60;

/// Force that moves the piston at an opening, N; at least a thousandth of what the tank gives, so that a time exists.
fn drive_n(p: &Parameters, opening_pu: f64, opens: bool) -> f64 {
    let (servo, oil) = (&p.servomotor, &p.oil);
    let load_n = servo.load_closed_n + servo.load_slope_n * opening_pu;
    let (into_m2, out_m2, load_n) = if opens {
        (servo.opening_area_m2, servo.closing_area_m2, load_n)
    } else {
        (servo.closing_area_m2, servo.opening_area_m2, -load_n)
    };
    let pressure_n = oil.tank_pressure_pa * into_m2 - oil.return_pressure_pa * out_m2;
    (pressure_n - load_n - servo.coulomb_friction_n).max(1e-3 * oil.tank_pressure_pa * into_m2)
}

/// Speed at an opening through ports of so much area, m/s.
fn speed_m_s(p: &Parameters, port_m2: f64, opening_pu: f64, opens: bool) -> f64 {
    let servo = &p.servomotor;
    let cubes = servo.opening_area_m2.powi(3) + servo.closing_area_m2.powi(3);
    let per_square = 0.5 * p.oil.density_kg_m3 * cubes / (p.esv.discharge_coefficient * port_m2).powi(2);
    let damping = servo.viscous_damping_n_s_m;
    // The positive root of a v² + B v = F.
    let root = (damping * damping + 4.0 * per_square * drive_n(p, opening_pu, opens)).sqrt();
    (root - damping) / (2.0 * per_square)
}

/// Time of a full stroke through ports of so much open area, s.
pub(super) fn time_s(p: &Parameters, port_m2: f64, opens: bool) -> f64 {
    let step_m = p.servomotor.stroke_m / f64::from(STEPS);
    let middle = |k: u32| (f64::from(k) + 0.5) / f64::from(STEPS);
    (0..STEPS).map(|k| step_m / speed_m_s(p, port_m2, middle(k), opens)).sum()
}

/// The open area of the ports at which a full stroke takes a time, m²; none where damping alone would make it slower.
pub(super) fn area_m2(p: &Parameters, wanted_s: f64, opens: bool) -> Option<f64> {
    let (mut low, mut high) = (1e-9_f64.ln(), 10.0_f64.ln());
    if time_s(p, high.exp(), opens) > wanted_s {
        return None;
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if time_s(p, middle.exp(), opens) > wanted_s {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some((0.5 * (low + high)).exp())
}

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_model::params;

    #[test]
    fn area_and_time_are_each_others_inverse() {
        let p = params::reference().parameters;
        for opens in [true, false] {
            for wanted_s in [3.0, 9.0, 40.0] {
                let area = area_m2(&p, wanted_s, opens).unwrap();
                assert!((time_s(&p, area, opens) - wanted_s).abs() < 1e-6 * wanted_s);
            }
        }
    }
}
