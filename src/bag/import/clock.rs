//! Time as files write it: ISO 8601, patterns, epochs, Excel serials, seconds from a start; local times by their zone.

mod colon;
mod detect;
mod format;
mod words;
mod zone;

use std::borrow::Cow;

use jiff::Timestamp;
use jiff::civil::{Date, DateTime, Time};
use jiff::fmt::strtime::BrokenDownTime;
use jiff::tz::{AmbiguousOffset, Offset, TimeZone};

use super::map::TimeMap;
use super::number::{Numbers, decimal, decimal_ns};

pub(super) use detect::{are_times, detect, says_of_day};
pub use format::Format;
pub(super) use zone::of_header as zone_of_header;
use zone::zone;

/// A second, ns.
const SECOND_NS: i128 = 1_000_000_000;
/// A day, ns.
const DAY_NS: i64 = 86_400_000_000_000;
/// What a serial number of a day holds, ns: fifteen digits of a number of five before the point are 1e-10 days.
const SERIAL_GRAIN_NS: i64 = 100_000;
/// Days from Excel's zero, 30 December 1899, to 1970.
const EXCEL_DAYS: i64 = 25_569;
/// Days from MATLAB's zero to 1970.
const MATLAB_DAYS: i64 = 719_529;
/// Rows are no further apart where a count of the time of day that is not called so begins anew at midnight, ns.
const NEAR_MIDNIGHT_NS: i64 = 60_000_000_000;
/// An hour, ns.
const HOUR_NS: i64 = 3_600_000_000_000;

/// What counters of 16 and 32 bits count before they begin anew.
const COUNTS: [i64; 2] = [1 << 16, 1 << 32];
/// The last and the first part of a counter's range, one of so many: what lies between them is another jump of time.
const COUNTER_END: i64 = 16;

/// Reads the times of one file, in their order.
#[derive(Clone, Debug)]
pub struct TimeReader {
    format: Format,
    numbers: Numbers,
    zone: TimeZone,
    /// What a word behind the present time says of its zone.
    offset: Option<Offset>,
    /// The moment of relative times, ns, and the day of times without a date.
    start_ns: i64,
    day: Option<Date>,
    newest_ns: Option<i64>,
    /// The last count, time of day or of the hour, ns, and what those before it have lost by beginning anew, ns.
    last_ns: i64,
    lost_ns: i64,
    /// Its column says that it counts from midnight.
    of_day: bool,
    /// How often a counter began anew.
    pub wraps: u64,
    /// Times that the end of summer time makes ambiguous.
    pub folded: u64,
    /// Whether a zone was given.
    pub has_zone: bool,
    /// Whether times were local ones, to which a zone applies.
    pub used_zone: bool,
}

impl TimeReader {
    /// For a format and what the map says of time.
    ///
    /// # Errors
    /// In words, with the key of the map, where zone or start are none.
    pub(super) fn new(format: Format, map: &TimeMap, numbers: &Numbers) -> Result<Self, String> {
        let zone = map.zone.as_deref().map_or(Ok(TimeZone::UTC), zone)?;
        let mut clock = Self {
            format,
            numbers: numbers.clone(),
            zone,
            offset: None,
            start_ns: 0,
            day: None,
            newest_ns: None,
            last_ns: 0,
            lost_ns: 0,
            of_day: map.columns.iter().any(|name| says_of_day(name)),
            wraps: 0,
            folded: 0,
            has_zone: map.zone.is_some(),
            used_zone: false,
        };
        if let Some(start) = &map.start {
            let wanted = format!("time.start: expected a moment such as 2024-05-02T10:00:00+02:00, found `{start}`");
            let date = start.parse::<Date>().map_err(short);
            // A moment would be read as its day.
            clock.start_ns = match date.and_then(|date| if start.len() > 10 { Err(String::new()) } else { Ok(date) }) {
                Ok(date) => clock.at(date.to_datetime(Time::midnight()))?,
                Err(_) => clock.iso(start).map_err(|_| wanted)?,
            };
            clock.day =
                clock.zone.to_datetime(Timestamp::from_nanosecond(clock.start_ns.into()).map_err(short)?).date().into();
            clock.used_zone = false;
        }
        Ok(clock)
    }

    /// How its times are written.
    pub(super) fn format(&self) -> &Format {
        &self.format
    }

    /// One time, ns since 1970.
    ///
    /// # Errors
    /// In words, where it is none.
    pub(super) fn read(&mut self, text: &str) -> Result<i64, String> {
        let text = text.trim();
        let wanted = |format: &Format| format!("expected a time as `{}`, found `{text}`", format.name());
        let count = |unit_ns: i128| decimal_ns(&self.numbers.plain(text), unit_ns).ok_or_else(|| wanted(&self.format));
        let time_ns = match &self.format {
            Format::Epoch { unit_ns, zero_s } => {
                let since_ns =
                    decimal(&self.numbers.plain(text), (*unit_ns).into()).ok_or_else(|| wanted(&self.format))?;
                let time_ns = since_ns.checked_add(i128::from(*zero_s) * SECOND_NS);
                time_ns.and_then(|time_ns| i64::try_from(time_ns).ok()).ok_or_else(|| wanted(&self.format))?
            }
            Format::Relative { unit_ns } => {
                let (unit_ns, count_ns) = (*unit_ns, count((*unit_ns).into())?);
                self.unwrapped(count_ns, unit_ns).saturating_add(self.start_ns)
            }
            Format::Excel => self.serial(count(DAY_NS.into())?, EXCEL_DAYS)?,
            Format::WinCc => {
                let since_ns = count((DAY_NS / 1_000_000).into())?.checked_sub(EXCEL_DAYS * DAY_NS);
                let local_ns = since_ns.ok_or("a day beyond all calendars")?;
                self.local((local_ns + 500).div_euclid(1000) * 1000)?
            }
            Format::Matlab => {
                let days_ns = decimal_ns(&self.numbers.plain(text), (DAY_NS / 1000).into())
                    .ok_or_else(|| wanted(&self.format))?;
                self.matlab(days_ns)?
            }
            Format::Iso => self.iso(&colon::with_point(text))?,
            Format::Pattern(_) => self.pattern(text)?,
        };
        self.newest_ns = self.newest_ns.max(Some(time_ns));
        Ok(time_ns)
    }

    /// A count that goes on where a counter of 16 or 32 bits, or a day, begins anew.
    fn unwrapped(&mut self, count_ns: i64, unit_ns: i64) -> i64 {
        let last_ns = std::mem::replace(&mut self.last_ns, count_ns);
        if self.is_midnight(last_ns, count_ns) {
            self.lost_ns = self.lost_ns.saturating_add(DAY_NS);
            self.wraps += 1;
        } else if last_ns.saturating_sub(count_ns) > unit_ns.saturating_mul(COUNTS[0] / 2) {
            let begins_anew = |counts: &i64| {
                let range_ns = unit_ns.saturating_mul(*counts);
                // Without a sign it begins at 0, with one at minus half of its range.
                [0, range_ns / 2].into_iter().any(|below_ns| {
                    let (last_ns, count_ns) = (last_ns.saturating_add(below_ns), count_ns.saturating_add(below_ns));
                    (range_ns - range_ns / COUNTER_END..range_ns).contains(&last_ns)
                        && (0..range_ns / COUNTER_END).contains(&count_ns)
                })
            };
            if let Some(counts) = COUNTS.iter().find(|counts| begins_anew(counts)) {
                self.lost_ns = self.lost_ns.saturating_add(unit_ns.saturating_mul(*counts));
                self.wraps += 1;
            }
        }
        count_ns.saturating_add(self.lost_ns)
    }

    /// Whether a count of the time of day passes midnight between two rows, ns.
    fn is_midnight(&self, last_ns: i64, count_ns: i64) -> bool {
        let fell_ns = last_ns.saturating_sub(count_ns);
        let far = if self.of_day { DAY_NS / 2 } else { DAY_NS - NEAR_MIDNIGHT_NS };
        fell_ns > far && last_ns < DAY_NS && count_ns >= 0
    }

    /// A count of days since some zero as ns since 1970.
    fn serial(&mut self, since_zero_ns: i64, zero_days: i64) -> Result<i64, String> {
        let grains = (since_zero_ns + SERIAL_GRAIN_NS / 2).div_euclid(SERIAL_GRAIN_NS);
        let local_ns =
            (grains * SERIAL_GRAIN_NS).checked_sub(zero_days * DAY_NS).ok_or("a day beyond all calendars")?;
        self.local(local_ns)
    }

    /// MATLAB's days, which in ns would overflow, come as a thousandth.
    fn matlab(&mut self, thousandths: i64) -> Result<i64, String> {
        let since_1970 =
            thousandths.checked_sub(MATLAB_DAYS.saturating_mul(DAY_NS / 1000)).ok_or("a day beyond all calendars")?;
        let since_1970_ns = since_1970.checked_mul(1000).ok_or("a day beyond all calendars")?;
        self.serial(since_1970_ns, 0)
    }

    /// Local time, as ns as if its zone were UTC, as ns since 1970.
    pub(super) fn local(&mut self, local_ns: i64) -> Result<i64, String> {
        let timestamp = Timestamp::from_nanosecond(local_ns.into()).map_err(short)?;
        let local = TimeZone::UTC.to_datetime(timestamp);
        self.at(local)
    }

    fn iso(&mut self, text: &str) -> Result<i64, String> {
        // Commas before the fraction are as good as points in ISO 8601.
        let wanted =
            || format!("expected a time such as 2024-05-02T10:00:00.125 or 2024-05-02 10:00:00+02:00, found `{text}`");
        if let Ok(timestamp) = text.parse::<Timestamp>() {
            return ns(timestamp);
        }
        if let Some((local, offset)) = words::with_zone(text) {
            let local = local.parse::<DateTime>().map_err(|_| wanted())?;
            return ns(offset.to_timestamp(local).map_err(short)?);
        }
        self.at(text.parse::<DateTime>().map_err(|_| wanted())?)
    }

    fn pattern(&mut self, text: &str) -> Result<i64, String> {
        let Format::Pattern(pattern) = &self.format else { return Err("no pattern".into()) };
        // A word for the zone, which patterns do not read unless they say so; the map's pattern may have it as it stands.
        let literal = words::with_zone(pattern).map(|(pattern, _)| pattern.into_owned());
        let whole = text;
        let with_zone = if pattern.contains("%z") { None } else { words::with_zone(text) };
        self.offset = with_zone.as_ref().map(|(_, offset)| *offset);
        let text = with_zone.as_ref().map_or(text, |(local, _)| local);
        let pattern = literal.as_deref().filter(|_| with_zone.is_some()).unwrap_or(pattern);
        let text = if pattern.contains(":%f") { Cow::Borrowed(text) } else { colon::with_point(text) };
        let comma = !pattern.contains(',') && text.contains(',');
        let plain = if comma { text.replace(',', ".") } else { text.into_owned() };
        let in_words = pattern.contains("%b") || pattern.contains("%p");
        let plain = if in_words { words::english(&plain) } else { plain };
        let parts = BrokenDownTime::parse(pattern, &plain).map_err(|_| match words::with_unknown_zone(whole) {
            Some((_, word)) => format!("`{word}` in `{whole}` is no zone of one offset alone"),
            None => format!("expected a time as `{pattern}`, found `{whole}`"),
        })?;
        if parts.offset().is_some() || parts.iana_time_zone().is_some() {
            return ns(parts.to_timestamp().map_err(short)?);
        }
        if let Ok(local) = parts.to_datetime() {
            return self.at(local);
        }
        let date = parts.to_date().ok();
        if parts.hour().is_none() && parts.minute().is_some() && date.is_none() {
            return Ok(self.of_hour(&parts));
        }
        let time = parts.to_time().unwrap_or(Time::midnight());
        if let Some(date) = date {
            return self.at(date.to_datetime(time));
        }
        let of_day_ns = i64::try_from((time.duration_since(Time::midnight())).as_nanos()).unwrap_or(0);
        self.pass(of_day_ns, DAY_NS);
        let day = self.day.unwrap_or(Date::constant(1970, 1, 1));
        let day = (0..self.lost_ns / DAY_NS).try_fold(day, |day, _| day.tomorrow()).map_err(short)?;
        self.at(day.to_datetime(time))
    }

    /// Minutes and seconds, which begin anew with each hour, from the start.
    fn of_hour(&mut self, parts: &BrokenDownTime) -> i64 {
        let second = i64::from(parts.minute().unwrap_or(0)) * 60 + i64::from(parts.second().unwrap_or(0));
        let of_hour_ns = second * 1_000_000_000 + i64::from(parts.subsec_nanosecond().unwrap_or(0));
        self.pass(of_hour_ns, HOUR_NS);
        of_hour_ns + self.lost_ns + self.start_ns
    }

    /// Keeps a time of a period, the day or the hour, which has begun anew where it falls back by more than half of it.
    fn pass(&mut self, now_ns: i64, period_ns: i64) {
        if std::mem::replace(&mut self.last_ns, now_ns) - now_ns > period_ns / 2 {
            self.lost_ns += period_ns;
        }
    }

    /// Local time in the zone; where the end of summer time makes it ambiguous, the moment that goes on from the last one.
    fn at(&mut self, local: DateTime) -> Result<i64, String> {
        if let Some(offset) = self.offset {
            return ns(offset.to_timestamp(local).map_err(short)?);
        }
        self.used_zone = true;
        let ambiguous = self.zone.to_ambiguous_timestamp(local);
        match ambiguous.offset() {
            AmbiguousOffset::Unambiguous { .. } => ns(ambiguous.compatible().map_err(short)?),
            AmbiguousOffset::Fold { .. } => {
                self.folded += 1;
                let earlier = ns(ambiguous.earlier().map_err(short)?)?;
                let goes_back = self.newest_ns.is_some_and(|newest_ns| earlier < newest_ns);
                if goes_back { ns(ambiguous.later().map_err(short)?) } else { Ok(earlier) }
            }
            AmbiguousOffset::Gap { .. } => Err(format!(
                "{local} does not exist in the zone: clocks were set forward then; if the logger keeps winter time, give its \
                 offset instead, such as `time: {{zone: \"+01:00\"}}`"
            )),
        }
    }
}

fn ns(timestamp: Timestamp) -> Result<i64, String> {
    i64::try_from(timestamp.as_nanosecond()).map_err(|_| "a time beyond the year 2262".to_owned())
}

#[expect(clippy::needless_pass_by_value, reason = "for `map_err`")]
fn short(error: jiff::Error) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests;
