//! What may be wrong with a plant of the battery, by id and size: the catalogue's effects and some that it lacks.

use govtwin_model::effects::{Scaling, Stage, find};

/// How much of each effect is in a plant; all zero in a fault-free one. Sizes are deviations from neutral.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Faults {
    pub(super) command_delay_s: f64,
    pub(super) command_gain: f64,
    pub(super) cycle_extra_s: f64,
    pub(super) pv_overlap_pu: f64,
    pub(super) pv_null_shift_pu: f64,
    pub(super) pv_hysteresis_pu: f64,
    pub(super) pv_frequency_ratio: f64,
    pub(super) filter_ratio: f64,
    /// Greatest current less the rated one.
    pub(super) current_limit_pu: f64,
    pub(super) esv_delay_s: f64,
    pub(super) esv_travel_s: f64,
    pub(super) spool_friction_n: f64,
    pub(super) air_share: f64,
    pub(super) chamber_leak_m3_s_pa: f64,
    pub(super) spring_share: f64,
    pub(super) flow_force_ratio: f64,
    pub(super) cold_excess: f64,
    pub(super) port_overlap_m: f64,
    pub(super) port_wear_m: f64,
    pub(super) play_pu: f64,
    pub(super) servo_friction_n: f64,
    pub(super) servo_leak_m3_s_pa: f64,
    /// Strength of the cushion at the very end, N s²/m².
    pub(super) cushion: f64,
    pub(super) load_ratio: f64,
    /// Quadratic loss of the line, Pa s²/(m³ m³).
    pub(super) supply_loss: f64,
    /// Quadratic loss of the return line, Pa s²/(m³ m³).
    pub(super) return_loss: f64,
    pub(super) lvdt_gain: f64,
    pub(super) lvdt_bias_pu: f64,
    pub(super) feedback_bias_pu: f64,
    pub(super) feedback_lag_s: f64,
    pub(super) clock_offset_s: f64,
    pub(super) lvdt_cubic_pu: f64,
    pub(super) ripple_pa: f64,
    pub(super) sticky_spot_n: f64,
    pub(super) gain_drift_share: f64,
    pub(super) surge_n: f64,
    pub(super) dropout_s: f64,
    pub(super) esv_hang_s: f64,
    pub(super) relief_m3_s_pa: f64,
}

/// Something that no catalogue lists.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stranger {
    /// Its id in labels.
    pub id: &'static str,
    /// Where it sits.
    pub stage: Stage,
    /// Moderate size on the reference unit.
    pub typical: f64,
    /// What it is proportional to.
    pub scaling: Scaling,
    /// Unit of the size.
    pub unit: &'static str,
    /// What it is.
    pub meaning: &'static str,
}

/// All strangers.
pub(crate) const STRANGERS: &[Stranger] = &[
    Stranger {
        id: "lvdt_cubic",
        stage: Stage::Sensor,
        typical: 0.04,
        scaling: Scaling::Fixed,
        unit: "pu",
        meaning: "cubic error of the spool transducer at full stroke",
    },
    Stranger {
        id: "pump_ripple",
        stage: Stage::Supply,
        typical: 8.0e5,
        scaling: Scaling::Pressure,
        unit: "Pa",
        meaning: "oscillation of the supply pressure at 2 Hz behind the tank, amplitude",
    },
    Stranger {
        id: "sticky_spot",
        stage: Stage::Servomotor,
        typical: 3.0e5,
        scaling: Scaling::ServomotorForce,
        unit: "N",
        meaning: "friction in a narrow band of the servomotor's stroke",
    },
    Stranger {
        id: "gain_drift",
        stage: Stage::PilotValve,
        typical: 0.35,
        scaling: Scaling::Fixed,
        unit: "1",
        meaning: "share of the pilot valve's flow gain lost while it warms",
    },
    Stranger {
        id: "surge",
        stage: Stage::Servomotor,
        typical: 2.5e5,
        scaling: Scaling::ServomotorForce,
        unit: "N",
        meaning: "oscillating guide-vane load at 0.7 Hz, amplitude",
    },
    Stranger {
        id: "command_dropout",
        stage: Stage::Regulator,
        typical: 0.1,
        scaling: Scaling::Fixed,
        unit: "s",
        meaning: "length of gaps in which the command is not renewed",
    },
    Stranger {
        id: "esv_hang",
        stage: Stage::Esv,
        typical: 0.5,
        scaling: Scaling::Fixed,
        unit: "s",
        meaning: "time for which the ESV hangs half-way",
    },
    Stranger {
        id: "relief",
        stage: Stage::Spool,
        typical: 1.0e-9,
        scaling: Scaling::PilotLeak,
        unit: "m3/(s Pa)",
        meaning: "leakage of the control chamber above 3.35 MPa only",
    },
];

impl Faults {
    /// Adds an effect or a stranger of a size as labels give it; false where nothing is called so.
    pub(crate) fn add(&mut self, id: &str, size: f64) -> bool {
        let place = match id {
            "command_delay" => &mut self.command_delay_s,
            "command_gain" => &mut self.command_gain,
            "regulator_cycle" => &mut self.cycle_extra_s,
            "pv_overlap" => &mut self.pv_overlap_pu,
            "pv_null_shift" => &mut self.pv_null_shift_pu,
            "pv_hysteresis" => &mut self.pv_hysteresis_pu,
            "pv_bandwidth" => &mut self.pv_frequency_ratio,
            "pilot_filter" => &mut self.filter_ratio,
            "current_limit" => &mut self.current_limit_pu,
            "esv_delay" => &mut self.esv_delay_s,
            "esv_slow" => &mut self.esv_travel_s,
            "spool_friction" => &mut self.spool_friction_n,
            "entrained_air" => &mut self.air_share,
            "chamber_leak" => &mut self.chamber_leak_m3_s_pa,
            "spring" => &mut self.spring_share,
            "flow_force" => &mut self.flow_force_ratio,
            "viscosity" => &mut self.cold_excess,
            "port_overlap" => &mut self.port_overlap_m,
            "port_wear" => &mut self.port_wear_m,
            "backlash" => &mut self.play_pu,
            "servo_friction" => &mut self.servo_friction_n,
            "servo_leak" => &mut self.servo_leak_m3_s_pa,
            "cushion" => &mut self.cushion,
            "load" => &mut self.load_ratio,
            "supply_loss" => &mut self.supply_loss,
            "return_loss" => &mut self.return_loss,
            "lvdt_gain" => &mut self.lvdt_gain,
            "lvdt_bias" => &mut self.lvdt_bias_pu,
            "feedback_bias" => &mut self.feedback_bias_pu,
            "feedback_lag" => &mut self.feedback_lag_s,
            "clock_offset" => &mut self.clock_offset_s,
            "lvdt_cubic" => &mut self.lvdt_cubic_pu,
            "pump_ripple" => &mut self.ripple_pa,
            "sticky_spot" => &mut self.sticky_spot_n,
            "gain_drift" => &mut self.gain_drift_share,
            "surge" => &mut self.surge_n,
            "command_dropout" => &mut self.dropout_s,
            "esv_hang" => &mut self.esv_hang_s,
            "relief" => &mut self.relief_m3_s_pa,
            _ => return false,
        };
        let neutral = find(id).and_then(|spec| spec.parameters.first()).map_or(0.0, |parameter| parameter.neutral);
        *place += size - neutral;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_model::effects::of_the_chain;

    #[test]
    fn every_effect_and_stranger_can_be_added_and_is_gone_at_neutral() {
        let strangers = STRANGERS.iter().map(|stranger| (stranger.id, 0.0, stranger.typical));
        let listed = of_the_chain().map(|spec| (spec.id, spec.parameters[0].neutral, spec.parameters[0].typical));
        for (id, neutral, typical) in listed.chain(strangers) {
            let mut faults = Faults::default();
            assert!(faults.add(id, neutral), "{id}");
            assert_eq!(faults, Faults::default(), "{id}");
            faults.add(id, typical);
            assert_ne!(faults, Faults::default(), "{id}");
        }
        assert!(!Faults::default().add("gremlin", 1.0));
        assert!(STRANGERS.iter().all(|stranger| find(stranger.id).is_none()));
    }
}
