//! A shifted null of the pilot valve: at zero current it passes oil, after wear, a tired spring or a drifted amplifier.
//!
//! `s = x_p − n`: the hydraulic null lies at the valve position n (Merritt 1967, *Hydraulic Control Systems*, chapter 5;
//! Jelali & Kroll 2003, *Hydraulic Servo-systems*, chapter 4, null bias).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | n | valve position at which no oil passes `null_shift_pu` | pu of valve stroke |
//!
//! Without it the real spool stands off its demand at rest, by n over the spool loop's gain, which the large loop turns into an
//! offset of the servomotor inside the dead band. Limits: in the positions it equals an error of the regulator's current
//! reference, which the sheet lets vary; the pilot valve's own signal tells them apart.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "pv_null_shift", PilotValve, apply;
    "null_shift_pu" ["pu"] -0.3 ..= 0.3, neutral 0.0, typical 0.03: "valve position at which no oil passes";
};

fn apply([null_shift_pu]: [f64; 1], plant: &mut Plant) {
    plant.proportional_valve.null_shift_pu += null_shift_pu;
}
