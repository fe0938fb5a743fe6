//! Dry friction of the spool: silt, a bent sleeve, side forces of unrelieved lands.
//!
//! `F_f = F_c (1 + (r − 1) e^(−|v|/v_s)) sat(v/v_0)` against the motion (Armstrong-Hélouvry, Dupont & Canudas de Wit 1994,
//! Automatica 30(7), section 2; hydraulic lock: Merritt 1967, *Hydraulic Control Systems*, chapter 5).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | F_c | Coulomb friction `coulomb_n` | N |
//! | r | friction at rest over Coulomb friction `static_ratio` | 1 |
//! | v, v_s, v_0 | speed, Stribeck speed 2 mm/s, end of the viscous core 0.2 mm/s | m/s |
//!
//! Without it the control pressure of the real unit swings wider about the balance, and the spool waits before each
//! small movement. The positions show little: the small loop has force to spare. Limits: no presliding, no memory beyond the speed.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "spool_friction", Spool, apply;
    "coulomb_n" ["N"] 0.0 ..= 8000.0, neutral 0.0, typical 400.0, scales with SpoolForce:
        "Coulomb friction of the spool";
    "static_ratio" ["1"] 1.0 ..= 3.0, neutral 1.0, typical 1.3: "friction at rest over Coulomb friction";
};

fn apply([coulomb_n, static_ratio]: [f64; 2], plant: &mut Plant) {
    let friction = &mut plant.spool.friction;
    friction.coulomb_n += coulomb_n;
    friction.static_ratio *= static_ratio;
}
