//! Limits on the figures of a replay, and a stored replay as a limit: what makes a replay a test that can fail.
//!
//! A limit is `[PROCESS.]SIGNAL.MEASURE<=VALUE[UNIT]`, such as `spool.rmse<=0.5%` or `load_rejection.servomotor.max<=1%`. It holds for each recording,
//! or for each of the process that it names, so that a report can name the recording that breaks it. A limit that no recording shows is
//! broken: a test that silently covers less must not pass.

mod baseline;

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use govtwin_model::recording::Process;
use govtwin_model::replay::figures::SignalFigures;
use govtwin_model::signal::Signal;

use crate::replay_summary::{RecordingFigures, ReplaySummary};
pub use baseline::{Baseline, BaselineError};

/// Units of a limit, by the unit of the signal: name, and how many of the signal's unit it is.
const UNITS: [(&str, &str, f64); 7] = [
    ("pu", "%", 0.01),
    ("pu", "pu", 1.0),
    ("pu", "", 1.0),
    ("Pa", "Pa", 1.0),
    ("Pa", "kPa", 1e3),
    ("Pa", "bar", 1e5),
    ("Pa", "MPa", 1e6),
];

/// A figure that may have a limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Mean absolute error.
    Mae,
    /// Root mean square error.
    Rmse,
    /// Largest absolute error.
    Max,
    /// Size of the mean of simulated − measured.
    Bias,
    /// Coefficient of determination.
    R2,
}

impl Measure {
    /// All five.
    pub const ALL: [Self; 5] = [Self::Mae, Self::Rmse, Self::Max, Self::Bias, Self::R2];

    /// The name in limits.
    pub fn id(self) -> &'static str {
        match self {
            Self::Mae => "mae",
            Self::Rmse => "rmse",
            Self::Max => "max",
            Self::Bias => "bias",
            Self::R2 => "r2",
        }
    }

    /// Its value among the figures of a signal, in the signal's unit.
    pub fn of(self, figures: &SignalFigures) -> f64 {
        match self {
            Self::Mae => figures.mae,
            Self::Rmse => figures.rmse,
            Self::Max => figures.max_abs,
            Self::Bias => figures.bias.abs(),
            Self::R2 => figures.r2,
        }
    }
}

/// The short name of a signal in limits.
pub fn short_name(signal: Signal) -> &'static str {
    match signal {
        Signal::SpoolPosition => "spool",
        Signal::PilotValvePosition => "pilot_valve",
        Signal::ControlPressure => "control_pressure",
        Signal::ServomotorPosition => "servomotor",
    }
}

/// On which side of a limit a figure must lie.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Side {
    /// Not above it.
    AtMost,
    /// Not below it.
    AtLeast,
}

impl Side {
    fn keeps(self, value: f64, bound: f64) -> bool {
        match self {
            Self::AtMost => value <= bound,
            Self::AtLeast => value >= bound,
        }
    }

    /// As it is written.
    pub fn sign(self) -> &'static str {
        match self {
            Self::AtMost => "<=",
            Self::AtLeast => ">=",
        }
    }
}

/// A limit that a user requires.
#[derive(Clone, Debug, PartialEq)]
pub struct RequiredLimit {
    /// As the user wrote it.
    pub text: String,
    /// The process whose recordings it is for; `None` for every recording.
    pub process: Option<Process>,
    /// The signal.
    pub signal: Signal,
    /// The figure.
    pub measure: Measure,
    /// The side.
    pub side: Side,
    /// The bound, in the signal's unit; R² has none.
    pub bound: f64,
}

/// A text that is no limit.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "limit `{text}`: {problem}; expected [PROCESS.]SIGNAL.MEASURE<=VALUE[UNIT], such as spool.rmse<=0.5% or shutdown.servomotor.r2>=0.99"
)]
pub struct LimitError {
    text: String,
    problem: String,
}

impl FromStr for RequiredLimit {
    type Err = LimitError;

    fn from_str(text: &str) -> Result<Self, LimitError> {
        let text = text.trim();
        let parsed = parse(text);
        parsed.map_err(|problem| LimitError { text: text.to_owned(), problem })
    }
}

fn parse(text: &str) -> Result<RequiredLimit, String> {
    let sides = [Side::AtMost, Side::AtLeast];
    let found = sides.into_iter().find_map(|side| Some((side, text.split_once(side.sign())?)));
    let (side, (name, value)) = found.ok_or("found neither <= nor >=")?;
    let parts: Vec<&str> = name.split('.').map(str::trim).collect();
    let (process, signal, measure) = match parts[..] {
        [signal, measure] => (None, signal, measure),
        [process, signal, measure] => (Some(process), signal, measure),
        _ => return Err(format!("found {} names before {}", parts.len(), side.sign())),
    };
    let process = process.map(|name| named("process", name, &Process::ALL, Process::id)).transpose()?;
    let signal = Signal::ALL
        .into_iter()
        .find(|one| one.id() == signal)
        .map_or_else(|| named("signal", signal, &Signal::ALL, short_name), Ok)?;
    let measure = named("measure", measure, &Measure::ALL, Measure::id)?;
    let value = value.trim();
    let end = value.find(|c: char| c == '%' || c.is_alphabetic() && !matches!(c, 'e' | 'E')).unwrap_or(value.len());
    let (number, unit) = (value[..end].trim(), value[end..].trim());
    let number: f64 = number.parse().map_err(|_| format!("`{value}` is no number with a unit"))?;
    let scale = match measure {
        Measure::R2 if unit.is_empty() => 1.0,
        Measure::R2 => return Err(format!("R² has no unit, found `{unit}`")),
        _ => scale(signal, unit)?,
    };
    let bound = number * scale;
    let is_size = measure != Measure::R2;
    if !bound.is_finite() || is_size && bound < 0.0 {
        return Err(format!("{value} is no bound of {}", if is_size { "an error, which is 0 or above" } else { "R²" }));
    }
    Ok(RequiredLimit { text: text.to_owned(), process, signal, measure, side, bound })
}

/// How many of the signal's unit a unit is.
fn scale(signal: Signal, unit: &str) -> Result<f64, String> {
    let of_signal = || UNITS.iter().filter(|(of, ..)| *of == signal.unit());
    let known = of_signal().find(|(_, name, _)| *name == unit).map(|(.., scale)| *scale);
    known.ok_or_else(|| {
        let units: Vec<&str> = of_signal().map(|(_, name, _)| *name).filter(|name| !name.is_empty()).collect();
        let found = if unit.is_empty() { "found none".to_owned() } else { format!("found `{unit}`") };
        format!("{} takes a limit in {}, {found}", short_name(signal), units.join(", "))
    })
}

fn named<T: Copy>(what: &str, found: &str, all: &[T], name: impl Fn(T) -> &'static str) -> Result<T, String> {
    all.iter().copied().find(|one| name(*one) == found).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|one| name(*one)).collect();
        format!("`{found}` is no {what}: {}", names.join(", "))
    })
}

/// How a figure stands to its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Standing {
    /// It keeps the limit.
    Passes,
    /// It breaks the limit.
    Fails,
    /// There is no figure, which breaks the limit too.
    NotMeasured,
}

/// Where the error of a signal is largest within a recording, s from its start.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Stretch {
    /// From.
    pub from_s: f64,
    /// To.
    pub to_s: f64,
}

/// One figure beside its limit.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// The limit as required, or the figure of the baseline with what it may grow by.
    pub limit: String,
    /// The recording, process or `overall` whose figure it is.
    pub of: String,
    /// Position of the recording among those of the replay; `None` of a process.
    #[serde(skip)]
    pub recording: Option<usize>,
    /// The signal.
    pub signal: Signal,
    /// The figure.
    pub measure: Measure,
    /// Its value, in `unit`; `null` where there is none.
    pub value: f64,
    /// On which side of the bound it must lie.
    pub side: Side,
    /// The bound, in `unit`.
    pub bound: f64,
    /// Unit of both; 1 of R².
    pub unit: &'static str,
    /// How they stand.
    pub standing: Standing,
    /// Why there is no figure, where there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Where the error of a recording that fails is largest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stretch: Option<Stretch>,
}

impl Check {
    /// Whether it breaks its limit.
    pub fn is_broken(&self) -> bool {
        self.standing != Standing::Passes
    }

    fn of(
        of: String,
        limit: String,
        (signal, measure, side, bound): (Signal, Measure, Side, f64),
        figures: Option<&SignalFigures>,
    ) -> Self {
        let value = figures.map_or(f64::NAN, |figures| measure.of(figures));
        let reason = match figures {
            None => Some("no recording shows it".to_owned()),
            Some(one) if one.stands_in => Some("the measured signal stands in at the cut".to_owned()),
            Some(one) if one.left_out > 0 => {
                Some(format!("the twin has no finite value in {} measured rows", one.left_out))
            }
            Some(_) if value.is_nan() => Some("not measured".to_owned()),
            Some(_) => None,
        };
        let standing = match reason {
            Some(_) => Standing::NotMeasured,
            None if side.keeps(value, bound) => Standing::Passes,
            None => Standing::Fails,
        };
        let unit = if measure == Measure::R2 { "1" } else { signal.unit() };
        Self { limit, of, recording: None, signal, measure, value, side, bound, unit, standing, reason, stretch: None }
    }
}

impl fmt::Display for Check {
    /// One line: whose figure, its value, and the bound.
    #[expect(clippy::single_match_else, reason = "the two ways read alike")]
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let shown = |value: f64| match self.unit {
            "pu" => format!("{} %", govtwin_model::number::significant(100.0 * value, 3)),
            "Pa" => format!("{} kPa", govtwin_model::number::significant(1e-3 * value, 3)),
            _ => govtwin_model::number::significant(value, 5),
        };
        write!(f, "{}: {}.{}", self.of, short_name(self.signal), self.measure.id())?;
        match &self.reason {
            Some(reason) => write!(f, ": {reason}; required {}", self.limit),
            None => {
                let word = match (self.standing, self.side) {
                    (Standing::Passes, Side::AtMost) => "is not above",
                    (Standing::Passes, Side::AtLeast) => "is not below",
                    (_, Side::AtMost) => "is above",
                    (_, Side::AtLeast) => "is below",
                };
                write!(f, " {} {word} {} ({})", shown(self.value), shown(self.bound), self.limit)
            }
        }?;
        self.stretch.map_or(Ok(()), |at| write!(f, "; largest error from {:.1} s to {:.1} s", at.from_s, at.to_s))
    }
}

/// All figures that have a limit.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Validation {
    /// Whether every figure keeps its limit.
    pub passed: bool,
    /// Figure by figure: those of required limits, then those of the baseline.
    pub checks: Vec<Check>,
}

impl Validation {
    /// The checks that break their limits.
    pub fn broken(&self) -> impl Iterator<Item = &Check> {
        self.checks.iter().filter(|check| check.is_broken())
    }
}

/// Holds the figures of a replay against limits and a baseline, which may be exceeded by a share; `stretch` finds where the error of a signal is largest
/// within a recording.
pub fn validate(
    summary: &ReplaySummary,
    limits: &[RequiredLimit],
    baseline: Option<(&Baseline, f64)>,
    stretch: impl Fn(usize, Signal) -> Option<Stretch>,
) -> Validation {
    let mut checks: Vec<Check> = limits.iter().flat_map(|limit| required(summary, limit)).collect();
    checks.extend(baseline.into_iter().flat_map(|(baseline, worse_by)| baseline.checks(summary, worse_by)));
    for check in checks.iter_mut().filter(|check| check.is_broken()) {
        check.stretch = check.recording.and_then(|at| stretch(at, check.signal));
    }
    Validation { passed: !checks.iter().any(Check::is_broken), checks }
}

/// A limit on every recording that it is for.
fn required(summary: &ReplaySummary, limit: &RequiredLimit) -> Vec<Check> {
    let RequiredLimit { process, signal, measure, side, bound, .. } = *limit;
    let is_meant = |one: &RecordingFigures| process.is_none_or(|process| process.id() == one.process);
    let check =
        |of: &str, figures| Check::of(of.to_owned(), limit.text.clone(), (signal, measure, side, bound), figures);
    let meant = summary.recordings.iter().enumerate().filter(|(_, one)| is_meant(one));
    let checks: Vec<Check> = meant
        .map(|(at, one)| Check { recording: Some(at), ..check(&one.name, figures_of(&one.signals, signal)) })
        .collect();
    if checks.is_empty() { vec![check(process.map_or("overall", Process::id), None)] } else { checks }
}

fn figures_of(signals: &[SignalFigures], signal: Signal) -> Option<&SignalFigures> {
    signals.iter().find(|figures| figures.name == signal.id())
}

#[cfg(test)]
mod tests;
