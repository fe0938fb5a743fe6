//! One file per command: its arguments, and what it does.

pub mod bags;
pub mod check;
pub mod effects;
pub mod generate;
pub mod info;
pub mod output;
#[cfg(feature = "node")]
pub mod play;
#[cfg(feature = "node")]
pub mod record;
pub mod replay;
#[cfg(feature = "node")]
pub mod run;

/// How a command that did not fail ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Exit code 0.
    Ok,
    /// Finished, but the user should read the warnings: exit code 3.
    Warnings,
}
