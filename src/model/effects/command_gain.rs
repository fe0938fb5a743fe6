//! A scale error between the opening command and the regulator: an analogue link with a wrong span, a converter's drifted reference.
//!
//! The regulator reads `g Y_pid` (Isermann 2006, *Fault-Diagnosis Systems*, sensor faults: changed gain).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | g | what the regulator reads over the command issued `gain_ratio` | 1 |
//!
//! Without it the real servomotor comes to rest at g times the opening commanded, farther off the simulated one the wider it stands open;
//! its speed and all that follows the ESV agree. Limits: linear through zero, the same over all recordings.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "command_gain", Regulator, apply;
    "gain_ratio" ["1"] 0.5 ..= 2.0, neutral 1.0, typical 1.02: "what the regulator reads over the command issued";
};

fn apply([gain_ratio]: [f64; 1], plant: &mut Plant) {
    plant.regulator.command_gain *= gain_ratio;
}
