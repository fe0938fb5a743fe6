//! The time of a table: in which columns it stands, and how it is written.

use super::channel::ChannelValue;
use super::head::TableHead;
use super::records::{SAMPLED, TableRecords};
use crate::import::ImportError;
use crate::import::clock::{Format, TimeReader, detect};
use crate::import::map::Map;
use govtwin_model::units::{nanos_from_seconds, seconds_from_nanos};

/// What time columns, format and zone a table has.
pub(super) struct Timing {
    pub(super) columns: Vec<usize>,
    pub(super) clock: TimeReader,
    pub(super) note: String,
    pub(super) native: bool,
}

/// Finds the columns of time and how it is written.
pub(super) fn timing<R: TableRecords>(
    head: &TableHead,
    map: &Map,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<Timing, ImportError> {
    let path = &head.path;
    let wrong = |problem: String| ImportError::file(path, problem);
    let clock = |format: Format| TimeReader::new(format, &map.time, &head.numbers).map_err(wrong);
    if let Some(rate_hz) = map.time.rate_hz {
        let note = format!(
            "no time column: rows are {} s apart, as the map says",
            seconds_from_nanos(nanos_from_seconds(1.0 / rate_hz))
        );
        return Ok(Timing { columns: vec![], clock: clock(Format::Relative { unit_ns: 1 })?, note, native: true });
    }
    let mut columns = vec![];
    let mut note = String::new();
    for name in &map.time.columns {
        let index = head.find(name).map_err(wrong)?;
        columns.push(index.ok_or_else(|| wrong(format!("time: {}", head.absent(name))))?);
    }
    if columns.is_empty() {
        columns = head.time_columns();
        if columns.is_empty() && rises(&mut open()?)? {
            columns.push(0);
        }
        let first = columns.first().ok_or_else(|| {
            wrong(format!(
                "expected a column of time, and none has a name that says so; name it with `time: {{column: …}}` in the map, or give `time: \
                 {{rate_hz: …}}` where there is none; {}",
                head.absent("time")
            ))
        })?;
        let why = if head.time_columns().is_empty() { ", which rises from line to line" } else { "" };
        note = format!("time is column `{}`{why}", head.names[*first]);
    }
    if let Some(text) = &map.time.format {
        let format = Format::of(text).map_err(|problem| wrong(format!("time.format: {problem}")))?;
        return Ok(Timing { columns, clock: clock(format)?, note, native: false });
    }
    let mut records = open()?;
    let mut texts = vec![];
    let mut native = false;
    while texts.len() < SAMPLED && records.advance()? {
        native |= matches!(records.value(columns[0]), ChannelValue::Time(_) | ChannelValue::Local(_));
        texts.push(time_text(&records, &columns));
    }
    if native {
        return Ok(Timing { columns, clock: clock(Format::Epoch { unit_ns: 1 })?, note, native: true });
    }
    if texts.is_empty() {
        return Err(wrong("expected lines of data below the header, found none".into()));
    }
    let (name, unit) = (&head.names[columns[0]], head.units.get(columns[0]).map_or("", String::as_str));
    let detected = detect(&texts, name, unit, &head.numbers).map_err(wrong)?;
    let known = if note.is_empty() { format!("time is column `{name}`") } else { note };
    Ok(Timing {
        columns,
        clock: clock(detected.format.clone())?,
        note: format!("{known}: {}", detected.why),
        native: false,
    })
}

/// Whether the first column holds numbers that rise from record to record.
fn rises<R: TableRecords>(records: &mut R) -> Result<bool, ImportError> {
    let mut last: Option<f64> = None;
    let mut count = 0;
    while count < SAMPLED && records.advance()? {
        count += 1;
        let number = match records.value(0) {
            ChannelValue::Number(number) => number,
            ChannelValue::Whole(whole) => whole as f64,
            _ => return Ok(false),
        };
        if last.is_some_and(|last| number <= last) {
            return Ok(false);
        }
        last = Some(number);
    }
    Ok(count > 2)
}

/// The cells of time, joined by blanks.
fn time_text<R: TableRecords>(records: &R, columns: &[usize]) -> String {
    let text = |column: &usize| match records.value(*column) {
        _ if records.text_of(*column).is_some() => records.text_of(*column).unwrap_or_default().trim().to_owned(),
        ChannelValue::Text(text) => text.trim().to_owned(),
        ChannelValue::Number(number) => number.to_string(),
        ChannelValue::Whole(number) | ChannelValue::Time(number) | ChannelValue::Local(number) => number.to_string(),
        ChannelValue::Missing => String::new(),
    };
    columns.iter().map(text).collect::<Vec<_>>().join(" ")
}

/// 146 years before and after 1970: of any two such times the difference is a number of ns as well.
const FARTHEST_NS: i64 = 1 << 62;

/// The time of a record, ns since 1970.
pub(super) fn read_time<R: TableRecords>(
    records: &R,
    columns: &[usize],
    clock: &mut TimeReader,
) -> Result<i64, String> {
    let time_ns = any_time(records, columns, clock)?;
    let is_near = (-FARTHEST_NS..=FARTHEST_NS).contains(&time_ns);
    is_near.then_some(time_ns).ok_or_else(|| "expected a time between 1824 and 2116, found one beyond".to_owned())
}

fn any_time<R: TableRecords>(records: &R, columns: &[usize], clock: &mut TimeReader) -> Result<i64, String> {
    let only = columns.first().filter(|_| columns.len() == 1);
    if let Some(text) = only.and_then(|column| records.text_of(*column)) {
        return clock.read(text);
    }
    match only.map(|column| records.value(*column)) {
        Some(ChannelValue::Time(time_ns)) => Ok(time_ns),
        Some(ChannelValue::Local(local_ns)) => clock.local(local_ns),
        Some(ChannelValue::Text(text)) => clock.read(text),
        _ => clock.read(&time_text(records, columns)),
    }
}
