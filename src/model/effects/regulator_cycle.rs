//! A regulator whose large loop runs slower than specified: it samples command and position, and holds its demand longer.
//!
//! `u_y(t) = u_y(t_k)` for `t_k ≤ t < t_k + T_l + ΔT`: sample and hold (Åström & Wittenmark 1997,
//! *Computer-Controlled Systems*, section 1.2); the small loop keeps its pace.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | ΔT | time added to the large loop's period T_l `extra_period_s` | s |
//!
//! Without it the real spool moves in steps at a period of its own, the servomotor lags by half of it in ramps, and the
//! loop hunts where the simulated one settles. Limits: instants count from the first frame, as the true phase is
//! unknown; a run between two ticks takes effect within the tick, so that the response is continuous in ΔT. `fit` and `diagnose` simulate
//! the mean over all phases instead, and take the spread of the demand as noise to expect: a cycle jitters, and no recording tells its phase.

use crate::effects::EffectSpec;
use crate::plant::Plant;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "regulator_cycle", Regulator, apply;
    "extra_period_s" ["s"] 0.0 ..= 0.5, neutral 0.0, typical 0.04: "time added to the period of the large loop";
};

fn apply([extra_period_s]: [f64; 1], plant: &mut Plant) {
    if extra_period_s > 0.0 {
        plant.regulator.lengthen_large_loop(extra_period_s);
    }
}
