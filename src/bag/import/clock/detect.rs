//! How the times of a file are written, found out from some of them; what may be meant two ways is not guessed.

use std::borrow::Cow;

use super::format::whole_ns;
use super::{Format, colon, words};
use crate::import::convert::{either_factor, plain, with_factor};
use crate::import::map::TimeMap;
use crate::import::number::{NumberCell, Numbers};
use crate::import::words::Words;

/// Patterns that are tried, the more special first; of the last two only one may fit.
const PATTERNS: Words = Words(
    "%Y/%m/%d %H:%M:%S%.f|%Y.%m.%d %H:%M:%S%.f|%Y%m%dT%H%M%S%.f|%Y%m%d %H:%M:%S%.f|%Y%m%d %H%M%S%.f|%Y-%m-%d %H:%M|\
     %d.%m.%Y %H:%M:%S%.f|%d.%m.%y %H:%M:%S%.f|%d.%m.%Y %H:%M|%d.%m.%y %H:%M|%d-%m-%Y %H:%M:%S%.f|\
     %d-%b-%Y %H:%M:%S%.f|%d-%b-%y %H:%M:%S%.f|%d-%b-%y %I.%M.%S%.f %p|%a, %d %b %Y %H:%M:%S%.f|%d %b %Y %H:%M:%S%.f|%b %d, %Y %I:%M:%S%.f %p|\
     %b %d %Y %I:%M:%S%.f %p|%a %b %d %H:%M:%S%.f %Y|%Y年%m月%d日 %H:%M:%S%.f|%Y年%m月%d日%H时%M分%S%.f秒|%Y/%m/%d %p %I:%M:%S%.f|%Y-%jT%H:%M:%S%.f|%H:%M:%S%.f|%M:%S.%f|\
     %m/%d/%Y %I:%M:%S%.f %p|%d/%m/%Y %I:%M:%S%.f %p|%m/%d/%Y %H:%M:%S%.f|%d/%m/%Y %H:%M:%S%.f|%m/%d/%Y %H:%M|%d/%m/%Y %H:%M|\
     %m/%d/%y %H:%M:%S%.f|%d/%m/%y %H:%M:%S%.f",
);

/// What was found out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Detected {
    /// The format.
    pub format: Format,
    /// Why, for people.
    pub why: String,
}

/// Finds out how some times are written, in the order of the file; `name` and `unit` are those of their column.
///
/// # Errors
/// In words, where no format fits, or more than one.
pub(in crate::import) fn detect(
    texts: &[String],
    name: &str,
    unit: &str,
    numbers: &Numbers,
) -> Result<Detected, String> {
    if let Some(stamp) = digits_alone(texts, numbers) {
        let why = format!("`{}` is read as {stamp}, digits alone", texts[0].trim());
        return Ok(Detected { format: Format::Pattern(stamp.to_owned()), why });
    }
    let cells: Vec<NumberCell> = texts.iter().map(|text| numbers.cell(text)).collect();
    let values: Vec<f64> =
        cells.iter().filter_map(|cell| if let NumberCell::Number(x) = cell { Some(*x) } else { None }).collect();
    if values.len() * 10 >= texts.len() * 9 && !values.is_empty() {
        return number(&values, name, unit);
    }
    let texts: Vec<&String> = texts.iter().filter(|text| !numbers.is_missing(text.trim())).collect();
    let example = texts.first().map(|text| text.trim()).unwrap_or_default();
    let fits = |format: &Format| {
        let mut clock = super::TimeReader::new(format.clone(), &TimeMap::default(), numbers).ok()?;
        // A footer or a broken line does not decide.
        let read = texts.iter().filter(|text| clock.read(text).is_ok()).count();
        (read * 10 >= texts.len() * 9 && read > 0).then_some(())
    };
    if let Some(problem) = colon::unclear(texts.iter().map(|text| text.as_str())) {
        return Err(format!("column `{name}`, `{example}`: {problem}"));
    }
    let found = |format: Format| {
        let why = format!("`{example}` is read as {}", format.name());
        Ok(Detected { format, why })
    };
    if fits(&Format::Iso).is_some() {
        return found(Format::Iso);
    }
    let fitting: Vec<&str> =
        PATTERNS.all().filter(|pattern| fits(&Format::Pattern((*pattern).to_owned())).is_some()).collect();
    match fitting[..] {
        [first, other, ..] if first.starts_with("%m/%d") => Err(format!(
            "`{example}` may be month/day or day/month; say which with `time: {{format: \"{first}\"}}` or `{{format: \"{other}\"}}` in \
             the map"
        )),
        [first, ..] => found(Format::Pattern(first.to_owned())),
        [] => Err(unknown_zone(&texts, numbers).map_or_else(|| format!(
            "column `{name}`: expected times, found `{example}`; give their pattern, such as `time: {{format: \"%d.%m.%Y \
             %H:%M:%S%.f\"}}`, or name another column"
        ), |problem| format!("column `{name}`: {problem}"))),
    }
}

/// What to say of times that can be read but for the word for their zone behind them.
fn unknown_zone(texts: &[&String], numbers: &Numbers) -> Option<String> {
    let parted = texts.iter().filter_map(|text| words::with_unknown_zone(text));
    let (_, word) = parted.clone().next()?;
    let bare: Vec<String> = parted.filter(|(_, other)| *other == word).map(|(local, _)| local.into_owned()).collect();
    let format = (bare.len() * 10 >= texts.len() * 9).then(|| detect(&bare, "", "", numbers).ok())??.format;
    let name = format.name();
    let pattern = if format == Format::Iso { "%Y-%m-%d %H:%M:%S%.f" } else { &name };
    Some(format!(
        "`{word}` behind the times means several zones, or none that is known; say which with `time: {{format: \"{pattern} {word}\", zone: …}}` in \
         the map"
    ))
}

/// Whether nearly all texts are dates or times of day in one of the known ways, or look like some.
pub(in crate::import) fn are_times(texts: &[String], numbers: &Numbers) -> bool {
    let formats = [Format::Iso].into_iter().chain(PATTERNS.all().map(|pattern| Format::Pattern(pattern.to_owned())));
    let most = |count: usize| count * 10 >= texts.len() * 9 && count > 0;
    let looks = |text: &&String| {
        let text = text.trim();
        let digits = text.chars().filter(char::is_ascii_digit).count();
        // A date and a time of day have six digits and more, and signs or words of several kinds between them.
        let signs = ['-', '/', '.', ':', 'T', '年', '月', '时'].into_iter().filter(|sign| text.contains(*sign)).count();
        digits >= 6 && signs >= 2
    };
    most(texts.iter().filter(looks).count())
        || formats.into_iter().any(|format| {
            let clock = super::TimeReader::new(format, &TimeMap::default(), numbers);
            clock.is_ok_and(|mut clock| most(texts.iter().filter(|text| clock.read(text).is_ok()).count()))
        })
}

/// How digits alone write date and time of day, where all are such: no count of anything falls into these years with as many digits.
fn digits_alone(texts: &[String], numbers: &Numbers) -> Option<&'static str> {
    ["%Y%m%d%H%M%S%.f", "%Y%m%d%H%M%S%f"].into_iter().find(|pattern| {
        let map = TimeMap::default();
        let Ok(mut clock) = super::TimeReader::new(Format::Pattern((*pattern).to_owned()), &map, numbers) else {
            return false;
        };
        let mut texts = texts.iter().map(|text| text.trim()).filter(|text| !numbers.is_missing(text)).peekable();
        texts.peek().is_some()
            && texts.all(|text| {
                let enough = text.bytes().take_while(u8::is_ascii_digit).count() >= 14;
                enough && clock.read(text).is_ok_and(|time_ns| RECORDED_S.contains(&(time_ns as f64 * 1e-9)))
            })
    })
}

/// Years between which recordings are made that anybody imports, s since 1970: from 1992 to 2050.
const RECORDED_S: std::ops::Range<f64> = 694_224_000.0..2_524_608_000.0;
/// The least and the most time between two rows of a governor's recording, s, whose processes take seconds: outside, the unit of the counts is
/// another one.
const STEP_S: std::ops::RangeInclusive<f64> = 2e-4..=5.0;
/// The same where the header states the unit.
const STATED_STEP_S: std::ops::RangeInclusive<f64> = 1e-5..=60.0;

/// What Excel counts in those years, days.
const EXCEL: std::ops::Range<f64> = 33_604.0..54_789.0;
/// What WinCC counts in those years, millionths of a day.
const WINCC: std::ops::Range<f64> = 3.36e10..5.48e10;

/// Counts from a fixed moment, with their unit and that moment, s, in words.
const MOMENTS: [(&str, &str); 8] = [
    ("unix_ns", "nanoseconds since 1970"),
    ("unix_us", "microseconds since 1970"),
    ("unix_ms", "milliseconds since 1970"),
    ("unix_s", "seconds since 1970"),
    ("filetime", "Windows FILETIME: 100 ns since 1601"),
    ("windows_us", "microseconds since 1601"),
    ("dotnet_ticks", ".NET ticks: 100 ns since the year 1"),
    ("labview_s", "LabVIEW: seconds since 1904"),
];

/// The unit that a text states: name in a map, with the factor before it, and unit in ns.
fn stated(unit: &str) -> Option<(Cow<'static, str>, i64)> {
    let (factor, bare) = with_factor(unit);
    let (name, unit_ns) = plain_unit(bare)?;
    let unit_ns = whole_ns(factor, unit_ns)?;
    Some((if factor == 1.0 { name.into() } else { format!("{factor} {name}").into() }, unit_ns))
}

/// The unit that a text without a factor states.
fn plain_unit(unit: &str) -> Option<(&'static str, i64)> {
    Some(match plain(unit).as_str() {
        "s" | "sec" | "secs" | "second" | "seconds" | "sekunden" | "sek" => ("seconds", 1_000_000_000),
        "ms" | "msec" | "millis" | "millisecond" | "milliseconds" | "millisekunden" => ("milliseconds", 1_000_000),
        "us" | "µs" | "\u{3bc}s" | "usec" | "micros" | "microsecond" | "microseconds" => ("microseconds", 1000),
        "ns" | "nsec" | "nanos" | "nanosecond" | "nanoseconds" => ("nanoseconds", 1),
        "min" | "minutes" => ("minutes", 60_000_000_000),
        "h" | "hours" => ("hours", 3_600_000_000_000),
        _ => return None,
    })
}

/// The unit in a name such as `t_ms` or `us since boot`; `min` and `h` in names say other things as well.
fn in_name(name: &str) -> Option<(&'static str, i64)> {
    let lower = name.to_lowercase();
    let mut words = lower.split(|letter: char| !letter.is_alphanumeric()).filter(|word| !["min", "h"].contains(word));
    words.find_map(plain_unit)
}

/// What names of columns say that count from midnight, without blanks and signs.
const OF_DAY: Words =
    Words("ofday|oftheday|midnight|mitternacht|destages|minuit|dujour|medianoche|deldia|mezzanotte|delgiorno");

/// Whether a column, by its name, counts a unit of time from midnight: `ms of day`, `seconds since midnight`.
pub(in crate::import) fn says_of_day(name: &str) -> bool {
    let letters: String = name.to_lowercase().chars().filter(|letter| letter.is_alphabetic()).collect();
    in_name(name).is_some() && OF_DAY.all().any(|words| letters.contains(words))
}

/// What to say of a unit in a header that has a number in a way that is not understood.
fn unclear(name: &str, unit: &str) -> Option<String> {
    let inside =
        name.trim().strip_suffix([']', ')']).and_then(|rest| rest.rsplit_once(['[', '('])).map(|(_, inside)| inside);
    let unit = if unit.is_empty() { inside? } else { unit };
    let has_number =
        unit.contains(|letter: char| letter.is_numeric()) && in_name(unit).or_else(|| plain_unit(unit)).is_some();
    let meant = either_factor(unit).map(|[one, other]| format!(", which may mean {one} or {other}"));
    (has_number || meant.is_some()).then(|| {
        format!(
            "column `{name}`: its header says `{unit}`{}; say how it counts with `time: {{format: …}}` in the map, such as `0.1 milliseconds`",
            meant.unwrap_or_else(|| ", which is not understood".to_owned())
        )
    })
}

/// Fixed moments from which such counts fall into the years of recordings.
fn moments(first: f64, unit_ns: Option<i64>) -> Vec<(Format, &'static str)> {
    let formats = MOMENTS.iter().filter_map(|(name, words)| Some((Format::of(name).ok()?, *words)));
    formats
        .filter(|(format, _)| {
            let Format::Epoch { unit_ns: unit, zero_s } = format else { return false };
            let moment_s = first * (*unit as f64 * 1e-9) + *zero_s as f64;
            unit_ns.is_none_or(|stated| stated == *unit) && RECORDED_S.contains(&moment_s)
        })
        .collect()
}

fn number(values: &[f64], name: &str, unit: &str) -> Result<Detected, String> {
    let found = |format: Format, why: &str| Ok(Detected { format, why: why.to_owned() });
    let first = values[0];
    let mut steps: Vec<f64> =
        values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    let step = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    let asked = |found: &str| {
        Err(format!(
            "column `{name}` begins at {first} and changes by {step} from row to row: {found}; say how it counts with `time: {{format: …}}` in \
             the map: seconds, milliseconds, microseconds or nanoseconds from a start, unix_s, unix_ms, unix_us or unix_ns since 1970, filetime, \
             dotnet_ticks or labview_s"
        ))
    };
    let apart = |format: Format, words: &str, within: std::ops::RangeInclusive<f64>, why: &str| {
        let (Format::Epoch { unit_ns, .. } | Format::Relative { unit_ns }) = format else { return found(format, why) };
        let step_s = step * unit_ns as f64 * 1e-9;
        if step > 0.0 && !within.contains(&step_s) {
            return asked(&format!("as {words} its rows are {step_s} s apart, which those of a governor are not"));
        }
        found(format, why)
    };
    if name.trim().eq_ignore_ascii_case("time_ms") && WINCC.contains(&first) {
        return found(Format::WinCc, "numbers of this size are WinCC's millionths of a day since 1900");
    }
    if name.to_lowercase().contains("gps") && first > LARGE {
        return asked("the clock of GPS counts from 1980 and has no leap seconds");
    }
    // What the header says counts before the size of the numbers.
    let of_unit = stated(unit);
    if let (None, Some(problem)) = (&of_unit, unclear(name, unit)) {
        return Err(problem);
    }
    if let Some((words, unit_ns)) = of_unit.or_else(|| in_name(name).map(|(words, unit_ns)| (words.into(), unit_ns))) {
        return match &moments(first, Some(unit_ns))[..] {
            [] => apart(Format::Relative { unit_ns }, &words, STATED_STEP_S, &format!("the header says {words}")),
            [(format, since), ..] => {
                let why = format!("the header says {words}, and numbers of this size are {since}");
                apart(format.clone(), since, STATED_STEP_S, &why)
            }
        };
    }
    if let [(format, since)] = &moments(first, None)[..] {
        return apart(format.clone(), since, STEP_S, &format!("numbers of this size are {since}"));
    }
    if (7e5..8e5).contains(&first) && step < 0.02 {
        return found(Format::Matlab, "numbers of this size with such small steps are MATLAB's days");
    }
    if (2e4..8e4).contains(&first) {
        if step < 0.002 && !EXCEL.contains(&first) {
            return asked(
                "as days of Excel they are of no recording's year, and Modified Julian Days are not read: export dates as text",
            );
        }
        if step < 0.002 {
            return found(Format::Excel, "numbers of this size with such small steps are Excel's days");
        }
        return Err(format!(
            "column `{name}` begins at {first} and rises by {step}: days of Excel, or seconds? Say it with `time: {{format: excel}}` or \
             `{{format: seconds}}` in the map"
        ));
    }
    let whole = values.iter().all(|value| value.fract() == 0.0);
    if whole && step >= 1.0 {
        let rate_hint = "if it only counts rows, leave it out and give `time: {rate_hz: …}`";
        return Err(format!(
            "column `{name}` holds whole numbers that rise by {step} from {first}: in which unit? Say it with `time: {{format: milliseconds}}` \
             or `{{format: seconds}}` in the map; {rate_hint}"
        ));
    }
    if first.abs() >= LARGE {
        return asked("numbers of this size are no times of the last decades in any unit");
    }
    let seconds = Format::Relative { unit_ns: 1_000_000_000 };
    apart(seconds, "seconds", STEP_S, "numbers with such steps are taken as seconds from the start")
}

/// Seconds from a start that are more than this would be ten years.
const LARGE: f64 = 3e8;

#[cfg(test)]
mod tests {
    use super::*;

    fn of(texts: &[&str], unit: &str) -> Result<Format, String> {
        let numbers = Numbers { decimal: '.', thousands: None, missing: vec![] };
        let texts: Vec<String> = texts.iter().map(|text| (*text).to_owned()).collect();
        detect(&texts, "t", unit, &numbers).map(|detected| detected.format)
    }

    #[test]
    fn formats_are_found_out() {
        for (texts, unit, name) in [
            (["0.0", "0.01", "0.02"], "", "seconds"),
            (["0", "10", "20"], "ms", "milliseconds"),
            (["1714636800", "1714636801", "1714636802"], "", "unix_s"),
            (["1714636800250", "1714636800260", "1714636800270"], "", "unix_ms"),
            (["1714636800250000000", "1714636800260000000", "1714636800270000000"], "", "unix_ns"),
            (["45414.4166667", "45414.4166782", "45414.4166898"], "", "excel"),
            (["739374.333336227", "739374.333336343", "739374.333336459"], "", "matlab"),
            (["2024-05-02T10:00:00", "2024-05-02T10:00:01", "2024-05-02T10:00:02"], "", "iso"),
            (["2024-05-02 10:00:00.125+02:00", "2024-05-02 10:00:01+02:00", ""], "", "iso"),
            (["02.05.2024 10:00:00", "02.05.2024 10:00:01", "02.05.2024 10:00:02"], "", "%d.%m.%Y %H:%M:%S%.f"),
            (["02.05.24 10:00:00,1", "02.05.24 10:00:00,2", "02.05.24 10:00:01"], "", "%d.%m.%y %H:%M:%S%.f"),
            (["5/13/2024 10:00:00", "5/13/2024 10:00:01", "5/13/2024 10:00:02"], "", "%m/%d/%Y %H:%M:%S%.f"),
            (["13/05/2024 10:00:00", "13/05/2024 10:00:01", "13/05/2024 10:00:02"], "", "%d/%m/%Y %H:%M:%S%.f"),
            (["5/13/2024 1:00:00 PM", "5/13/2024 1:00:01 PM", "5/13/2024 1:00:02 PM"], "", "%m/%d/%Y %I:%M:%S%.f %p"),
            (["02-May-2024 10:00:00", "02-May-2024 10:00:01", "02-May-2024 10:00:02"], "", "%d-%b-%Y %H:%M:%S%.f"),
            (["10:00:00.1", "10:00:00.2", "10:00:00.3"], "", "%H:%M:%S%.f"),
            (["59:59.9", "00:00.0", "00:00.1"], "", "%M:%S.%f"),
            (["18:05:00:000", "18:05:00:040", "18:05:00:080"], "", "%H:%M:%S%.f"),
            (
                ["22.09.2026 18:05:00:0", "22.09.2026 18:05:00:40", "22.09.2026 18:05:00:120"],
                "",
                "%d.%m.%Y %H:%M:%S%.f",
            ),
            (["22. Mai 2026 10:00:00", "22. Mai 2026 10:00:01", "22. Mai 2026 10:00:02"], "", "%d %b %Y %H:%M:%S%.f"),
            (["22/9/2026 1:00:00 p. m.", "22/9/2026 1:00:01 p. m.", ""], "", "%d/%m/%Y %I:%M:%S%.f %p"),
            (["13/05/24 10:00:00", "13/05/24 10:00:01", "13/05/24 10:00:02"], "", "%d/%m/%y %H:%M:%S%.f"),
            (["2026-09-22 18:38:20.5 CEST", "2026-09-22 18:38:21 CEST", ""], "", "iso"),
            (["22.09.2026 18:38:20.5 CEST", "22.09.2026 17:38:21 CET", ""], "", "%d.%m.%Y %H:%M:%S%.f"),
            (["2026-09-22 18:38:20 UTC+0200", "2026-09-22 18:38:21 UTC+0200", ""], "", "iso"),
            (["22.09.2026 18:38:20 UTC+02:00", "22.09.2026 18:38:21 UTC+02:00", ""], "", "%d.%m.%Y %H:%M:%S%.f"),
            (["Sep 22 2026 06:38:20.5 PM EDT", "Sep 22 2026 06:38:21 PM EDT", ""], "", "%b %d %Y %I:%M:%S%.f %p"),
            (["Tue Sep 22 18:38:20 CEST 2026", "Tue Sep 22 18:38:21 CEST 2026", ""], "", "%a %b %d %H:%M:%S%.f %Y"),
            (["22-SEP-26 06.38.20.5 PM", "22-SEP-26 06.38.21.0 PM", ""], "", "%d-%b-%y %I.%M.%S%.f %p"),
            (
                ["Tue, 22 Sep 2026 18:38:20.5 +0200", "Tue, 22 Sep 2026 18:38:21 +0200", ""],
                "",
                "%a, %d %b %Y %H:%M:%S%.f",
            ),
            (["2026年9月22日 18:38:20", "2026年9月22日 18:38:21", ""], "", "%Y年%m月%d日 %H:%M:%S%.f"),
            (["2026-265T18:38:20.5", "2026-265T18:38:21", ""], "", "%Y-%jT%H:%M:%S%.f"),
            (["134345759000000000", "134345759000400000", "134345759000800000"], "", "filetime"),
            (["639000000000000000", "639000000000400000", "639000000000800000"], "", "dotnet_ticks"),
            (["13434575900000000", "13434575900040000", "13434575900080000"], "", "windows_us"),
            (["3873000000.00", "3873000000.04", "3873000000.08"], "", "labview_s"),
            (["3873000000.00", "3873000000.04", "3873000000.08"], "s", "labview_s"),
            // Counters since the device was switched on: 10 days of milliseconds, 80 minutes of microseconds.
            (["900000000", "900000040", "900000080"], "ms", "milliseconds"),
            (["4800000000", "4800040000", "4800080000"], "us", "microseconds"),
            (["0", "400", "800"], "0.1 ms", "0.1 milliseconds"),
            (["0", "400", "800"], "0,1 ms", "0.1 milliseconds"),
            (["4294960000", "4294960400", "4294960800"], "100us", "0.1 milliseconds"),
            (["0", "4", "8"], "x10 ms", "10 milliseconds"),
            (["0", "400000", "800000"], "100 ns", "0.0001 milliseconds"),
            (["134345759000000000", "134345759000400000", "134345759000800000"], "100 ns", "filetime"),
            (["1714636800250", "1714636800260", "1714636800270"], "ms", "unix_ms"),
            (["1714636800.25", "1714636800.26", "1714636800.27"], "s", "unix_s"),
        ] {
            assert_eq!(of(&texts, unit).unwrap_or_else(|error| panic!("{error}")).name(), name, "{texts:?}");
        }
    }

    #[test]
    fn what_may_be_meant_two_ways_is_asked_for() {
        for (texts, words) in [
            (["05/02/2024 10:00:00", "05/02/2024 10:00:01", "05/02/2024 10:00:02"], "month/day or day/month"),
            (["45000", "45001", "45002"], "days of Excel, or seconds?"),
            (["0", "1", "2"], "in which unit?"),
            (["61305.7766204", "61305.7766208", "61305.7766213"], "Modified Julian Days"),
            (["900000000", "900000040", "900000080"], "as seconds since 1970 its rows are 40 s apart"),
            (["0.0", "0.00001", "0.00002"], "say how it counts"),
            (["5.5e10", "5.6e10", "5.7e10"], "in which unit?"),
            (
                ["2026-09-22 18:38:20 IST", "2026-09-22 18:38:21 IST", ""],
                "`IST` behind the times means several zones, or none that is known; say which with `time: {format: \"%Y-%m-%d %H:%M:%S%.f IST\"",
            ),
            (["22.09.2026 18:38:20 CST", "22.09.2026 18:38:21 CST", ""], "%d.%m.%Y %H:%M:%S%.f CST"),
            (["18:05:00:00", "18:05:00:04", "18:05:00:08"], "has up to 2 digits: milliseconds, or a fraction?"),
            (["open", "close", "open"], "expected times, found `open`"),
        ] {
            let error = of(&texts, "").unwrap_err();
            assert!(error.contains(words) && error.contains("time: {"), "{error}");
        }
        for (unit, words) in [
            ("ms x 10", "`ms x 10`, which may mean 0.1 ms or 10 ms"),
            ("10^-4 s", "`10^-4 s`, which is not understood"),
            ("1/10 ms", "`1/10 ms`, which is not understood"),
        ] {
            let error = of(&["0", "4", "8"], unit).unwrap_err();
            assert!(error.contains(words) && error.contains("time: {"), "{error}");
        }
    }
}
