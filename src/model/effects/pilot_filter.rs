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

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "pilot_filter", PilotValve, apply;
    "clogging_ratio" ["1"] 0.0 ..= 50.0, neutral 0.0, typical 3.0:
        "the filter's conductance is 1/value of the fully open filling edge's";
};

fn apply([clogging_ratio]: [f64; 1], plant: &mut Plant) {
    let valve = &mut plant.proportional_valve;
    valve.filling_restriction = valve.filling_restriction.hypot(clogging_ratio / valve.conductance);
}
