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

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "servo_friction", Servomotor, apply;
    "extra_coulomb_n" ["N"] 0.0 ..= 5.0e5, neutral 0.0, typical 6.0e4, scales with ServomotorForce:
        "Coulomb friction of the servomotor above the sheet's";
    "static_ratio" ["1"] 1.0 ..= 4.0, neutral 1.0, typical 1.4: "friction at rest over Coulomb friction";
};

fn apply([extra_coulomb_n, static_ratio]: [f64; 2], plant: &mut Plant) {
    let friction = &mut plant.servomotor.friction;
    friction.coulomb_n += extra_coulomb_n;
    friction.static_ratio *= static_ratio;
}
