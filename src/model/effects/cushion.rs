//! A cushion at the closed end of the servomotor's stroke: the outlet narrows and the last part of closing is slow.
//!
//! `F = K (1 − Y/L) w²` against closing for `Y < L`: the drop over an outlet whose drag grows towards the end
//! (orifice law: Merritt 1967, *Hydraulic Control Systems*, chapter 3; cushion time of servomotors: ASME PTC 29-2005).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | K | strength at the very end `strength_n_s2_m2` | N s²/m² |
//! | L | length of the cushion from the closed end `length_pu` | pu of stroke |
//! | Y, w | piston position, piston speed | pu, m/s |
//!
//! Without it the simulated servomotor runs into its closed end at full speed while the real one slows down over the last part of
//! the stroke, in shutdowns and rejections only. Limits: closing only; no cushion at the open end.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "cushion", Servomotor, apply;
    "strength_n_s2_m2" ["N s2/m2"] 0.0 ..= 5.0e9, neutral 0.0, typical 1.0e8, scales with Cushion:
        "cushion force per speed squared at the very end";
    "length_pu" ["pu"] 0.005 ..= 0.5, neutral 0.1, typical 0.06:
        "length of the cushion from the closed end, pu of stroke";
};

fn apply([strength_n_s2_m2, length_pu]: [f64; 2], plant: &mut Plant) {
    let servo = &mut plant.servomotor;
    servo.cushion_n_s2_m2 += strength_n_s2_m2;
    servo.cushion_length_m = length_pu * servo.stroke_m;
}
