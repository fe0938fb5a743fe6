//! What may be wrong with a plant of the battery, by id and size: the catalogue's effects and some that it lacks.

use govtwin_model::effects::{Scaling, Stage, find};

/// Faults of a plant, each by its field and its id.
macro_rules! faults {
    ($($(#[$doc:meta])* $field:ident = $id:literal,)+) => {
        /// How much of each effect is in a plant; all zero in a fault-free one. Sizes are deviations from neutral.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub(crate) struct Faults {
            $($(#[$doc])* pub(super) $field: f64,)+
        }

        impl Faults {
            fn place(&mut self, id: &str) -> Option<&mut f64> {
                match id {
                    $($id => Some(&mut self.$field),)+
                    _ => None,
                }
            }
        }
    };
}

faults! {
    command_delay_s = "command_delay",
    command_gain = "command_gain",
    cycle_extra_s = "regulator_cycle",
    pv_overlap_pu = "pv_overlap",
    pv_null_shift_pu = "pv_null_shift",
    pv_hysteresis_pu = "pv_hysteresis",
    pv_frequency_ratio = "pv_bandwidth",
    filter_ratio = "pilot_filter",
    /// Greatest current less the rated one.
    current_limit_pu = "current_limit",
    esv_delay_s = "esv_delay",
    esv_travel_s = "esv_slow",
    spool_friction_n = "spool_friction",
    air_share = "entrained_air",
    chamber_leak_m3_s_pa = "chamber_leak",
    spring_share = "spring",
    flow_force_ratio = "flow_force",
    cold_excess = "viscosity",
    port_overlap_m = "port_overlap",
    port_wear_m = "port_wear",
    play_pu = "backlash",
    servo_friction_n = "servo_friction",
    servo_leak_m3_s_pa = "servo_leak",
    /// Strength of the cushion at the very end, N s²/m².
    cushion = "cushion",
    load_ratio = "load",
    /// Quadratic loss of the line, Pa s²/(m³ m³).
    supply_loss = "supply_loss",
    /// Quadratic loss of the return line, Pa s²/(m³ m³).
    return_loss = "return_loss",
    lvdt_gain = "lvdt_gain",
    lvdt_bias_pu = "lvdt_bias",
    feedback_bias_pu = "feedback_bias",
    feedback_lag_s = "feedback_lag",
    clock_offset_s = "clock_offset",
    lvdt_cubic_pu = "lvdt_cubic",
    ripple_pa = "pump_ripple",
    sticky_spot_n = "sticky_spot",
    gain_drift_share = "gain_drift",
    surge_n = "surge",
    dropout_s = "command_dropout",
    esv_hang_s = "esv_hang",
    relief_m3_s_pa = "relief",
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

/// A row for each stranger, as in an effect's file.
macro_rules! strangers {
    ($($id:literal $stage:ident [$unit:literal] $typical:literal $(, scales with $scaling:ident)?: $meaning:literal;)+) => {
        /// All strangers.
        pub(crate) const STRANGERS: &[Stranger] = &[$(Stranger {
            id: $id,
            stage: Stage::$stage,
            typical: $typical,
            scaling: [$(Scaling::$scaling,)? Scaling::Fixed][0],
            unit: $unit,
            meaning: $meaning,
        },)+];
    };
}

strangers! {
    "lvdt_cubic" Sensor ["pu"] 0.04: "cubic error of the spool transducer at full stroke";
    "pump_ripple" Supply ["Pa"] 8.0e5, scales with Pressure: "oscillation of the supply pressure at 2 Hz behind the tank, amplitude";
    "sticky_spot" Servomotor ["N"] 3.0e5, scales with ServomotorForce: "friction in a narrow band of the servomotor's stroke";
    "gain_drift" PilotValve ["1"] 0.35: "share of the pilot valve's flow gain lost while it warms";
    "surge" Servomotor ["N"] 2.5e5, scales with ServomotorForce: "oscillating guide-vane load at 0.7 Hz, amplitude";
    "command_dropout" Regulator ["s"] 0.1: "length of gaps in which the command is not renewed";
    "esv_hang" Esv ["s"] 0.5: "time for which the ESV hangs half-way";
    "relief" Spool ["m3/(s Pa)"] 1.0e-9, scales with PilotLeak: "leakage of the control chamber above 3.35 MPa only";
}

impl Faults {
    /// Adds an effect or a stranger of a size as labels give it; false where nothing is called so.
    pub(crate) fn add(&mut self, id: &str, size: f64) -> bool {
        let Some(place) = self.place(id) else { return false };
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
