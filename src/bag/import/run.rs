//! An import from its files to its rows: merged by time, constants first, the ESV on change and once a second.

use std::path::{Path, PathBuf};

use super::ImportError;
use super::csv_file::CsvFile;
use super::findings::{Findings, SignalFindings};
use super::lines::{Between, Course, Lines, SparsePoints};
use super::map::{Map, SignalMap, SignalPlace};
use super::recurring::Recurring;
use super::resample::Resampler;
use super::row::{ImportedRow, Target};
use super::source::table::TableSource;
use super::source::{Source, SourceKind, kind_of};
use super::topics::{self, BagRows};
use crate::align::ROW_LIMIT;

/// Rows between two calls of the progress.
const ROWS_PER_CALL: u64 = 4096;
/// Larger tables are none of a compressing historian, and are not read twice, bytes.
const LARGEST_LOOKED_AT: u64 = 1 << 23;

/// Files opened by a map.
pub struct Import {
    map: Map,
    sources: Vec<OpenSource>,
}

/// A source and its next row.
struct OpenSource {
    path: PathBuf,
    bytes: u64,
    source: Box<dyn Source>,
    next: Option<ImportedRow>,
}

/// What became of an import.
#[derive(Clone, Debug, Default)]
pub struct ImportOutcome {
    /// Rows handed on.
    pub rows: u64,
    /// What is known of each signal.
    pub signals: Vec<SignalFindings>,
    /// How the files were understood.
    pub notes: Vec<String>,
    /// What a user should look into.
    pub warnings: Vec<String>,
    /// How far the command may have been from what was taken, pu: between the few points of a historian; else 0.
    pub command_deviation_pu: f64,
}

impl Import {
    /// Opens files by a map: parts that follow each other in time, or that hold some of the signals each.
    ///
    /// # Errors
    /// Where a file cannot be read, or a signal of the map is in none of them.
    pub fn open(paths: &[PathBuf], map: &Map) -> Result<Self, ImportError> {
        let mut sources = vec![];
        for path in paths {
            let source = open(path, map)?;
            let bytes = std::fs::metadata(path).map_or(1, |meta| meta.len().max(1));
            sources.push(OpenSource { path: path.clone(), bytes, source, next: None });
        }
        let import = Self { map: map.clone(), sources };
        import.check()?;
        Ok(import)
    }

    /// Every signal of the map is somewhere, and every file holds something.
    fn check(&self) -> Result<(), ImportError> {
        for (number, signal) in self.map.signals.iter().enumerate() {
            let Some(place) = signal.place() else { continue };
            if self.sources.iter().any(|part| part.source.holds().contains(&number)) {
                continue;
            }
            let id = signal.target.id();
            let kinds: Vec<SourceKind> =
                self.sources.iter().map(|part| kind_of(&part.path)).collect::<Result<_, _>>()?;
            let is_field = matches!(signal.from, SignalPlace::Field(_));
            let fits = |kind: &SourceKind| (*kind == SourceKind::Bag) == is_field;
            let Some(at) = kinds.iter().position(fits) else {
                let (key, has, wants) = if is_field {
                    ("field", "a table has columns", "column: NAME")
                } else {
                    ("column", "a bag has topics", "field: /topic.field")
                };
                let path = self.sources.first().map_or(Path::new(""), |part| &part.path);
                return Err(ImportError::file(
                    path,
                    format!("{id}: the map names the {key} `{place}`, and {has}; expected `{wants}`"),
                ));
            };
            let path = &self.sources[at].path;
            let problem = match kinds[at] {
                SourceKind::Bag => topics::absent(path, place)?,
                _ => head_of(path, &self.map)?.absent(place),
            };
            return Err(ImportError::file(path, format!("{id}: {problem}")));
        }
        match self.sources.iter().find(|part| part.source.holds().is_empty()) {
            Some(part) => {
                Err(ImportError::file(&part.path, "holds none of the signals that the map names; leave it out"))
            }
            None => Ok(()),
        }
    }

    /// Whether a grid of so many rows is one to make.
    fn bounded(&self, rows: u64) -> Result<(), ImportError> {
        if rows <= ROW_LIMIT.unsigned_abs() {
            return Ok(());
        }
        let path = self.sources.first().map_or(Path::new(""), |part| &part.path);
        Err(ImportError::file(
            path,
            format!(
                "`resample: {{rate_hz: {}}}` makes over {ROW_LIMIT} rows of it; give a rate near that of the samples, or import a part",
                self.map.resample_hz.unwrap_or(f64::NAN)
            ),
        ))
    }

    /// Reads everything: hands on each row, and now and then the share that is done.
    ///
    /// # Errors
    /// Where a file cannot be read on, or `on_row` fails.
    pub fn run<E: From<ImportError>>(
        mut self,
        on_row: &mut dyn FnMut(&ImportedRow) -> Result<(), E>,
        on_progress: &mut dyn FnMut(f64),
    ) -> Result<ImportOutcome, E> {
        let mut findings = Findings::new(&self.map);
        let mut rows = 0_u64;
        let course = self.course()?;
        let compressed = matches!(course, Course::Line { .. });
        let mut lines = compressed.then(Lines::default);
        let mut resampler = self.map.resample_hz.map(|rate_hz| Resampler::new(rate_hz, compressed));
        let mut recurring = Recurring::new(&self.map);
        let mut held: Option<ImportedRow> = None;
        for part in &mut self.sources {
            part.next = part.source.next()?;
        }
        let mut hand_on = |row: &mut ImportedRow, rows: &mut u64| {
            recurring.complete(row);
            *rows += u64::from(!row.is_empty());
            if row.is_empty() { Ok(()) } else { on_row(row) }
        };
        let mut read = 0_u64;
        loop {
            let row = self.earliest()?;
            if let (Some(held), Some(row)) = (&mut held, &row)
                && held.merge(row)
            {
                continue;
            }
            let ends = row.is_none();
            let mut whole = std::mem::replace(&mut held, row);
            if let Some(lines) = &mut lines {
                match whole.take() {
                    Some(row) => lines.push(row),
                    None => lines.flush(None),
                }
                if ends {
                    lines.flush(None);
                }
            }
            while let Some(mut whole) = whole.take().or_else(|| lines.as_mut().and_then(Lines::pop)) {
                findings.take(&whole);
                match &mut resampler {
                    Some(resampler) => {
                        self.bounded(resampler.rows_until(whole.time_ns))?;
                        resampler.push(&whole);
                        while let Some(mut row) = resampler.pop() {
                            hand_on(&mut row, &mut rows)?;
                        }
                    }
                    None => hand_on(&mut whole, &mut rows)?,
                }
            }
            if ends {
                break;
            }
            read += 1;
            if read.is_multiple_of(ROWS_PER_CALL) {
                on_progress(self.share());
            }
        }
        let mut outcome = ImportOutcome::default();
        let stated_pu = self.command().and_then(|command| command.deviation_percent).map(|percent| percent / 100.0);
        let (note, question) = course.words(lines.as_ref().map_or(0, |lines| lines.added), stated_pu);
        outcome.notes.extend(note);
        outcome.warnings.extend(question);
        outcome.command_deviation_pu = stated_pu.unwrap_or(course.deviation_pu());
        if let Some(mut resampler) = resampler {
            resampler.end();
            while let Some(mut row) = resampler.pop() {
                hand_on(&mut row, &mut rows)?;
            }
            outcome.notes.push(resampler.said());
        }
        for part in &self.sources {
            let said = part.source.said();
            outcome.notes.extend(said.notes);
            outcome.warnings.extend(said.warnings);
        }
        let (signals, warnings) = findings.finish();
        outcome.rows = rows;
        outcome.signals = signals;
        outcome.warnings.extend(warnings);
        Ok(outcome)
    }

    fn command(&self) -> Option<&SignalMap> {
        self.map.signals.iter().find(|signal| signal.target == Target::OpeningCommand)
    }

    /// What the command of a table does between its points, by a first reading of files that are as small as compressed ones.
    fn course(&self) -> Result<Course, ImportError> {
        let column = self.command().filter(|command| matches!(command.from, SignalPlace::Column(_)));
        let between = column.map(|command| command.between);
        let bytes: u64 = self.sources.iter().map(|part| part.bytes).sum();
        match between {
            None | Some(Between::Hold) => return Ok(Course::Hold),
            Some(Between::Found) if bytes > LARGEST_LOOKED_AT => return Ok(Course::Hold),
            Some(Between::Found | Between::Line) => {}
        }
        let paths: Vec<PathBuf> = self.sources.iter().map(|part| part.path.clone()).collect();
        let mut again = Self::open(&paths, &self.map)?;
        for part in &mut again.sources {
            part.next = part.source.next()?;
        }
        let mut points = SparsePoints::default();
        while let Some(row) = again.earliest()? {
            if !points.take(&row) {
                break;
            }
        }
        Ok(match (between, points.course()) {
            (Some(Between::Line), _) => Course::Line { points: points.commands() },
            (_, course) => course,
        })
    }

    /// The earliest row of all sources, of one time that of the file named first.
    fn earliest(&mut self) -> Result<Option<ImportedRow>, ImportError> {
        let next = |part: &OpenSource| part.next.as_ref().map(|row| row.time_ns);
        let with_row = self.sources.iter().enumerate().filter_map(|(k, part)| Some((next(part)?, k)));
        let Some((_, k)) = with_row.min() else { return Ok(None) };
        let part = &mut self.sources[k];
        let row = part.next.take();
        part.next = part.source.next()?;
        Ok(row)
    }

    fn share(&self) -> f64 {
        let total: u64 = self.sources.iter().map(|part| part.bytes).sum();
        let done: f64 = self.sources.iter().map(|part| part.source.share() * part.bytes as f64).sum();
        done / total.max(1) as f64
    }
}

/// Opens one file.
fn open(path: &Path, map: &Map) -> Result<Box<dyn Source>, ImportError> {
    Ok(match kind_of(path)? {
        SourceKind::Bag => Box::new(BagRows::open(path, map)?),
        SourceKind::Table => {
            let file = CsvFile::open(path, &map.file)?;
            Box::new(TableSource::new(file.head.clone(), map, || file.records())?)
        }
        #[cfg(feature = "parquet")]
        SourceKind::Parquet => {
            let file = super::parquet_file::ParquetFile::open(path)?;
            Box::new(TableSource::new(file.head.clone(), map, || file.records())?)
        }
        #[cfg(not(feature = "parquet"))]
        SourceKind::Parquet => return Err(no_parquet(path)),
    })
}

/// The columns of a table.
fn head_of(path: &Path, map: &Map) -> Result<super::source::head::TableHead, ImportError> {
    match kind_of(path)? {
        #[cfg(feature = "parquet")]
        SourceKind::Parquet => Ok(super::parquet_file::ParquetFile::open(path)?.head),
        _ => Ok(CsvFile::open(path, &map.file)?.head),
    }
}

/// Says that this build reads no Parquet.
#[cfg(not(feature = "parquet"))]
pub(super) fn no_parquet(path: &Path) -> ImportError {
    ImportError::file(
        path,
        "a Parquet file, which this build cannot read; build with `--features parquet`, or write it as CSV once: \
         `python3 -c \"import pandas; pandas.read_parquet('IN').to_csv('OUT.csv', index=False)\"`",
    )
}
