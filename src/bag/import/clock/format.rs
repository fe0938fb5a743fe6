//! The forms in which files write times, by name or pattern.

use std::borrow::Cow;

use crate::import::convert::with_factor;
use govtwin_model::params::nearest;

/// How time is written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Format {
    /// A count of so many ns from a fixed moment on, UTC.
    Epoch {
        /// The unit, ns.
        unit_ns: i64,
        /// The moment, s since 1970.
        zero_s: i64,
    },
    /// A count of so many ns from the start of the recording on.
    Relative {
        /// The unit, ns.
        unit_ns: i64,
    },
    /// Days since 30 December 1899, local time.
    Excel,
    /// Millionths of a day since 30 December 1899, local time, as WinCC writes them.
    WinCc,
    /// Days since the year 0, local time.
    Matlab,
    /// ISO 8601, with or without offset.
    Iso,
    /// A pattern as of `strftime`.
    Pattern(String),
}

/// 1 January 1601, from which Windows counts, s since 1970.
const WINDOWS_S: i64 = -11_644_473_600;
/// 1 January of the year 1, from which .NET counts, s since 1970.
const DOTNET_S: i64 = -62_135_596_800;
/// 1 January 1904, from which LabVIEW counts, s since 1970.
const LABVIEW_S: i64 = -2_082_844_800;

/// Names of formats that are no patterns.
const NAMED: [(&str, Format); 18] = [
    ("iso", Format::Iso),
    ("unix_s", Format::Epoch { unit_ns: 1_000_000_000, zero_s: 0 }),
    ("unix_ms", Format::Epoch { unit_ns: 1_000_000, zero_s: 0 }),
    ("unix_us", Format::Epoch { unit_ns: 1000, zero_s: 0 }),
    ("unix_ns", Format::Epoch { unit_ns: 1, zero_s: 0 }),
    ("filetime", Format::Epoch { unit_ns: 100, zero_s: WINDOWS_S }),
    ("windows_us", Format::Epoch { unit_ns: 1000, zero_s: WINDOWS_S }),
    ("dotnet_ticks", Format::Epoch { unit_ns: 100, zero_s: DOTNET_S }),
    ("labview_s", Format::Epoch { unit_ns: 1_000_000_000, zero_s: LABVIEW_S }),
    ("seconds", Format::Relative { unit_ns: 1_000_000_000 }),
    ("milliseconds", Format::Relative { unit_ns: 1_000_000 }),
    ("microseconds", Format::Relative { unit_ns: 1000 }),
    ("nanoseconds", Format::Relative { unit_ns: 1 }),
    ("minutes", Format::Relative { unit_ns: 60_000_000_000 }),
    ("hours", Format::Relative { unit_ns: 3_600_000_000_000 }),
    ("excel", Format::Excel),
    ("wincc_ms", Format::WinCc),
    ("matlab", Format::Matlab),
];

/// A text that is neither the name of a format of times nor a pattern.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{hint}expected a pattern such as \"%d.%m.%Y %H:%M:%S%.f\", or one of {}",
    names.join(", "),
    hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "))
)]
#[non_exhaustive]
pub struct FormatError {
    /// The name that it may be meant for.
    pub near: Option<&'static str>,
    /// The names that there are.
    pub names: Vec<&'static str>,
}

impl Format {
    /// From its name, or as a pattern.
    ///
    /// # Errors
    /// Where it is neither.
    pub fn of(text: &str) -> Result<Self, FormatError> {
        if let Some((_, format)) = NAMED.iter().find(|(name, _)| *name == text) {
            return Ok(format.clone());
        }
        if text.contains('%') {
            return Ok(Self::Pattern(text.to_owned()));
        }
        let (factor, name) = with_factor(text);
        if let Some((_, Self::Relative { unit_ns })) = NAMED.iter().find(|(known, _)| *known == name)
            && let Some(unit_ns) = whole_ns(factor, *unit_ns)
        {
            return Ok(Self::Relative { unit_ns });
        }
        let names = NAMED.map(|(name, _)| name);
        Err(FormatError { near: nearest(text, names), names: names.to_vec() })
    }

    /// Its name, or the pattern; empty where it has none.
    pub fn name(&self) -> Cow<'_, str> {
        match self {
            Self::Pattern(pattern) => Cow::Borrowed(pattern),
            named => match NAMED.iter().find(|(_, format)| format == named) {
                Some((name, _)) => Cow::Borrowed(*name),
                None => self.scaled_name().into(),
            },
        }
    }

    /// The name of a count of another unit than those of the table, as `0.1 milliseconds`.
    fn scaled_name(&self) -> String {
        match self {
            Self::Relative { unit_ns } => format!("{} milliseconds", *unit_ns as f64 / 1e6),
            _ => String::new(),
        }
    }
}

/// So many of a unit, ns, where they are a whole number of ns.
#[expect(clippy::cast_possible_truncation, reason = "whole and below 3e15")]
pub(super) fn whole_ns(factor: f64, unit_ns: i64) -> Option<i64> {
    let product_ns = factor * unit_ns as f64;
    let whole = product_ns.round();
    // A month is more than any count's unit.
    let is_whole = (whole - product_ns).abs() <= 1e-6 * product_ns && (1.0..3e15).contains(&whole);
    is_whole.then_some(whole as i64)
}
