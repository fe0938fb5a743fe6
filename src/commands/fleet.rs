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

/// Arguments of `govtwin fleet`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// List the work: an entry for each unit and period, and every object that is in none with its reason.
    Plan(plan::Args),
    /// Do one entry of a plan, or all of them, and keep the result in a store.
    Run(run::Args),
    /// Gather the results of a store into one page and one table.
    Gather(gather::Args),
}

const HELP: &str = "\
A fleet takes three steps, and any engine that runs a command many times does the middle one:
  govtwin fleet plan recordings --units units.csv --out store
  seq 0 $(($(wc -l < store/entries.jsonl) - 1)) | xargs -P 8 -I I govtwin fleet run store --index I --out store
  govtwin fleet gather store

What the store holds is all that counts: a result is written in one step where none stands, so that entries may be done twice, by two workers
at once, or again after a kill, and nothing is lost or doubled. A folder is a store; with the cargo feature `cloud` so are s3://, gs:// and az://.
docs/fleet.md holds recipes for xargs, GNU parallel, HyperQueue, Slurm and Kubernetes.

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 finished with warnings.";

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    match &args.command {
        Command::Plan(args) => plan::run(args),
        Command::Run(args) => run::run(args),
        Command::Gather(args) => gather::run(args),
    }
}
