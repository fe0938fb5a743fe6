//! A part of the second that stands in a column of its own.

use std::cmp::Ordering;

use super::head::{TableHead, fraction_digits};
use super::records::{SAMPLED, TableRecords};
use super::timing::time_text;
use crate::import::ImportError;
use crate::import::words::Words;

/// What the last column of a time is: the part of the second that the others lack.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fraction {
    /// Digits behind the second: 3 of milliseconds, 9 of nanoseconds.
    digits: usize,
    /// The decimal sign of numbers.
    decimal: char,
}

impl Fraction {
    /// Of some columns, by the name of the last.
    pub(super) fn of(head: &TableHead, columns: &[usize]) -> Option<Self> {
        let [.., last] = columns else { return None };
        let digits = fraction_digits(&head.names[*last]).filter(|_| columns.len() > 1)?;
        Some(Self { digits, decimal: head.numbers.decimal })
    }

    /// A time with its part of the second, before a half of the day or a zone; none where that is no such part, or the time has its own.
    pub(super) fn joined(self, time: &str, part: &str) -> Option<String> {
        let is_part = part.len() <= self.digits && part.bytes().all(|byte| byte.is_ascii_digit()) && !part.is_empty();
        let is_count = time.bytes().all(|byte| byte.is_ascii_digit());
        let colon = time.find(':').unwrap_or(0);
        let offset = time[colon..].find(['+', '-']).map_or(time.len(), |at| colon + at);
        let behind_colon =
            |colon: usize| (colon + 3 <= offset && time.is_char_boundary(colon + 3)).then_some(colon + 3);
        let end = if is_count { time.len() } else { time[..offset].rfind(':').and_then(behind_colon)? };
        let (second, rest) = time.split_at(end);
        let whole = is_count
            || second[end - 2..].bytes().all(|byte| byte.is_ascii_digit())
                && !rest.starts_with(|letter: char| letter.is_ascii_digit() || ".,:".contains(letter));
        let sign = if is_count { self.decimal } else { '.' };
        (is_part && whole).then(|| format!("{second}{sign}{part:0>width$}{rest}", width = self.digits))
    }
}

/// Names that nothing else has: that of Rockwell's logs.
const SURE: Words = Words("millitm");

/// How parts of the second follow each other, as far as they differ.
#[derive(Clone, Copy, Debug, Default)]
struct PartOrder {
    /// Rows of one second in a row, and those of them with a greater and with a lesser part than the one before.
    same: usize,
    rises: usize,
    falls: usize,
    /// Rows of another second than the one before, and those of them with a greater and with a lesser part.
    turns: usize,
    climbs: usize,
    drops: usize,
}

impl PartOrder {
    fn take(&mut self, same: bool, order: Ordering) {
        let (count, greater, lesser) = if same {
            (&mut self.same, &mut self.rises, &mut self.falls)
        } else {
            (&mut self.turns, &mut self.climbs, &mut self.drops)
        };
        *count += 1;
        *greater += usize::from(order.is_gt());
        *lesser += usize::from(order.is_lt());
    }

    /// Whether they rise while the second stays, or fall where the newest row stands first; lines of several signals share a time, and then the part
    /// must begin anew with the second.
    fn is_of_seconds(&self) -> bool {
        let changes = self.rises + self.falls;
        let goes = |along: usize, anew: usize| {
            along * 10 >= changes * 9 && (changes == self.same || 2 * anew >= self.turns && self.turns > 0)
        };
        self.same == 0 || changes > 0 && (goes(self.rises, self.drops) || goes(self.falls, self.climbs))
    }
}

/// The column beside whole seconds that holds the rest of them: by its name, and since it rises or falls where the seconds stay.
pub(super) fn fraction_beside<R: TableRecords>(
    head: &TableHead,
    columns: &[usize],
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<Option<usize>, ImportError> {
    let candidates = (0..head.names.len()).filter(|column| !columns.contains(column));
    for part in candidates.filter(|column| head.is_fraction_of(*column, columns)) {
        let with_part = [columns, &[part]].concat();
        let Some(fraction) = Fraction::of(head, &with_part) else { continue };
        let mut records = open()?;
        let (mut count, mut fit, mut order) = (0, 0, PartOrder::default());
        let mut last: Option<(String, String)> = None;
        while count < SAMPLED && records.advance()? {
            let (time, cell) = (time_text(&records, columns, None), time_text(&records, &[part], None));
            count += 1;
            if fraction.joined(&time, &cell).is_some() {
                fit += 1;
                let part = format!("{cell:0>width$}", width = fraction.digits);
                if let Some((last_time, last_part)) = &last {
                    order.take(*last_time == time, part.cmp(last_part));
                }
                last = Some((time, part));
            }
        }
        let sure = SURE.has(&head.names[part].trim().to_lowercase());
        if fit * 10 >= count * 9 && fit > 1 && (sure || order.is_of_seconds()) {
            return Ok(Some(part));
        }
    }
    Ok(None)
}
