//! `govtwin fleet`: many units over many periods, on whatever engine runs commands, with the truth in a store.

mod entries;
mod gather;
mod look;
mod period;
mod plan;
mod run;
mod unit_sheets;
mod worker;

use clap::Subcommand;

use crate::commands::Outcome;
use crate::commands::output::Progress;

/// Arguments of `govtwin fleet`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Plan the work: an entry for each unit and period, and a list of what is in no entry.
    Plan(plan::Args),
    /// Diagnose one entry of a plan, or all of them, and store the results.
    Run(run::Args),
    /// Gather the results of a store into one page and one table.
    Gather(gather::Args),
}

const HELP: &str = "\
A fleet is diagnosed in three steps; any engine that runs a command many times does the second:
  govtwin fleet plan recordings --units units.csv --out store
  seq 0 $(($(wc -l < store/entries.jsonl) - 1)) |
      xargs -P 8 -I I govtwin fleet run store --index I --out store
  govtwin fleet gather store

A store is a folder or, with the cargo feature `cloud`, an address s3://, gs:// or az://. A result
is written in one step, and only if none exists. An entry may therefore run twice, on two workers
at once, or again after a kill: exactly one result is kept. docs/fleet.md has recipes for xargs,
GNU parallel, HyperQueue, Slurm and Kubernetes.

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 finished with warnings.";

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    match &args.command {
        Command::Plan(args) => plan::run(args),
        Command::Run(args) => run::run(args),
        Command::Gather(args) => gather::run(args),
    }
}

/// Looks at all items at once, and gives what counts and what does not, each in the order of the items.
fn look_at_each<T: Sync, Counts: Send, Not: Send>(
    items: &[T],
    noun: &'static str,
    look: impl Fn(&T) -> anyhow::Result<Result<Counts, Not>> + Sync,
) -> anyhow::Result<(Vec<Counts>, Vec<Not>)> {
    let (mut counts, mut not) = (Vec::new(), Vec::new());
    for one in Progress::each(items, noun, look) {
        match one? {
            Ok(one) => counts.push(one),
            Err(one) => not.push(one),
        }
    }
    Ok((counts, not))
}
