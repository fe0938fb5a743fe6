//! The table of a fleet in Apache Parquet: the lines of [`super::table`], column by column, the same bytes for the same lines.

use std::sync::Arc;

use parquet::basic::{Compression, ZstdLevel};
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

use super::table::{COLUMNS, Cell, Line};

/// Lines in a group of rows: a group is held in memory while it is written.
const GROUP_LINES: usize = 100_000;

/// What a column holds, by its name.
fn kind(column: &str) -> &'static str {
    match column {
        "probability" | "value" | "low_90" | "high_90" | "information_share" | "cumulative_sum" => "double",
        "determined" | "changed" => "boolean",
        "recordings" => "int64",
        _ => "binary",
    }
}

/// The table as a Parquet file.
///
/// # Errors
/// The library's message; to memory it refuses nothing that this schema holds.
pub fn bytes(lines: &[Line]) -> Result<Vec<u8>, ParquetError> {
    let field = |name: &&str| match kind(name) {
        "binary" => format!("optional binary {name} (UTF8);"),
        kind => format!("optional {kind} {name};"),
    };
    let fields: String = COLUMNS.iter().map(field).collect();
    let schema = Arc::new(parse_message_type(&format!("message fleet {{ {fields} }}"))?);
    let properties = WriterProperties::builder().set_compression(Compression::ZSTD(ZstdLevel::default())).build();
    let mut writer = SerializedFileWriter::new(Vec::new(), schema, Arc::new(properties))?;
    for group in lines.chunks(GROUP_LINES) {
        let mut part = writer.next_row_group()?;
        for (place, name) in COLUMNS.iter().enumerate() {
            let Some(mut open) = part.next_column()? else { continue };
            let cells = || group.iter().map(|line| &line[place]);
            let there: Vec<i16> = cells().map(|cell| i16::from(*cell != Cell::Empty)).collect();
            match kind(name) {
                "double" => {
                    let values: Vec<f64> =
                        cells().filter_map(|cell| if let Cell::Number(x) = cell { Some(*x) } else { None }).collect();
                    open.typed::<DoubleType>().write_batch(&values, Some(&there), None)?;
                }
                "boolean" => {
                    let values: Vec<bool> =
                        cells().filter_map(|cell| if let Cell::Flag(x) = cell { Some(*x) } else { None }).collect();
                    open.typed::<BoolType>().write_batch(&values, Some(&there), None)?;
                }
                "int64" => {
                    let count = |cell: &Cell| if let Cell::Count(x) = cell { i64::try_from(*x).ok() } else { None };
                    let values: Vec<i64> = cells().filter_map(count).collect();
                    open.typed::<Int64Type>().write_batch(&values, Some(&there), None)?;
                }
                _ => {
                    let text =
                        |cell: &Cell| if let Cell::Text(x) = cell { Some(ByteArray::from(x.as_str())) } else { None };
                    let values: Vec<ByteArray> = cells().filter_map(text).collect();
                    open.typed::<ByteArrayType>().write_batch(&values, Some(&there), None)?;
                }
            }
            open.close()?;
        }
        part.close()?;
    }
    writer.into_inner()
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::{FileReader as _, SerializedFileReader};
    use parquet::record::Field;

    use super::*;

    #[test]
    fn every_cell_reads_back() {
        let mut line = Line::default();
        line[0] = Cell::Text("unit ü".into());
        line[9] = Cell::Number(-1.5e-7);
        line[13] = Cell::Flag(true);
        line[16] = Cell::Count(4);
        let lines = vec![line.clone(), Line::default()];
        let written = bytes(&lines).unwrap();
        assert_eq!(written, bytes(&lines).unwrap(), "the same bytes for the same lines");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("t.parquet");
        std::fs::write(&path, &written).unwrap();
        let reader = SerializedFileReader::new(std::fs::File::open(&path).unwrap()).unwrap();
        let rows: Vec<_> = reader.get_row_iter(None).unwrap().map(Result::unwrap).collect();
        let cell = |row: usize, column: usize| rows[row].get_column_iter().nth(column).unwrap().1.clone();
        assert_eq!(cell(0, 0), Field::Str("unit ü".into()));
        assert_eq!(cell(0, 9), Field::Double(-1.5e-7));
        assert_eq!(cell(0, 13), Field::Bool(true));
        assert_eq!(cell(0, 16), Field::Long(4));
        assert!((0..COLUMNS.len()).all(|column| cell(1, column) == Field::Null));
    }
}
