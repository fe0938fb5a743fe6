//! Extra overlap of the main ports: the spool's lands are longer, or the ports narrower, than drawn.
//!
//! `h_0 → h_0 + Δh` on both sides of neutral (Merritt 1967, *Hydraulic Control Systems*, section 5.1).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | Δh | extra overlap `extra_overlap_m` | m |
//!
//! Without it the simulated servomotor starts earlier than the real one after each rest or reversal, and
//! the real spool wanders further before the servomotor follows. Limits: both sides alike, sharp edges.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "port_overlap", Servomotor, apply;
    "extra_overlap_m" ["m"] -2.0e-4 ..= 2.0e-3, neutral 0.0, typical 2.0e-4, scales with SpoolStroke:
        "extra overlap of the main ports, each side of neutral";
};

fn apply([extra_overlap_m]: [f64; 1], plant: &mut Plant) {
    let ports = &mut plant.main_ports;
    ports.opening_overlap_m = (ports.opening_overlap_m + extra_overlap_m).max(0.0);
    ports.closing_overlap_m = (ports.closing_overlap_m + extra_overlap_m).max(0.0);
}
