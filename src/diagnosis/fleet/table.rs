//! The table of a fleet: a line for each unit and period, below it one for each cause and each determined parameter.

use super::ageing::Trend;
use super::gathered::{Gathered, Row, Status};
use super::result::SizeInterval;

/// The columns.
pub const COLUMNS: [&str; 19] = [
    "unit",
    "period",
    "status",
    "verdict",
    "stage",
    "row",
    "name",
    "measure",
    "probability",
    "value",
    "low_90",
    "high_90",
    "information_share",
    "determined",
    "cumulative_sum",
    "changed",
    "recordings",
    "words",
    "key",
];

/// A cell.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Cell {
    /// Nothing.
    #[default]
    Empty,
    /// Words.
    Text(String),
    /// A number in the unit of the column `measure`.
    Number(f64),
    /// A count.
    Count(u64),
    /// Yes or no.
    Flag(bool),
}

impl Cell {
    /// Its text in CSV: numbers by the shortest text that reads back to the same bits.
    fn text(&self) -> String {
        match self {
            Self::Empty => String::new(),
            Self::Text(text) => text.clone(),
            Self::Number(number) => number.to_string(),
            Self::Count(count) => count.to_string(),
            Self::Flag(flag) => flag.to_string(),
        }
    }
}

/// A line of the table.
pub type Line = [Cell; COLUMNS.len()];

/// All lines, by unit, period, kind and name.
pub fn lines(gathered: &Gathered) -> Vec<Line> {
    gathered.rows.iter().flat_map(|row| of_row(row, gathered)).collect()
}

fn of_row(row: &Row, gathered: &Gathered) -> Vec<Line> {
    let trends = gathered.trends.get(&row.unit).map(Vec::as_slice).unwrap_or_default();
    let found = row.found.as_ref();
    let head = |kind: &str, name: &str| -> Line {
        let mut line = Line::default();
        let verdict = found.map_or(Cell::Empty, |found| words(&found.verdict));
        let stage = found.and_then(|found| found.stage.as_deref()).map_or(Cell::Empty, words);
        line[..7].clone_from_slice(&[
            words(&row.unit),
            words(&row.period),
            words(row.status.id()),
            verdict,
            stage,
            words(kind),
            words(name),
        ]);
        line[16] = Cell::Count(row.recordings as u64);
        line[18] = words(&row.key);
        line
    };
    let mut entry = head("entry", "");
    entry[17] = words(&row.words);
    let mut lines = vec![entry];
    let Some(found) = found else { return lines };
    for (name, probability) in [("none", found.none_probability), ("unknown", found.unknown_probability)] {
        let mut line = head("cause", name);
        line[8] = number(probability);
        lines.push(line);
    }
    for cause in &found.causes {
        for size in &cause.sizes {
            let name = format!("{}.{}", cause.id, size.name);
            let mut line = head("cause", &name);
            line[8] = number(cause.probability);
            fill(&mut line, size, found.names_causes() && size.is_determined(), &name, &row.period, trends);
            lines.push(line);
        }
    }
    for size in &found.parameters {
        let mut line = head("parameter", &size.name);
        fill(&mut line, size, size.is_determined(), &size.name, &row.period, trends);
        lines.push(line);
    }
    lines
}

fn fill(line: &mut Line, size: &SizeInterval, determined: bool, name: &str, period: &str, trends: &[Trend]) {
    line[7] = words(&size.unit);
    line[9] = number(size.value);
    line[10] = number(size.low);
    line[11] = number(size.high);
    line[12] = number(size.information_share);
    line[13] = Cell::Flag(determined);
    let trend = trends.iter().find(|trend| trend.name == name);
    if let Some(point) = trend.and_then(|trend| trend.points.iter().find(|point| point.period == period)) {
        line[14] = Cell::Number(point.cumulative_sum);
        line[15] = Cell::Flag(point.changed);
    }
}

fn words(text: &str) -> Cell {
    if text.is_empty() { Cell::Empty } else { Cell::Text(text.to_owned()) }
}

fn number(number: Option<f64>) -> Cell {
    number.map_or(Cell::Empty, Cell::Number)
}

/// The table as CSV.
pub fn csv(lines: &[Line]) -> String {
    csv_text(&COLUMNS, lines.iter().map(|line| line.iter().map(Cell::text).collect()))
}

/// Rows below a head as CSV, as RFC 4180 has it but for line ends.
pub(crate) fn csv_text(head: &[&str], rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut writer = csv::Writer::from_writer(Vec::new());
    // To a vector of bytes nothing is refused, and all rows are as long as the head.
    let _ = writer.write_record(head);
    for row in rows {
        let _ = writer.write_record(row);
    }
    writer.into_inner().map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).unwrap_or_default()
}

impl Status {
    /// The word in the table.
    pub fn id(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::Failed => "failed",
            Self::Missing => "missing",
        }
    }
}
