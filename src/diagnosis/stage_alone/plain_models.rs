//! Plain models of a stage, which know nothing of a servomotor: what a twin must predict better than.

use crate::stage_alone::plain::{Parts, Plain, plain_of};
use crate::stage_alone::run::{Lag, Run, SpoolLaw, mean_spool, solved};
use crate::stage_alone::set_point::{Part, SetPoint};

/// What a plain model is called in reports, by its parts.
const TITLES: [(&str, PlainKind); 6] = [
    ("integrator", PlainKind::Integrator),
    ("integrator with two gains", PlainKind::TwoGains),
    ("integrator with two gains and dead zone", PlainKind::DeadZone),
    ("plain law", PlainKind::PlainLaw),
    ("first-order lag", PlainKind::Lag),
    ("set point with lag", PlainKind::SetPoint),
];

/// What the time constant of a lag is called.
pub(crate) const LAG: &str = "lag";

/// What the speed below the dead band is called where it is one of its own, and what ends it.
pub(crate) const GAIN_BELOW: &str = "gain below zero";
pub(crate) const SATURATES: &str = "saturates beyond the dead band by";

/// What a dead time is called.
pub(crate) const DELAY: &str = "delay";

/// What reports call a number of a loop. A regulator's integral action is told by its proportional gain over its integral one; what stops short of where it
/// is sent by half of a width tells no more than that.
fn title_of(part: Part) -> &'static str {
    match part {
        Part::Gain => "gain",
        Part::Level => "level",
        Part::Lag => LAG,
        Part::Delay => DELAY,
        Part::Integral => "integral time",
        Part::Valve => "lag of the valve",
        Part::Forward => "feed-forward of speed",
        Part::Play => "backlash or dead band, full width",
        Part::Rising => "rate limit, rising",
        Part::Falling => "rate limit, falling",
    }
}

/// The kinds of plain models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PlainKind {
    /// The position sums up what drives it.
    Integrator,
    /// The same with a gain each way.
    TwoGains,
    /// The same with a dead zone.
    DeadZone,
    /// The same with a lag.
    PlainLaw,
    /// The position settles to a line over what drives it.
    Lag,
    /// The same with a delay, a rate limit each way, integral action, and play or a dead band.
    SetPoint,
}

/// A plain model as fitted.
#[derive(Clone, Copy, Debug)]
pub(crate) enum PlainModel {
    /// A sum.
    Sum(PlainKind, Plain),
    /// A set point.
    SetPoint(PlainKind, SetPoint),
}

impl PlainKind {
    /// All of them, the plainest first.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        TITLES.into_iter().map(|(_, kind)| kind)
    }

    /// What it is called in reports.
    pub(crate) fn title(self) -> &'static str {
        TITLES.iter().find(|(_, kind)| *kind == self).map_or("", |(title, _)| title)
    }

    /// The kind that reports call so.
    pub(crate) fn titled(title: &str) -> Option<Self> {
        TITLES.iter().find(|(known, _)| *known == title).map(|(_, kind)| *kind)
    }

    /// Whether its position settles, which a servomotor's does not.
    pub(crate) fn settles(self) -> bool {
        matches!(self, Self::Lag | Self::SetPoint)
    }

    /// The numbers of a set point that count in it: a first-order lag has no delay.
    pub(crate) fn parts_of(self, law: SetPoint) -> impl Iterator<Item = Part> {
        law.parts().filter(move |part| self == Self::SetPoint || *part != Part::Delay)
    }

    /// The same with what is not told but not known either: a valve's lag too short to see takes the place of a part of the integral time.
    pub(crate) fn uncertain_parts_of(self, law: SetPoint) -> impl Iterator<Item = Part> {
        let unseen = law.integral_s.is_finite() && law.valve_s <= 0.0;
        self.parts_of(law).filter(move |part| law.is_own(*part)).chain(unseen.then_some(Part::Valve))
    }

    /// Fits it to free runs; none where nothing drives them.
    pub(crate) fn fitted(self, runs: &[Run]) -> Option<PlainModel> {
        let parts = |band, lag| Parts { band, lag };
        let sum = |law| PlainModel::Sum(self, law);
        let set_point = |with_limits| Some(PlainModel::SetPoint(self, SetPoint::fitted(runs, with_limits)?));
        match self {
            Self::Integrator => integrator(runs).map(sum),
            Self::TwoGains => plain_of(runs, parts(false, false)).map(sum),
            Self::DeadZone => plain_of(runs, parts(true, false)).map(sum),
            Self::PlainLaw => plain_of(runs, parts(true, true)).map(sum),
            Self::Lag => set_point(false),
            Self::SetPoint => set_point(true),
        }
    }
}

/// One gain and a zero, by least squares.
fn integrator(runs: &[Run]) -> Option<Plain> {
    let middle = mean_spool(runs);
    let shapes = |drive: f64, _: f64| vec![drive - middle, 1.0];
    let law = SpoolLaw { lag: Lag::default(), settles_s: None, shapes: &shapes };
    let best = solved(law.normals(runs).iter())?;
    let zero = middle - best[1] / best[0];
    zero.is_finite().then_some(Plain {
        lag: Lag::default(),
        zero,
        half_band: 0.0,
        saturates: f64::INFINITY,
        above_1_s: best[0],
        below_1_s: best[0],
    })
}

impl PlainModel {
    /// Position at each sample of a run from its first.
    pub(crate) fn simulated(&self, run: &Run) -> Vec<f64> {
        match self {
            Self::Sum(_, law) => law.simulated(run),
            Self::SetPoint(_, law) => law.simulated(run),
        }
    }

    /// Its parameters, each by name, value and unit, in the units of the recordings; `drive` is what drives it.
    pub(crate) fn parameters(&self, drive: &str) -> Vec<(&'static str, f64, String)> {
        let of = |name, value, unit: String| (name, value, unit);
        let speed = || format!("of the position per second and unit of the {drive}");
        let (in_drive, seconds) = (format!("of the {drive}"), || "s".to_owned());
        match *self {
            Self::Sum(kind, Plain { lag, zero, half_band, saturates, above_1_s, below_1_s }) => {
                let mut all = match kind {
                    PlainKind::Integrator => vec![of("gain", above_1_s, speed())],
                    _ => vec![of("gain above zero", above_1_s, speed()), of(GAIN_BELOW, below_1_s, speed())],
                };
                all.push(of("zero", zero, in_drive.clone()));
                if matches!(kind, PlainKind::DeadZone | PlainKind::PlainLaw) {
                    all.push(of("dead band, full width", 2.0 * half_band, in_drive.clone()));
                }
                if kind == PlainKind::PlainLaw {
                    if lag.has_delay() {
                        all.push(of(DELAY, lag.delay_s, seconds()));
                    }
                    if lag.constant_s > 0.0 {
                        all.push(of(LAG, lag.constant_s, seconds()));
                    }
                    if saturates.is_finite() {
                        all.push(of(SATURATES, saturates, in_drive));
                    }
                }
                all
            }
            Self::SetPoint(kind, law) => {
                let of = |part: Part| {
                    let unit = match part {
                        Part::Gain => format!("of the position per unit of the {drive}"),
                        Part::Level | Part::Play => "of the position".to_owned(),
                        Part::Forward => format!("of the {drive}'s speed"),
                        Part::Rising | Part::Falling => "of the position per second".to_owned(),
                        Part::Lag | Part::Delay | Part::Integral | Part::Valve => seconds(),
                    };
                    let width = if part == Part::Play { 2.0 } else { 1.0 };
                    of(title_of(part), width * law.value(part), unit)
                };
                kind.parts_of(law).map(of).collect()
            }
        }
    }
}
