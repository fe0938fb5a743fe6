//! Distributing valve, pilot valve, ESV and regulator of a unit derived from a plate.

use super::{Making, relative};
use govtwin_model::parameters::Tolerance;

impl Making<'_> {
    /// Distributing valve, pilot valve and ESV by the valve's size.
    pub(super) fn valve(&mut self, size: f64) {
        let by = |law: &str| format!("similarity: the reference unit's times {law} of the valve's size, {size:.2}");
        let shipped = |making: &Self, key: &str| making.shipped(key);
        for (key, item, power, spread) in [
            ("distributing_valve.control_area_m2", "control_area", 2, 0.2),
            ("distributing_valve.spool_mass_kg", "spool_mass", 3, 0.4),
            ("distributing_valve.control_volume_m3", "control_volume", 3, 0.5),
            ("proportional_valve.rated_flow_m3_s", "pilot_valve_flow", 3, 0.4),
            ("esv.drain_area_m2", "", 3, 0.5),
            ("distributing_valve.leakage_m3_s_pa", "", 1, 0.6),
        ] {
            let usual = if key.ends_with("rated_flow_m3_s") { 0.05 } else { 0.03 };
            if item.is_empty() || !self.taken(key, item, usual) {
                let value = shipped(self, key) * size.powi(power);
                let law = ["", "the first power", "the square", "the cube"][usize::try_from(power).unwrap_or(0)];
                self.by(key, value, spread, by(law));
            }
        }
        if let Some(diameter_m) = self.plate.get("esv_diameter") {
            let area = 0.25 * std::f64::consts::PI * diameter_m * diameter_m;
            let source = format!("{}: pi/4 d^2", self.words("esv_diameter"));
            self.put("esv.drain_area_m2", area, relative(0.1), source, true);
        }
        let (control_m2, pressure_pa) = (self.p.distributing_valve.control_area_m2, self.p.oil.tank_pressure_pa);
        if !self.taken("distributing_valve.constant_pressure_area_m2", "constant_pressure_area", 0.01) {
            let source = "half of the control area, so that both ways are alike";
            self.put(
                "distributing_valve.constant_pressure_area_m2",
                0.5 * control_m2,
                relative(0.02),
                source.into(),
                false,
            );
        }
        let mass_kg = self.p.distributing_valve.spool_mass_kg;
        self.by(
            "distributing_valve.viscous_damping_n_s_m",
            60.0 * mass_kg,
            0.5,
            "60 1/s times the spool's mass, as the reference unit",
        );
        let stroke_m = self.p.distributing_valve.reference_stroke_m;
        let force_n = 0.038 * pressure_pa * control_m2;
        self.by("distributing_valve.spring_precompression_m", 2.0 * stroke_m, 0.2, "twice the spool's stroke");
        let source = "a preload of 3.8 % of tank pressure times control area, over its compression";
        self.by("distributing_valve.spring_stiffness_n_m", force_n / (2.0 * stroke_m), 0.3, source);
        let volume = self.p.distributing_valve.control_volume_m3;
        let least = 2.0 * control_m2 * self.p.distributing_valve.stroke_min_m.abs();
        if volume < least && !self.plate.values.contains_key("control_volume") {
            self.by("distributing_valve.control_volume_m3", least, 0.5, "twice what the control piston sweeps");
        }
        let shipped_n = self.shipped("oil.tank_pressure_pa") * self.shipped("distributing_valve.control_area_m2");
        let yields = Some(Tolerance::Absolute(3.0e-8 * shipped_n / (pressure_pa * control_m2)));
        self.put("distributing_valve.stop_compliance_m_n", 0.0, yields, "rigid until a fit says more".into(), false);
        if !self.taken("proportional_valve.natural_frequency_rad_s", "pilot_valve_frequency", 0.1) {
            self.by("proportional_valve.natural_frequency_rad_s", 377.0, 0.4, "usual of such valves: 60 Hz");
        }
        let source = "usual of such valves: 0.6 to 0.9";
        self.put("proportional_valve.damping_ratio", 0.75, relative(0.15), source.into(), false);
        if !self.taken("proportional_valve.rated_pressure_drop_pa", "pilot_valve_drop", 0.0) {
            let source = "usual of such valves: 35 bar over one edge";
            self.put("proportional_valve.rated_pressure_drop_pa", 3.5e6, None, source.into(), false);
        }
    }

    pub(super) fn regulator(&mut self) {
        for (key, item, spread) in
            [("regulator.position_gain", "position_gain", 0.4), ("regulator.spool_gain", "spool_gain", 0.4)]
        {
            if !self.taken(key, item, 0.0) {
                let value = self.shipped(key);
                self.by(key, value, spread, "as the reference unit, as the governor's setting is not given");
                self.assumed.push(format!("{item} is not given: {value} assumed"));
            }
        }
        let compensation = 1.1 * self.p.main_ports.overlap_m / self.p.distributing_valve.reference_stroke_m;
        for (keys, item, usual, source) in [
            (
                ["regulator.deadband_upper_pu", "regulator.deadband_lower_pu"],
                "dead_band",
                0.0005,
                "as the reference unit, as the governor's setting is not given",
            ),
            (
                ["regulator.compensation_positive_pu", "regulator.compensation_negative_pu"],
                "compensation",
                compensation,
                "1.1 times overlap over stroke, as the governor's setting is not given",
            ),
        ] {
            for (sign, key) in [1.0, -1.0].into_iter().zip(keys) {
                match self.plate.get(item) {
                    Some(value) => {
                        let source = self.words(item);
                        self.put(key, sign * value, None, source, true);
                    }
                    None => self.put(key, sign * usual, Some(Tolerance::LogNormal(0.5)), source.into(), false),
                }
            }
        }
        let source = "the valve's real null differs from its nominal one by this much";
        self.put("regulator.current_reference_pu", 0.0, Some(Tolerance::Absolute(0.01)), source.into(), false);
        for (key, item) in [
            ("regulator.large_loop_period_s", "large_loop_period"),
            ("regulator.small_loop_period_s", "small_loop_period"),
        ] {
            self.taken(key, item, 0.0);
        }
    }
}
