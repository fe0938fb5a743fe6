//! Worn metering edges of the main distributing valve: rounded by erosion, they pass oil before they open and wipe out the overlap.
//!
//! `x_eff = e(x − h_0) − e(−x − h_0)`, `e(b) = (b + √(b² + r²))/2`: far beyond an edge it is as sharp as new, and before it the flow dies away with
//! the inverse of the distance (rounded edges: Shearer 1980, Joint Automatic Control Conference, TA9-G; flow before the edge inverse to the
//! distance: Eryilmaz & Wilson 2000, Journal of Dynamic Systems, Measurement, and Control 122(3)).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | r | radius of the edges `edge_radius_m` | m |
//! | x, h_0, x_eff | spool position, overlap, effective travel | m |
//! | b | distance beyond an edge | m |
//!
//! Without it the real servomotor creeps while the spool stands within the overlap, and answers small demands more strongly than the
//! simulated one; at large travel both agree. Limits: all four edges alike; what flows from supply past both edges to return is left out.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "port_wear", Servomotor, apply;
    "edge_radius_m" ["m"] 0.0 ..= 2.0e-3, neutral 0.0, typical 2.0e-4, scales with SpoolStroke:
        "radius of the worn metering edges of the main ports";
};

fn apply([edge_radius_m]: [f64; 1], plant: &mut Plant) {
    let ports = &mut plant.main_ports;
    ports.edge_radius_m = ports.edge_radius_m.hypot(edge_radius_m);
}
