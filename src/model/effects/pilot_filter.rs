//! A clogged pilot filter: oil that fills the control chamber passes a second orifice, oil that leaves it does not.
//!
//! `1/G² = 1/(s G_1)² + (n/G_1)²` on the filling edge: orifices in series (Merritt 1967, *Hydraulic Control Systems*, chapter 3).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | n | filter's resistance: its conductance is 1/n of the fully open edge's `clogging_ratio` | 1 |
//! | G_1, s | conductance of the edge at full stroke, its opening | m³/(s √Pa), 1 |
//!
//! Without it the real spool opens slower than the simulated one and closes as fast; small movements hardly differ. Limits: turbulent,
//! constant over the recording, on the filling side only.

use crate::effects::{EffectDefinition, EffectLaw, EffectParameter, EffectSpec, Scaling, Stage};
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = EffectSpec::new(EffectDefinition {
    id: "pilot_filter",
    stage: Stage::PilotValve,
    source: include_str!("pilot_filter.rs"),
    parameters: &[EffectParameter {
        name: "clogging_ratio",
        unit: "1",
        neutral: 0.0,
        min: 0.0,
        max: 50.0,
        typical: 3.0,
        scaling: Scaling::Fixed,
        doc: "the filter's conductance is 1/value of the fully open filling edge's",
    }],
    apply: &EffectLaw(apply),
});

fn apply([clogging_ratio]: [f64; 1], plant: &mut Plant) {
    let valve = &mut plant.proportional_valve;
    valve.filling_restriction = valve.filling_restriction.hypot(clogging_ratio / valve.conductance);
}
