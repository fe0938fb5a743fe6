//! Cold oil that warms: thicker at the start of a recording than on the sheet, and back to it with time.
//!
//! `μ/μ_0 = 1 + c e^(−t/τ)`; viscous damping goes with it, laminar leakage against it (Merritt 1967, *Hydraulic Control
//! Systems*, chapters 2 and 3; the fall of viscosity with temperature: ASTM D341).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | c | viscosity at the start over the sheet's, less 1 `cold_excess` | 1 |
//! | τ | time constant of warming `warming_time_s` | s |
//!
//! Without it the real servomotor and spool are slower than simulated at the start of a recording and agree at its end. Limits:
//! orifices are taken as turbulent, hence independent of it; every recording starts equally cold.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "viscosity", Spool, apply;
    "cold_excess" ["1"] 0.0 ..= 30.0, neutral 0.0, typical 3.0:
        "viscosity at the start of a recording over the sheet's, less 1";
    "warming_time_s" ["s"] 1.0 ..= 3600.0, neutral 60.0, typical 120.0: "time constant with which the oil warms";
};

fn apply([cold_excess, warming_time_s]: [f64; 2], plant: &mut Plant) {
    plant.supply.cold_excess += cold_excess;
    plant.supply.warming_time_s = warming_time_s;
}
