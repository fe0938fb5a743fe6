//! What can be wrong with a file to import or its map, told so that its reader can mend it.

use std::path::{Path, PathBuf};

use crate::BagError;
use govtwin_model::params::FileProblem;
use govtwin_model::params::error::list;

/// Why something cannot be imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The operating system refused.
    #[error("{path}: cannot {action}: {reason}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried, as a verb.
        action: &'static str,
        /// The system's own words.
        reason: std::io::Error,
    },
    /// The map is wrong; all its problems at once.
    #[error("{}", list("map", path, problems))]
    Map {
        /// The map.
        path: PathBuf,
        /// What is wrong, in the order of the file.
        problems: Vec<FileProblem>,
    },
    /// The file is not what the map, or anybody, expects.
    #[error("{path}: {problem}")]
    File {
        /// The file.
        path: PathBuf,
        /// What was expected, what was found, and the way out.
        problem: String,
    },
    /// One line of the file cannot be used, and with it the file.
    #[error("{path}:{line}: {problem}")]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: u64,
        /// What was expected, what was found, and the way out.
        problem: String,
    },
    /// The bag cannot be read.
    #[error(transparent)]
    Bag(#[from] BagError),
}

impl ImportError {
    /// For `map_err` on what the operating system does.
    pub(super) fn io(path: &Path, action: &'static str) -> impl FnOnce(std::io::Error) -> Self {
        move |reason| Self::Io { path: path.to_owned(), action, reason }
    }

    /// Something wrong with a whole file.
    pub(super) fn file(path: &Path, problem: impl Into<String>) -> Self {
        Self::File { path: path.to_owned(), problem: problem.into() }
    }

    /// Something wrong in one line of a file.
    pub(super) fn line(path: &Path, line: u64, problem: impl Into<String>) -> Self {
        Self::Line { path: path.to_owned(), line, problem: problem.into() }
    }
}
