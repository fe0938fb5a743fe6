//! An offset of the servomotor's transducer: a slipped coupling, a shifted core, a drifted zero.
//!
//! `Y_r = Y + b`; the regulator and the recording both read `Y_r` (Isermann 2006, *Fault-Diagnosis Systems*, sensor faults: offset).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | b | offset `bias_pu` | pu of stroke |
//! | Y, Y_r | piston position, reading | pu |
//!
//! Without it the real reading ends at b where the servomotor is shut, and the regulator presses on towards a closed command or stops short of
//! it; away from the ends readings agree. Limits: constant over all recordings; where no recording reaches an end of the stroke it
//! looks like a load off the sheet, or like nothing.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "feedback_bias", Sensor, apply;
    "bias_pu" ["pu"] -0.1 ..= 0.1, neutral 0.0, typical 5.0e-3: "offset of the servomotor's transducer, pu of stroke";
};

fn apply([bias_pu]: [f64; 1], plant: &mut Plant) {
    plant.servomotor.reading_bias_pu += bias_pu;
}
