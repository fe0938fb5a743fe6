//! Leakage across the servomotor's piston: a worn ring or a scored cylinder.
//!
//! `Q_l = C_p (P_1 − P_2)` from the opening into the closing chamber: laminar flow through a gap (Merritt 1967, *Hydraulic Control Systems*, chapters 3 and 6).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | C_p | leakage coefficient across the piston `leakage_m3_s_pa` | m³/(s Pa) |
//! | P_1, P_2 | pressures of the opening and the closing chamber | Pa |
//!
//! Without it the real piston creeps under load while the ports are shut, so that the regulator corrects again and again, and it runs
//! slower against the load. Limits: laminar, the same along the stroke.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "servo_leak", Servomotor, apply;
    "leakage_m3_s_pa" ["m3/(s Pa)"] 0.0 ..= 2.0e-8, neutral 0.0, typical 5.0e-10, scales with MainLeak:
        "leakage coefficient across the piston";
};

fn apply([leakage_m3_s_pa]: [f64; 1], plant: &mut Plant) {
    plant.servomotor.cross_leakage_m3_s_pa += leakage_m3_s_pa;
}
