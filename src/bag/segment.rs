//! Segments: pieces of a file small enough to load at once, with the times of their messages.

use super::chunk::HEAD_LEN;

/// Bare records are taken together up to this size, bytes.
const TOGETHER_LEN: u64 = 1 << 20;

/// A chunk, a run of bare records, or a range of rows, and when its messages were recorded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Segment {
    /// Where it begins: bytes from the start of the file, or the first row.
    pub(super) at: u64,
    /// Where it ends: bytes from the start of the file, or the row after the last.
    pub(super) end: u64,
    /// Log time of the earliest message, ns.
    pub(super) first_ns: i64,
    messages: u64,
    bare: bool,
}

impl Segment {
    /// A segment of one record whose body has `len` bytes, without messages yet.
    pub(super) fn new(at: u64, len: u64) -> Self {
        let end = at.saturating_add(HEAD_LEN as u64).saturating_add(len);
        Self { at, end, first_ns: i64::MAX, messages: 0, bare: false }
    }

    /// The same for a record outside of any chunk.
    pub(super) fn bare(at: u64, len: u64) -> Self {
        Self { bare: true, ..Self::new(at, len) }
    }

    /// A range of rows, without messages yet.
    #[cfg(feature = "sqlite")]
    pub(super) fn rows(at: u64, end: u64) -> Self {
        Self { at, end, first_ns: i64::MAX, messages: 0, bare: false }
    }

    /// A message is in it.
    pub(super) fn count(&mut self, log_time_ns: i64) {
        self.first_ns = self.first_ns.min(log_time_ns);
        self.messages += 1;
    }

    /// How many messages are in it.
    pub(super) fn messages(&self) -> u64 {
        self.messages
    }

    /// Takes a bare record that follows at once; false where it does not, or this one is large already.
    pub(super) fn absorb(&mut self, next: &Self) -> bool {
        let fits = self.bare && next.bare && next.at == self.end && next.end - self.at <= TOGETHER_LEN;
        if fits {
            self.end = next.end;
            self.first_ns = self.first_ns.min(next.first_ns);
            self.messages += next.messages;
        }
        fits
    }
}
