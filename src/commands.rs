//! One file per command: its arguments, and what it does.

pub mod check;
pub mod info;
pub mod output;
#[cfg(feature = "node")]
pub mod play;
#[cfg(feature = "node")]
pub mod record;
pub mod replay;
#[cfg(feature = "node")]
pub mod run;
