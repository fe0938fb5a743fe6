//! A fit that cools: priors weigh most at first, so that familiar parameters are not stretched before a strange one had its due.

use crate::estimation::coordinate::{Coordinate, Judge};
use crate::estimation::fit::{Effort, Fit, Start, fit_all};

/// Temperatures through which fits far from the sheet cool.
const TEMPERATURES: [f64; 3] = [50.0, 5.0, 1.0];

/// Fits from several starts through the temperatures of [`TEMPERATURES`], so many rounds at each.
pub fn annealed<C: Coordinate>(
    data: &impl Judge<C::Subject>,
    base: &C::Subject,
    coordinates: &[C],
    starts: &[Vec<f64>],
    rounds: usize,
) -> Vec<Fit> {
    let effort = |temperature| Effort { rounds, refresh: 2, temperature, ..Effort::FULL };
    let mut hot = Vec::new();
    for positions in starts {
        hot.push(Start { base, coordinates, positions, effort: effort(TEMPERATURES[0]), known: None });
    }
    let mut fits = fit_all(data, &hot);
    for temperature in &TEMPERATURES[1..] {
        let mut cooler = Vec::new();
        for Fit { positions, slopes, .. } in &fits {
            cooler.push(Start { base, coordinates, positions, effort: effort(*temperature), known: Some(slopes) });
        }
        let next = fit_all(data, &cooler);
        drop(cooler);
        fits = next;
    }
    fits
}
