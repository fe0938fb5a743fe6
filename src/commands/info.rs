//! `govtwin info`.

use crate::cli::Outcome;

/// Arguments of `govtwin info`.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Not built yet.
pub fn run(_args: &Args) -> anyhow::Result<Outcome> {
    anyhow::bail!("not built yet")
}
