//! Limits that a user gives, and whether an interval is within them.

use serde::Serialize;

use super::Measure;
use crate::result::Interval;

/// What a contract or a standard asks of one measure.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Limit {
    /// The least value allowed, in the measure's unit.
    pub min: Option<f64>,
    /// The largest value allowed, in the measure's unit.
    pub max: Option<f64>,
    /// The source of the limit, in the user's words; empty if none is given.
    pub source: String,
}

/// The limits of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AcceptanceLimits {
    /// What the file calls itself; empty where it gives no name.
    pub name: String,
    /// Limits by measure, each measure once.
    pub of: Vec<(Measure, Limit)>,
}

impl AcceptanceLimits {
    /// The limit of a measure, where there is one.
    pub fn limit(&self, measure: Measure) -> Option<&Limit> {
        self.of.iter().find(|(known, _)| *known == measure).map(|(_, limit)| limit)
    }
}

/// The result of a measure against its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum LimitStanding {
    /// The whole interval keeps the limit.
    Passes,
    /// The whole interval breaks it.
    Fails,
    /// The interval holds values on both sides.
    Undecided,
    /// There is a limit, and no value.
    NotMeasured,
}

impl LimitStanding {
    /// The word in reports.
    pub fn word(self) -> &'static str {
        match self {
            Self::Passes => "passes",
            Self::Fails => "fails",
            Self::Undecided => "undecided",
            Self::NotMeasured => "not measured",
        }
    }
}

impl Limit {
    /// The result of a value against it.
    pub fn judge(&self, value: Option<Interval>) -> LimitStanding {
        let Some(Interval { low, high, .. }) = value else { return LimitStanding::NotMeasured };
        let keeps = |value: f64| self.min.is_none_or(|min| value >= min) && self.max.is_none_or(|max| value <= max);
        let beyond = self.max.is_some_and(|max| low > max) || self.min.is_some_and(|min| high < min);
        if keeps(low) && keeps(high) {
            LimitStanding::Passes
        } else if beyond {
            LimitStanding::Fails
        } else {
            LimitStanding::Undecided
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Limit, LimitStanding};
    use crate::result::Interval;

    #[test]
    fn a_limit_is_kept_or_broken_by_the_whole_interval() {
        let limit = Limit { min: Some(1.0), max: Some(2.0), source: String::new() };
        for (low, high, expected) in [
            (1.0, 2.0, LimitStanding::Passes),
            (2.1, 3.0, LimitStanding::Fails),
            (0.1, 0.9, LimitStanding::Fails),
            (1.9, 2.1, LimitStanding::Undecided),
            (0.5, 3.0, LimitStanding::Undecided),
        ] {
            assert_eq!(limit.judge(Some(Interval { value: low, low, high })), expected, "{low} {high}");
        }
        assert_eq!(limit.judge(None), LimitStanding::NotMeasured);
        assert_eq!(
            Limit { min: None, ..limit }.judge(Some(Interval { value: 0.0, low: 0.0, high: 1.0 })),
            LimitStanding::Passes
        );
    }
}
