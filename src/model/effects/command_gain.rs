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

use crate::effects::{EffectDefinition, EffectLaw, EffectParameter, EffectSpec, Scaling, Stage};
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = EffectSpec::new(EffectDefinition {
    id: "command_gain",
    stage: Stage::Regulator,
    source: include_str!("command_gain.rs"),
    parameters: &[EffectParameter {
        name: "gain_ratio",
        unit: "1",
        neutral: 1.0,
        min: 0.5,
        max: 2.0,
        typical: 1.02,
        scaling: Scaling::Fixed,
        doc: "what the regulator reads over the command issued",
    }],
    apply: &EffectLaw(apply),
});

fn apply([gain_ratio]: [f64; 1], plant: &mut Plant) {
    plant.regulator.command_gain *= gain_ratio;
}
