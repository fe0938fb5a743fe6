//! Values that are each in their physical range but do not go together.

use std::fmt;

use crate::parameters::Parameters;

use super::number::{number_text, quantity_text};

/// Something that values of several keys must fulfil together.
struct Requirement {
    keys: &'static [&'static str],
    holds: fn(&Parameters) -> bool,
    otherwise: fn(&Parameters) -> String,
}

/// Values that contradict each other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Conflict {
    /// The keys involved.
    pub keys: &'static [&'static str],
    /// What is wrong with them, with the values and their units.
    pub message: String,
}

impl fmt::Display for Conflict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.keys.join(", "), self.message)
    }
}

/// Every contradiction among the parameters, for whoever sets them otherwise than by a file, which is checked as it is read.
pub fn conflicts(parameters: &Parameters) -> impl Iterator<Item = Conflict> {
    REQUIREMENTS
        .iter()
        .filter(move |requirement| !(requirement.holds)(parameters))
        .map(move |requirement| Conflict { keys: requirement.keys, message: (requirement.otherwise)(parameters) })
}

const REQUIREMENTS: &[Requirement] = &[
    Requirement {
        keys: &["regulator.spool_command_min_pu", "regulator.spool_command_max_pu"],
        holds: |p| p.regulator.spool_command_min_pu < p.regulator.spool_command_max_pu,
        otherwise: |p| {
            let low = number_text(p.regulator.spool_command_min_pu);
            let high = quantity_text(p.regulator.spool_command_max_pu, "pu");
            format!("{low} and {high} leave the regulator nothing to command")
        },
    },
    Requirement {
        keys: &["regulator.large_loop_period_s", "regulator.small_loop_period_s"],
        holds: |p| {
            let ratio = p.regulator.large_loop_period_s / p.regulator.small_loop_period_s;
            ratio.round() >= 1.0 && (ratio - ratio.round()).abs() < 1e-9 * ratio
        },
        otherwise: |p| {
            let large = quantity_text(p.regulator.large_loop_period_s, "s");
            let small = quantity_text(p.regulator.small_loop_period_s, "s");
            format!("the large loop's {large} must be a whole multiple of the small loop's {small}")
        },
    },
    Requirement {
        keys: &["oil.return_pressure_pa", "oil.tank_pressure_pa"],
        holds: |p| p.oil.return_pressure_pa < p.oil.tank_pressure_pa,
        otherwise: |p| {
            let low = number_text(p.oil.return_pressure_pa);
            let high = quantity_text(p.oil.tank_pressure_pa, "Pa");
            format!("the return line's {low} must lie below the tank's {high}")
        },
    },
    Requirement {
        keys: &["distributing_valve.stroke_min_m", "distributing_valve.stroke_max_m", "main_ports.overlap_m"],
        holds: |p| {
            let overlap_m = p.main_ports.overlap_m;
            p.distributing_valve.stroke_min_m < -overlap_m && overlap_m < p.distributing_valve.stroke_max_m
        },
        otherwise: |p| {
            let low = number_text(p.distributing_valve.stroke_min_m);
            let high = number_text(p.distributing_valve.stroke_max_m);
            let overlap = quantity_text(p.main_ports.overlap_m, "m");
            format!(
                "between its stops at {low} and {high} the spool must open both ways beyond the overlap of {overlap}"
            )
        },
    },
    Requirement {
        keys: &[
            "distributing_valve.control_volume_m3",
            "distributing_valve.control_area_m2",
            "distributing_valve.stroke_min_m",
        ],
        holds: |p| least_control_volume_m3(p) > 0.0,
        otherwise: |p| {
            let volume = quantity_text(least_control_volume_m3(p), "m3");
            format!("the control chamber would hold {volume} at the closing stop; it must hold more than 0")
        },
    },
    Requirement {
        keys: &[
            "distributing_valve.control_area_m2",
            "distributing_valve.constant_pressure_area_m2",
            "distributing_valve.spring_stiffness_n_m",
            "distributing_valve.spring_precompression_m",
            "distributing_valve.spool_mass_kg",
            "oil.tank_pressure_pa",
            "oil.return_pressure_pa",
        ],
        holds: |p| (p.oil.return_pressure_pa..p.oil.tank_pressure_pa).contains(&holding_pressure_pa(p)),
        otherwise: |p| {
            let holding = quantity_text(holding_pressure_pa(p), "Pa");
            let low = number_text(p.oil.return_pressure_pa);
            let high = quantity_text(p.oil.tank_pressure_pa, "Pa");
            format!(
                "holding the spool at neutral would take {holding} in the control chamber; \
                 return and tank allow {low} to {high}"
            )
        },
    },
    Requirement {
        keys: &[
            "servomotor.opening_area_m2",
            "servomotor.closing_area_m2",
            "servomotor.load_closed_n",
            "servomotor.load_slope_n",
            "servomotor.coulomb_friction_n",
            "oil.tank_pressure_pa",
            "oil.return_pressure_pa",
        ],
        holds: |p| {
            let (opening_n, closing_n) = servomotor_forces_n(p);
            loads_n(p).iter().all(|load_n| {
                opening_n > load_n + p.servomotor.coulomb_friction_n
                    && closing_n > p.servomotor.coulomb_friction_n - load_n
            })
        },
        otherwise: |p| {
            let (opening_n, closing_n) = servomotor_forces_n(p);
            let [closed_n, open_n] = loads_n(p);
            format!(
                "the servomotor's {} to open and {} to close do not overcome loads of {} closed and {} open \
                 with a friction of {}",
                quantity_text(opening_n, "N"),
                quantity_text(closing_n, "N"),
                quantity_text(closed_n, "N"),
                quantity_text(open_n, "N"),
                quantity_text(p.servomotor.coulomb_friction_n, "N"),
            )
        },
    },
];

fn least_control_volume_m3(p: &Parameters) -> f64 {
    let valve = &p.distributing_valve;
    valve.control_volume_m3 + valve.control_area_m2 * valve.stroke_min_m
}

/// Control pressure at which the forces on the spool balance at neutral.
fn holding_pressure_pa(p: &Parameters) -> f64 {
    let valve = &p.distributing_valve;
    let spring_n = valve.spring_stiffness_n_m * valve.spring_precompression_m;
    let weight_n = valve.spool_mass_kg * valve.gravity_m_s2;
    (p.oil.tank_pressure_pa * valve.constant_pressure_area_m2 + spring_n - weight_n) / valve.control_area_m2
}

/// Greatest forces of the servomotor at standstill, towards opening and towards closing.
fn servomotor_forces_n(p: &Parameters) -> (f64, f64) {
    let (supply_pa, return_pa) = (p.oil.tank_pressure_pa, p.oil.return_pressure_pa);
    let (opening_m2, closing_m2) = (p.servomotor.opening_area_m2, p.servomotor.closing_area_m2);
    (supply_pa * opening_m2 - return_pa * closing_m2, supply_pa * closing_m2 - return_pa * opening_m2)
}

/// Guide-vane loads towards closing, closed and fully open.
fn loads_n(p: &Parameters) -> [f64; 2] {
    [p.servomotor.load_closed_n, p.servomotor.load_closed_n + p.servomotor.load_slope_n]
}
