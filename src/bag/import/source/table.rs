//! Rows of a table, whatever its file: time by a clock, signals by their columns, one value a line where the table is long.

use std::collections::VecDeque;

use super::channel::{Bad, ChannelValue, SourceChannel};
use super::head::{TableHead, hint, with_header_unit};
use super::records::TableRecords;
use super::timing::{read_time, timing};
use super::{Source, SourceNotes};
use crate::import::ImportError;
use crate::import::clock::TimeReader;
use crate::import::map::{Map, Repeated, SignalPlace, TimeMap};
use crate::import::row::ImportedRow;
use govtwin_model::units::nanos_from_seconds;

/// A signal and its column.
struct SignalColumn {
    index: usize,
    channel: SourceChannel,
}

/// Where the tags and values of a long table stand.
struct Long {
    tag: usize,
    value: usize,
}

/// A table as a source of rows.
pub(in crate::import) struct TableSource<R> {
    head: TableHead,
    records: R,
    columns: Vec<SignalColumn>,
    long: Option<Long>,
    time: Vec<usize>,
    clock: TimeReader,
    /// The file itself says how its times count.
    native: bool,
    rate_hz: Option<f64>,
    repeated: Repeated,
    rows: u64,
    bad_times: Bad,
    first_bad_time: String,
    /// Rows of one time that wait for the next, and the last step between two times, ns.
    waiting: VecDeque<ImportedRow>,
    ready: VecDeque<ImportedRow>,
    last_step_ns: i64,
    spread: u64,
    warnings: Vec<String>,
}

impl<R: TableRecords> TableSource<R> {
    /// Opens a table by a map; `open` gives its records from the beginning.
    pub(in crate::import) fn new(
        mut head: TableHead,
        map: &Map,
        open: impl Fn() -> Result<R, ImportError>,
    ) -> Result<Self, ImportError> {
        let path = head.path.clone();
        let wrong = |problem: String| ImportError::file(&path, problem);
        let find =
            |name: &str| head.find(name).map_err(wrong)?.ok_or_else(|| ImportError::file(&path, head.absent(name)));
        let long = match (&map.file.tag_column, &map.file.value_column) {
            (Some(tag), Some(value)) => Some(Long { tag: find(tag)?, value: find(value)? }),
            _ => None,
        };
        let timing = timing(&head, map, &open)?;
        let mut warnings = vec![];
        let mut columns = vec![];
        for (signal, one) in map.signals.iter().enumerate() {
            let SignalPlace::Column(name) = &one.from else { continue };
            if long.is_some() {
                columns.push(SignalColumn { index: usize::MAX, channel: SourceChannel::new(signal, one) });
            } else if let Some(index) = head.find(name).map_err(wrong)? {
                let stated = head.units.get(index).map_or("", String::as_str);
                let one = with_header_unit(one, stated, &mut head.notes, &mut warnings);
                columns.push(SignalColumn { index, channel: SourceChannel::new(signal, &one) });
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
    pub(in crate::import) fn value(&self, column: usize) -> ChannelValue<'_> {
        self.records.value(column)
    }

    /// The next record that has a time, as a row.
    fn record(&mut self) -> Result<Option<ImportedRow>, ImportError> {
        while let Some(time_ns) = self.advance()? {
            let place = self.records.place();
            let mut row = ImportedRow::at(time_ns);
            match &self.long {
                Some(long) => {
                    let ChannelValue::Text(tag) = self.records.value(long.tag) else { continue };
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

impl<R: TableRecords> Source for TableSource<R> {
    fn next(&mut self) -> Result<Option<ImportedRow>, ImportError> {
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

    fn said(&self) -> SourceNotes {
        let path = self.head.path.display();
        let mut said = SourceNotes { notes: self.head.notes.clone(), warnings: self.warnings.clone() };
        for one in said.notes.iter_mut().chain(&mut said.warnings) {
            *one = format!("{path}: {one}");
        }
        if let Some((line, _)) = &self.bad_times.first {
            let (count, problem) = (self.bad_times.count, &self.first_bad_time);
            said.warnings.push(format!("{path}:{line}: {count} lines left out, the first because {problem}"));
        }
        if let Some((line, text)) = &self.records.ragged().first {
            let count = self.records.ragged().count;
            said.warnings
                .push(format!("{path}:{line}: {count} lines left out that have too few cells, the first `{text}`"));
        }
        for column in &self.columns {
            if let Some((line, text)) = &column.channel.bad.first {
                let (count, id) = (column.channel.bad.count, column.channel.map.target.id());
                let place = column.channel.map.place().unwrap_or_default();
                let hint = hint(text, &self.head.numbers);
                said.warnings.push(format!(
                    "{path}:{line}: {id} (`{place}`): {count} cells are no numbers, the first `{text}`{hint}"
                ));
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
            said.notes
                .push(format!("{path}: {} rows shared a time with others and were spread up to the next", self.spread));
        }
        said
    }
}
