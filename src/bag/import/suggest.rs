//! A map proposed for a file that nobody has mapped: by the names of its columns, their units, ranges and shapes.

mod column;
mod machines;
mod names;
mod propose;
mod rank;
mod relations;
mod signal_words;
mod tall;
mod trio;
mod trip;

use std::path::Path;
use std::sync::Arc;

use super::ImportError;
use super::csv_file::CsvFile;
use super::map::{FileMap, Map, Repeated, TimeMap};
use super::number::Numbers;
use super::source::channel::ChannelValue;
use super::source::head::{TableHead, hint};
use super::source::quality::column_of;
use super::source::records::TableRecords;
use super::source::table::TableSource;
use super::source::timing::is_timed;
use super::source::{Source as _, SourceKind, kind_of};
use crate::{FieldReader, FieldValue, TopicInfo, messages};

pub use column::{Envelope, SuggestedColumn};
pub use rank::Proposed;
pub use relations::RelatedPair;

/// Columns of a file that are looked at.
const MOST_COLUMNS: usize = 400;
/// Rows between two calls of the progress.
const ROWS_PER_CALL: u64 = 4096;

/// What was understood of a file.
#[derive(Clone, Debug, Default)]
pub struct Suggestion {
    /// The map.
    pub map: Map,
    /// Every column or field, in the order of the file.
    pub columns: Vec<SuggestedColumn>,
    /// What each signal of the map was chosen by, in its order.
    pub reasons: Vec<Proposed>,
    /// Which columns hang together by their courses, the strongest first.
    pub pairs: Vec<RelatedPair>,
    /// How the file was understood.
    pub notes: Vec<String>,
    /// What its reader must decide, or should look into.
    pub open: Vec<String>,
    /// Rows, or messages.
    pub rows: u64,
}

/// The unit of a column that its file does not state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnUnit {
    /// The column's name.
    pub column: String,
    /// The unit.
    pub unit: String,
}

/// What is known of a file before.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Of this map, `file` and `time` count.
    pub map: Map,
    /// Units of columns.
    pub units: Vec<ColumnUnit>,
}

/// Looks through a file and proposes a map.
///
/// # Errors
/// Where it cannot be read, or its time is not understood: then the error says which line of a map would help.
pub fn suggest(path: &Path, known: &Known, on_progress: &mut dyn FnMut(f64)) -> Result<Suggestion, ImportError> {
    match kind_of(path)? {
        SourceKind::Bag => of_bag(path, &known.units, on_progress),
        SourceKind::Table => {
            let file = CsvFile::open(path, &known.map.file)?;
            let mut layout = known.map.file.clone();
            layout.separator = Some(file.dialect.separator);
            layout.decimal = Some(file.dialect.numbers.decimal);
            layout.thousands = file.dialect.numbers.thousands;
            layout.header_line = Some(file.dialect.header_line);
            layout.unit_line = file.dialect.unit_line;
            layout.first_line = Some(file.dialect.first_line);
            of_table(file.head.clone(), layout, known, || file.records(), on_progress)
        }
        #[cfg(feature = "parquet")]
        SourceKind::Parquet => {
            let file = super::parquet_file::ParquetFile::open(path)?;
            of_table(file.head.clone(), FileMap::default(), known, || file.records(), on_progress)
        }
        #[cfg(not(feature = "parquet"))]
        SourceKind::Parquet => Err(super::run::no_parquet(path)),
    }
}

fn of_table<R: TableRecords>(
    mut head: TableHead,
    layout: FileMap,
    known: &Known,
    open: impl Fn() -> Result<R, ImportError>,
    on_progress: &mut dyn FnMut(f64),
) -> Result<Suggestion, ImportError> {
    let mut map = Map { file: layout, time: known.map.time.clone(), ..Map::default() };
    for ColumnUnit { column, unit } in &known.units {
        let place = head.find(column).and_then(|place| place.ok_or_else(|| head.absent(column)));
        let place = place.map_err(|problem| ImportError::file(&head.path, problem))?;
        head.units[place].clone_from(unit);
    }
    let is_timed = is_timed(&head, &map, &open)?;
    if !is_timed {
        map.time.rate_hz = Some(1.0);
    }
    let names = head.names.clone();
    let (units, numbers) = (head.units.clone(), head.numbers.clone());
    if let Some(long) = tall::columns(&head, &open)? {
        return tall::suggest(&head, map, &long, &open, on_progress);
    }
    let mut table = TableSource::new(head, &map, &open)?;
    let (time_columns, time) = table.time(&map);
    let mut columns: Vec<SuggestedColumn> =
        names.iter().zip(&units).take(MOST_COLUMNS).map(|(name, unit)| SuggestedColumn::new(name, unit)).collect();
    let mut rows = 0_u64;
    let (mut newest_ns, mut repeated) = (None, 0_u64);
    while let Some(time_ns) = table.advance()? {
        repeated += u64::from(newest_ns == Some(time_ns));
        newest_ns = Some(time_ns);
        for (index, column) in columns.iter_mut().enumerate().filter(|(index, _)| !time_columns.contains(index)) {
            if let Some(time_ns) = table.time_of(index) {
                column.take(time_ns, table.value(index));
            }
        }
        rows += 1;
        if rows.is_multiple_of(ROWS_PER_CALL) {
            on_progress(table.share());
        }
    }
    let said = table.said();
    // Neither times nor what says whether others are good is a signal.
    let of_others: Vec<usize> = (0..names.len()).filter_map(|column| column_of(&names, column)).collect();
    let mut place = 0;
    columns.retain(|_| {
        place += 1;
        !time_columns.contains(&(place - 1)) && !of_others.contains(&(place - 1))
    });
    let unread = unread(&columns, &numbers);
    let mut suggestion = rank::rank(Map { time, ..map }, columns, false);
    suggestion.open.extend(unread);
    if !is_timed {
        suggestion.open.insert(
            0,
            "time: there is no column of it, so that rows are counted as if one second apart (`rate_hz: 1`): times and speeds are in rows until \
             `rate_hz` says how many there are in a second; where a column is the time, name it with --time-column"
                .to_owned(),
        );
    }
    for signal in &mut suggestion.map.signals {
        let index = signal.place().and_then(|name| names.iter().position(|known| known == name));
        signal.time = index.and_then(|index| table.own_time_of(index)).map(|number| format!("#{number}"));
    }
    suggestion.notes = said.notes;
    suggestion.open.extend(said.warnings);
    if rows > 2 && 100 * (repeated + 1) >= 99 * rows {
        suggestion.open.push(format!(
            "time: {repeated} of {rows} rows have the time of the one before, as in a column of days alone; name the one that holds the time of day \
             with --time-column, or say with --rate-hz how many rows a second has"
        ));
    } else if 2 * repeated > rows {
        // Most rows have the time of the one before: a clock without fractions of the second.
        suggestion.map.time.repeated = Repeated::Spread;
        suggestion.open.push(format!(
            "time: {repeated} of {rows} rows have the time of the one before, as if an export had cut the fraction of the second; the map spreads \
             them evenly (`repeated: spread`); an export with fractions is better"
        ));
    } else if 100 * repeated > rows {
        suggestion.open.push(format!(
            "time: {repeated} of {rows} rows have the time of the one before, as if an export had rounded them; where rows are evenly spaced, \
             `rate_hz` in place of the column counts them"
        ));
    }
    if names.len() > MOST_COLUMNS {
        suggestion.notes.push(format!("of {} columns the first {MOST_COLUMNS} were looked at", names.len()));
    }
    suggestion.rows = rows;
    Ok(suggestion)
}

/// Columns whose cells look like numbers and are none, as they are written.
fn unread(columns: &[SuggestedColumn], numbers: &Numbers) -> Vec<String> {
    let of = |column: &SuggestedColumn| {
        let text = column.unread.as_deref().filter(|_| column.texts > column.range.count && column.words.len() > 1)?;
        let (name, texts) = (&column.name, column.texts);
        Some(format!("column `{name}`: {texts} cells are no numbers, the first `{text}`{}", hint(text, numbers)))
    };
    columns.iter().filter_map(of).collect()
}

fn of_bag(path: &Path, units: &[ColumnUnit], on_progress: &mut dyn FnMut(f64)) -> Result<Suggestion, ImportError> {
    let bag = messages(path)?;
    let total: u64 = bag.files().iter().map(|file| file.messages).sum();
    let mut notes = vec![];
    let mut readers = vec![];
    // A topic with several definitions has a reader for each.
    for topic in bag.topics() {
        match FieldReader::new(topic) {
            Ok(reader) => {
                notes.push(format!("topic {} of type {}", topic.name, topic.type_name));
                // Positions of its joints are in m or rad, never in pu (REP 103).
                let joints = topic.type_name == "sensor_msgs/msg/JointState";
                readers.push((Arc::clone(topic), reader, joints));
            }
            Err(problem) => notes.push(format!("topic {}: {problem}", topic.name)),
        }
    }
    let mut columns: Vec<SuggestedColumn> = vec![];
    let mut rows = 0_u64;
    for message in bag {
        let message = message?;
        rows += 1;
        if rows.is_multiple_of(ROWS_PER_CALL) {
            on_progress(rows as f64 / total.max(1) as f64);
        }
        let is_its = |known: &Arc<TopicInfo>| {
            Arc::ptr_eq(known, &message.topic)
                || (known.name == message.topic.name && known.schema == message.topic.schema)
        };
        let Some((known, reader, joints)) = readers.iter().find(|(known, ..)| is_its(known)) else { continue };
        let topic = &known.name;
        let time_ns = reader.stamp_ns(&message.data).unwrap_or(message.log_time_ns);
        for (field, value) in reader.leaves(&message.data) {
            if field.starts_with("header.") || field.starts_with("stamp.") {
                continue;
            }
            let name = format!("{topic}.{field}");
            let place = columns.iter().position(|column| column.name == name);
            let place = place.or_else(|| {
                (columns.len() < MOST_COLUMNS).then(|| {
                    let given = units.iter().find(|one| one.column == name).map(|one| one.unit.as_str());
                    let unit = given.unwrap_or(if *joints && field.starts_with("position") { "m" } else { "" });
                    columns.push(SuggestedColumn::new(&name, unit));
                    columns.len() - 1
                })
            });
            let Some(column) = place.and_then(|place| columns.get_mut(place)) else { continue };
            match &value {
                FieldValue::Number(number) => column.take(time_ns, ChannelValue::Number(*number)),
                FieldValue::Text(text) => column.take(time_ns, ChannelValue::Text(text)),
            }
        }
    }
    let mut suggestion = rank::rank(Map { time: TimeMap::default(), ..Map::default() }, columns, true);
    suggestion.notes = notes;
    suggestion.rows = rows;
    Ok(suggestion)
}
