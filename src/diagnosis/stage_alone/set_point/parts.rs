//! Parts of the law that are there only where they pay for themselves between pieces: play, integral action, the valve's lag, feed-forward; and a limit of its own
//! each way where one leaves far more: where one way is hardly driven, the greatest speed seen would pass for its limit.

use super::coordinates::{Axis, MOST_PLAY};
use super::{FreeRuns, SetPoint, usual_speeds};
use nalgebra::DVector;

use crate::estimation::coordinate::square;
use crate::stage_alone::run::{Run, travel, typical_s};
use crate::stage_alone::spread::is_gain;

/// Halves of the play that a fit may begin from, as shares of the position's travel.
const PLAYS: [f64; 5] = [0.005, 0.01, 0.02, 0.04, 0.08];
/// Integral times that a fit may begin from, as shares of a run's length.
const INTEGRALS: [f64; 4] = [0.05, 0.15, 0.5, 1.5];
/// Lags of the valve that a fit may begin from, as shares of the loop's, each with the delay as it is and as much shorter.
const VALVES: [f64; 4] = [0.1, 0.2, 0.4, 0.8];
/// Shares of the command's speed that a fit may begin from.
const FORWARDS: [f64; 3] = [0.2, 0.5, 0.9];
/// Two limits leave at most this share of the error that one leaves: a law that is a little wrong gains some by any further number.
const OWN_LIMITS: f64 = 0.8;

impl SetPoint {
    /// The same with the parts that pay, the one that gains most first: fitted to every second run, it must predict the others better.
    pub(super) fn with_parts(mut self, runs: &[Run], axes: &[Axis]) -> Option<Self> {
        let parts: [fn(Self, &FreeRuns<'_>) -> Vec<Self>; 4] =
            [Self::with_play, Self::with_integral, Self::with_valve, Self::with_forward];
        let mut left = parts.to_vec();
        loop {
            let Some(data) = FreeRuns::beside(&self, runs) else { return Some(self) };
            // With a part more far less may be left, of which a sample's worth is less.
            self = data.fitted(&[self], axes)?;
            let paying = left.iter().enumerate().filter_map(|(place, part)| {
                let (gain, law) = self.paying(&part(self, &data), &data, axes)?;
                Some((place, gain, law))
            });
            let paying = paying.max_by(|a, b| a.1.total_cmp(&b.1));
            self = match paying {
                Some((place, _, law)) => {
                    left.remove(place);
                    law
                }
                None => match self.with_own_limits(&data, axes) {
                    Some(law) => law,
                    None => return Some(self),
                },
            };
        }
    }

    /// The same with play of some width.
    fn with_play(self, data: &FreeRuns<'_>) -> Vec<Self> {
        let travel = travel(data.runs, |run| &run.opening);
        best(PLAYS.map(|share| Self { half_play: share * travel, ..self }), data)
    }

    /// The same with integral action, which stands still at a rate limit or winds up.
    fn with_integral(self, data: &FreeRuns<'_>) -> Vec<Self> {
        let length_s = typical_s(data.runs);
        let ways = &[false, true][..if self.rising_limit.min(self.falling_limit).is_finite() { 2 } else { 1 }];
        let of = |&winds_up: &bool| {
            best(INTEGRALS.map(|share| Self { integral_s: share * length_s, winds_up, ..self }), data)
        };
        ways.iter().flat_map(of).collect()
    }

    /// The same behind a valve's lag, of which the delay may have held a part.
    fn with_valve(self, data: &FreeRuns<'_>) -> Vec<Self> {
        let of = |is_delayed: bool| {
            let starts = VALVES.map(|share| {
                let valve_s = share * self.lag_s;
                Self {
                    valve_s,
                    delay_s: if is_delayed { self.delay_s } else { (self.delay_s - valve_s).max(0.0) },
                    ..self
                }
            });
            best(starts, data)
        };
        [true, false].into_iter().flat_map(of).collect()
    }

    /// The same with a share of the command's speed beside the error.
    fn with_forward(self, data: &FreeRuns<'_>) -> Vec<Self> {
        best(FORWARDS.map(|forward| Self { forward, ..self }), data)
    }

    /// The same with a limit of its own each way, or one way alone, where that makes the error clearly less.
    fn with_own_limits(self, data: &FreeRuns<'_>, axes: &[Axis]) -> Option<Self> {
        if !self.has_one_limit() {
            return None;
        }
        let none = f64::INFINITY;
        let [up, down] = usual_speeds(data.runs);
        let [up_now, down_now] = if self.rising_limit.is_finite() { [self.rising_limit; 2] } else { [up, down] };
        let limits = [
            (up, down),
            (0.7 * up, 0.7 * down),
            (up_now, 0.6 * down_now),
            (0.6 * up_now, down_now),
            (up, none),
            (none, down),
        ];
        let starts = limits.map(|(rising_limit, falling_limit)| Self { rising_limit, falling_limit, ..self });
        let law = data.fitted(&starts, axes)?;
        (square(&data.of(&law)) < OWN_LIMITS.powi(2) * square(&data.of(&self))).then_some(law)
    }

    /// The best fit from some starts, and how much better it predicts what it was not fitted to, where it does.
    fn paying(self, starts: &[Self], data: &FreeRuns<'_>, axes: &[Axis]) -> Option<(f64, Self)> {
        let parts: [Vec<Run>; 2] =
            [0, 1].map(|which| data.runs.iter().skip(which).step_by(2).cloned().collect::<Vec<Run>>());
        let mut gained: Vec<Vec<f64>> = Vec::new();
        for which in [0, 1] {
            let [own, other] = [which, 1 - which].map(|part| FreeRuns { runs: &parts[part], size: data.size });
            let laws = [own.fitted(&[self], axes)?, own.fitted(starts, axes)?];
            let errors = laws.map(|law| other.of(&law).iter().map(DVector::norm).collect::<Vec<f64>>());
            let gain = |(without, with): (&f64, &f64)| (without / with.max(f64::MIN_POSITIVE)).ln();
            gained.push(errors[0].iter().zip(&errors[1]).map(gain).collect());
        }
        let law = data.fitted(starts, axes)?;
        // Play that is as large as it may be stands for something else.
        let is_whole = law.half_play < 0.99 * MOST_PLAY * travel(data.runs, |run| &run.opening);
        (pays(&gained) && is_whole).then(|| (gained.iter().flatten().sum(), law))
    }
}

/// The start that leaves least.
fn best<const N: usize>(starts: [SetPoint; N], data: &FreeRuns<'_>) -> Vec<SetPoint> {
    let squares = starts.iter().map(|start| square(&data.of(start)));
    squares.zip(starts).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, start)| start).into_iter().collect()
}

/// Whether what is gained in the pieces of two parts, as logarithms of errors, is a gain in both, and beyond the spread between pieces.
fn pays(gained: &[Vec<f64>]) -> bool {
    gained.iter().all(|part| part.iter().sum::<f64>() > 0.0) && is_gain(&gained.concat())
}
