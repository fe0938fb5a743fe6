//! Periods of the calendar, UTC, and which one a recording begins in.

use clap::ValueEnum;
use jiff::Timestamp;
use jiff::civil::Date;
use jiff::tz::Offset;

/// How long a period is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Period {
    /// A calendar day, such as 2024-03-09.
    Day,
    /// A calendar month, such as 2024-03.
    Month,
    /// A quarter, such as 2024-Q1.
    Quarter,
    /// A year, such as 2024.
    Year,
    /// All recordings of a unit in one entry.
    All,
}

impl Period {
    /// The period of a time, ns since 1970. Names sort by time.
    pub fn of(self, time_ns: i64) -> String {
        // Every number of nanoseconds of 64 bits is a time that the calendar knows.
        let time = Timestamp::from_nanosecond(time_ns.into()).unwrap_or(Timestamp::UNIX_EPOCH);
        let date: Date = Offset::UTC.to_datetime(time).date();
        let (year, month) = (date.year(), date.month());
        match self {
            Self::Day => date.to_string(),
            Self::Month => format!("{year:04}-{month:02}"),
            Self::Quarter => format!("{year:04}-Q{}", (month + 2) / 3),
            Self::Year => format!("{year:04}"),
            Self::All => "all".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Period;

    #[test]
    fn a_time_lies_in_its_period_and_names_sort() {
        // 2024-02-29 23:59:59 UTC and a second later.
        let (before, after) = (1_709_251_199_000_000_000, 1_709_251_200_000_000_000);
        let of = |period: Period| [before, after].map(|time_ns| period.of(time_ns));
        assert_eq!(of(Period::Day), ["2024-02-29", "2024-03-01"]);
        assert_eq!(of(Period::Month), ["2024-02", "2024-03"]);
        assert_eq!(of(Period::Quarter), ["2024-Q1", "2024-Q1"]);
        assert_eq!(of(Period::Year), ["2024", "2024"]);
        assert_eq!(of(Period::All), ["all", "all"]);
        assert_eq!(Period::Quarter.of(0), "1970-Q1");
    }
}
