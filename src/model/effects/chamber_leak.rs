//! Leakage from the control chamber to return: a worn land, a bad seal, a valve not quite shut.
//!
//! `Q_l = C_r (P_ctrl − P_t)` leaves the chamber: laminar flow through a gap (Merritt 1967, *Hydraulic Control Systems*, chapter 3).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | C_r | leakage coefficient to return `leakage_m3_s_pa` | m³/(s Pa) |
//!
//! Without it the real pilot valve stands open at rest and the spool off its demand towards closing; it opens slower and closes faster.
//! Limits: laminar, independent of the spool's place; the positions confuse it with a null shift of the pilot valve.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "chamber_leak", Spool, apply;
    "leakage_m3_s_pa" ["m3/(s Pa)"] 0.0 ..= 2.0e-10, neutral 0.0, typical 5.0e-12, scales with PilotLeak:
        "leakage coefficient from the control chamber to return";
};

fn apply([leakage_m3_s_pa]: [f64; 1], plant: &mut Plant) {
    plant.spool.return_leakage_m3_s_pa += leakage_m3_s_pa;
}
