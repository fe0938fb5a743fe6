//! `govtwin fleet run`: one entry of a plan, or all of them.

use anyhow::{Context, bail};
use govtwin::fleet::changes::word_of;
use govtwin::fleet::entry::Entry;
use govtwin::fleet::result::EntryResult as Kept;
use govtwin::store::Store;
use serde_json::json;

use super::entries::{EntryChoice, PlanFile, wanted};
use super::worker::{Done, work};
use crate::commands::Outcome;
use crate::commands::output::{print, warn};

/// Arguments of `govtwin fleet run`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// The plan: entries.jsonl, or the folder or store that holds it.
    #[arg(value_name = "UNITS")]
    plan: String,
    /// Which entry, counted from 0; without it HQ_ENTRY, SLURM_ARRAY_TASK_ID or JOB_COMPLETION_INDEX of the environment, and without those all
    /// entries, one after the other.
    #[arg(long, value_name = "I")]
    index: Option<usize>,
    /// Folder or object store of results.
    #[arg(long, value_name = "STORE")]
    out: String,
    /// Does entries again whose result is a failure.
    #[arg(long)]
    retry_failed: bool,
    /// Print a line of JSON for each entry instead of words.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
An entry whose result is in STORE already is skipped. The result's name is the SHA-256 of recordings, sheet, map, options and program version, and
it is written in one step where none stands: workers that are killed, that come twice, or that work on one entry at once lose and double nothing.
An entry that cannot be diagnosed has a result as well: its error, which `govtwin fleet gather` counts. Where the machine or the store is at
fault, such as a full disk, there is none; STORE/notes says why, and the entry can be tried again.

HQ_ENTRY may hold the entry itself, a line of entries.jsonl, as HyperQueue's --each-line hands it over; then the plan's list is not read.

Exit codes: 0 every entry that was asked for has its result, be it a failure, 1 at least one has none, 2 wrong usage.";

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let plan = PlanFile::open(&args.plan).context("UNITS")?;
    let store = Store::open(&args.out).context("--out")?;
    let entries = match wanted(args.index)? {
        EntryChoice::At(index) => vec![plan.nth(index)?],
        EntryChoice::This(entry) => vec![*entry],
        EntryChoice::All => plan.all()?,
    };
    let mut lacking = Vec::new();
    for entry in &entries {
        match work(entry, &plan.beside, &store, args.retry_failed) {
            Ok(done) => tell(args, entry, &done)?,
            Err(error) => lacking.push(format!("{}: no result: {error:#}", entry.name())),
        }
    }
    match &lacking[..] {
        [] => Ok(Outcome::Ok),
        [one] => bail!("{one}"),
        all => bail!("{} of {} entries have no result:\n  {}", all.len(), entries.len(), all.join("\n  ")),
    }
}

fn tell(args: &Args, entry: &Entry, done: &Done) -> anyhow::Result<()> {
    let (id, words) = match done {
        Done::There => ("there", "its result is there already".to_owned()),
        Done::Beaten => ("there", "another worker wrote its result meanwhile".to_owned()),
        Done::Written(kept) => ("written", told(kept)),
    };
    if let Done::Written(kept) = done
        && let Some(error) = &kept.error
    {
        warn(&format!("{}: cannot be diagnosed, which is its result: {error}", entry.name()));
    }
    if args.json {
        let line = json!({"unit": entry.unit, "period": entry.period, "key": entry.key, "result": id, "words": words});
        return print(&format!("{line}\n"));
    }
    print(&format!("{}: {words}\n", entry.name()))
}

fn told(kept: &Kept) -> String {
    kept.found.as_ref().map_or_else(|| "failed".to_owned(), word_of)
}
