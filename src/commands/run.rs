//! `govtwin run`.

use crate::cli::Outcome;

/// Arguments of `govtwin run`.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Not built yet.
pub fn run(_args: &Args) -> anyhow::Result<Outcome> {
    anyhow::bail!("not built yet")
}
