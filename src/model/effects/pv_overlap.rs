//! Overlap of the pilot valve's lands: around the hydraulic null the valve moves and no oil passes.
//!
//! `s = x_p − sat(x_p, ±h)`, `Q_x = Q_n s √(Δp/Δp_n)` (Merritt 1967, *Hydraulic Control Systems*, chapter 5, overlapped valves).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | h | half width of the dead zone `overlap_pu` | pu of valve stroke |
//! | x_p, s | valve position, hydraulic opening | pu |
//!
//! Without it the real spool rests longer before it follows a small demand, overshoots and hunts slowly about its place with
//! the pilot valve swinging across the zone. Limits: both edges alike and sharp; where leakage
//! or a null shift hides, it looks like one.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "pv_overlap", PilotValve, apply;
    "overlap_pu" ["pu"] 0.0 ..= 0.4, neutral 0.0, typical 0.05:
        "half width of the dead zone around the pilot valve's null";
};

fn apply([overlap_pu]: [f64; 1], plant: &mut Plant) {
    plant.proportional_valve.overlap_pu += overlap_pu;
}
