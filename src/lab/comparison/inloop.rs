//! A residual inside the loop: what the twin's spool rate misses, learned over the twin's own state and given back to its control chamber.
//!
//! An additive residual changes the estimate of the spool only; servomotor and regulator stay as they were. Here the twin itself goes
//! on with the correction: `Q = A·Δv(state)` flows into the control chamber (area A), a [`Term`] of the plant. `Δv` is learned from runs in which
//! the twin is pulled to the recorded spool, `Q = A·K·(x_recorded − x)`, as a Luenberger observer does (Luenberger 1971, "An
//! introduction to observers", *IEEE Transactions on Automatic Control* 16): the pull that it takes is what the rate misses. In a free run
//! nothing measured enters.

use govtwin_correction::forest::Forest;
use govtwin_correction::guard::Guard;
use govtwin_model::plant::term::{Point, Term, View};
use govtwin_model::state::State;

/// What a rate is learned over.
pub const FEATURES: usize = 8;

/// The twin's own state as a row of features.
pub(crate) fn features(state: &State, tank_pressure_pa: f64) -> [f64; FEATURES] {
    [
        state.pilot_position_pu,
        state.control_pressure_pa,
        state.spool_position_m,
        state.spool_velocity_m_s,
        state.opening_pressure_pa - state.closing_pressure_pa,
        state.servomotor_position_m,
        state.servomotor_velocity_m_s,
        tank_pressure_pa,
    ]
}

/// The path's position at a time, straight from sample to sample, m; NaN for an empty path.
pub(crate) fn at(path: &[[f64; 2]], time_s: f64) -> f64 {
    let next = path.partition_point(|[sample_s, _]| *sample_s <= time_s);
    match (next.checked_sub(1).and_then(|before| path.get(before)), path.get(next)) {
        (Some([from_s, from_m]), Some([to_s, to_m])) => from_m + (to_m - from_m) * (time_s - from_s) / (to_s - from_s),
        (Some([_, position_m]), None) | (None, Some([_, position_m])) => *position_m,
        (None, None) => f64::NAN,
    }
}

/// Pulls the spool along a recorded path.
#[derive(Debug)]
pub(crate) struct Pull {
    /// Time since the first frame, s, and spool position, m, in the order of time.
    pub path: Vec<[f64; 2]>,
    /// The spool's control area, m².
    pub area_m2: f64,
    /// Gain K of the pull, 1/s.
    pub gain_1_s: f64,
}

impl Term for Pull {
    fn point(&self) -> Point {
        Point::ChamberFlow
    }

    fn apply(&self, signal: f64, view: &View<'_>, _: &mut [f64]) -> f64 {
        let missing_m = at(&self.path, view.time_s) - view.state.spool_position_m;
        if missing_m.is_finite() { signal + self.area_m2 * self.gain_1_s * missing_m } else { signal }
    }
}

/// Gives the spool the rate that was learned.
#[derive(Debug)]
pub(crate) struct LearnedSpoolRate {
    /// Trees over [`features`]; their output is a rate in m/s.
    pub forest: Forest,
    /// Where they know their way.
    pub guard: Guard,
    /// The spool's control area, m².
    pub area_m2: f64,
}

impl Term for LearnedSpoolRate {
    fn point(&self) -> Point {
        Point::ChamberFlow
    }

    fn apply(&self, signal: f64, view: &View<'_>, _: &mut [f64]) -> f64 {
        let row = features(view.state, view.tank_pressure_pa);
        let Some(weight) = self.guard.weight(&row).filter(|weight| *weight > 0.0) else { return signal };
        let [low, high] = self.guard.range;
        signal + self.area_m2 * weight * self.forest.value(&row).max(low).min(high)
    }
}

#[cfg(test)]
mod tests {
    use super::at;

    #[test]
    fn a_path_runs_straight_between_its_samples_and_holds_at_its_ends() {
        let path = [[1.0, 0.0], [3.0, 4.0]];
        assert_eq!([0.0, 1.0, 1.5, 3.0, 9.0].map(|time_s| at(&path, time_s)), [0.0, 0.0, 1.0, 4.0, 4.0]);
        assert!(at(&[], 0.0).is_nan());
    }
}
