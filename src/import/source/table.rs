//! Rows of a table, whatever its file: time by a clock, signals by their columns, one value a line where the table is long.

use std::collections::VecDeque;
use std::path::PathBuf;

use super::channel::{Bad, Channel, Value};
use super::{Said, Source};
use crate::import::ImportError;
use crate::import::clock::{Clock, Format, detect};
use crate::import::convert::{Unit, plain, pressure, share};
use crate::import::dialect::bracketed;
use crate::import::map::{Map, Place, Repeated, SignalMap, TimeMap};
use crate::import::number::Numbers;
use crate::import::row::Row;
use crate::params::nearest;
use crate::units::{nanos_from_seconds, seconds_from_nanos};

/// Records from which the format of times is found out.
pub(in crate::import) const SAMPLED: usize = 300;
/// Names that columns of time have, in lower case, without what stands in brackets; the surest first.
const TIMES: [&str; 26] = [
    "timestamp", "__time", "time", "t", "time stamp", "datetime", "date_time", "date/time", "date time", "datum/zeit", "zeitstempel",
    "zeit", "uhrzeit", "horodatage", "heure", "temps", "fecha", "tiempo", "ora", "time_s", "t_s", "time_ns", "#time", "date", "datum",
    "index",
];
/// Names of columns that hold a date beside a column of the time of day.
const DATES: [&str; 3] = ["date", "datum", "fecha"];
/// Names of the latter.
const TIMES_OF_DAY: [&str; 5] = ["time", "zeit", "uhrzeit", "heure", "ora"];

/// Records of a table file.
pub(in crate::import) trait Records {
    /// Goes on to the next record; false at the end.
    fn advance(&mut self) -> Result<bool, ImportError>;
    /// The record's line or number, counted from 1.
    fn place(&self) -> u64;
    /// What stands in a column.
    fn value(&self, column: usize) -> Value<'_>;
    /// The text of a cell, where the file holds text: times keep every digit of it.
    fn text_of(&self, _column: usize) -> Option<&str> {
        None
    }
    /// The share of the file that is read.
    fn share(&self) -> f64;
    /// Records that had too few cells.
    fn ragged(&self) -> &Bad;
}

/// What is known of a table before its records.
#[derive(Clone, Debug)]
pub(in crate::import) struct Head {
    pub(in crate::import) path: PathBuf,
    pub(in crate::import) names: Vec<String>,
    /// Units that the table states, empty where it does not.
    pub(in crate::import) units: Vec<String>,
    pub(in crate::import) numbers: Numbers,
    /// How the file was understood.
    pub(in crate::import) notes: Vec<String>,
}

impl Head {
    /// The column of a name, `#3` being the third; none where there is none.
    ///
    /// # Errors
    /// In words, where two columns have the name.
    pub(in crate::import) fn find(&self, name: &str) -> Result<Option<usize>, String> {
        let name = name.trim();
        if let Some(number) = name.strip_prefix('#').and_then(|digits| digits.parse::<usize>().ok()) {
            return Ok(number.checked_sub(1).filter(|index| *index < self.names.len()));
        }
        let bare = |known: &String| bracketed(known).is_some_and(|(bare, _)| bare == name);
        for same in [&|known: &String| known == name, &bare as &dyn Fn(&String) -> bool] {
            let places: Vec<usize> =
                self.names.iter().enumerate().filter(|(_, known)| same(known)).map(|(index, _)| index).collect();
            match places[..] {
                [] => {}
                [index] => return Ok(Some(index)),
                [first, second, ..] => {
                    let (first, second) = (first + 1, second + 1);
                    return Err(format!(
                        "`{name}` is the name of columns {first} and {second}; name the one you mean by its number, \"#{first}\""
                    ));
                }
            }
        }
        Ok(None)
    }

    /// What to say of a column that is not there.
    pub(in crate::import) fn absent(&self, name: &str) -> String {
        const MOST: usize = 30;
        let hint = nearest(name, self.names.iter().map(String::as_str));
        let hint = hint.map_or(String::new(), |near| format!(" did you mean `{near}`?"));
        let mut names: Vec<String> = self.names.iter().take(MOST).map(|name| format!("`{name}`")).collect();
        if self.names.len() > MOST {
            names.push(format!("and {} more", self.names.len() - MOST));
        }
        format!("there is no column `{name}`;{hint} columns: {}", names.join(", "))
    }

    /// The columns that by their names hold the time: one, or date and time of day.
    pub(in crate::import) fn time_columns(&self) -> Vec<usize> {
        let bare = |name: &String| bracketed(name).map_or(name.as_str(), |(bare, _)| bare).trim().to_lowercase();
        let find = |wanted: &str| self.names.iter().position(|name| bare(name) == wanted);
        let first = |names: &[&str]| names.iter().find_map(|name| find(name));
        match (first(&DATES), first(&TIMES_OF_DAY)) {
            (Some(date), Some(time)) => vec![date, time],
            _ => first(&TIMES).into_iter().collect(),
        }
    }
}

/// A signal and its column.
struct Column {
    index: usize,
    channel: Channel,
}

/// Where the tags and values of a long table stand.
struct Long {
    tag: usize,
    value: usize,
}

/// A table as a source of rows.
pub(in crate::import) struct Table<R> {
    head: Head,
    records: R,
    columns: Vec<Column>,
    long: Option<Long>,
    time: Vec<usize>,
    clock: Clock,
    /// The file itself says how its times count.
    native: bool,
    rate_hz: Option<f64>,
    repeated: Repeated,
    rows: u64,
    bad_times: Bad,
    first_bad_time: String,
    /// Rows of one time that wait for the next, and the last step between two times, ns.
    waiting: VecDeque<Row>,
    ready: VecDeque<Row>,
    last_step_ns: i64,
    spread: u64,
    warnings: Vec<String>,
}

/// What time columns, format and zone a table has.
struct Timing {
    columns: Vec<usize>,
    clock: Clock,
    note: String,
    native: bool,
}

impl<R: Records> Table<R> {
    /// Opens a table by a map; `open` gives its records from the beginning.
    pub(in crate::import) fn new(
        mut head: Head,
        map: &Map,
        open: impl Fn() -> Result<R, ImportError>,
    ) -> Result<Self, ImportError> {
        let path = head.path.clone();
        let wrong = |problem: String| ImportError::file(&path, problem);
        let find = |name: &str| {
            head.find(name).map_err(wrong)?.ok_or_else(|| ImportError::file(&path, head.absent(name)))
        };
        let long = match (&map.file.tag_column, &map.file.value_column) {
            (Some(tag), Some(value)) => Some(Long { tag: find(tag)?, value: find(value)? }),
            _ => None,
        };
        let timing = timing(&head, map, &open)?;
        let mut warnings = vec![];
        let mut columns = vec![];
        for (signal, one) in map.signals.iter().enumerate() {
            let Place::Column(name) = &one.from else { continue };
            if long.is_some() {
                columns.push(Column { index: usize::MAX, channel: Channel::new(signal, one) });
            } else if let Some(index) = head.find(name).map_err(wrong)? {
                let stated = head.units.get(index).map_or("", String::as_str);
                let one = with_header_unit(one, stated, &mut head.notes, &mut warnings);
                columns.push(Column { index, channel: Channel::new(signal, &one) });
            }
        }
        if !timing.note.is_empty() {
            head.notes.push(timing.note);
        }
        Ok(Self {
            head,
            records: open()?,
            columns,
            long,
            time: timing.columns,
            clock: timing.clock,
            native: timing.native,
            rate_hz: map.time.rate_hz,
            repeated: map.time.repeated,
            rows: 0,
            bad_times: Bad::default(),
            first_bad_time: String::new(),
            waiting: VecDeque::new(),
            ready: VecDeque::new(),
            last_step_ns: 0,
            spread: 0,
            warnings,
        })
    }

    /// The columns of time, and what a map says of it so that nothing is left to be found out.
    pub(in crate::import) fn time(&self, map: &Map) -> (Vec<usize>, TimeMap) {
        let names = self.time.iter().map(|column| self.head.names[*column].clone()).collect();
        let format = Some(self.clock.format().name().to_owned()).filter(|name| !name.is_empty() && !self.native);
        (self.time.clone(), TimeMap { columns: names, format, ..map.time.clone() })
    }

    /// Goes on to the next record that has a time, and gives it, ns.
    pub(in crate::import) fn advance(&mut self) -> Result<Option<i64>, ImportError> {
        while self.records.advance()? {
            let place = self.records.place();
            let time = match self.rate_hz {
                Some(rate_hz) => Ok(nanos_from_seconds(self.rows as f64 / rate_hz)),
                None => read_time(&self.records, &self.time, &mut self.clock),
            };
            let time_ns = match time {
                Ok(time_ns) => time_ns,
                Err(problem) => {
                    if self.bad_times.first.is_none() {
                        self.first_bad_time.clone_from(&problem);
                    }
                    self.bad_times.note(place, &problem);
                    continue;
                }
            };
            self.rows += 1;
            return Ok(Some(time_ns));
        }
        if self.rows == 0 {
            return Err(self.nothing());
        }
        Ok(None)
    }

    /// What stands in a column of the present record.
    pub(in crate::import) fn value(&self, column: usize) -> Value<'_> {
        self.records.value(column)
    }

    /// The next record that has a time, as a row.
    fn record(&mut self) -> Result<Option<Row>, ImportError> {
        while let Some(time_ns) = self.advance()? {
            let place = self.records.place();
            let mut row = Row::at(time_ns);
            match &self.long {
                Some(long) => {
                    let Value::Text(tag) = self.records.value(long.tag) else { continue };
                    let tag = tag.trim();
                    for column in self.columns.iter_mut().filter(|column| column.channel.map.place() == Some(tag)) {
                        column.channel.take(self.records.value(long.value), place, &mut row);
                    }
                    if row.is_empty() {
                        continue;
                    }
                }
                None => {
                    for column in &mut self.columns {
                        column.channel.take(self.records.value(column.index), place, &mut row);
                    }
                }
            }
            return Ok(Some(row));
        }
        Ok(None)
    }

    fn nothing(&self) -> ImportError {
        match &self.bad_times.first {
            Some((line, _)) => ImportError::line(&self.head.path, *line, self.first_bad_time.clone()),
            None => ImportError::file(&self.head.path, "expected lines of data below the header, found none"),
        }
    }

    /// Spreads the rows that wait up to a time evenly.
    fn release(&mut self, next_ns: Option<i64>) {
        let count = i64::try_from(self.waiting.len()).unwrap_or(1).max(1);
        let Some(first) = self.waiting.front() else { return };
        let step_ns = next_ns.map_or(self.last_step_ns, |next_ns| next_ns - first.time_ns);
        self.last_step_ns = step_ns;
        if count > 1 {
            self.spread += self.waiting.len() as u64;
        }
        for (k, mut row) in (0..).zip(self.waiting.drain(..)) {
            row.time_ns += step_ns / count * k + step_ns % count * k / count;
            self.ready.push_back(row);
        }
    }
}

impl<R: Records> Source for Table<R> {
    fn next(&mut self) -> Result<Option<Row>, ImportError> {
        if self.repeated == Repeated::Keep {
            return self.record();
        }
        loop {
            if let Some(row) = self.ready.pop_front() {
                return Ok(Some(row));
            }
            match self.record()? {
                Some(row) => {
                    if self.waiting.front().is_some_and(|first| first.time_ns != row.time_ns) {
                        self.release(Some(row.time_ns));
                    }
                    self.waiting.push_back(row);
                }
                None if self.waiting.is_empty() => return Ok(None),
                None => self.release(None),
            }
        }
    }

    fn share(&self) -> f64 {
        self.records.share()
    }

    fn holds(&self) -> Vec<usize> {
        self.columns.iter().map(|column| column.channel.signal).collect()
    }

    fn said(&self) -> Said {
        let path = self.head.path.display();
        let mut said = Said { notes: self.head.notes.clone(), warnings: self.warnings.clone() };
        for one in said.notes.iter_mut().chain(&mut said.warnings) {
            *one = format!("{path}: {one}");
        }
        if let Some((line, problem)) = &self.bad_times.first {
            let count = self.bad_times.count;
            said.warnings.push(format!("{path}:{line}: {count} lines left out, the first because {problem}"));
        }
        if let Some((line, text)) = &self.records.ragged().first {
            let count = self.records.ragged().count;
            said.warnings.push(format!("{path}:{line}: {count} lines left out that have too few cells, the first `{text}`"));
        }
        for column in &self.columns {
            if let Some((line, text)) = &column.channel.bad.first {
                let (count, id) = (column.channel.bad.count, column.channel.map.target.id());
                let place = column.channel.map.place().unwrap_or_default();
                let hint = hint(text, &self.head.numbers);
                said.warnings.push(format!("{path}:{line}: {id} (`{place}`): {count} cells are no numbers, the first `{text}`{hint}"));
            }
        }
        if self.clock.folded > 0 {
            said.warnings.push(format!(
                "{path}: {} times lie in the hour that the end of summer time repeats; each is taken as the first that goes on",
                self.clock.folded
            ));
        }
        if self.clock.used_zone && !self.clock.has_zone {
            let zone = "local times without a zone are taken as UTC; give `time: {zone: Europe/Zurich}` in the map if they are not";
            said.warnings.push(format!("{path}: {zone}"));
        }
        if self.spread > 0 {
            said.notes.push(format!("{path}: {} rows shared a time with others and were spread up to the next", self.spread));
        }
        said
    }
}

/// What a cell that is no number may be.
fn hint(text: &str, numbers: &Numbers) -> String {
    let digits = text.bytes().filter(u8::is_ascii_digit).count();
    if digits == 0 || digits * 2 < text.len() {
        return format!("; if it stands for no value, add it to `file: {{missing: [\"{text}\"]}}` in the map");
    }
    let other = if numbers.decimal == '.' { ',' } else { '.' };
    match (text.matches(other).count(), text.contains(numbers.decimal)) {
        (1, false) => format!("; give `file: {{decimal: \"{other}\"}}` in the map if that is the decimal sign"),
        (0, _) => String::new(),
        _ => format!("; give `file: {{thousands: \"{other}\"}}` in the map if that stands between groups of digits"),
    }
}

/// The signal with the unit that its column's header states, where the map states none; where both do and differ, a warning.
fn with_header_unit(one: &SignalMap, stated: &str, notes: &mut Vec<String>, warnings: &mut Vec<String>) -> SignalMap {
    let mut one = one.clone();
    let read = |text: &str| if one.target.is_pressure() { pressure(text) } else { share(text) };
    let id = one.target.id();
    if stated.is_empty() || one.target == crate::import::row::Target::Esv {
        return one;
    }
    if one.unit.is_empty() {
        let takes_unit = one.conversion.range.is_none() || one.conversion.to != [0.0, 1.0];
        match read(stated) {
            Some(unit) if takes_unit => {
                if unit != Unit::ONE {
                    notes.push(format!("{id}: unit `{stated}` as its header says"));
                }
                one.conversion.unit = unit;
                stated.clone_into(&mut one.unit);
            }
            None if takes_unit => warnings.push(format!(
                "{id}: its header says `{stated}`, and the map neither a `unit` nor, for a position, which values are closed and open \
                 (`range`); taken as {}",
                one.target.unit()
            )),
            _ => {}
        }
    } else if let (Some(header), Some(mapped)) = (read(stated), read(&one.unit))
        && header != mapped
    {
        let mapped = plain(&one.unit);
        warnings.push(format!("{id}: its header says `{stated}`, the map `{mapped}`; the map counts"));
    }
    one
}

/// Finds the columns of time and how it is written.
fn timing<R: Records>(
    head: &Head,
    map: &Map,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<Timing, ImportError> {
    let path = &head.path;
    let wrong = |problem: String| ImportError::file(path, problem);
    let clock = |format: Format| Clock::new(format, &map.time, &head.numbers).map_err(wrong);
    if let Some(rate_hz) = map.time.rate_hz {
        let note = format!("no time column: rows are {} s apart, as the map says", seconds_from_nanos(nanos_from_seconds(1.0 / rate_hz)));
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
        let first = columns.first().ok_or_else(|| {
            wrong(format!(
                "expected a column of time, and none has a name that says so; name it with `time: {{column: …}}` in the map, or give `time: \
                 {{rate_hz: …}}` where there is none; {}",
                head.absent("time")
            ))
        })?;
        note = format!("time is column `{}`", head.names[*first]);
    }
    if let Some(text) = &map.time.format {
        let format = Format::of(text).map_err(|problem| wrong(format!("time.format: {problem}")))?;
        return Ok(Timing { columns, clock: clock(format)?, note, native: false });
    }
    let mut records = open()?;
    let mut texts = vec![];
    let mut native = false;
    while texts.len() < SAMPLED && records.advance()? {
        native |= matches!(records.value(columns[0]), Value::Time(_) | Value::Local(_));
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
    Ok(Timing { columns, clock: clock(detected.format.clone())?, note: format!("{known}: {}", detected.why), native: false })
}

/// The cells of time, joined by blanks.
fn time_text<R: Records>(records: &R, columns: &[usize]) -> String {
    let text = |column: &usize| match records.value(*column) {
        _ if records.text_of(*column).is_some() => records.text_of(*column).unwrap_or_default().trim().to_owned(),
        Value::Text(text) => text.trim().to_owned(),
        Value::Number(number) => number.to_string(),
        Value::Whole(number) | Value::Time(number) | Value::Local(number) => number.to_string(),
        Value::Missing => String::new(),
    };
    columns.iter().map(text).collect::<Vec<_>>().join(" ")
}

fn read_time<R: Records>(records: &R, columns: &[usize], clock: &mut Clock) -> Result<i64, String> {
    let only = columns.first().filter(|_| columns.len() == 1);
    if let Some(text) = only.and_then(|column| records.text_of(*column)) {
        return clock.read(text);
    }
    match only.map(|column| records.value(*column)) {
        Some(Value::Time(time_ns)) => Ok(time_ns),
        Some(Value::Local(local_ns)) => clock.local(local_ns),
        Some(Value::Text(text)) => clock.read(text),
        _ => clock.read(&time_text(records, columns)),
    }
}
