//! Trips between slow samples: when the ESV really tripped, found from what the unit did.

use crate::frame::EsvState;
use crate::likelihood::problem::{Problem, twin_of};
use crate::likelihood::trial::Trial;
use crate::parameters::Unit;
use crate::units::nanos_from_seconds;

/// Places tried between two samples before the search narrows.
const PLACES: i64 = 20;

/// Where the search ends: the twin's tick, ns.
const TICK_NS: i64 = 1_000_000;

/// Trials of a problem with their trips where this unit explains them best; none if no trial has a trip whose time is in doubt.
///
/// A trip that a slow recorder writes down with the next sample came up to one sample earlier. A servomotor at full speed makes a
/// hundredth of its stroke in that time: taken at its stamp, the trip would pass for a fault.
#[must_use]
pub fn placed(problem: &Problem, unit: &Unit) -> Option<Vec<Trial>> {
    let mut any = false;
    let trials = problem
        .trials
        .iter()
        .enumerate()
        .map(|(index, trial)| match doubt(trial) {
            Some((row, doubt_ns)) => {
                any = true;
                let price = |early_ns: i64| {
                    problem.residuals_in(&trip_at(trial, row, early_ns), twin_of(unit), index).norm_squared()
                };
                trip_at(trial, row, cheapest(doubt_ns, price))
            }
            None => trial.clone(),
        })
        .collect();
    any.then_some(trials)
}

/// The row of the first trip, and by how much it may be late, ns.
fn doubt(trial: &Trial) -> Option<(usize, i64)> {
    let state = |row: usize| trial.frames[row].inputs.esv;
    let row = (1..trial.frames.len()).find(|&row| state(row) == EsvState::Shutdown && state(row - 1) != state(row))?;
    trial.is_slow().then(|| (row, nanos_from_seconds(trial.period_s)))
}

/// The trial with its trip so much earlier.
fn trip_at(trial: &Trial, row: usize, early_ns: i64) -> Trial {
    let mut moved = trial.clone();
    let from_ns = trial.frames[row].time_ns - early_ns;
    for frame in moved.frames[..row].iter_mut().rev().take_while(|frame| frame.time_ns >= from_ns) {
        frame.inputs.esv = EsvState::Shutdown;
    }
    moved
}

/// The cheapest shift from 0 to a limit: a grid, then halved steps down to a tick.
fn cheapest(limit_ns: i64, price: impl Fn(i64) -> f64) -> i64 {
    let mut step_ns = (limit_ns / PLACES).max(TICK_NS);
    let mut best = (price(0), 0);
    let try_at = |shift_ns: i64, best: &mut (f64, i64)| {
        if (0..=limit_ns).contains(&shift_ns) {
            let cost = price(shift_ns);
            if cost < best.0 {
                *best = (cost, shift_ns);
            }
        }
    };
    for place in 1..=limit_ns / step_ns {
        try_at(place * step_ns, &mut best);
    }
    while step_ns > TICK_NS {
        step_ns = (step_ns / 2).max(TICK_NS);
        let centre_ns = best.1;
        try_at(centre_ns - step_ns, &mut best);
        try_at(centre_ns + step_ns, &mut best);
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_search_finds_the_shift_to_a_tick() {
        for truth_ns in [0, 3_000_000, 104_000_000, 200_000_000] {
            let found_ns = cheapest(200_000_000, |shift_ns| (shift_ns - truth_ns).abs() as f64);
            assert!((found_ns - truth_ns).abs() <= TICK_NS, "{truth_ns}: {found_ns}");
        }
    }
}
