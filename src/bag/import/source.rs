//! Sources of rows: tables and bags behind one face, told apart by their first bytes.

pub(super) mod channel;
mod fraction;
pub(super) mod head;
mod machine;
mod order;
mod pairs;
pub(super) mod quality;
pub(super) mod records;
pub(super) mod table;
pub(super) mod timing;

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use super::ImportError;
use super::row::ImportedRow;
use govtwin_files::check_regular;

/// What a file is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SourceKind {
    /// Text in columns.
    Table,
    /// Apache Parquet.
    Parquet,
    /// A bag, in a file or a folder.
    Bag,
}

/// Files that people have and that are none of these, by their first bytes, with the way out.
const OTHERS: [(&[u8], &str); 11] = [
    (b"MDF     ", "a measurement file MDF; export the signals as CSV first (in asammdf: `MDF(FILE).export(\"csv\")`)"),
    (
        b"UnFinMF ",
        "a measurement file MDF that was not finished; mend it with its program, then export the signals as CSV",
    ),
    (b"PK\x03\x04", "a workbook or zip archive; in Excel or LibreOffice save the sheet as CSV, and import that"),
    (
        b"\xd0\xcf\x11\xe0",
        "a workbook of the older kind; in Excel or LibreOffice save the sheet as CSV, and import that",
    ),
    (b"\x1f\x8b", "a file compressed with gzip; unpack it first: `gunzip -k FILE`"),
    (b"\x28\xb5\x2f\xfd", "a file compressed with zstd; unpack it first: `zstd -d FILE`"),
    (b"MATLAB", "a MAT-file; in MATLAB write the signals with `writetable(table(t, y, …), 'FILE.csv')`"),
    (b"\x89HDF", "an HDF5 file, perhaps a MAT-file of version 7.3; write the signals as CSV or Parquet first"),
    (b"TDSm", "a TDMS file; export it as CSV first"),
    (b"#ROSBAG V", "a ROS 1 bag; convert it first: `rosbags-convert --src FILE --dst OUT`"),
    (b"%PDF", "a PDF; ask for the table behind it"),
];

/// What is said of COMTRADE: crates that read it are drafts, or of some weeks, and none reads all of its forms.
const COMTRADE: &str = "a fault recorder's COMTRADE (.cfg, .dat, .cff); export its channels as CSV first, with the names in the first line and times \
                        from the .cfg: in Python `comtrade.load(CFG, DAT).to_dataframe().to_csv(FILE)`, or with the recorder's own program";

/// Whether a file begins as the configuration of a COMTRADE recording, or as one that holds all of its parts.
fn is_comtrade(head: &[u8]) -> bool {
    let text = String::from_utf8_lossy(&head[..head.len().min(1024)]);
    let mut lines = text.lines();
    let station = lines.next().unwrap_or_default().trim().to_lowercase();
    // The second line counts channels: all, analogue, digital.
    let counts: Vec<&str> = lines.next().unwrap_or_default().split(',').map(str::trim).collect();
    let count = |text: &str, kind: char| {
        let digits = text.strip_suffix([kind, kind.to_ascii_lowercase()]);
        digits.is_some_and(|digits| !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit()))
    };
    let counted = matches!(counts[..], [all, analogue, digital] if all.parse::<u32>().is_ok() && count(analogue, 'A') && count(digital, 'D'));
    station.starts_with("--- file type:") || (counted && (1..=2).contains(&station.matches(',').count()))
}

/// Text that is no table, with the way out.
fn other_text(head: &[u8]) -> Option<&'static str> {
    let text = String::from_utf8_lossy(head);
    let text = text.trim_start_matches('\u{feff}').trim_start();
    let line = text.lines().find(|line| !line.starts_with('#')).unwrap_or_default();
    if text.starts_with("{\"") || text.starts_with("[{") || text.starts_with("{\n") {
        return Some(
            "JSON; write its signals as a table of one column each first (in Python `pandas.read_json(FILE, lines=True).to_csv(FILE)`)",
        );
    }
    if text.starts_with('<') {
        return Some(
            "a page or XML, which some programs call .xls; open it in Excel or LibreOffice and save the sheet as CSV",
        );
    }
    // measurement,tag=value field=value time
    let parts: Vec<&str> = line.split(' ').collect();
    let is_line = matches!(parts[..], [series, fields, time] if !series.contains('"') && fields.split(',').all(|field| field.contains('='))
        && time.len() >= 10 && time.bytes().all(|byte| byte.is_ascii_digit()));
    is_line.then_some(
        "InfluxDB's line protocol; export a table in its place: `influx query --raw QUERY` writes annotated CSV, `influx -format csv` a plain one",
    )
}

/// Whether the configuration of a COMTRADE recording lies beside a file of data.
fn beside_comtrade(path: &Path) -> bool {
    let is_data = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("dat"));
    let is_one = |end: &str| {
        let mut head = vec![];
        let path = path.with_extension(end);
        let read = check_regular(&path).and_then(|_| File::open(&path)?.take(1024).read_to_end(&mut head));
        read.is_ok() && is_comtrade(&head)
    };
    is_data && (is_one("cfg") || is_one("CFG"))
}

/// Tells what a file is by its first bytes; its name plays no part.
///
/// # Errors
/// Where it cannot be read, is empty, or is something else, with the way out.
pub fn kind_of(path: &Path) -> Result<SourceKind, ImportError> {
    if path.is_dir() {
        return Ok(SourceKind::Bag);
    }
    check_regular(path).map_err(ImportError::io(path, "read"))?;
    let mut head = vec![];
    let file = File::open(path).map_err(ImportError::io(path, "open"))?;
    file.take(4096).read_to_end(&mut head).map_err(ImportError::io(path, "read"))?;
    if head.is_empty() {
        return Err(ImportError::file(path, "expected a table or a bag, found an empty file"));
    }
    if head.starts_with(mcap_magic()) || head.starts_with(b"SQLite format 3\0") {
        return Ok(SourceKind::Bag);
    }
    if head.starts_with(b"PAR1") {
        return Ok(SourceKind::Parquet);
    }
    if is_comtrade(&head) || beside_comtrade(path) {
        return Err(ImportError::file(path, format!("expected a table or a bag, found {COMTRADE}")));
    }
    if let Some(found) = other_text(&head) {
        return Err(ImportError::file(path, format!("expected a table or a bag, found {found}")));
    }
    if let Some((_, found)) = OTHERS.iter().find(|(magic, _)| head.starts_with(magic)) {
        return Err(ImportError::file(path, format!("expected a table or a bag, found {found}")));
    }
    let marked = head.starts_with(b"\xff\xfe") || head.starts_with(b"\xfe\xff");
    let zeros: usize = head.iter().map(|byte| usize::from(*byte == 0)).sum();
    // Of text in two bytes a letter nearly every second byte is 0.
    if zeros > 0 && !marked && !(zeros * 5 > head.len() * 2 && zeros * 5 < head.len() * 3) {
        let found = "a file with zero bytes, which no table of text has";
        return Err(ImportError::file(path, format!("expected a table or a bag, found {found}")));
    }
    Ok(SourceKind::Table)
}

/// The first bytes of an MCAP file.
fn mcap_magic() -> &'static [u8] {
    b"\x89MCAP0\r\n"
}

/// What a source has to say once it is read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct SourceNotes {
    /// How it was understood.
    pub(super) notes: Vec<String>,
    /// What a user should look into.
    pub(super) warnings: Vec<String>,
}

/// Rows in the order of a file.
pub(super) trait Source {
    /// The next row; none at the end.
    fn next(&mut self) -> Result<Option<ImportedRow>, ImportError>;
    /// The share of the file that is read.
    fn share(&self) -> f64;
    /// Numbers of the map's signals that it holds.
    fn holds(&self) -> Vec<usize>;
    /// What there is to say of it, at the end.
    fn said(&self) -> SourceNotes;
}
