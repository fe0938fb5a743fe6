//! Clocks that disagree: the stamps of command and ESV run ahead of, or behind, the plant's own.
//!
//! A command stamped t acted on the plant at `t − δ` of the plant's clock (Mills 1991, IEEE Transactions on Communications 39(10), clock offset).
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | δ | stamps of command and ESV less the plant's `offset_s` | s |
//!
//! Without it the real unit seems to act δ before it was told, or |δ| too late, and alike to commands and trips: the sign and the
//! ESV tell it from a delay of the command. Limits: constant; one that would need the future (δ > 0) works in replay, which
//! shifts the inputs, and means nothing to a live node.

use std::sync::Arc;

use crate::effects::EffectSpec;
use crate::plant::Plant;
use crate::plant::term::Point;
use crate::plant::term::delay::Delay;

/// The effect.
pub(crate) const SPEC: EffectSpec = effect! {
    "clock_offset", Sensor, apply;
    "offset_s" ["s"] -0.5 ..= 0.5, neutral 0.0, typical 0.03:
        "stamps of command and ESV less those of the plant's signals";
};

fn apply([offset_s]: [f64; 1], plant: &mut Plant) {
    if offset_s == 0.0 {
        return;
    }
    // Whole periods of the large loop are looked ahead, and what was too much of the last one is waited for again.
    let (tick_s, grid_ticks) = (plant.regulator.small_loop_period_s(), plant.regulator.ticks_per_large_loop());
    let grid_s = tick_s * grid_ticks as f64;
    let ahead_s = (offset_s / grid_s).ceil().max(0.0) * grid_s;
    plant.lookahead_s += ahead_s;
    for (point, grid_ticks) in [(Point::Command, grid_ticks), (Point::EsvOpening, 1)] {
        plant.terms.push(Arc::new(Delay::new(point, ahead_s - offset_s, tick_s, grid_ticks)));
    }
}
