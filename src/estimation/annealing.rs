//! A fit that cools: priors weigh most at first, so that familiar parameters are not stretched before a strange one had its due.

use crate::estimation::fit::{Effort, Fit, Start, fit_all};
use crate::estimation::free_parameter::FreeParameter;
use crate::likelihood::problem::Problem;
use crate::parameters::Unit;

/// Temperatures through which fits far from the sheet cool.
pub const COOLING: [f64; 3] = [50.0, 5.0, 1.0];

/// Fits from several starts through the temperatures of [`COOLING`], so many rounds at each.
#[must_use]
pub fn annealed(
    problem: &Problem,
    unit: &Unit,
    free_parameters: &[FreeParameter],
    starts: &[Vec<f64>],
    rounds: usize,
) -> Vec<Fit> {
    let effort = |temperature| Effort { rounds, refresh: 2, temperature };
    let mut hot = Vec::new();
    for positions in starts {
        hot.push(Start { base: unit, free_parameters, positions, effort: effort(COOLING[0]), known: None });
    }
    let mut fits = fit_all(problem, &hot);
    for temperature in &COOLING[1..] {
        let mut cooler = Vec::new();
        for Fit { positions, slopes, .. } in &fits {
            cooler.push(Start {
                base: unit,
                free_parameters,
                positions,
                effort: effort(*temperature),
                known: Some(slopes),
            });
        }
        let next = fit_all(problem, &cooler);
        drop(cooler);
        fits = next;
    }
    fits
}
