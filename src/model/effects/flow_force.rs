//! Steady flow forces on the spool: oil that leaves a port at an angle pushes the port shut.
//!
//! `F_j = −r · 2 C_d w cos 69° · x_eff Σ Δp` over the two metering edges (Merritt 1967, *Hydraulic Control Systems*, section 5.6).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | r | force over the theoretical one `force_ratio` | 1 |
//! | C_d, w, x_eff, Δp | discharge coefficient, port width, port travel, pressure drop of an edge | 1, m, m, Pa |
//!
//! Without it the real control pressure is higher than simulated while the servomotor opens and lower while it closes, in
//! proportion to the spool's travel. The positions show little. Limits: steady part only; no force of accelerating oil.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "flow_force", Spool, apply;
    "force_ratio" ["1"] 0.0 ..= 5.0, neutral 0.0, typical 1.0:
        "flow force over the theoretical one of sharp-edged ports";
};

fn apply([force_ratio]: [f64; 1], plant: &mut Plant) {
    let ports = &mut plant.main_ports;
    ports.flow_force_m += force_ratio * ports.theoretical_flow_force_m;
}
