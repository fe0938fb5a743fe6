//! Slips on the command line: an error of their own, since their exit code is one.

/// A slip in how the program was called, which no other file could mend: exit code 2.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct Usage(String);

/// An error for a slip on the command line.
pub fn usage(words: impl Into<String>) -> anyhow::Error {
    Usage(words.into()).into()
}

/// An error for a slip on the command line, unless `is_right`.
pub fn expect(is_right: bool, words: impl FnOnce() -> String) -> anyhow::Result<()> {
    if is_right { Ok(()) } else { Err(usage(words())) }
}
