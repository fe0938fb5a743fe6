//! LabVIEW's measurement files (`.lvm`): a head, then segments with a head each; times count from the start of a segment, or not at all.

use jiff::SignedDuration;
use jiff::civil::DateTime;

use super::Rewriter;
use crate::import::number::decimal_ns;

/// A second, ns.
const SECOND_NS: i128 = 1_000_000_000;
/// What ends a head.
const END: &str = "***End_of_Header***";

/// Where in the file a line stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Place {
    /// In the head of the file, or of a segment.
    #[default]
    Head,
    /// Before the names of the columns.
    Names,
    /// In the rows.
    Rows,
    /// In what programs note for themselves.
    Special,
}

/// Where the times stand.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Times {
    /// In the first column.
    #[default]
    One,
    /// In no column: rows are evenly spaced.
    No,
    /// Before each column.
    Each,
}

/// A reader of such a file.
#[derive(Clone, Debug)]
pub(super) struct LabView {
    place: Place,
    separator: char,
    comma: bool,
    times: Times,
    /// Times count from 1904 on.
    absolute: bool,
    /// Of the segment: its start, the time of the first row and the step from row to row, ns.
    date: String,
    start: Option<DateTime>,
    first_ns: i64,
    step_ns: Option<i64>,
    row: i64,
    units: Vec<String>,
    names: Option<Vec<String>>,
}

impl Default for LabView {
    fn default() -> Self {
        Self {
            place: Place::Head,
            separator: '\t',
            comma: false,
            times: Times::One,
            absolute: false,
            date: String::new(),
            start: None,
            first_ns: 0,
            step_ns: None,
            row: 0,
            units: vec![],
            names: None,
        }
    }
}

impl LabView {
    /// A time of the file, ns.
    fn ns(&self, text: &str) -> Option<i64> {
        let text = text.trim();
        if self.comma { decimal_ns(&text.replace(',', "."), SECOND_NS) } else { decimal_ns(text, SECOND_NS) }
    }

    /// A line of a head.
    fn key(&mut self, line: &str) {
        let (key, rest) = line.split_once(['\t', ',', ';']).unwrap_or((line, ""));
        // Values of the head of a segment stand above their columns.
        let values: Vec<&str> = rest.split(self.separator).collect();
        let first = values.iter().map(|value| value.trim()).find(|value| !value.is_empty()).unwrap_or_default();
        match key.trim() {
            "Separator" => self.separator = if rest.trim().starts_with("Comma") { ',' } else { '\t' },
            "Decimal_Separator" => self.comma = rest.trim().starts_with(','),
            "X_Columns" => {
                self.times = match first {
                    "No" => Times::No,
                    "Multi" => Times::Each,
                    _ => Times::One,
                }
            }
            "Time_Pref" => self.absolute = first == "Absolute",
            "Date" => first.replace('/', "-").clone_into(&mut self.date),
            "Time" => {
                let time = first.replace(',', ".");
                // More digits than a time has.
                let (seconds, digits) = time.split_once('.').unwrap_or((&time, "0"));
                let digits: String = digits.chars().take(9).collect();
                self.start = format!("{}T{seconds}.{digits}", self.date).parse().ok();
            }
            "X0" => self.first_ns = self.ns(first).unwrap_or(0),
            "Delta_X" => self.step_ns = self.ns(first),
            "Y_Unit_Label" => self.units = values.iter().map(|value| value.trim().to_owned()).collect(),
            _ => {}
        }
    }

    /// Names with their units, once: what follows are rows.
    fn named(&mut self, line: &str) -> Result<String, String> {
        let each = self.times == Times::Each;
        let name = |(k, cell): (usize, &str)| {
            let cell = cell.trim();
            let unit = match k.checked_sub(1).filter(|k| !each || k.is_multiple_of(2)) {
                Some(k) if cell != "Comment" => self.units.get(k).map_or("", String::as_str),
                _ => "",
            };
            if unit.is_empty() || cell.contains('[') { cell.to_owned() } else { format!("{cell} [{unit}]") }
        };
        let names: Vec<String> = line.split(self.separator).enumerate().map(name).collect();
        self.row = 0;
        match &self.names {
            Some(known) if *known != names => Err(format!(
                "segments hold other channels ({} and {}); export each as a file of its own",
                known.join(", "),
                names.join(", ")
            )),
            Some(_) => Ok(String::new()),
            None => {
                self.names = Some(names.clone());
                Ok(names.join(&self.separator.to_string()))
            }
        }
    }

    /// A time as the table has it.
    fn time(&self, since_ns: i64) -> String {
        let start = self.start.filter(|_| !self.absolute);
        if let Some(time) = start.and_then(|start| start.checked_add(SignedDuration::from_nanos(since_ns)).ok()) {
            return time.to_string();
        }
        let (sign, since_ns) = (if since_ns < 0 { "-" } else { "" }, since_ns.unsigned_abs());
        format!("{sign}{}.{:09}", since_ns / 1_000_000_000, since_ns % 1_000_000_000)
    }

    fn timed(&mut self, line: &str) -> Result<String, String> {
        let mut cells: Vec<String> = line.split(self.separator).map(str::to_owned).collect();
        match self.times {
            Times::No => {
                let step_ns = self.step_ns.filter(|step_ns| *step_ns > 0).ok_or(
                    "expected `Delta_X`, the time from row to row, in the head of a file without a column of times (`X_Columns No`)",
                )?;
                let time = self.time(self.first_ns.saturating_add(self.row.saturating_mul(step_ns)));
                match cells.first_mut().filter(|first| first.trim().is_empty()) {
                    Some(first) => *first = time,
                    None => cells.insert(0, time),
                }
            }
            Times::One | Times::Each => {
                let columns = if self.times == Times::One { 1 } else { cells.len() };
                for cell in cells.iter_mut().take(columns).step_by(2) {
                    // What is no time is told with its line.
                    if let Some(since_ns) = self.ns(cell) {
                        *cell = self.time(since_ns);
                    }
                }
            }
        }
        self.row += 1;
        Ok(cells.join(&self.separator.to_string()))
    }
}

impl Rewriter for LabView {
    fn line(&mut self, line: &str) -> Result<String, String> {
        let text = line.trim();
        let begins_segment = self.place == Place::Rows && text.starts_with("Channels");
        if text.starts_with("***Start_Special***") {
            self.place = Place::Special;
        } else if text.starts_with("***End_Special***") {
            self.place = Place::Head;
        } else if text.starts_with(END) {
            // The head of the file ends so as well; what follows it is that of a segment, or its names.
            self.place = Place::Names;
        } else if begins_segment {
            self.place = Place::Head;
            self.key(line);
        } else if !text.is_empty() {
            match self.place {
                Place::Names if text.starts_with("X_Value") => {
                    self.place = Place::Rows;
                    return self.named(line);
                }
                Place::Head | Place::Names => self.key(line),
                Place::Rows => return self.timed(line),
                Place::Special => {}
            }
        }
        Ok(String::new())
    }
}
