//! Rows of a table in the order of time: made record by record, held back where they share a time.

use super::super::channel::ChannelValue;
use super::super::order::{MOST_SORTED, sort};
use super::super::records::TableRecords;
use super::{TableSource, quality_cell};
use crate::import::ImportError;
use crate::import::row::{ImportedRow, Target};

impl<R: TableRecords> TableSource<R> {
    /// The next record that has a time, as a row; what it holds of other times waits.
    pub(super) fn record(&mut self) -> Result<Option<ImportedRow>, ImportError> {
        loop {
            if let Some(row) = self.of_record.pop_front() {
                return Ok(Some(row));
            }
            if self.advance()?.is_none() {
                return Ok(None);
            }
            let place = self.records.place();
            let tag = match &self.long {
                Some(long) => match self.records.tag(long.tag) {
                    Some(tag) => Some((tag, long.value)),
                    None => continue,
                },
                None => None,
            };
            for (group, now_ns) in self.now_ns.iter().enumerate() {
                let Some(time_ns) = now_ns else { continue };
                let mut row = ImportedRow::at(*time_ns);
                for column in self.columns.iter_mut().filter(|column| column.group == group) {
                    let index = match &tag {
                        Some((tag, value)) if column.channel.map.place() == Some(tag) => *value,
                        Some(_) => continue,
                        None => column.index,
                    };
                    let value = self.records.value(index);
                    let good = column
                        .quality
                        .as_ref()
                        .is_none_or(|(at, quality)| quality.is_good(quality_cell(&self.records, *at)));
                    if good {
                        column.channel.take(value, place, &mut row);
                    } else {
                        column.not_good += u64::from(value != ChannelValue::Missing);
                    }
                }
                if tag.is_none() && self.now_ns.len() == 1 || !row.is_empty() {
                    self.of_record.push_back(row);
                }
            }
        }
    }

    /// The next row in the order of time.
    pub(super) fn in_order(&mut self) -> Result<Option<ImportedRow>, ImportError> {
        if self.rises {
            return Ok(self.record()?.map(|row| self.latch(row)));
        }
        if self.sorted.is_none() {
            let mut rows = vec![];
            while let Some(row) = self.record()? {
                rows.push(row);
                if rows.len() > MOST_SORTED {
                    let problem = format!(
                        "is not in the order of time, and has more than {MOST_SORTED} rows; sort it by time first, or split it"
                    );
                    return Err(ImportError::file(&self.head.path, problem));
                }
            }
            self.order = sort(&mut rows).map_err(|problem| ImportError::file(&self.head.path, problem))?;
            self.sorted = Some(rows.into_iter());
        }
        let row = self.sorted.as_mut().and_then(Iterator::next);
        Ok(row.map(|row| self.latch(row)))
    }

    /// A row with a trip that stays, where the map says so.
    pub(super) fn latch(&mut self, mut row: ImportedRow) -> ImportedRow {
        if self.columns.iter().any(|column| column.channel.latches) {
            self.latched |= row.value(Target::Esv) == Some(0.0);
            if self.latched && row.value(Target::Esv).is_some() {
                row.set(Target::Esv, 0.0);
            }
        }
        row
    }

    pub(super) fn nothing(&self) -> ImportError {
        match &self.bad_times.first {
            Some((line, _)) => ImportError::line(&self.head.path, *line, self.first_bad_time.clone()),
            None => ImportError::file(&self.head.path, "expected lines of data below the header, found none"),
        }
    }

    /// Spreads the rows that wait up to a time evenly.
    pub(super) fn release(&mut self, next_ns: Option<i64>) {
        let count = i64::try_from(self.waiting.len()).unwrap_or(1).max(1);
        let Some(first) = self.waiting.front() else { return };
        let step_ns = next_ns.map_or(self.last_step_ns, |next_ns| next_ns - first.time_ns);
        self.last_step_ns = step_ns;
        if count > 1 {
            self.spread += self.waiting.len() as u64;
        }
        for (k, mut row) in (0..).zip(self.waiting.drain(..)) {
            row.time_ns += step_ns / count * k + step_ns % count * k / count;
            self.ready.push_back(row);
        }
    }
}
