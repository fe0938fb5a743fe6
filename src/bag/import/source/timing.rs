//! The time of a table: in which columns it stands, and how it is written.

use super::channel::ChannelValue;
use super::fraction::{Fraction, fraction_beside};
use super::head::TableHead;
use super::pairs::pairs;
use super::records::{SAMPLED, TableRecords};
use crate::import::ImportError;
use crate::import::clock::{Format, TimeReader, are_times, detect, zone_of_header};
use crate::import::map::{Map, SignalPlace, TimeMap};
use govtwin_model::units::{nanos_from_seconds, seconds_from_nanos};

/// Columns that hold the time of others.
#[derive(Clone, Debug)]
pub(super) struct TimeGroup {
    /// The columns of the time: one, or date and time of day, and a part of the second behind them.
    pub(super) columns: Vec<usize>,
    pub(super) clock: TimeReader,
    /// The file itself says how its times count.
    pub(super) native: bool,
    of: TimeOf,
    /// Other columns of time go on where it is blank.
    pub(super) may_be_blank: bool,
    fraction: Option<Fraction>,
}

/// Columns that a time counts for.
#[derive(Clone, Debug, PartialEq, Eq)]
enum TimeOf {
    /// All that have no other.
    All,
    /// Those from one on, and before another: pairs of time and value side by side.
    Range(std::ops::Range<usize>),
    /// One that a map names.
    Column(usize),
}

impl TimeGroup {
    /// Whether the time counts for a column.
    pub(super) fn is_of(&self, column: usize) -> bool {
        match &self.of {
            TimeOf::All => true,
            TimeOf::Range(columns) => columns.contains(&column),
            TimeOf::Column(index) => *index == column,
        }
    }

    /// The time of a record, ns since 1970; nothing where a time that counts for some columns alone is blank.
    pub(super) fn read<R: TableRecords>(&mut self, records: &R) -> Option<Result<i64, String>> {
        let blank = self.may_be_blank && time_text(records, &self.columns, None).trim().is_empty();
        (!blank).then(|| read_time(records, self))
    }
}

/// The time of a table, and how it was found.
pub(super) struct Timing {
    pub(super) group: TimeGroup,
    pub(super) note: String,
}

/// Whether there is a column of time, by the map, by name or as one that rises, or a rate in its place.
pub(in crate::import) fn is_timed<R: TableRecords>(
    head: &TableHead,
    map: &Map,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<bool, ImportError> {
    let is_given = map.time.rate_hz.is_some() || !map.time.columns.is_empty();
    Ok(is_given
        || !head.time_columns().is_empty()
        || rising(head, &mut open()?)?.is_some()
        || dated(head, open)?.is_some())
}

/// Finds the columns of time and how it is written.
pub(super) fn timing<R: TableRecords>(
    head: &TableHead,
    map: &Map,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<Timing, ImportError> {
    let path = &head.path;
    let wrong = |problem: String| ImportError::file(path, problem);
    if let Some(rate_hz) = map.time.rate_hz {
        let note = format!(
            "no time column: rows are {} s apart, as the map says",
            seconds_from_nanos(nanos_from_seconds(1.0 / rate_hz))
        );
        let format = Format::Relative { unit_ns: 1 };
        let clock = TimeReader::new(format, &map.time, &head.numbers).map_err(wrong)?;
        return Ok(Timing {
            group: TimeGroup {
                columns: vec![],
                clock,
                native: true,
                of: TimeOf::All,
                may_be_blank: false,
                fraction: None,
            },
            note,
        });
    }
    let mut columns = vec![];
    let mut note = String::new();
    for name in &map.time.columns {
        let index = head.find(name).map_err(wrong)?;
        columns.push(index.ok_or_else(|| wrong(format!("time: {}", head.absent(name))))?);
    }
    if columns.is_empty() {
        columns = head.time_columns();
        let mut why = "";
        if columns.is_empty() {
            columns.extend(dated(head, open)?);
            why = ", by what stands in it";
        }
        if columns.is_empty() {
            columns.extend(rising(head, &mut open()?)?);
            why = if columns.is_empty() { why } else { ", which rises from line to line" };
        }
        let first = columns.first().ok_or_else(|| {
            wrong(format!(
                "expected a column of time, and none has a name that says so; name it with `time: {{column: …}}` in the map, or give `time: \
                 {{rate_hz: …}}` where there is none; {}",
                head.absent("time")
            ))
        })?;
        note = format!("time is column `{}`{why}", head.names[*first]);
        if let Some(part) = fraction_beside(head, &columns, open)? {
            note = format!("{note} with `{}` as part of the second", head.names[part]);
            columns.push(part);
        }
    }
    written(head, map, open, columns, TimeOf::All, note)
}

/// How the times in some columns are written.
fn written<R: TableRecords>(
    head: &TableHead,
    map: &Map,
    open: &impl Fn() -> Result<R, ImportError>,
    columns: Vec<usize>,
    of: TimeOf,
    note: String,
) -> Result<Timing, ImportError> {
    let wrong = |problem: String| ImportError::file(&head.path, problem);
    let fraction = Fraction::of(head, &columns);
    let (format, native, note) = match &map.time.format {
        Some(text) => {
            let format = Format::of(text).map_err(|problem| wrong(format!("time.format: {problem}")))?;
            (format, false, note)
        }
        None => found(head, open, (&columns, fraction, &of), note)?,
    };
    // The map counts before the header.
    let stated = columns.iter().find_map(|column| zone_of_header(&head.names[*column]));
    let stated = stated.filter(|_| map.time.zone.is_none());
    let note = match &stated {
        Some(zone) if !note.is_empty() => format!("{note}, in {zone} as its header says"),
        _ => note,
    };
    let names = columns.iter().map(|column| head.names[*column].clone()).collect();
    let time = TimeMap { columns: names, zone: stated.or(map.time.zone.clone()), ..map.time.clone() };
    let clock = TimeReader::new(format, &time, &head.numbers).map_err(wrong)?;
    let may_be_blank = of != TimeOf::All;
    Ok(Timing { group: TimeGroup { columns, clock, native, of, may_be_blank, fraction }, note })
}

/// How the times in some columns are written by what stands there, whether the file itself says it, and the note with the reason.
fn found<R: TableRecords>(
    head: &TableHead,
    open: &impl Fn() -> Result<R, ImportError>,
    (columns, fraction, of): (&[usize], Option<Fraction>, &TimeOf),
    note: String,
) -> Result<(Format, bool, String), ImportError> {
    let wrong = |problem: String| ImportError::file(&head.path, problem);
    let mut records = open()?;
    let mut texts = vec![];
    let mut native = false;
    while texts.len() < SAMPLED && records.advance()? {
        native |= matches!(records.value(columns[0]), ChannelValue::Time(_) | ChannelValue::Local(_));
        let text = time_text(&records, columns, fraction);
        if *of == TimeOf::All || !text.trim().is_empty() {
            texts.push(text);
        }
    }
    if native {
        return Ok((Format::Epoch { unit_ns: 1, zero_s: 0 }, true, note));
    }
    if texts.is_empty() {
        return Err(wrong("expected lines of data below the header, found none".into()));
    }
    let (name, unit) = (&head.names[columns[0]], head.units.get(columns[0]).map_or("", String::as_str));
    let detected = detect(&texts, name, unit, &head.numbers).map_err(wrong)?;
    let known = if note.is_empty() { format!("time is column `{name}`") } else { note };
    Ok((detected.format, false, format!("{known}: {}", detected.why)))
}

/// Times that count for some columns alone: those that the map gives to signals, and in pairs of time and value side by side those of each pair.
pub(super) fn own_times<R: TableRecords>(
    head: &TableHead,
    map: &Map,
    main: &TimeGroup,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<Vec<TimeGroup>, ImportError> {
    let wrong = |problem: String| ImportError::file(&head.path, problem);
    let mut found = vec![];
    for pair in pairs(head, main, open)? {
        let in_pair = |column: &Option<usize>| column.is_some_and(|column| pair.of.contains(&column));
        for signal in map.signals.iter().filter(|signal| signal.time.is_none() && !map.time.columns.is_empty()) {
            let SignalPlace::Column(name) = &signal.from else { continue };
            if in_pair(&head.find(name).map_err(wrong)?) {
                let (id, first) = (signal.target.id(), pair.columns[0] + 1);
                return Err(wrong(format!(
                    "{id}: column `{name}` stands beside column {first} of times, which differ from those of the map's `time.column`; give \
                     `time: \"#{first}\"` in the signal, or leave `time.column` out, so that each column takes the times beside it"
                )));
            }
        }
        let Timing { group, .. } =
            written(head, map, open, pair.columns.clone(), TimeOf::Range(pair.of), String::new())?;
        found.push(group);
    }
    for signal in &map.signals {
        let (Some(time), SignalPlace::Column(name)) = (&signal.time, &signal.from) else { continue };
        let place = |name: &str| head.find(name).map_err(wrong)?.ok_or_else(|| wrong(head.absent(name)));
        let (time, column) = (place(time)?, place(name)?);
        let Timing { group, .. } = written(head, map, open, vec![time], TimeOf::Column(column), String::new())?;
        found.push(group);
    }
    Ok(found)
}

/// The first column in which nearly every cell is a date or a time of day, or looks like one; one that is called the source's or universal is
/// preferred, as others may be those of a receiver.
fn dated<R: TableRecords>(
    head: &TableHead,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<Option<usize>, ImportError> {
    let mut texts: Vec<Vec<String>> = vec![vec![]; head.names.len()];
    let mut native = vec![false; head.names.len()];
    let mut records = open()?;
    let mut count = 0;
    while count < SAMPLED && records.advance()? {
        count += 1;
        for (column, (texts, native)) in texts.iter_mut().zip(&mut native).enumerate() {
            match records.value(column) {
                ChannelValue::Text(text) => texts.push(text.to_owned()),
                ChannelValue::Time(_) | ChannelValue::Local(_) => *native = true,
                _ => {}
            }
        }
    }
    let is_one = |column: &usize| {
        let texts = &texts[*column];
        let varies = texts.windows(2).any(|pair| pair[0] != pair[1]);
        native[*column] || texts.len() * 10 >= count * 9 && varies && are_times(texts, &head.numbers)
    };
    let found: Vec<usize> = (0..head.names.len()).filter(is_one).collect();
    let preferred = |column: &&usize| {
        let name = head.names[**column].to_lowercase();
        name.contains("source") || name.contains("utc")
    };
    Ok(found.iter().find(preferred).or(found.first()).copied())
}

/// A column of numbers that rise from record to record: one that may be time by its name, the first, or else the last.
fn rising<R: TableRecords>(head: &TableHead, records: &mut R) -> Result<Option<usize>, ImportError> {
    let named = (0..head.names.len()).filter(|column| head.has_time_word(*column));
    let mut columns: Vec<(usize, f64)> =
        named.chain([0, head.names.len().saturating_sub(1)]).map(|column| (column, f64::NEG_INFINITY)).collect();
    let mut count = 0;
    while count < SAMPLED && !columns.is_empty() && records.advance()? {
        count += 1;
        columns.retain_mut(|(column, last)| {
            let number = match records.value(*column) {
                ChannelValue::Number(number) => number,
                ChannelValue::Whole(whole) => whole as f64,
                _ => return false,
            };
            number > std::mem::replace(last, number)
        });
    }
    Ok(columns.first().map(|(column, _)| *column).filter(|_| count > 2))
}

/// The cells of time, joined by blanks; a part of the second by the decimal sign.
pub(super) fn time_text<R: TableRecords>(records: &R, columns: &[usize], fraction: Option<Fraction>) -> String {
    let text = |column: &usize| match records.value(*column) {
        _ if records.text_of(*column).is_some() => records.text_of(*column).unwrap_or_default().trim().to_owned(),
        ChannelValue::Text(text) => text.trim().to_owned(),
        ChannelValue::Number(number) => number.to_string(),
        ChannelValue::Whole(number) | ChannelValue::Time(number) | ChannelValue::Local(number) => number.to_string(),
        ChannelValue::Missing => String::new(),
    };
    let cells: Vec<String> = columns.iter().map(text).collect();
    let joined =
        fraction.zip(cells.split_last()).and_then(|(fraction, (part, time))| fraction.joined(&time.join(" "), part));
    joined.unwrap_or_else(|| cells.join(" "))
}

/// 146 years before and after 1970: of any two such times the difference is a number of ns as well.
const FARTHEST_NS: i64 = 1 << 62;

/// The time of a record, ns since 1970.
fn read_time<R: TableRecords>(records: &R, group: &mut TimeGroup) -> Result<i64, String> {
    let time_ns = any_time(records, group)?;
    let is_near = (-FARTHEST_NS..=FARTHEST_NS).contains(&time_ns);
    is_near.then_some(time_ns).ok_or_else(|| "expected a time between 1824 and 2116, found one beyond".to_owned())
}

fn any_time<R: TableRecords>(records: &R, group: &mut TimeGroup) -> Result<i64, String> {
    let TimeGroup { columns, clock, fraction, .. } = group;
    let only = columns.first().filter(|_| columns.len() == 1);
    if let Some(text) = only.and_then(|column| records.text_of(*column)) {
        return clock.read(text);
    }
    match only.map(|column| records.value(*column)) {
        Some(ChannelValue::Time(time_ns)) => Ok(time_ns),
        Some(ChannelValue::Local(local_ns)) => clock.local(local_ns),
        Some(ChannelValue::Text(text)) => clock.read(text),
        _ => clock.read(&time_text(records, columns, *fraction)),
    }
}
