//! Tables in Apache Parquet, read page by page; nested columns are passed over.

use std::fs::File;
use std::path::{Path, PathBuf};

use parquet::basic::{ConvertedType, LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::reader::RowIter;
use parquet::record::{Field, Row};

use super::ImportError;
use super::number::Numbers;
use super::source::channel::{Bad, ChannelValue};
use super::source::head::TableHead;
use super::source::records::TableRecords;

/// Milliseconds in a day.
const DAY_MS: i64 = 86_400_000;

/// How a column of times counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Times {
    /// Its unit, ns.
    unit_ns: i64,
    /// Whether it counts from 1970 in UTC, or shows a wall clock.
    utc: bool,
}

/// A Parquet file and its columns.
#[derive(Clone, Debug)]
pub(super) struct ParquetFile {
    pub(super) head: TableHead,
    times: Vec<Option<Times>>,
}

impl ParquetFile {
    /// Reads the schema.
    pub(super) fn open(path: &Path) -> Result<Self, ImportError> {
        let reader = reader(path)?;
        let meta = reader.metadata().file_metadata();
        let (mut names, mut times) = (vec![], vec![]);
        for field in meta.schema_descr().root_schema().get_fields() {
            names.push(field.name().to_owned());
            let info = field.get_basic_info();
            let repeated = info.has_repetition() && info.repetition() == Repetition::REPEATED;
            let of = if !field.is_primitive() || repeated {
                None
            } else {
                let legacy = match info.converted_type() {
                    ConvertedType::TIMESTAMP_MILLIS => Some(Times { unit_ns: 1_000_000, utc: true }),
                    ConvertedType::TIMESTAMP_MICROS => Some(Times { unit_ns: 1000, utc: true }),
                    // Spark and old pandas write local or UTC times alike in 96 bits; both mean UTC.
                    _ if field.get_physical_type() == Physical::INT96 => Some(Times { unit_ns: 1_000_000, utc: true }),
                    _ => None,
                };
                match info.logical_type_ref() {
                    Some(LogicalType::Timestamp(time)) => {
                        let unit_ns = match time.unit {
                            TimeUnit::MILLIS => 1_000_000,
                            TimeUnit::MICROS => 1000,
                            TimeUnit::NANOS => 1,
                        };
                        Some(Times { unit_ns, utc: time.is_adjusted_to_u_t_c })
                    }
                    _ => legacy,
                }
            };
            times.push(of);
        }
        let rows = meta.num_rows();
        let by = meta.created_by().unwrap_or("an unknown program");
        let notes = vec![format!("Parquet of {} columns and {rows} rows, written by {by}", names.len())];
        let units = vec![String::new(); names.len()];
        let units: Vec<String> = names
            .iter()
            .zip(units)
            .map(|(name, none)| super::dialect::bracketed(name).map_or(none, |(_, unit)| unit.to_owned()))
            .collect();
        let numbers = Numbers { decimal: '.', thousands: None, missing: vec![] };
        Ok(Self { head: TableHead { path: path.to_owned(), names, units, numbers, notes }, times })
    }

    /// The rows from the first on.
    pub(super) fn records(&self) -> Result<ParquetRecords, ImportError> {
        let reader = reader(&self.head.path)?;
        let total = u64::try_from(reader.metadata().file_metadata().num_rows()).unwrap_or(0).max(1);
        let rows = RowIter::from_file_into(Box::new(reader));
        let path = self.head.path.clone();
        Ok(ParquetRecords {
            path,
            rows,
            row: vec![],
            times: self.times.clone(),
            passed: 0,
            total,
            none: Bad::default(),
        })
    }
}

fn reader(path: &Path) -> Result<SerializedFileReader<File>, ImportError> {
    let file = File::open(path).map_err(ImportError::io(path, "open"))?;
    SerializedFileReader::new(file)
        .map_err(|error| ImportError::file(path, format!("cannot be read as Parquet: {error}")))
}

/// Rows of a Parquet file.
pub(super) struct ParquetRecords {
    path: PathBuf,
    rows: RowIter<'static>,
    row: Vec<Field>,
    times: Vec<Option<Times>>,
    passed: u64,
    total: u64,
    none: Bad,
}

impl TableRecords for ParquetRecords {
    fn advance(&mut self) -> Result<bool, ImportError> {
        let Some(row) = self.rows.next() else { return Ok(false) };
        self.passed += 1;
        let row: Row = row.map_err(|error| {
            ImportError::line(&self.path, self.passed, format!("this row cannot be read as Parquet: {error}"))
        })?;
        self.row = row.into_columns().into_iter().map(|(_, field)| field).collect();
        Ok(true)
    }

    fn place(&self) -> u64 {
        self.passed
    }

    fn value(&self, column: usize) -> ChannelValue<'_> {
        let Some(field) = self.row.get(column) else { return ChannelValue::Missing };
        let whole = match field {
            Field::Byte(value) => i64::from(*value),
            Field::Short(value) => i64::from(*value),
            Field::Int(value) => i64::from(*value),
            Field::Long(value) | Field::TimestampMillis(value) | Field::TimestampMicros(value) => *value,
            Field::UByte(value) => i64::from(*value),
            Field::UShort(value) => i64::from(*value),
            Field::UInt(value) => i64::from(*value),
            Field::ULong(value) => i64::try_from(*value).unwrap_or(i64::MAX),
            Field::Bool(value) => i64::from(*value),
            Field::Date(days) => {
                return ChannelValue::Local(i64::from(*days).saturating_mul(DAY_MS).saturating_mul(1_000_000));
            }
            Field::Float16(value) => return ChannelValue::Number(f64::from(f32::from(*value))),
            Field::Float(value) => return ChannelValue::Number(f64::from(*value)),
            Field::Double(value) => return ChannelValue::Number(*value),
            Field::Str(text) => return ChannelValue::Text(text),
            Field::Decimal(_) => return field.to_string().parse().map_or(ChannelValue::Missing, ChannelValue::Number),
            _ => return ChannelValue::Missing,
        };
        match self.times.get(column).copied().flatten() {
            Some(Times { unit_ns, utc: true }) => ChannelValue::Time(whole.saturating_mul(unit_ns)),
            Some(Times { unit_ns, utc: false }) => ChannelValue::Local(whole.saturating_mul(unit_ns)),
            None => ChannelValue::Whole(whole),
        }
    }

    fn share(&self) -> f64 {
        self.passed as f64 / self.total as f64
    }

    fn ragged(&self) -> &Bad {
        &self.none
    }
}
