//! The numbers of a set point as a fit turns them.

use super::{SetPoint, usual_speed, usual_speeds};
use crate::estimation::coordinate::Coordinate;
use crate::stage_alone::run::{Run, mean_spool, travel, typical_s};

/// Least and greatest lag, and greatest delay, as shares of a run's length.
pub(super) const LAG_RANGE: (f64, f64) = (1e-3, 10.0);
const MOST_DELAY: f64 = 0.5;
/// The most that half of the play may be, as a share of the position's travel: with more, the position would hardly move.
pub(super) const MOST_PLAY: f64 = 0.25;
/// The most of the command's speed that goes to the valve beside the error: with more, the position would run ahead of its command.
const MOST_FORWARD: f64 = 1.5;
/// Least and greatest integral time, as shares of a run's length.
const INTEGRAL_RANGE: (f64, f64) = (1e-3, 1e2);

/// The numbers of the law.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Part {
    Gain,
    Level,
    Lag,
    Delay,
    Integral,
    Valve,
    Forward,
    Play,
    Rising,
    Falling,
}

impl Part {
    /// Those that every law has.
    const ALWAYS: [Self; 3] = [Self::Gain, Self::Level, Self::Lag];
    /// The others, what is looked at first for being idle before what is.
    pub(super) const OPTIONAL: [Self; 7] =
        [Self::Forward, Self::Integral, Self::Valve, Self::Play, Self::Rising, Self::Falling, Self::Delay];

    pub(super) fn is_limit(self) -> bool {
        matches!(self, Self::Rising | Self::Falling)
    }

    /// Whether it is a time, s.
    pub(crate) fn is_time(self) -> bool {
        matches!(self, Self::Lag | Self::Delay | Self::Integral | Self::Valve)
    }
}

impl SetPoint {
    /// The numbers that say anything, in the order of reports: what is not there is not turned.
    pub(crate) fn parts(self) -> impl Iterator<Item = Part> {
        let of = [Part::Delay, Part::Integral, Part::Valve, Part::Forward, Part::Play, Part::Rising, Part::Falling];
        let is_there = move |part: &Part| *part == Part::Delay || self.value(*part) != Self::NONE.value(*part);
        Part::ALWAYS.into_iter().chain(of.into_iter().filter(is_there))
    }

    /// Whether a part is a number of its own: a limit that holds both ways is one number.
    pub(crate) fn is_own(&self, part: Part) -> bool {
        part != Part::Falling || !self.has_one_limit()
    }

    /// Whether one limit holds both ways.
    pub(super) fn has_one_limit(&self) -> bool {
        self.rising_limit == self.falling_limit
    }

    fn number(&mut self, part: Part) -> &mut f64 {
        match part {
            Part::Gain => &mut self.gain,
            Part::Level => &mut self.level,
            Part::Lag => &mut self.lag_s,
            Part::Delay => &mut self.delay_s,
            Part::Integral => &mut self.integral_s,
            Part::Valve => &mut self.valve_s,
            Part::Forward => &mut self.forward,
            Part::Play => &mut self.half_play,
            Part::Rising => &mut self.rising_limit,
            Part::Falling => &mut self.falling_limit,
        }
    }

    pub(crate) fn value(mut self, part: Part) -> f64 {
        *self.number(part)
    }

    /// The same with another number; a limit that holds both ways still does.
    pub(crate) fn with(mut self, part: Part, value: f64) -> Self {
        if part == Part::Rising && self.has_one_limit() {
            self.falling_limit = value;
        }
        *self.number(part) = value;
        self
    }
}

/// One number of the law, in steps of its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    pub part: Part,
    /// A step: of limits and of times but the delay as a logarithm, of the others in their unit.
    step: f64,
    /// Between which values, in the number's unit.
    range: (f64, f64),
    /// The command about which the gain turns.
    middle: f64,
}

impl Axis {
    pub(super) const MOST: usize = 10;

    pub(super) fn all(runs: &[Run], start: &SetPoint, with_limits: bool) -> Vec<Self> {
        let length_s = typical_s(runs);
        let (command, opening) = (travel(runs, |run| &run.spool), travel(runs, |run| &run.opening));
        let all = (f64::NEG_INFINITY, f64::INFINITY);
        let axis = |part, step, range| Self { part, step, range, middle: mean_spool(runs) };
        let usual = usual_speed(usual_speeds(runs));
        let speeds = (0.05 * usual, 20.0 * usual);
        let mut axes = vec![
            axis(Part::Gain, 0.05 * (opening / command).max(start.gain.abs()), all),
            axis(Part::Level, 0.05 * opening.max(command * start.gain.abs()), all),
            axis(Part::Lag, 0.2, (LAG_RANGE.0 * length_s, LAG_RANGE.1 * length_s)),
        ];
        if with_limits {
            axes.extend([
                axis(Part::Delay, 0.02 * length_s, (0.0, MOST_DELAY * length_s)),
                axis(Part::Rising, 0.2, speeds),
                axis(Part::Falling, 0.2, speeds),
                axis(Part::Play, 0.01 * opening, (0.0, MOST_PLAY * opening)),
                axis(Part::Integral, 0.2, (INTEGRAL_RANGE.0 * length_s, INTEGRAL_RANGE.1 * length_s)),
                axis(Part::Valve, 0.2, (LAG_RANGE.0 * length_s, LAG_RANGE.1 * length_s)),
                axis(Part::Forward, 0.05, (0.0, MOST_FORWARD)),
            ]);
        }
        axes
    }

    /// Whether it turns anything from there: what is not there does not, nor a limit that is never reached.
    pub(super) fn acts(&self, base: &SetPoint) -> bool {
        base.is_own(self.part) && base.parts().any(|part| part == self.part)
    }

    fn is_logarithmic(&self) -> bool {
        self.part.is_limit() || (self.part.is_time() && self.part != Part::Delay)
    }
}

impl Coordinate for Axis {
    type Subject = SetPoint;

    fn range(&self, base: &SetPoint) -> (f64, f64) {
        let value = base.value(self.part);
        let place =
            |end: f64| if self.is_logarithmic() { (end / value).ln() / self.step } else { (end - value) / self.step };
        (place(self.range.0).min(0.0), place(self.range.1).max(0.0))
    }

    fn prior_centre(&self) -> Option<f64> {
        None
    }

    fn turn(&self, base: &SetPoint, law: &mut SetPoint, position: f64) {
        let by = self.step * position;
        let value = base.value(self.part);
        match self.part {
            Part::Gain => {
                law.gain = value + by;
                law.level -= by * self.middle;
            }
            Part::Level => law.level += by,
            part if self.is_logarithmic() => *law = law.with(part, value * by.exp()),
            part => *law.number(part) = (value + by).max(0.0),
        }
    }
}
