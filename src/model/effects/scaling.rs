//! How large a moderate fault is on a unit of another size: the laws of similarity.
//!
//! The catalogue gives sizes and ranges in SI units for the reference unit. On another one a force goes with tank pressure times area, an overlap
//! with the spool's stroke, a line's loss with pressure over the square of the flow through the full ports, and a leak with that flow over the
//! pressure. Ratios, times and positions in pu stay what they are.

use crate::parameters::Parameters;
use crate::params::reference_parameters;

/// What the size of an effect's parameter is proportional to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Scaling {
    /// Nothing: the same on every unit.
    Fixed,
    /// Tank pressure times opening area of the servomotor.
    ServomotorForce,
    /// Tank pressure times control area of the spool.
    SpoolForce,
    /// The spool's stroke.
    SpoolStroke,
    /// Precompression of the spool's spring.
    SpringPreload,
    /// Tank pressure over the square of the flow through the full main ports.
    LineLoss,
    /// Flow through the full main ports over tank pressure.
    MainLeak,
    /// Flow through the full pilot valve over tank pressure.
    PilotLeak,
    /// The servomotor's force over the square of its full speed.
    Cushion,
    /// Tank pressure.
    Pressure,
}

impl Scaling {
    /// What it goes with, in words; none where it is fixed.
    pub fn words(self) -> Option<&'static str> {
        match self {
            Self::Fixed => None,
            Self::ServomotorForce => Some("tank pressure times opening area"),
            Self::SpoolForce => Some("tank pressure times control area"),
            Self::SpoolStroke => Some("the spool's stroke"),
            Self::SpringPreload => Some("the spring's precompression"),
            Self::LineLoss => Some("tank pressure over the square of the flow through the full main ports"),
            Self::MainLeak => Some("the flow through the full main ports over tank pressure"),
            Self::PilotLeak => Some("the flow through the full pilot valve over tank pressure"),
            Self::Cushion => Some("the servomotor's force over the square of its full speed"),
            Self::Pressure => Some("tank pressure"),
        }
    }

    /// Factor by which a size of the reference unit is to be multiplied.
    pub fn factor(self, size: &UnitSize) -> f64 {
        match self {
            Self::Fixed => 1.0,
            Self::ServomotorForce => size.servomotor_force_ratio,
            Self::SpoolForce => size.spool_force_ratio,
            Self::SpoolStroke => size.spool_stroke_ratio,
            Self::SpringPreload => size.spring_preload_ratio,
            Self::LineLoss => size.pressure_ratio / (size.flow_ratio * size.flow_ratio),
            Self::MainLeak => size.flow_ratio / size.pressure_ratio,
            Self::PilotLeak => size.pilot_flow_ratio / size.pressure_ratio,
            Self::Cushion => size.servomotor_force_ratio / (size.servomotor_speed_ratio * size.servomotor_speed_ratio),
            Self::Pressure => size.pressure_ratio,
        }
    }
}

/// How large a unit is: ratios to the reference unit, on which all are exactly 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitSize {
    /// Of tank pressures.
    pub pressure_ratio: f64,
    /// Of flows through the full main ports.
    pub flow_ratio: f64,
    /// Of flows through the full pilot valve at tank pressure.
    pub pilot_flow_ratio: f64,
    /// Of tank pressure times opening area.
    pub servomotor_force_ratio: f64,
    /// Of the servomotor's speeds at full flow.
    pub servomotor_speed_ratio: f64,
    /// Of tank pressure times control area.
    pub spool_force_ratio: f64,
    /// Of the spool's speeds at the pilot valve's full flow.
    pub spool_speed_ratio: f64,
    /// Of the spool's strokes.
    pub spool_stroke_ratio: f64,
    /// Of precompressions of the spool's spring.
    pub spring_preload_ratio: f64,
}

/// Flow through the full main ports at tank pressure, by the law of similarity.
fn flow(p: &Parameters) -> f64 {
    p.main_ports.width_m
        * p.distributing_valve.reference_stroke_m
        * (p.oil.tank_pressure_pa / p.oil.density_kg_m3).sqrt()
}

/// Flow through the full pilot valve at tank pressure.
fn pilot_flow(p: &Parameters) -> f64 {
    let valve = &p.proportional_valve;
    valve.rated_flow_m3_s * (p.oil.tank_pressure_pa / valve.rated_pressure_drop_pa).sqrt()
}

impl UnitSize {
    /// Of a unit's parameters.
    pub fn new(parameters: &Parameters) -> Self {
        let ratio = |of: fn(&Parameters) -> f64| of(parameters) / of(reference_parameters());
        Self {
            pressure_ratio: ratio(|p| p.oil.tank_pressure_pa),
            flow_ratio: ratio(flow),
            pilot_flow_ratio: ratio(pilot_flow),
            servomotor_force_ratio: ratio(|p| p.oil.tank_pressure_pa * p.servomotor.opening_area_m2),
            servomotor_speed_ratio: ratio(|p| flow(p) / p.servomotor.opening_area_m2),
            spool_force_ratio: ratio(|p| p.oil.tank_pressure_pa * p.distributing_valve.control_area_m2),
            spool_speed_ratio: ratio(|p| pilot_flow(p) / p.distributing_valve.control_area_m2),
            spool_stroke_ratio: ratio(|p| p.distributing_valve.reference_stroke_m),
            spring_preload_ratio: ratio(|p| p.distributing_valve.spring_precompression_m),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::CATALOGUE;
    use crate::params::reference;

    #[test]
    fn on_the_reference_unit_sizes_are_those_of_the_catalogue() {
        let unit = reference();
        for parameter in CATALOGUE.iter().flat_map(|spec| spec.parameters) {
            assert_eq!(parameter.on(&unit.parameters), *parameter, "{}", parameter.name);
            assert!(parameter.scaling == Scaling::Fixed || parameter.neutral == 0.0, "{}", parameter.name);
            // What has a unit of size goes with one.
            let is_free = ["1", "s", "pu"].contains(&parameter.unit);
            assert_eq!(parameter.scaling == Scaling::Fixed, is_free, "{}: {}", parameter.name, parameter.unit);
        }
    }

    #[test]
    fn on_a_larger_unit_forces_and_flows_are_larger() {
        let mut unit = reference();
        unit.parameters.oil.tank_pressure_pa *= 2.0;
        unit.parameters.servomotor.opening_area_m2 *= 10.0;
        unit.parameters.main_ports.width_m *= 5.0;
        let on = |id: &str| crate::effects::find(id).unwrap().parameters[0].on(&unit.parameters);
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
        assert!(near(on("servo_friction").typical, 20.0 * 6.0e4) && near(on("servo_friction").max, 20.0 * 5.0e5));
        let flow = 5.0 * 2.0_f64.sqrt();
        assert!(near(on("supply_loss").typical, 2.0e9 * 2.0 / (flow * flow)));
        assert!(near(on("servo_leak").typical, 5.0e-10 * flow / 2.0));
        assert!(near(on("cushion").typical, 1.0e8 * 20.0 / (flow / 10.0).powi(2)));
        assert!(near(on("port_overlap").typical, 2.0e-4) && near(on("backlash").typical, 2.0e-3));
    }
}
