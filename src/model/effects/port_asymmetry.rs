//! Unequal main ports for the two directions: one land worn or chipped, windows cut unlike, an asymmetric valve.
//!
//! `g_o → (1 + a) g_o`, `g_c → (1 − a) g_c`: flow per spool travel when opening and when closing (unmatched ports: Merritt 1967,
//! *Hydraulic Control Systems*, section 5.1; asymmetric edges: Jelali & Kroll 2003, *Hydraulic Servo-systems*, section 4.3).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | a | asymmetry of the ports `asymmetry_ratio` | 1 |
//! | g_o, g_c | gain of the ports when opening and when closing | m²/(s √Pa) |
//!
//! Without it the real servomotor is faster than simulated in one direction and slower in the other, in the same ratio at every spool
//! position and opening. Limits: both edges of a direction alike, the same along the port; a diagnosis tries it where the servomotor stage
//! stands alone.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "port_asymmetry", Servomotor, apply;
    "asymmetry_ratio" ["1"] -0.9 ..= 0.9, neutral 0.0, typical 0.1:
        "gain of the opening ports above the mean of both directions, relative";
};

fn apply([asymmetry_ratio]: [f64; 1], plant: &mut Plant) {
    let ports = &mut plant.main_ports;
    ports.opening_gain *= 1.0 + asymmetry_ratio;
    ports.closing_gain *= 1.0 - asymmetry_ratio;
}
