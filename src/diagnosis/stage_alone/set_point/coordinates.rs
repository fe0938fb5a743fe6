//! The numbers of a set point as a fit turns them.

use super::{SetPoint, usual_speeds};
use crate::estimation::coordinate::Coordinate;
use crate::stage_alone::run::{Run, mean_spool, travel, typical_s};

/// Least and greatest lag, and greatest delay, as shares of a run's length.
pub(super) const LAG_RANGE: (f64, f64) = (1e-3, 10.0);
const MOST_DELAY: f64 = 0.5;
/// The most that half of the play may be, as a share of the position's travel: with more, the position would hardly move.
pub(super) const MOST_PLAY: f64 = 0.25;
/// Least and greatest integral time, as shares of a run's length.
const INTEGRAL_RANGE: (f64, f64) = (1e-3, 1e2);

/// What is turned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Gain,
    Level,
    Lag,
    Delay,
    Rising,
    Falling,
    Play,
    Integral,
}

/// One number of the law, in steps of its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    pub part: Part,
    /// A step: of gain, level, delay and play in their unit, of the others as a logarithm.
    step: f64,
    /// Between which values, in the number's unit.
    range: (f64, f64),
    /// The command about which the gain turns.
    middle: f64,
}

impl Axis {
    pub(super) const MOST: usize = 8;

    pub(super) fn all(runs: &[Run], start: &SetPoint, with_limits: bool) -> Vec<Self> {
        let length_s = typical_s(runs);
        let (command, opening) = (travel(runs, |run| &run.spool), travel(runs, |run| &run.opening));
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        let axis = |part, step, range| Self { part, step, range, middle: mean_spool(runs) };
        let speeds = usual_speeds(runs).map(|speed| (0.05 * speed, 20.0 * speed));
        let mut axes = vec![
            axis(Part::Gain, 0.05 * (opening / command).max(start.gain.abs()), all),
            axis(Part::Level, 0.05 * opening.max(command * start.gain.abs()), all),
            axis(Part::Lag, 0.2, (LAG_RANGE.0 * length_s, LAG_RANGE.1 * length_s)),
        ];
        if with_limits {
            axes.push(axis(Part::Delay, 0.02 * length_s, (0.0, MOST_DELAY * length_s)));
            axes.push(axis(Part::Rising, 0.2, speeds[0]));
            axes.push(axis(Part::Falling, 0.2, speeds[1]));
            axes.push(axis(Part::Play, 0.01 * opening, (0.0, MOST_PLAY * opening)));
            axes.push(axis(Part::Integral, 0.2, (INTEGRAL_RANGE.0 * length_s, INTEGRAL_RANGE.1 * length_s)));
        }
        axes
    }

    /// Whether it turns anything from there: a limit that is never reached does not, nor play or integral action that is not there.
    pub(super) fn acts(&self, base: &SetPoint) -> bool {
        self.value(base).is_finite() && (self.part != Part::Play || base.half_play > 0.0)
    }

    fn value(&self, law: &SetPoint) -> f64 {
        match self.part {
            Part::Gain => law.gain,
            Part::Level => law.level,
            Part::Lag => law.lag_s,
            Part::Delay => law.delay_s,
            Part::Rising => law.rising_limit,
            Part::Falling => law.falling_limit,
            Part::Play => law.half_play,
            Part::Integral => law.integral_s,
        }
    }

    fn is_logarithmic(&self) -> bool {
        matches!(self.part, Part::Lag | Part::Rising | Part::Falling | Part::Integral)
    }
}

impl Coordinate for Axis {
    type Subject = SetPoint;

    fn range(&self, base: &SetPoint) -> (f64, f64) {
        let value = self.value(base);
        let place =
            |end: f64| if self.is_logarithmic() { (end / value).ln() / self.step } else { (end - value) / self.step };
        (place(self.range.0).min(0.0), place(self.range.1).max(0.0))
    }

    fn prior_centre(&self) -> Option<f64> {
        None
    }

    fn turn(&self, base: &SetPoint, law: &mut SetPoint, position: f64) {
        let by = self.step * position;
        match self.part {
            Part::Gain => {
                law.gain = base.gain + by;
                law.level -= by * self.middle;
            }
            Part::Level => law.level += by,
            Part::Lag => law.lag_s = base.lag_s * by.exp(),
            Part::Delay => law.delay_s = (base.delay_s + by).max(0.0),
            Part::Rising => law.rising_limit = base.rising_limit * by.exp(),
            Part::Falling => law.falling_limit = base.falling_limit * by.exp(),
            Part::Play => law.half_play = (base.half_play + by).max(0.0),
            Part::Integral => law.integral_s = base.integral_s * by.exp(),
        }
    }
}
