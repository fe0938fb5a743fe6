//! A fit that cools: priors weigh most at first, so that familiar parameters are not stretched before a strange one had its due.

use crate::parameters::Unit;
use crate::tuning::bench::Bench;
use crate::tuning::fit::{Effort, Fit, fit};
use crate::tuning::knob::Knob;

/// Temperatures through which fits far from the sheet cool.
pub const COOLING: [f64; 3] = [50.0, 5.0, 1.0];

/// A fit through the temperatures of [`COOLING`], so many rounds at each.
#[must_use]
pub fn cooled(bench: &Bench, unit: &Unit, knobs: &[Knob], start: &[f64], rounds: usize) -> Fit {
    let effort = |temperature| Effort { rounds, refresh: 2, temperature };
    let hot = fit(bench, unit, knobs, start, effort(COOLING[0]), None);
    let warm = fit(bench, unit, knobs, &hot.positions, effort(COOLING[1]), Some(&hot.slopes));
    fit(bench, unit, knobs, &warm.positions, effort(COOLING[2]), Some(&warm.slopes))
}
