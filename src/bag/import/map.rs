//! Maps: which column or field holds which signal, and how it is to be read; from YAML and to it.

mod parse;
mod reader;
mod text;

use std::path::Path;

use super::ImportError;
use super::convert::Conversion;
use super::lines::Between;
use super::row::Target;
use govtwin_files::read_text;

pub use text::map_text;

/// More than any map holds; guards against being handed the data.
const LARGEST_FILE_BYTES: u64 = 1 << 20;

/// How a file is to be read as signals.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Map {
    /// What the recording is called; the file's name where empty.
    pub name: String,
    /// Where the data come from, for the bag's record.
    pub source: String,
    /// How a table is laid out.
    pub file: FileMap,
    /// How time is written.
    pub time: TimeMap,
    /// The signals.
    pub signals: Vec<SignalMap>,
    /// Rate of a common grid on which all signals are put by straight lines, Hz; none leaves samples as they are.
    pub resample_hz: Option<f64>,
}

/// How a table is laid out; what is not given is found out and said.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FileMap {
    /// Character between two cells.
    pub separator: Option<u8>,
    /// `.` or `,`.
    pub decimal: Option<char>,
    /// Character between groups of three digits.
    pub thousands: Option<char>,
    /// A name that the encoding standard of the web knows, such as `windows-1252`.
    pub encoding: Option<String>,
    /// Line of the column names, counted from 1; 0 where there is none.
    pub header_line: Option<u64>,
    /// Line of the units.
    pub unit_line: Option<u64>,
    /// First line of data.
    pub first_line: Option<u64>,
    /// Texts that stand for no value, beside the empty one, `NaN` and the like.
    pub missing: Vec<String>,
    /// Column of the signal's name, in a table with one value a line.
    pub tag_column: Option<String>,
    /// Column of the value there.
    pub value_column: Option<String>,
}

/// What becomes of rows that share one time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Repeated {
    /// They stay as they are; a reader of the bag keeps the last.
    #[default]
    Keep,
    /// They are spread evenly up to the next time: a clock that shows whole seconds beside faster samples.
    Spread,
}

/// How time is written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeMap {
    /// Its columns, joined by a blank: date and time may stand apart.
    pub columns: Vec<String>,
    /// How it is written; found out and said where not given.
    pub format: Option<String>,
    /// Zone of local times.
    pub zone: Option<String>,
    /// The moment from which relative times count.
    pub start: Option<String>,
    /// Rate of rows in a file without time, Hz.
    pub rate_hz: Option<f64>,
    /// What becomes of rows that share one time.
    pub repeated: Repeated,
    /// Of bags: take the time of recording although messages have a stamp.
    pub by_log: bool,
}

/// Where a signal is found.
#[derive(Clone, Debug, PartialEq)]
pub enum SignalPlace {
    /// A column of a table.
    Column(String),
    /// A field of a message, `/topic.field[index]`.
    Field(String),
    /// Nowhere: this value, in the signal's unit after the import.
    Constant(f64),
}

/// When an event column says that the ESV has tripped.
#[derive(Clone, Debug, PartialEq)]
pub enum TripRule {
    /// The cell is this text, or this number.
    Is(String),
    /// The number lies above.
    Above(f64),
    /// The number lies below.
    Below(f64),
}

/// The unit of a position that is taken as the file has it.
pub(super) const AS_RECORDED: &str = "as recorded";

/// One signal.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalMap {
    /// Which.
    pub target: Target,
    /// Where it is.
    pub from: SignalPlace,
    /// Its unit as the map writes it; empty where it gives none.
    pub unit: String,
    /// From what the file holds to the unit of the import.
    pub conversion: Conversion,
    /// Of the ESV: what means shutdown.
    pub shutdown: Vec<TripRule>,
    /// Of the ESV: a trip stays, even where the column falls back.
    pub latch: bool,
    /// Of the command: what it does between its points.
    pub between: Between,
    /// Of the command: how far it may have been from that, % of the stroke.
    pub deviation_percent: Option<f64>,
    /// The column of its own times, where it has other ones than the rest of the table.
    pub time: Option<String>,
    /// The column that says whether its values are good; `none` where no column does although one is called so.
    pub quality: Option<String>,
    /// What stands in that column beside a good value; found out where nothing is given.
    pub good: Vec<String>,
    /// Line of the map, counted from 1.
    pub line: Option<usize>,
}

impl SignalMap {
    /// A signal from a column, as it stands there.
    pub fn of_column(target: Target, column: &str) -> Self {
        Self {
            target,
            from: SignalPlace::Column(column.to_owned()),
            unit: String::new(),
            conversion: Conversion::NONE,
            shutdown: vec![],
            latch: false,
            between: Between::default(),
            deviation_percent: None,
            time: None,
            quality: None,
            good: vec![],
            line: None,
        }
    }

    /// The name of its column or field; none of a constant.
    pub fn place(&self) -> Option<&str> {
        match &self.from {
            SignalPlace::Column(name) | SignalPlace::Field(name) => Some(name),
            SignalPlace::Constant(_) => None,
        }
    }
}

impl Map {
    /// Reads a map.
    ///
    /// # Errors
    /// When the file cannot be read, or holds anything that is not right; all problems come at once.
    pub fn load(path: &Path) -> Result<Self, ImportError> {
        let text = read_text(path, LARGEST_FILE_BYTES).map_err(ImportError::io(path, "read the map"))?;
        Self::parse(&text, path)
    }

    /// The same with the positions of command, spool and servomotor in the units of the file: a stage that is judged alone is told in those.
    #[must_use]
    pub fn as_recorded(mut self) -> Self {
        let positions = [Target::OpeningCommand, Target::SpoolPosition, Target::ServomotorPosition];
        for signal in self.signals.iter_mut().filter(|signal| positions.contains(&signal.target)) {
            (signal.unit, signal.conversion) = (AS_RECORDED.to_owned(), Conversion::NONE);
        }
        self
    }

    /// Reads a map from its text, which stands or will stand at `path`.
    ///
    /// # Errors
    /// As [`Map::load`].
    pub fn parse(text: &str, path: &Path) -> Result<Self, ImportError> {
        parse::parse(text).map_err(|problems| ImportError::Map { path: path.to_owned(), problems })
    }
}
