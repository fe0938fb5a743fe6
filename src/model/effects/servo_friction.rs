//! More friction of servomotor and guide vanes than the sheet says: tight packings, dry bushings, a bent ring.
//!
//! `F_f = (F_c + ΔF) (1 + (r − 1) e^(−|v|/v_s)) sat(v/v_0)` against the motion (Armstrong-Hélouvry, Dupont & Canudas de Wit 1994,
//! Automatica 30(7), section 2).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | ΔF | Coulomb friction above the sheet's F_c `extra_coulomb_n` | N |
//! | r | friction at rest over Coulomb friction `static_ratio` | 1 |
//! | v, v_s, v_0 | speed, Stribeck speed 2 mm/s, end of the viscous core 0.2 mm/s | m/s |
//!
//! Without it the real servomotor starts later after each rest and runs slower both ways; at rest it stays where it was left. Limits: the
//! same along the stroke and both ways.

use crate::effects::{EffectDefinition, EffectLaw, EffectParameter, EffectSpec, Scaling, Stage};
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = EffectSpec::new(EffectDefinition {
    id: "servo_friction",
    stage: Stage::Servomotor,
    source: include_str!("servo_friction.rs"),
    parameters: &[
        EffectParameter {
            name: "extra_coulomb_n",
            unit: "N",
            neutral: 0.0,
            min: 0.0,
            max: 5.0e5,
            typical: 6.0e4,
            scaling: Scaling::ServomotorForce,
            doc: "Coulomb friction of the servomotor above the sheet's",
        },
        EffectParameter {
            name: "static_ratio",
            unit: "1",
            neutral: 1.0,
            min: 1.0,
            max: 4.0,
            typical: 1.4,
            scaling: Scaling::Fixed,
            doc: "friction at rest over Coulomb friction",
        },
    ],
    apply: &EffectLaw(apply),
});

fn apply([extra_coulomb_n, static_ratio]: [f64; 2], plant: &mut Plant) {
    let friction = &mut plant.servomotor.friction;
    friction.coulomb_n += extra_coulomb_n;
    friction.static_ratio *= static_ratio;
}
