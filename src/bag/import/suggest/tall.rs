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
use crate::import::words::Words;

/// Tables with one value a line have few columns.
const MOST_WIDE: usize = 12;
/// Names of the column of the signals' names, in lower case, letters and digits alone.
const TAGS: Words = Words(
    "tag|tagname|name|signal|signalname|variable|varname|pointname|messstelle|topic|series|metric|field|item|itemname|parameter|bezeichnung|nom|\
     sensor|dataitem|ostrtag|etiqueta|nome|variável|标签|测点|测点名称|名称|point|kanal",
);
/// Names of that column where signals have numbers.
const NUMBERED: Words = Words(
    "id|tagid|pointid|itemid|signalid|valueid|channelid|numericid|tagindex|index|no|nr|number|nummer|channel|kanal|point",
);
/// Names of the column of values.
const VALUES: Words = Words("value|wert|val|varvalue|valeur|valor|datavalue");
/// Names that the column of units has.
const UNITS: Words = Words("unit|units|einheit|engunits|eu|uom|unité");

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
    let mut numbers = vec![0_usize; head.names.len()];
    let mut tags: Vec<Vec<String>> = vec![vec![]; head.names.len()];
    let (mut filled, mut count) = (numbers.clone(), 0);
    while count < SAMPLED && records.advance()? {
        count += 1;
        for column in 0..head.names.len() {
            let is_number = matches!(records.value(column), ChannelValue::Number(_) | ChannelValue::Whole(_));
            numbers[column] += usize::from(is_number);
            let Some(tag) = records.tag(column) else { continue };
            filled[column] += 1;
            if !tags[column].iter().any(|known| *known == tag) {
                tags[column].push(tag.into_owned());
            }
        }
    }
    let named = |column: usize, names: Words| {
        let name: String = head.names[column].chars().filter(|letter| letter.is_alphanumeric()).collect();
        names.has(&name.to_lowercase())
    };
    let repeats = |column: usize| {
        !time.contains(&column) && filled[column] == count && count > 0 && tags[column].len() * 2 <= count
    };
    let is_tag = |column: &usize| {
        repeats(*column) && numbers[*column] == 0 && (named(*column, TAGS) || named(*column, NUMBERED))
    };
    // A number that is one and the same is of a machine, or of nothing.
    let is_number = |column: &usize| repeats(*column) && tags[*column].len() > 1 && named(*column, NUMBERED);
    let all = 0..head.names.len();
    let Some(tag) = all.clone().find(is_tag).or_else(|| all.clone().find(is_number)) else { return Ok(None) };
    let numbered = all.clone().filter(|column| *column != tag && named(*column, NUMBERED));
    let taken: Vec<usize> = time.iter().copied().chain([tag]).chain(numbered).collect();
    let quality = column_of_lines(&head.names, &taken);
    let unit = all.clone().find(|column| named(*column, UNITS));
    let free = all.filter(|column| !taken.contains(column) && Some(*column) != unit);
    // A column called so is the value, unless it is the only one that could be.
    let value = free.clone().find(|column| named(*column, VALUES)).or_else(|| {
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
        let Some(tag) = table.tag(tall.tag) else { continue };
        let known = columns.iter().position(|column| column.name == tag);
        let place = known.or_else(|| {
            let unit = match tall.unit.map(|unit| table.value(unit)) {
                Some(ChannelValue::Text(unit)) => unit.trim(),
                _ => "",
            };
            (columns.len() < MOST_COLUMNS).then(|| {
                columns.push(SuggestedColumn::new(&tag, unit));
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
