//! A tired or broken centring spring of the spool: less stiffness, or less pre-compression.
//!
//! `F_k = (1 − a) k (δ_0 − d + x)` while compressed, else 0 (Liu et al. 2025, equation 17; Wahl 1963, *Mechanical Springs*, set and relaxation).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | a | share of the stiffness lost `stiffness_loss_share` | 1 |
//! | d | pre-compression lost `preload_loss_m` | m |
//!
//! Without it the simulated control pressure is higher than the real one at every place of the spool, by k d/A and
//! more the further it opens; the positions show it only where the pressure reaches its limits, in trips above all. Limits: linear coils.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "spring", Spool, apply;
    "stiffness_loss_share" ["1"] 0.0 ..= 0.95, neutral 0.0, typical 0.3: "share of the spring's stiffness lost";
    "preload_loss_m" ["m"] 0.0 ..= 0.1, neutral 0.0, typical 0.01, scales with SpringPreload: "pre-compression lost";
};

fn apply([stiffness_loss_share, preload_loss_m]: [f64; 2], plant: &mut Plant) {
    let spool = &mut plant.spool;
    spool.spring_stiffness_n_m *= 1.0 - stiffness_loss_share;
    spool.spring_precompression_m = (spool.spring_precompression_m - preload_loss_m).max(0.0);
}
