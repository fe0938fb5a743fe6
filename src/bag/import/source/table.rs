//! Rows of a table, whatever its file: time by a clock, signals by their columns, one value a line where the table is long.

mod refused;
mod rows;
mod said;

use std::collections::VecDeque;

use self::refused::{one_machine, other_header};
use super::channel::{Bad, ChannelValue, SourceChannel};
use super::head::{TableHead, with_header_unit};
use super::order::{RowOrder, Steps};
use super::quality::{Quality, QualityLook, column_of, column_of_lines, column_of_rows};
use super::records::TableRecords;
use super::timing::{TimeGroup, Timing, own_times, timing};
use super::{Source, SourceNotes};
use crate::import::ImportError;
use crate::import::convert::unit_by_name;
use crate::import::dialect::bracketed;
use crate::import::map::{Map, Repeated, SignalMap, SignalPlace, TimeMap};
use crate::import::row::ImportedRow;
use govtwin_model::units::nanos_from_seconds;

/// A signal and its column.
struct SignalColumn {
    index: usize,
    /// The column of time that counts for it, by its place among those of the table.
    group: usize,
    channel: SourceChannel,
    /// The column that says whether its values are good.
    quality: Option<(usize, Quality)>,
    /// Values that were left out because of it.
    not_good: u64,
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
    /// Columns of time, the one that counts where no other does first.
    times: Vec<TimeGroup>,
    /// The times of the present record.
    now_ns: Vec<Option<i64>>,
    rate_hz: Option<f64>,
    repeated: Repeated,
    rows: u64,
    bad_times: Bad,
    first_bad_time: String,
    /// All rows in the order of time, where the file has another.
    sorted: Option<std::vec::IntoIter<ImportedRow>>,
    rises: bool,
    order: RowOrder,
    /// A trip that is to stay was seen.
    latched: bool,
    /// Rows of the present record that are still to be handed on.
    of_record: VecDeque<ImportedRow>,
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
        let Timing { group, note } = timing(&head, map, &open)?;
        let mut times = vec![group];
        if long.is_none() && map.time.rate_hz.is_none() {
            times.extend(own_times(&head, map, &times[0], &open)?);
            times[0].may_be_blank = times.len() > 1;
        }
        let mut warnings = vec![];
        let mut columns = vec![];
        for (signal, one) in map.signals.iter().enumerate() {
            let SignalPlace::Column(name) = &one.from else { continue };
            // Trips that stay are those of the rows in the order of time.
            let (index, stated) = if long.is_some() {
                (usize::MAX, bracketed(name).map_or("", |(_, unit)| unit))
            } else if let Some(index) = head.find(name).map_err(wrong)? {
                (index, head.units.get(index).map_or("", String::as_str))
            } else {
                continue;
            };
            let group = times.iter().rposition(|group| group.is_of(index)).unwrap_or(0);
            let whole = head.names.get(index).unwrap_or(name);
            let stated = if one.target.is_pressure() { unit_by_name(whole, stated) } else { stated.to_owned() };
            let channel = SourceChannel::without_latch(signal, one).under(whole, &stated);
            let one = with_header_unit(one, &stated, &mut head.notes, &mut warnings).map_err(wrong)?;
            columns.push(SignalColumn { index, group, channel: channel.by(one), quality: None, not_good: 0 });
        }
        if !note.is_empty() {
            head.notes.push(note);
        }
        let now_ns = vec![None; times.len()];
        let mut table = Self {
            head,
            records: open()?,
            columns,
            long,
            times,
            now_ns,
            rate_hz: map.time.rate_hz,
            repeated: map.time.repeated,
            rows: 0,
            bad_times: Bad::default(),
            first_bad_time: String::new(),
            sorted: None,
            rises: true,
            order: RowOrder::default(),
            latched: false,
            of_record: VecDeque::new(),
            waiting: VecDeque::new(),
            ready: VecDeque::new(),
            last_step_ns: 0,
            spread: 0,
            warnings,
        };
        if !table.columns.is_empty() {
            table.look_through(map, open()?)?;
        }
        one_machine(&table, map, &mut open()?)?;
        Ok(table)
    }

    /// Looks at all times and qualities before the first row is handed on.
    fn look_through(&mut self, map: &Map, mut records: R) -> Result<(), ImportError> {
        let mut looks = vec![];
        for (place, column) in self.columns.iter().enumerate() {
            if let Some(index) = self.quality_column(map, column)? {
                looks.push((place, index, QualityLook::default()));
            }
        }
        let mut clock = self.times[0].clone();
        let mut steps = Steps::default();
        let timed = self.rate_hz.is_none() && self.times.len() == 1;
        while (timed || !looks.is_empty()) && records.advance()? {
            if timed && let Some(Ok(time_ns)) = clock.read(&records) {
                steps.take(time_ns);
            }
            for (place, index, look) in &mut looks {
                // Lines of other tags say nothing of this one.
                let of_tag = self.long.as_ref().is_none_or(|long| {
                    let tag = self.columns[*place].channel.map.place();
                    records.tag(long.tag).as_deref() == tag
                });
                if of_tag {
                    look.take(quality_cell(&records, *index));
                }
            }
        }
        // Columns with times of their own do not go on together.
        self.rises = steps.rises() && self.times.len() == 1;
        let mut asked = vec![];
        for (place, index, look) in looks {
            let column = &mut self.columns[place];
            let (name, id) = (&self.head.names[index], column.channel.map.target.id());
            if !column.channel.map.good.is_empty() {
                column.quality = Some((index, Quality::Listed(column.channel.map.good.clone())));
                continue;
            }
            match look.quality(name) {
                Ok(quality) => column.quality = quality.map(|quality| (index, quality)),
                // What may be of whole rows is asked once.
                Err(_) if asked.contains(&index) => {}
                Err(found) => {
                    asked.push(index);
                    self.warnings.push(format!(
                        "{id}: column `{name}` may say which of its values are good, and holds {found}; say which with `quality: \"{name}\", \
                         good: […]` in the signal, or `quality: none`; all values are taken"
                    ));
                }
            }
        }
        Ok(())
    }

    /// The column that says whether the values of a signal are good.
    fn quality_column(&self, map: &Map, column: &SignalColumn) -> Result<Option<usize>, ImportError> {
        let names = &self.head.names;
        match column.channel.map.quality.as_deref() {
            Some("none") => Ok(None),
            Some(name) => {
                let found = self.head.find(name).map_err(|problem| ImportError::file(&self.head.path, problem))?;
                found.map(Some).ok_or_else(|| ImportError::file(&self.head.path, self.head.absent(name)))
            }
            None => Ok(match &self.long {
                Some(long) => {
                    let taken: Vec<usize> =
                        self.times[0].columns.iter().copied().chain([long.tag, long.value]).collect();
                    column_of_lines(names, &taken)
                }
                // What is mapped as a signal is no quality of another.
                None => column_of(names, column.index).or_else(|| column_of_rows(names)).filter(|index| {
                    let mapped = |signal: &SignalMap| signal.place() == Some(names[*index].as_str());
                    !map.signals.iter().any(mapped)
                }),
            }),
        }
    }

    /// The columns of time, and what a map says of it so that nothing is left to be found out.
    pub(in crate::import) fn time(&self, map: &Map) -> (Vec<usize>, TimeMap) {
        let main = &self.times[0];
        let all = self.times.iter().flat_map(|group| group.columns.iter().copied()).collect();
        // Of columns with one name the number tells which.
        let name = |column: &usize| {
            let name = &self.head.names[*column];
            let alone = self.head.names.iter().filter(|other| *other == name).count() == 1;
            if alone { name.clone() } else { format!("#{}", column + 1) }
        };
        let format = Some(main.clock.format().name().into_owned()).filter(|name| !name.is_empty() && !main.native);
        (all, TimeMap { columns: main.columns.iter().map(name).collect(), format, ..map.time.clone() })
    }

    /// The column of time of a column, by its number from 1, where that is another than the one of the map.
    pub(in crate::import) fn own_time_of(&self, column: usize) -> Option<usize> {
        let group = self.times.iter().rposition(|group| group.is_of(column)).filter(|group| *group > 0)?;
        self.times[group].columns.first().map(|index| index + 1)
    }

    /// Goes on to the next record that has a time, and gives it, ns.
    pub(in crate::import) fn advance(&mut self) -> Result<Option<i64>, ImportError> {
        while self.records.advance()? {
            if let Some(rate_hz) = self.rate_hz {
                let time_ns = nanos_from_seconds(self.rows as f64 / rate_hz);
                (self.now_ns[0], self.rows) = (Some(time_ns), self.rows + 1);
                return Ok(Some(time_ns));
            }
            for (group, now_ns) in self.times.iter_mut().zip(&mut self.now_ns) {
                *now_ns = match group.read(&self.records) {
                    Some(Ok(time_ns)) => Some(time_ns),
                    Some(Err(problem)) => {
                        if let Some(other) = other_header(&self.records, &self.head.names, group.columns.first()) {
                            let problem = format!("line {}: {other}", self.records.place());
                            return Err(ImportError::file(&self.head.path, problem));
                        }
                        if self.bad_times.first.is_none() {
                            self.first_bad_time.clone_from(&problem);
                        }
                        self.bad_times.note(self.records.place(), &problem);
                        None
                    }
                    None => None,
                };
            }
            if let Some(time_ns) = self.now_ns.iter().flatten().next() {
                self.rows += 1;
                return Ok(Some(*time_ns));
            }
        }
        if self.rows == 0 {
            return Err(self.nothing());
        }
        Ok(None)
    }

    /// The time of a column in the present record, ns.
    pub(in crate::import) fn time_of(&self, column: usize) -> Option<i64> {
        let group = self.times.iter().rposition(|group| group.is_of(column)).unwrap_or(0);
        self.now_ns.get(group).copied().flatten()
    }

    /// What a column of the present record calls a signal.
    pub(in crate::import) fn tag(&self, column: usize) -> Option<std::borrow::Cow<'_, str>> {
        self.records.tag(column)
    }

    /// What stands in a column of the present record.
    pub(in crate::import) fn value(&self, column: usize) -> ChannelValue<'_> {
        self.records.value(column)
    }
}

/// What stands in a column of qualities, where `Bad` is a word and no missing number.
fn quality_cell<R: TableRecords>(records: &R, column: usize) -> ChannelValue<'_> {
    let text = records.text_of(column).map(str::trim).filter(|text| !text.is_empty());
    match (records.value(column), text) {
        (ChannelValue::Missing, Some(text)) => ChannelValue::Text(text),
        (value, _) => value,
    }
}

impl<R: TableRecords> Source for TableSource<R> {
    fn next(&mut self) -> Result<Option<ImportedRow>, ImportError> {
        if self.repeated == Repeated::Keep {
            return self.in_order();
        }
        loop {
            if let Some(row) = self.ready.pop_front() {
                return Ok(Some(row));
            }
            match self.in_order()? {
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
        self.notes()
    }
}
