//! The time of a table: in which columns it stands, and how it is written.

use super::channel::ChannelValue;
use super::fraction::{Fraction, fraction_beside};
use super::head::TableHead;
use super::records::{SAMPLED, TableRecords};
use crate::import::ImportError;
use crate::import::clock::{Format, TimeReader, are_times, detect};
use crate::import::dialect::bracketed;
use crate::import::map::{Map, SignalPlace};
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

/// Whether there is a column of time, by the map, by name or as the first that rises, or a rate in its place.
pub(in crate::import) fn is_timed<R: TableRecords>(
    head: &TableHead,
    map: &Map,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<bool, ImportError> {
    let is_given = map.time.rate_hz.is_some() || !map.time.columns.is_empty();
    Ok(is_given || !head.time_columns().is_empty() || rises(&mut open()?)? || dated(head, open)?.is_some())
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
        if columns.is_empty() && rises(&mut open()?)? {
            columns.push(0);
            why = ", which rises from line to line";
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
    let clock = TimeReader::new(format, &map.time, &head.numbers).map_err(wrong)?;
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
        let range = pair.end..pair.until;
        let in_pair = |column: &Option<usize>| column.is_some_and(|column| range.contains(&column));
        for signal in map.signals.iter().filter(|signal| signal.time.is_none() && !map.time.columns.is_empty()) {
            let SignalPlace::Column(name) = &signal.from else { continue };
            if in_pair(&head.find(name).map_err(wrong)?) {
                let (id, first) = (signal.target.id(), pair.columns[0] + 1);
                return Err(wrong(format!(
                    "{id}: column `{name}` stands behind column {first} of times, which differ from those of the map's `time.column`; give \
                     `time: \"#{first}\"` in the signal, or leave `time.column` out, so that each column takes the times before it"
                )));
            }
        }
        let Timing { group, .. } = written(head, map, open, pair.columns.clone(), TimeOf::Range(range), String::new())?;
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

/// A column of times in pairs of time and value side by side, and where the columns end for which it counts.
struct Pair {
    columns: Vec<usize>,
    end: usize,
    until: usize,
}

/// Further columns of times, of the same name as the first or beside other signals, whose times are others.
fn pairs<R: TableRecords>(
    head: &TableHead,
    main: &TimeGroup,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<Vec<Pair>, ImportError> {
    let bare = |column: usize| {
        let name = head.names[column].trim();
        bracketed(name).map_or(name, |(bare, _)| bare).trim().to_lowercase()
    };
    let Some(first) = main.columns.first().copied() else { return Ok(vec![]) };
    let width = main.columns.len();
    let named = |column: &usize| bare(*column) == bare(first);
    let mut begins: Vec<usize> = (0..head.names.len()).filter(named).collect();
    if begins.len() == 1 && width == 1 {
        begins.extend(times_beside(head, main, open)?);
        begins.sort_unstable();
    }
    let mut pairs = vec![];
    for (place, begin) in begins.iter().enumerate().filter(|(_, begin)| **begin != first) {
        let columns: Vec<usize> = (*begin..(begin + width).min(head.names.len())).collect();
        let until = begins.get(place + 1).copied().unwrap_or(head.names.len());
        let alike =
            width == 1 || columns.iter().zip(&main.columns).all(|(column, of_main)| bare(*column) == bare(*of_main));
        if alike && columns.len() == width && begin + width < until {
            pairs.push(Pair { columns, end: begin + width, until });
        }
    }
    if pairs.is_empty() {
        return Ok(pairs);
    }
    // The same times again are an export that repeats them.
    let mut differ = vec![false; pairs.len()];
    let mut records = open()?;
    let mut count = 0;
    while count < SAMPLED && records.advance()? {
        count += 1;
        let of_main = time_text(&records, &main.columns, None);
        for (pair, differ) in pairs.iter().zip(&mut differ) {
            *differ |= time_text(&records, &pair.columns, None) != of_main;
        }
    }
    let mut differ = differ.into_iter();
    pairs.retain(|_| differ.next() == Some(true));
    Ok(pairs)
}

/// Columns of another name than that of the time which hold times as well, each before a signal of its own: they are written as the times are, go on
/// from record to record, and pass as much time.
fn times_beside<R: TableRecords>(
    head: &TableHead,
    main: &TimeGroup,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<Vec<usize>, ImportError> {
    let [first] = main.columns[..] else { return Ok(vec![]) };
    // One that follows another has no signal of its own.
    let mut columns: Vec<usize> = (0..head.names.len())
        .filter(|column| *column == first || head.may_be_time(*column, first) || head.names[*column].starts_with('#'))
        .collect();
    let all = columns.clone();
    columns.retain(|column| !all.contains(&(column + 1)) && column + 1 < head.names.len());
    if columns.len() < 2 || !columns.contains(&first) {
        return Ok(vec![]);
    }
    let mut times: Vec<Vec<i64>> = vec![vec![]; columns.len()];
    let mut clocks = vec![main.clock.clone(); columns.len()];
    let mut filled = vec![0_usize; columns.len()];
    let mut records = open()?;
    let mut count = 0;
    while count < SAMPLED && records.advance()? {
        count += 1;
        for (place, column) in columns.iter().enumerate() {
            let text = time_text(&records, &[*column], None);
            if !text.trim().is_empty() {
                filled[place] += 1;
                times[place].extend(clocks[place].read(&text).ok());
            }
        }
    }
    let range = |times: &[i64]| Some((*times.iter().min()?, *times.iter().max()?));
    let Some(of_main) = columns.iter().position(|column| *column == first).and_then(|place| range(&times[place]))
    else {
        return Ok(vec![]);
    };
    let main_ns = of_main.1.saturating_sub(of_main.0);
    let is_one = |place: usize| {
        let own = &times[place];
        let Some((least, most)) = range(own) else { return false };
        let steps = own.windows(2).map(|pair| pair[1].cmp(&pair[0]));
        let (mut rises, mut falls) = (0, 0);
        for step in steps {
            rises += usize::from(step.is_gt());
            falls += usize::from(step.is_lt());
        }
        let goes_on = rises.max(falls) * 2 >= own.len() && rises.min(falls) * 20 <= own.len();
        let own_ns = most.saturating_sub(least);
        let as_long = own_ns / 20 <= main_ns && main_ns / 20 <= own_ns;
        let near = least.abs_diff(of_main.0) < NEAR_NS.saturating_add(main_ns.unsigned_abs());
        own.len() * 10 >= filled[place] * 9 && own.len() > 2 && goes_on && as_long && near
    };
    Ok(columns
        .iter()
        .enumerate()
        .filter(|(place, column)| **column != first && is_one(*place))
        .map(|(_, column)| *column)
        .collect())
}

/// Times of signals side by side begin within so much of each other, ns.
const NEAR_NS: u64 = 600_000_000_000;

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
