//! `govtwin fleet run`: one entry of a plan, or all of them.

use anyhow::{Context, bail};
use govtwin_diagnosis::fleet::changes::word_of;
use govtwin_diagnosis::fleet::entry::Entry;
use govtwin_files::store::Store;
use serde_json::json;

use super::entries::{PlanFile, wanted};
use super::worker::{Done, work};
use crate::commands::Outcome;
use crate::commands::output::{print, warn};

/// Arguments of `govtwin fleet run`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Plan: entries.jsonl, or the folder or store that holds it.
    #[arg(value_name = "UNITS")]
    plan: String,
    /// Index of the entry, counted from 0; without it, that of the environment, else all entries.
    ///
    /// The environment variables are HQ_ENTRY, SLURM_ARRAY_TASK_ID and JOB_COMPLETION_INDEX. All entries are
    /// processed one after the other.
    #[arg(long, value_name = "I")]
    index: Option<usize>,
    /// Folder or object store of results.
    #[arg(long, value_name = "STORE")]
    out: String,
    /// Repeat entries whose result is a failure.
    #[arg(long)]
    retry_failed: bool,
    /// Print a line of JSON for each entry instead of text.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
An entry whose result is in STORE is skipped. The name of a result is the SHA-256 of recordings,
sheet, map, options and program version. It is written in one step, and only if none exists, so
workers may be killed, repeated, or work on the same entry at once.

If an entry cannot be diagnosed, its result is the error, which `govtwin fleet gather` counts. If
the machine or the store fails, such as with a full disk, there is no result: STORE/notes has the
reason, and the entry can be tried again.

HQ_ENTRY may hold the entry itself, a line of entries.jsonl, as HyperQueue's --each-line passes it;
the list of the plan is then not read.

Examples:
  govtwin fleet run store --index 0 --out store
  RAYON_NUM_THREADS=1 govtwin fleet run store --out store     # all entries, on one core

Exit codes: 0 every requested entry has its result, even if it is a failure; 1 at least one has
none; 2 wrong usage.";

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let plan = PlanFile::open(&args.plan).context("UNITS")?;
    let store = Store::open(&args.out).context("--out")?;
    let entries = wanted(&plan, args.index)?;
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
        Done::Written(kept) => ("written", kept.found.as_ref().map_or_else(|| "failed".to_owned(), word_of)),
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
