//! A part of the second that stands in a column of its own.

use super::head::{TableHead, fraction_digits};
use super::records::{SAMPLED, TableRecords};
use super::timing::time_text;
use crate::import::ImportError;

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

    /// A time with its part of the second; without one where that is no such part, or the time has its own.
    pub(super) fn joined(self, time: &str, part: &str) -> Option<String> {
        let is_part = part.len() <= self.digits && part.bytes().all(|byte| byte.is_ascii_digit()) && !part.is_empty();
        let count = time.bytes().all(|byte| byte.is_ascii_digit());
        let second = time.rsplit(':').next().unwrap_or_default();
        let whole = count || (time.contains(':') && second.len() == 2 && second.parse::<u8>().is_ok());
        let sign = if count { self.decimal } else { '.' };
        (is_part && whole).then(|| format!("{time}{sign}{part:0>width$}", width = self.digits))
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
        let (mut count, mut fit, mut same, mut rises, mut varies) = (0, 0, 0, 0, false);
        let mut last: Option<(String, String)> = None;
        while count < SAMPLED && records.advance()? {
            let (time, cell) = (time_text(&records, columns, None), time_text(&records, &[part], None));
            let Some(joined) = fraction.joined(&time, &cell) else {
                count += 1;
                continue;
            };
            (count, fit) = (count + 1, fit + 1);
            if let Some((_, last_joined)) = last.filter(|(last_time, _)| *last_time == time) {
                same += 1;
                rises += usize::from(joined > last_joined);
                varies |= joined != last_joined;
            }
            last = Some((time, joined));
        }
        let ordered = same == 0 || rises * 10 >= same * 9 || (varies && rises * 10 <= same);
        if fit * 10 >= count * 9 && fit > 1 && ordered {
            return Ok(Some(part));
        }
    }
    Ok(None)
}
