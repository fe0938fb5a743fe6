//! Tables with one value a line, as historians export them: the name of the signal, its time, its value, and perhaps its unit and quality.

use super::column::SuggestedColumn;
use super::{MOST_COLUMNS, ROWS_PER_CALL, Suggestion, rank};
use crate::import::ImportError;
use crate::import::map::{FileMap, Map};
use crate::import::source::Source as _;
use crate::import::source::channel::ChannelValue;
use crate::import::source::head::TableHead;
use crate::import::source::quality::column_of_lines;
use crate::import::source::records::{SAMPLED, TableRecords};
use crate::import::source::table::TableSource;

/// Tables with one value a line have few columns.
const MOST_WIDE: usize = 12;
/// Names that the column of the signals' names has.
const TAGS: [&str; 38] = [
    "tag",
    "tagname",
    "tag name",
    "tag_name",
    "name",
    "signal",
    "signalname",
    "variable",
    "varname",
    "point",
    "pointname",
    "point name",
    "messstelle",
    "kanal",
    "topic",
    "series",
    "metric",
    "_field",
    "item",
    "itemname",
    "parameter",
    "bezeichnung",
    "nom",
    "sensor",
    "data item",
    "dataitem",
    "tag id",
    "tagid",
    "point id",
    "item id",
    "@ostr tag",
    "etiqueta",
    "nome",
    "variável",
    "标签",
    "测点",
    "测点名称",
    "名称",
];
/// Names that the column of units has.
const UNITS: [&str; 7] = ["unit", "units", "einheit", "engunits", "eu", "uom", "unité"];

/// The columns of a table with one value a line.
pub(super) struct TallColumns {
    tag: usize,
    value: usize,
    unit: Option<usize>,
}

/// Finds them; none where the table has another shape.
pub(super) fn columns<R: TableRecords>(
    head: &TableHead,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<Option<TallColumns>, ImportError> {
    if head.names.len() > MOST_WIDE {
        return Ok(None);
    }
    let time = head.time_columns();
    let mut records = open()?;
    let (mut texts, mut numbers) = (vec![0_usize; head.names.len()], vec![0_usize; head.names.len()]);
    let mut words: Vec<Vec<String>> = vec![vec![]; head.names.len()];
    let mut count = 0;
    while count < SAMPLED && records.advance()? {
        count += 1;
        for column in 0..head.names.len() {
            match records.value(column) {
                ChannelValue::Text(text) => {
                    texts[column] += 1;
                    if !words[column].iter().any(|known| known == text) {
                        words[column].push(text.to_owned());
                    }
                }
                ChannelValue::Number(_) | ChannelValue::Whole(_) => numbers[column] += 1,
                _ => {}
            }
        }
    }
    let named = |column: usize, names: &[&str]| names.contains(&head.names[column].trim().to_lowercase().as_str());
    let is_tag = |column: &usize| {
        let distinct = words[*column].len();
        !time.contains(column)
            && texts[*column] == count
            && count > 0
            && named(*column, &TAGS)
            && distinct >= 1
            && distinct * 2 <= count
    };
    let Some(tag) = (0..head.names.len()).find(is_tag) else { return Ok(None) };
    let taken: Vec<usize> = time.iter().copied().chain([tag]).collect();
    let quality = column_of_lines(&head.names, &taken);
    let unit = (0..head.names.len()).find(|column| named(*column, &UNITS));
    let free = (0..head.names.len()).filter(|column| !taken.contains(column) && Some(*column) != unit);
    // A column called so is the value, unless it is the only one that could be.
    let named_value =
        |column: &usize| named(*column, &["value", "wert", "_value", "val", "varvalue", "valeur", "valor"]);
    let value = free.clone().find(named_value).or_else(|| {
        // Several columns of numbers are those of several signals, whatever the name beside them is of.
        let several =
            free.clone().filter(|column| Some(*column) != quality && numbers[*column] * 2 > count).count() > 1;
        free.filter(|column| Some(*column) != quality && !several)
            .max_by_key(|column| (numbers[*column], std::cmp::Reverse(*column)))
    });
    Ok(value.map(|value| TallColumns { tag, value, unit }))
}

/// Proposes a map: the signals are named by their tags.
pub(super) fn suggest<R: TableRecords>(
    head: &TableHead,
    map: Map,
    tall: &TallColumns,
    open: &impl Fn() -> Result<R, ImportError>,
    on_progress: &mut dyn FnMut(f64),
) -> Result<Suggestion, ImportError> {
    let name = |column: usize| Some(head.names[column].clone());
    let file = FileMap { tag_column: name(tall.tag), value_column: name(tall.value), ..map.file.clone() };
    let map = Map { file, ..map };
    let mut table = TableSource::new(head.clone(), &map, open)?;
    let (_, time) = table.time(&map);
    let mut columns: Vec<SuggestedColumn> = vec![];
    let mut rows = 0_u64;
    while let Some(time_ns) = table.advance()? {
        rows += 1;
        if rows.is_multiple_of(ROWS_PER_CALL) {
            on_progress(table.share());
        }
        let ChannelValue::Text(tag) = table.value(tall.tag) else { continue };
        let tag = tag.trim();
        let known = columns.iter().position(|column| column.name == tag);
        let place = known.or_else(|| {
            let unit = match tall.unit.map(|unit| table.value(unit)) {
                Some(ChannelValue::Text(unit)) => unit.trim(),
                _ => "",
            };
            (columns.len() < MOST_COLUMNS).then(|| {
                columns.push(SuggestedColumn::new(tag, unit));
                columns.len() - 1
            })
        });
        if let Some(column) = place.and_then(|place| columns.get_mut(place)) {
            column.take(time_ns, table.value(tall.value));
        }
    }
    let mut suggestion = rank::rank(Map { time, ..map }, columns, false);
    let said = table.said();
    suggestion.notes = said.notes;
    suggestion.notes.push(format!("one value a line: column `{}` names the signals", head.names[tall.tag]));
    suggestion.open.extend(said.warnings);
    suggestion.rows = rows;
    Ok(suggestion)
}
