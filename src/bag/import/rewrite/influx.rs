//! `InfluxDB`'s CSV: tables one after the other, each with annotations and names of its own, and a series told apart by all columns of its group.

use csv::{ReaderBuilder, StringRecord, WriterBuilder};

use super::Rewriter;

/// Columns that say nothing of a series or its values.
const OWN: [&str; 6] = ["", "result", "table", "_start", "_stop", "_time"];

/// Whether a line begins such a file.
pub(super) fn begins(line: &str) -> bool {
    let annotated = ["#group,", "#datatype,", "#default,"].iter().any(|begin| line.trim_start().starts_with(begin));
    let cells: Vec<&str> = line.trim_end().split(',').collect();
    annotated || ["_time", "_value", "_field"].iter().all(|name| cells.contains(name))
}

/// A reader of such a file.
#[derive(Clone, Debug, Default)]
pub(super) struct Influx {
    group: Vec<bool>,
    defaults: Vec<String>,
    /// Annotations were seen, or the file began: names come next.
    named: bool,
    columns: Columns,
    /// The names that the table has by now.
    given: Option<Vec<String>>,
}

/// What the columns of the present table hold.
#[derive(Clone, Debug, Default)]
struct Columns {
    time: Option<usize>,
    value: Option<usize>,
    /// What tells the series from others, in the order of its name.
    series: Vec<usize>,
    /// Of a table without `_field` and `_value`, what is handed on.
    wide: Vec<usize>,
    error: Option<usize>,
}

fn cells(line: &str) -> Vec<String> {
    let mut record = StringRecord::new();
    let mut reader = ReaderBuilder::new().has_headers(false).flexible(true).from_reader(line.as_bytes());
    let read = reader.read_record(&mut record);
    read.map_or_else(|_| vec![], |_| record.iter().map(|cell| cell.trim().to_owned()).collect())
}

fn line_of(cells: &[&str]) -> String {
    let mut writer = WriterBuilder::new().from_writer(vec![]);
    // Writing to memory does not fail.
    let _ = writer.write_record(cells);
    let text = writer.into_inner().unwrap_or_default();
    String::from_utf8_lossy(&text).trim_end_matches(['\n', '\r']).to_owned()
}

impl Influx {
    fn names(&mut self, names: &[String]) -> Result<String, String> {
        for (what, count) in [("#group", self.group.len()), ("#default", self.defaults.len())] {
            if count > 0 && count != names.len() {
                return Err(format!("`{what}` has {count} cells, expected {}, one for each name", names.len()));
            }
        }
        let at = |wanted: &str| names.iter().position(|name| name == wanted);
        let is_own = |k: &usize| OWN.contains(&names[*k].as_str());
        let rest = || (0..names.len()).filter(|k| !is_own(k));
        let (value, field) = (at("_value"), at("_field"));
        let of_group = |k: &usize| self.group.get(*k).copied().unwrap_or(true);
        let last = [at("_measurement"), field];
        let tags = rest().filter(|k| of_group(k) && Some(*k) != value && !last.contains(&Some(*k)));
        let series = tags.chain(last.into_iter().flatten()).collect();
        let is_long = value.is_some() && field.is_some();
        self.columns = Columns {
            time: at("_time"),
            value: value.filter(|_| is_long),
            series,
            wide: at("_time").into_iter().chain(rest()).collect(),
            error: at("error"),
        };
        self.named = true;
        if self.columns.error.is_some() {
            return Ok(String::new());
        }
        let given: Vec<String> = if is_long {
            ["_time", "_field", "_value"].map(str::to_owned).to_vec()
        } else {
            self.columns.wide.iter().map(|k| names[*k].clone()).collect()
        };
        match &self.given {
            Some(known) if *known != given => Err(format!(
                "tables have other columns ({} and {}); export them as files of their own, or without `pivot`",
                known.join(", "),
                given.join(", ")
            )),
            Some(_) => Ok(String::new()),
            None => {
                let line = line_of(&given.iter().map(String::as_str).collect::<Vec<_>>());
                self.given = Some(given);
                Ok(line)
            }
        }
    }
}

impl Rewriter for Influx {
    fn line(&mut self, line: &str) -> Result<String, String> {
        if line.trim().is_empty() {
            // A table without annotations of its own begins with names as well.
            return Ok(String::new());
        }
        let cells = cells(line);
        match cells.first().map(String::as_str) {
            Some("#group") => {
                (self.group, self.named) = (cells.iter().map(|cell| cell == "true").collect(), false);
                return Ok(String::new());
            }
            Some("#default") => {
                self.defaults = cells.iter().map(|cell| cell.trim_start_matches("#default").to_owned()).collect();
                self.named = false;
                return Ok(String::new());
            }
            Some(other) if other.starts_with('#') => {
                self.named = false;
                return Ok(String::new());
            }
            _ => {}
        }
        if !self.named || cells.iter().any(|cell| cell == "_time") {
            return self.names(&cells);
        }
        let cell = |k: usize| {
            let own = cells.get(k).map_or("", String::as_str);
            if own.is_empty() { self.defaults.get(k).map_or("", String::as_str) } else { own }
        };
        if let Some(error) = self.columns.error {
            return Err(format!("the database has answered with an error and no data: {}", cell(error)));
        }
        let Some(value) = self.columns.value else {
            return Ok(line_of(&self.columns.wide.iter().map(|k| cell(*k)).collect::<Vec<_>>()));
        };
        let series: Vec<&str> = self.columns.series.iter().map(|k| cell(*k)).filter(|cell| !cell.is_empty()).collect();
        Ok(line_of(&[self.columns.time.map_or("", cell), &series.join("."), cell(value)]))
    }
}
