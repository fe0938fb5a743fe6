//! Tables of text: CSV of any separator and encoding, read line by line in bounded memory.

use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read};
use std::path::Path;
use std::rc::Rc;

use csv::{ByteRecord, Reader, ReaderBuilder};
use encoding_rs::Encoding;
use encoding_rs_io::DecodeReaderBytesBuilder;

use super::ImportError;
use super::dialect::{Dialect, is_data, sniff, split};
use super::map::FileMap;
use super::number::{NumberCell, Numbers};
use super::rewrite::plain_table;
use super::source::channel::{Bad, ChannelValue};
use super::source::head::TableHead;
use super::source::records::TableRecords;

/// From so many bytes the layout is found out.
const SAMPLE_BYTES: u64 = 1 << 18;
/// A record may have so many bytes; more means a quote that is never closed, or no table at all.
const LONGEST_RECORD_BYTES: u64 = 1 << 23;

/// How a table of text is to be read.
#[derive(Clone, Debug)]
pub(super) struct CsvFile {
    pub(super) head: TableHead,
    pub(super) dialect: Dialect,
    encoding: Option<&'static Encoding>,
    bytes: u64,
}

impl CsvFile {
    /// Finds out how a table is laid out.
    pub(super) fn open(path: &Path, map: &FileMap) -> Result<Self, ImportError> {
        let mut notes = vec![];
        let bytes = std::fs::metadata(path).map_err(ImportError::io(path, "read"))?.len();
        let encoding = encoding(path, map, &mut notes)?;
        let mut sample = vec![];
        let reader = decoded(path, encoding, &Counts::default())?;
        reader.take(SAMPLE_BYTES).read_to_end(&mut sample).map_err(ImportError::io(path, "read"))?;
        let mut sample = String::from_utf8_lossy(&sample).into_owned();
        if sample.len() as u64 >= SAMPLE_BYTES
            && let Some(end) = sample.rfind('\n')
        {
            // The last line may be cut.
            sample.truncate(end);
        }
        let dialect = sniff(&sample, map).map_err(|problem| ImportError::file(path, problem))?;
        let separator = match dialect.separator {
            b'\t' => "tab".to_owned(),
            b' ' => "blanks".to_owned(),
            byte => format!("`{}`", char::from(byte)),
        };
        let header = match dialect.header_line {
            0 => "no line of names".to_owned(),
            line => format!("names in line {line}"),
        };
        notes.insert(
            0,
            format!(
                "{} columns separated by {separator}, decimal `{}`, {header}, data from line {} on",
                dialect.names.len(),
                dialect.numbers.decimal,
                dialect.first_line
            ),
        );
        let head = TableHead {
            path: path.to_owned(),
            names: dialect.names.clone(),
            units: dialect.units.clone(),
            numbers: dialect.numbers.clone(),
            notes,
        };
        Ok(Self { head, dialect, encoding, bytes })
    }

    /// The records from the first line of data on.
    pub(super) fn records(&self) -> Result<CsvRecords, ImportError> {
        let counts = Counts::default();
        let blanks = self.dialect.separator == b' ';
        let mut lines = BufReader::with_capacity(1 << 16, decoded(&self.head.path, self.encoding, &counts)?);
        for _ in 1..self.dialect.first_line {
            counts.left.set(LONGEST_RECORD_BYTES);
            lines.skip_until(b'\n').map_err(ImportError::io(&self.head.path, "read"))?;
        }
        let reader = ReaderBuilder::new()
            // Lines that blanks separate are taken apart here, so that runs of blanks count as one.
            .delimiter(if blanks { 0x1f } else { self.dialect.separator })
            .quoting(self.dialect.quoted)
            .flexible(true)
            .has_headers(false)
            .from_reader(lines);
        Ok(CsvRecords {
            path: self.head.path.clone(),
            reader,
            counts,
            record: ByteRecord::new(),
            blanks: blanks.then(Vec::new),
            numbers: self.dialect.numbers.clone(),
            in_cells: self.dialect.in_cells.clone(),
            separator: self.dialect.separator,
            width: self.dialect.names.len(),
            first_line: self.dialect.first_line.max(1),
            bytes: self.bytes.max(1),
            ragged: Bad::default(),
        })
    }
}

/// What is counted beside the reading: bytes of the file, and bytes that the present record may still have.
#[derive(Clone, Debug, Default)]
struct Counts {
    read: Rc<Cell<u64>>,
    left: Rc<Cell<u64>>,
}

/// A reader that counts what the file gives.
struct Counted {
    file: File,
    counts: Counts,
}

impl Read for Counted {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.counts.read.set(self.counts.read.get() + count as u64);
        Ok(count)
    }
}

/// A reader that ends where a record has more bytes than any has.
struct Bounded<R> {
    inner: R,
    counts: Counts,
}

impl<R: Read> Read for Bounded<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.inner.read(buffer)?;
        match self.counts.left.get().checked_sub(count as u64) {
            Some(left) => self.counts.left.set(left),
            None => {
                return Err(io::Error::new(
                    io::ErrorKind::InvalidData,
                    format!(
                        "expected lines of less than {LONGEST_RECORD_BYTES} bytes, found a longer one; is there a quotation mark (\") \
                         that is never closed?"
                    ),
                ));
            }
        }
        Ok(count)
    }
}

type Decoded = Bounded<Box<dyn Read>>;

/// The file as UTF-8; marks at its beginning count before what the map says.
fn decoded(path: &Path, encoding: Option<&'static Encoding>, counts: &Counts) -> Result<Decoded, ImportError> {
    let file = File::open(path).map_err(ImportError::io(path, "open"))?;
    let counted = Counted { file, counts: counts.clone() };
    let inner = DecodeReaderBytesBuilder::new().encoding(encoding).bom_override(true).strip_bom(true).build(counted);
    let inner = plain_table(inner).map_err(ImportError::io(path, "read"))?;
    counts.left.set(LONGEST_RECORD_BYTES);
    Ok(Bounded { inner, counts: counts.clone() })
}

/// The encoding that the map names, or that the first bytes show; none for UTF-8.
fn encoding(path: &Path, map: &FileMap, notes: &mut Vec<String>) -> Result<Option<&'static Encoding>, ImportError> {
    if let Some(label) = &map.encoding {
        let known = Encoding::for_label(label.as_bytes()).ok_or_else(|| {
            let problem =
                format!("file.encoding: expected a name such as utf-8, windows-1252 or utf-16le, found `{label}`");
            ImportError::file(path, problem)
        })?;
        return Ok(Some(known));
    }
    let mut head = vec![];
    let file = File::open(path).map_err(ImportError::io(path, "open"))?;
    file.take(SAMPLE_BYTES).read_to_end(&mut head).map_err(ImportError::io(path, "read"))?;
    if Encoding::for_bom(&head).is_some() {
        return Ok(None);
    }
    let zeros = |from: usize| head.iter().skip(from).step_by(2).filter(|byte| **byte == 0).count();
    let (even, odd) = (zeros(0), zeros(1));
    if even + odd > head.len() / 3 {
        let found = if odd > even { encoding_rs::UTF_16LE } else { encoding_rs::UTF_16BE };
        notes.push(format!("text in {}, as every second byte is 0", found.name()));
        return Ok(Some(found));
    }
    // A letter of several bytes may be cut at the end of the sample.
    let cut = |error: &std::str::Utf8Error| error.error_len().is_none();
    if std::str::from_utf8(&head).as_ref().err().is_some_and(|error| !cut(error)) {
        notes.push("text in windows-1252, as it is not UTF-8".to_owned());
        return Ok(Some(encoding_rs::WINDOWS_1252));
    }
    Ok(None)
}

/// Records of a table of text.
pub(super) struct CsvRecords {
    path: std::path::PathBuf,
    reader: Reader<BufReader<Decoded>>,
    counts: Counts,
    record: ByteRecord,
    /// Of lines that blanks separate, where their cells stand.
    blanks: Option<Vec<(usize, usize)>>,
    numbers: Numbers,
    /// Units behind the numbers of a column.
    in_cells: Vec<String>,
    separator: u8,
    width: usize,
    first_line: u64,
    bytes: u64,
    ragged: Bad,
}

impl CsvRecords {
    fn text(&self, column: usize) -> &str {
        let bytes = match &self.blanks {
            None => self.record.get(column),
            Some(cells) => cells.get(column).and_then(|(from, to)| self.record.get(0)?.get(*from..*to)),
        };
        // What is no text is no number either, and is told as such.
        let text = bytes.map_or("", |bytes| std::str::from_utf8(bytes).unwrap_or("\u{fffd}"));
        let unit = self.in_cells.get(column).filter(|unit| !unit.is_empty());
        unit.and_then(|unit| text.trim_end().strip_suffix(unit.as_str())).map_or(text, str::trim_end)
    }

    fn cells(&self) -> usize {
        self.blanks.as_ref().map_or(self.record.len(), Vec::len)
    }

    /// Lines of the table that stand inside of a cell of the present record: its quotation mark is closed late, or never.
    fn swallowed(&self) -> usize {
        if !self.record.as_slice().contains(&b'\n') {
            return 0;
        }
        let is_row = |line: &[u8]| {
            let cells = split(&String::from_utf8_lossy(line), self.separator);
            is_data(&cells, self.width, &self.numbers)
        };
        let lines = self.record.iter().flat_map(|cell| cell.split(|byte| *byte == b'\n').skip(1));
        lines.filter(|line| is_row(line)).count()
    }

    /// Takes a line apart at its blanks.
    fn split(&mut self) {
        let Some(cells) = &mut self.blanks else { return };
        cells.clear();
        let line = self.record.get(0).unwrap_or_default();
        let mut from = None;
        for (at, byte) in line.iter().enumerate() {
            match (byte.is_ascii_whitespace(), from) {
                (true, Some(start)) => {
                    cells.push((start, at));
                    from = None;
                }
                (false, None) => from = Some(at),
                _ => {}
            }
        }
        cells.extend(from.map(|start| (start, line.len())));
    }
}

impl TableRecords for CsvRecords {
    fn advance(&mut self) -> Result<bool, ImportError> {
        loop {
            self.counts.left.set(LONGEST_RECORD_BYTES);
            let more = self.reader.read_byte_record(&mut self.record).map_err(|error| {
                let problem = error.to_string();
                ImportError::line(
                    &self.path,
                    self.record.position().map_or(0, csv::Position::line) + self.first_line - 1,
                    problem,
                )
            })?;
            if !more {
                return Ok(false);
            }
            let swallowed = self.swallowed();
            if swallowed > 0 {
                let problem = format!(
                    "a quotation mark (\") opens in this line, and {swallowed} lines of the table follow before it is closed; remove it, or close it in \
                     its line"
                );
                return Err(ImportError::line(&self.path, self.place(), problem));
            }
            self.split();
            if self.cells() >= self.width {
                return Ok(true);
            }
            // A logger that lost its power leaves zeros where it had room.
            let is_empty = |byte: &u8| byte.is_ascii_whitespace() || *byte == 0;
            let blank = self.record.iter().all(|cell| cell.iter().all(is_empty));
            if !blank {
                let place = self.place();
                let text =
                    String::from_utf8_lossy(self.record.get(0).unwrap_or_default()).replace(char::is_control, " ");
                self.ragged.note(place, &text);
            }
        }
    }

    fn place(&self) -> u64 {
        self.record.position().map_or(0, csv::Position::line) + self.first_line - 1
    }

    fn value(&self, column: usize) -> ChannelValue<'_> {
        let text = self.text(column);
        match self.numbers.cell(text) {
            NumberCell::Number(number) => ChannelValue::Number(number),
            NumberCell::Missing => ChannelValue::Missing,
            NumberCell::Other => ChannelValue::Text(text),
        }
    }

    fn text_of(&self, column: usize) -> Option<&str> {
        Some(self.text(column))
    }

    fn share(&self) -> f64 {
        self.counts.read.get() as f64 / self.bytes as f64
    }

    fn ragged(&self) -> &Bad {
        &self.ragged
    }
}
