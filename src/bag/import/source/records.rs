//! Records of a table file, whatever the file's format.

use super::channel::{Bad, ChannelValue};
use crate::import::ImportError;

/// Records from which the format of times is found out.
pub(in crate::import) const SAMPLED: usize = 300;

/// Records of a table file.
pub(in crate::import) trait TableRecords {
    /// Goes on to the next record; false at the end.
    fn advance(&mut self) -> Result<bool, ImportError>;
    /// The record's line or number, counted from 1.
    fn place(&self) -> u64;
    /// What stands in a column.
    fn value(&self, column: usize) -> ChannelValue<'_>;
    /// The text of a cell, where the file holds text: times keep every digit of it.
    fn text_of(&self, _column: usize) -> Option<&str> {
        None
    }
    /// The share of the file that is read.
    fn share(&self) -> f64;
    /// Records that had too few cells.
    fn ragged(&self) -> &Bad;
}
