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

use crate::effects::{EffectDefinition, EffectLaw, EffectParameter, EffectSpec, Scaling, Stage};
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = EffectSpec::new(EffectDefinition {
    id: "viscosity",
    stage: Stage::Spool,
    source: include_str!("viscosity.rs"),
    parameters: &[
        EffectParameter {
            name: "cold_excess",
            unit: "1",
            neutral: 0.0,
            min: 0.0,
            max: 30.0,
            typical: 3.0,
            scaling: Scaling::Fixed,
            doc: "viscosity at the start of a recording over the sheet's, less 1",
        },
        EffectParameter {
            name: "warming_time_s",
            unit: "s",
            neutral: 60.0,
            min: 1.0,
            max: 3600.0,
            typical: 120.0,
            scaling: Scaling::Fixed,
            doc: "time constant with which the oil warms",
        },
    ],
    apply: &EffectLaw(apply),
});

fn apply([cold_excess, warming_time_s]: [f64; 2], plant: &mut Plant) {
    plant.supply.cold_excess += cold_excess;
    plant.supply.warming_time_s = warming_time_s;
}
