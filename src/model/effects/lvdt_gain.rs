//! A wrong gain of the spool's transducer: a bad calibration, an ageing oscillator.
//!
//! `y_r = g y`; the regulator and the recording both read `y_r` (Isermann 2006, *Fault-Diagnosis Systems*, sensor faults: changed gain).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | g | reading over position `gain_ratio` | 1 |
//! | y, y_r | spool position, reading | pu |
//!
//! Without it the real spool reading has another value at the stops, and the servomotor moves at 1/g of the speed that the reading
//! promises in slow movements. Limits: linear.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "lvdt_gain", Sensor, apply;
    "gain_ratio" ["1"] 0.5 ..= 2.0, neutral 1.0, typical 1.08:
        "reading of the spool's transducer over the true position";
};

fn apply([gain_ratio]: [f64; 1], plant: &mut Plant) {
    plant.spool.reading_gain *= gain_ratio;
}
