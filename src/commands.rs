//! One file per command: its arguments, and what it does.

#[cfg(not(all(feature = "lab", feature = "residual", feature = "node")))]
mod absent;
pub mod accept;
pub mod bags;
#[cfg(feature = "lab")]
pub mod blind;
#[cfg(feature = "node")]
mod bus_map;
#[cfg(feature = "lab")]
pub mod calibrate;
pub mod check;
mod choice;
#[cfg(feature = "residual")]
pub mod compare;
pub mod completions;
pub mod diagnose;
pub mod doctor;
pub mod effects;
pub mod fit;
pub mod fleet;
pub mod generate;
pub mod import;
pub mod info;
#[cfg(feature = "residual")]
pub mod learn;
pub mod man;
pub mod model;
#[cfg(feature = "node")]
mod network;
pub mod output;
pub mod parent;
#[cfg(feature = "node")]
pub mod play;
pub mod provenance;
#[cfg(feature = "node")]
pub mod record;
pub mod recover;
pub mod replay;
pub mod report;
pub mod report_file;
#[cfg(feature = "node")]
pub mod run;
pub mod sheet;
#[cfg(feature = "residual")]
pub mod train;
mod usage;
pub mod watch;

/// Commands that are there with a feature alone: where it is off, they say so.
macro_rules! absent {
    ($($command:ident needs $feature:tt),+) => {$(
        #[cfg(not(feature = $feature))]
        pub mod $command {
            pub use super::absent::Args;

            /// Says which build has the command.
            pub fn run(_: &Args) -> anyhow::Result<super::Outcome> {
                super::absent::run(stringify!($command), $feature)
            }
        }
    )+};
}

absent!(
    blind needs "lab", calibrate needs "lab", compare needs "residual", train needs "residual", play needs "node",
    record needs "node", run needs "node"
);

use std::path::Path;

use govtwin_model::params::{self, ParamsError, Sheet};

pub use usage::{Usage, expect, number, unknown, usage};

/// How a command that did not fail ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Exit code 0.
    Ok,
    /// Finished, but the user should read the warnings: exit code 3.
    Warnings,
    /// Finished, and what was to be kept is not: exit code 4.
    Failed,
}

/// The data sheet of `--params`; without it, that of the shipped reference unit.
fn sheet_of(given: Option<&Path>) -> Result<Sheet, ParamsError> {
    given.map_or_else(|| Ok(params::reference_sheet()), params::load_sheet)
}
