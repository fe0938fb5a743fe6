//! An offset of the spool's transducer: a shifted core or a drifted amplifier.
//!
//! `y_r = y + b`; the regulator and the recording both read `y_r` (Isermann 2006, *Fault-Diagnosis Systems*, sensor faults: offset).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | b | offset `bias_pu` | pu of reference stroke |
//! | y, y_r | spool position, reading | pu |
//!
//! Without it the real spool reads b at its stops beyond what the nuts allow, and the servomotor drifts to one side of its dead
//! band. Limits: constant over all recordings.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "lvdt_bias", Sensor, apply;
    "bias_pu" ["pu"] -0.3 ..= 0.3, neutral 0.0, typical 0.03: "offset of the spool's transducer";
};

fn apply([bias_pu]: [f64; 1], plant: &mut Plant) {
    plant.spool.reading_bias_pu += bias_pu;
}
