//! Records of a table file, whatever the file's format.

use std::borrow::Cow;

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
    /// What a cell calls the signal of its line: a name, or a number as it is written.
    fn tag(&self, column: usize) -> Option<Cow<'_, str>> {
        let written = self.text_of(column);
        let tag: Cow<'_, str> = match (self.value(column), written) {
            (ChannelValue::Missing, _) | (ChannelValue::Time(_) | ChannelValue::Local(_), None) => return None,
            (_, Some(text)) | (ChannelValue::Text(text), None) => text.trim().into(),
            (ChannelValue::Number(number), None) => number.to_string().into(),
            (ChannelValue::Whole(number), None) => number.to_string().into(),
        };
        (!tag.is_empty()).then_some(tag)
    }
    /// The share of the file that is read.
    fn share(&self) -> f64;
    /// Records that had too few cells.
    fn ragged(&self) -> &Bad;
}
