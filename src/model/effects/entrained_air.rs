//! Free air in the oil of the control chamber: bubbles drawn in at the tank, a line that was not vented.
//!
//! `1/β_e = 1/β + α P_0/P²` with P absolute: oil and isothermal gas share the volume (Merritt 1967, *Hydraulic Control Systems*,
//! chapter 2, effective bulk modulus).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | α | volume share of free air at atmospheric pressure `free_air_share` | 1 |
//! | P_0, P | atmosphere, chamber pressure | Pa |
//!
//! Without it the simulated control pressure answers too stiffly: the real one moves later and rings slower, most after an ESV trip, when
//! the pressure is low. The positions show little. Limits: in the control chamber only, a dead end where air stays (the servomotor's
//! chambers are flushed by each stroke, and 2 % there would move it by less than its sensor's noise); no solution of air in oil.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "entrained_air", Spool, apply;
    "free_air_share" ["1"] 0.0 ..= 0.2, neutral 0.0, typical 0.03: "volume share of free air at atmospheric pressure";
};

fn apply([free_air_share]: [f64; 1], plant: &mut Plant) {
    plant.spool.free_air_share += free_air_share;
}
