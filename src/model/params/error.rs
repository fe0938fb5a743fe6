//! What can be wrong with a parameter file, with what its reader needs to correct it.

use std::fmt;
use std::path::PathBuf;

/// One thing wrong in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileProblem {
    /// Line, counted from 1, where it is known.
    pub line: Option<usize>,
    /// Dotted key, such as `oil.density_kg_m3`; empty where it concerns the whole file.
    pub key: String,
    /// What was found, what is expected, and the suggested fix.
    pub message: String,
}

impl fmt::Display for FileProblem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.key.is_empty() {
            write!(f, "{}: ", self.key)?;
        }
        f.write_str(&self.message)
    }
}

/// A parameter file that cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ParamsError {
    /// The file cannot be read.
    #[error("cannot read the {what} file {}: {reason}", path.display())]
    Read {
        /// Which kind of file it should be: parameter, limits, plate.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// Why.
        reason: std::io::Error,
    },
    /// The file cannot be written.
    #[error("cannot write the parameter file {}: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        reason: std::io::Error,
    },
    /// The content is wrong; all problems of the file at once.
    #[error("{}", list(&format!("{what} file"), path, problems))]
    Invalid {
        /// Which kind of file it should be: parameter, limits, plate.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// What is wrong, in the order of the file.
        problems: Vec<FileProblem>,
    },
}

impl ParamsError {
    /// What is wrong in the file's content; empty where it could not be read or written at all.
    pub fn problems(&self) -> &[FileProblem] {
        match self {
            Self::Invalid { problems, .. } => problems,
            Self::Read { .. } | Self::Write { .. } => &[],
        }
    }
}

/// One line a problem, each beginning with `file:line:` as compilers do, so that editors can jump to it.
pub fn list(what: &str, path: &std::path::Path, problems: &[FileProblem]) -> String {
    let noun = if problems.len() == 1 { "problem" } else { "problems" };
    let path = path.display();
    let lines = problems.iter().take(MOST_LISTED).map(|problem| match problem.line {
        Some(line) => format!("\n  {path}:{line}: {problem}"),
        None => format!("\n  {path}: {problem}"),
    });
    let more = problems.len().saturating_sub(MOST_LISTED);
    let more = if more > 0 { format!("\n  and {more} more") } else { String::new() };
    format!("{} {noun} in the {what} {path}{}{more}", problems.len(), lines.collect::<String>())
}

/// More problems of one file are counted only.
const MOST_LISTED: usize = 100;
