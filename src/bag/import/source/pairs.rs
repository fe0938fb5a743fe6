//! Columns of time beside that of the table: pairs of time and value side by side.

use std::ops::Range;

use super::head::TableHead;
use super::records::{SAMPLED, TableRecords};
use super::timing::{TimeGroup, time_text};
use crate::import::ImportError;
use crate::import::dialect::bracketed;

/// A column of times in pairs of time and value side by side, and the columns for which it counts.
pub(super) struct Pair {
    pub(super) columns: Vec<usize>,
    pub(super) of: Range<usize>,
}

/// Further columns of times, of the same name as the first or beside other signals, whose times are others.
pub(super) fn pairs<R: TableRecords>(
    head: &TableHead,
    main: &TimeGroup,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<Vec<Pair>, ImportError> {
    let bare = |column: usize| {
        let name = head.names[column].trim();
        bracketed(name).map_or(name, |(bare, _)| bare).trim().to_lowercase()
    };
    let Some(first) = main.columns.first().copied() else { return Ok(vec![]) };
    let width = main.columns.len();
    let named = |column: &usize| bare(*column) == bare(first);
    let mut begins: Vec<usize> = (0..head.names.len()).filter(named).collect();
    if begins.len() == 1 && width == 1 {
        begins.extend(times_beside(head, main, open)?);
        begins.sort_unstable();
    }
    let is_behind = are_behind(&begins, width, head.names.len());
    let mut pairs = vec![];
    for (place, begin) in begins.iter().enumerate().filter(|(_, begin)| **begin != first) {
        let columns: Vec<usize> = (*begin..(begin + width).min(head.names.len())).collect();
        let of = if is_behind {
            place.checked_sub(1).map_or(0, |before| begins[before] + width)..*begin
        } else {
            begin + width..begins.get(place + 1).copied().unwrap_or(head.names.len())
        };
        let alike =
            width == 1 || columns.iter().zip(&main.columns).all(|(column, of_main)| bare(*column) == bare(*of_main));
        if alike && columns.len() == width && !of.is_empty() {
            pairs.push(Pair { columns, of });
        }
    }
    if pairs.is_empty() {
        return Ok(pairs);
    }
    // The same times again are an export that repeats them.
    let mut differ = vec![false; pairs.len()];
    let mut records = open()?;
    let mut count = 0;
    while count < SAMPLED && records.advance()? {
        count += 1;
        let of_main = time_text(&records, &main.columns, None);
        for (pair, differ) in pairs.iter().zip(&mut differ) {
            *differ |= time_text(&records, &pair.columns, None) != of_main;
        }
    }
    let mut differ = differ.into_iter();
    pairs.retain(|_| differ.next() == Some(true));
    Ok(pairs)
}

/// Whether times stand behind their values: the last column is one, and the first none.
fn are_behind(begins: &[usize], width: usize, columns: usize) -> bool {
    begins.first().is_some_and(|first| *first > 0) && begins.last().is_some_and(|last| last + width == columns)
}

/// Columns of another name than that of the time which hold times as well, each beside a signal of its own: they are written as the times are, go on
/// from record to record, and pass as much time.
fn times_beside<R: TableRecords>(
    head: &TableHead,
    main: &TimeGroup,
    open: &impl Fn() -> Result<R, ImportError>,
) -> Result<Vec<usize>, ImportError> {
    let [first] = main.columns[..] else { return Ok(vec![]) };
    // One that follows another has no signal of its own.
    let mut columns: Vec<usize> = (0..head.names.len())
        .filter(|column| *column == first || head.may_be_time(*column, first) || head.names[*column].starts_with('#'))
        .collect();
    let all = columns.clone();
    let is_behind = are_behind(&all, 1, head.names.len());
    columns.retain(|column| {
        let signal = if is_behind { column.checked_sub(1) } else { Some(column + 1) };
        signal.is_some_and(|signal| !all.contains(&signal) && signal < head.names.len())
    });
    if columns.len() < 2 || !columns.contains(&first) {
        return Ok(vec![]);
    }
    let mut times: Vec<Vec<i64>> = vec![vec![]; columns.len()];
    let mut clocks = vec![main.clock.clone(); columns.len()];
    let mut filled = vec![0_usize; columns.len()];
    let mut records = open()?;
    let mut count = 0;
    while count < SAMPLED && records.advance()? {
        count += 1;
        for (place, column) in columns.iter().enumerate() {
            let text = time_text(&records, &[*column], None);
            if !text.trim().is_empty() {
                filled[place] += 1;
                times[place].extend(clocks[place].read(&text).ok());
            }
        }
    }
    let range = |times: &[i64]| Some((*times.iter().min()?, *times.iter().max()?));
    let Some(of_main) = columns.iter().position(|column| *column == first).and_then(|place| range(&times[place]))
    else {
        return Ok(vec![]);
    };
    let main_ns = of_main.1.saturating_sub(of_main.0);
    let is_one = |place: usize| {
        let own = &times[place];
        let Some((least, most)) = range(own) else { return false };
        let steps = own.windows(2).map(|pair| pair[1].cmp(&pair[0]));
        let (mut rises, mut falls) = (0, 0);
        for step in steps {
            rises += usize::from(step.is_gt());
            falls += usize::from(step.is_lt());
        }
        let goes_on = rises.max(falls) * 2 >= own.len() && rises.min(falls) * 20 <= own.len();
        let own_ns = most.saturating_sub(least);
        let as_long = own_ns / 20 <= main_ns && main_ns / 20 <= own_ns;
        let near = least.abs_diff(of_main.0) < NEAR_NS.saturating_add(main_ns.unsigned_abs());
        own.len() * 10 >= filled[place] * 9 && own.len() > 2 && goes_on && as_long && near
    };
    Ok(columns
        .iter()
        .enumerate()
        .filter(|(place, column)| **column != first && is_one(*place))
        .map(|(_, column)| *column)
        .collect())
}

/// Times of signals side by side begin within so much of each other, ns.
const NEAR_NS: u64 = 600_000_000_000;
