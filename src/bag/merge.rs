//! All messages of a bag in log-time order.

use std::path::Path;

use super::topic::RawMessage;
use super::{BagError, FileHealth, Warning, source};

/// The messages of a bag in log-time order; messages of one time stay in file order.
#[derive(Debug)]
pub struct Messages {
    messages: std::vec::IntoIter<RawMessage>,
    files: Vec<FileHealth>,
    warnings: Vec<Warning>,
}

impl Messages {
    /// How the files are.
    #[must_use]
    pub fn files(&self) -> &[FileHealth] {
        &self.files
    }

    /// What a user should read before the messages.
    #[must_use]
    pub fn warnings(&self) -> &[Warning] {
        &self.warnings
    }
}

impl Iterator for Messages {
    type Item = RawMessage;

    fn next(&mut self) -> Option<RawMessage> {
        self.messages.next()
    }
}

/// Gives all messages of a bag, of any type, in log-time order.
///
/// # Errors
/// Where there is no bag at the path. Damage is no error.
pub fn messages(path: &Path) -> Result<Messages, BagError> {
    let source = source::open(path)?;
    let mut messages = vec![];
    let (files, _) = source.scan(&mut |message| messages.push(message.to_owned()))?;
    messages.sort_by_key(|message| message.log_time_ns);
    Ok(Messages { messages: messages.into_iter(), files, warnings: source.warnings })
}
