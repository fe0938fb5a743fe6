//! Flow that no longer grows with the spool: windows that are fully open early, a pump or a throttle that gives no more.
//!
//! `x → max(−x_s, min(x, x_s))`, `x_s = (1 − s) x_N` (saturation among the nonlinearities of valves: Jelali & Kroll 2003, *Hydraulic
//! Servo-systems*, section 4.3).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | s | part of the reference stroke over which flow grows no more `saturated_share` | 1 |
//! | x, x_s, x_N | spool position, where the flow is full, reference stroke | m |
//!
//! Without it the real servomotor is slower than simulated at large travel of the spool, alike both ways, and as fast at small. Limits: sharp,
//! alike both ways; acts only where the recorded spool drives the servomotor stage.

use std::sync::Arc;

use crate::effects::EffectSpec;
use crate::plant::Plant;
use crate::plant::term::{Point, Term, View};

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "flow_saturation", Spool, apply;
    "saturated_share" ["1"] 0.0 ..= 0.95, neutral 0.0, typical 0.3:
        "part of the spool's reference stroke over which the flow grows no more";
};

fn apply([saturated_share]: [f64; 1], plant: &mut Plant) {
    if saturated_share > 0.0 {
        plant.terms.push(Arc::new(Full { position_m: (1.0 - saturated_share) * plant.spool.reference_stroke_m }));
    }
}

#[derive(Debug)]
struct Full {
    position_m: f64,
}

impl Term for Full {
    fn point(&self) -> Point {
        Point::DrivingSpool
    }

    fn apply(&self, signal: f64, _view: &View<'_>, _memory: &mut [f64]) -> f64 {
        signal.clamp(-self.position_m, self.position_m)
    }
}
