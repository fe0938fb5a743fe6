//! Hysteresis of the pilot valve's solenoid: the magnet's force depends on where the current came from.
//!
//! The valve follows `u_h`, which stays while `|u − u_h| ≤ w/2` and is dragged at the gap's edge otherwise: the play operator
//! (Krasnosel'skii & Pokrovskii 1989, *Systems with Hysteresis*, section 2; for valves Jelali & Kroll 2003,
//! *Hydraulic Servo-systems*, chapter 4).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | w | total width of the loop, rising to falling `width_pu` | pu of current |
//! | u, u_h | current, current that the valve follows | pu |
//!
//! Without it the real spool lags after each reversal of the current and swings in a small limit cycle about its demand.
//! Limits: one loop of constant width, started in its middle; real magnets have inner loops of less width.

use std::sync::Arc;

use crate::effects::EffectSpec;
use crate::plant::Plant;
use crate::plant::term::Point;
use crate::plant::term::play::Play;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "pv_hysteresis", PilotValve, apply;
    "width_pu" ["pu"] 0.0 ..= 0.5, neutral 0.0, typical 0.05: "total width of the hysteresis loop on the valve current";
};

fn apply([width_pu]: [f64; 1], plant: &mut Plant) {
    if width_pu > 0.0 {
        plant.terms.push(Arc::new(Play::new(Point::ValveCurrent, width_pu)));
    }
}
