//! `govtwin fleet plan`: what there is to do, one entry for each unit and period.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Context, bail};
use govtwin_diagnosis::fleet::plan::{LeftOut, Plan, Reason, left_out_csv, plan};
use govtwin_diagnosis::fleet::units::UnitRow;
use govtwin_files::store::Store;
use govtwin_pages::table::Table;
use serde_json::json;

use super::entries::{self, ENTRIES};
use super::look::{Item, Reading, items, look, owner};
use super::look_at_each;
use super::period::Period;
use super::unit_sheets::{self, Units};
use crate::commands::output::{print, table_text, warn};
use crate::commands::provenance::PROGRAM;
use crate::commands::{Outcome, expect};

/// The table of what is in no entry.
const LEFT_OUT: &str = "left_out.csv";

/// Arguments of `govtwin fleet plan`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Folder or object store of recordings: a path, or s3://BUCKET/PREFIX, gs://… or az://….
    #[arg(value_name = "SOURCE")]
    source: String,
    /// CSV table of the units: column `unit`, and optionally `folder`, `sheet`, `map`, `without`.
    #[arg(long, value_name = "FILE")]
    units: PathBuf,
    /// Folder or store for the plan: entries.jsonl, left_out.csv, sheets and maps.
    #[arg(long, value_name = "STORE")]
    out: String,
    /// Length of the period of one entry: it holds the recordings of a unit that begin in that period, UTC.
    #[arg(long, value_enum, default_value_t = Period::Month)]
    period: Period,
    /// Leave an effect out of the catalogue of every unit; may be repeated.
    #[arg(long, value_name = "ID")]
    without: Vec<String>,
    /// Seed of the bootstrap that gives the intervals of explained fractions.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print JSON instead of a summary.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
units.csv has one line per unit:
  unit,folder,sheet,map,without
  Alpha 1,alpha/1,sheets/alpha.yaml,,
  Alpha 2,alpha/2,sheets/alpha.yaml,maps/historian.yaml,supply_loss return_loss
  folder    folder below SOURCE; the name of the unit if the column is missing
  sheet     data sheet, relative to the table; the shipped reference unit if empty
  map       import map, relative to the table
  without   effects left out of the catalogue

Recordings are recognised by content, whatever their names. A recording belongs to the unit in whose
folder it is, and to the period in which it begins. Files in STORE:
  entries.jsonl   one line of JSON per entry; sheets and maps are copied next to it, so that workers
                  need only the plan and the recordings
  left_out.csv    every object that is in no entry: duplicates, unreadable files, recordings of no
                  unit, of two units or of another unit than they state, and other files

Examples:
  govtwin fleet plan recordings --units units.csv --out store
  govtwin fleet plan s3://plant/recordings --units units.csv --out s3://plant/diagnosis

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 something that should be a recording is in no
entry, or a unit has none.";

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    for id in &args.without {
        expect(govtwin_model::effects::find(id).is_some(), || {
            format!("--without {id}: there is no such effect; `govtwin effects` lists them")
        })?;
    }
    let units = unit_sheets::read(&args.units, args.seed, &args.without)?;
    let source = Store::open(&args.source).context("SOURCE")?;
    let out = Store::open(&args.out).context("--out")?;
    let objects = source.list("").context("SOURCE")?;
    if objects.is_empty() {
        bail!("{}: expected recordings, found nothing there; is it the right folder or prefix?", source.address());
    }
    let items = items(&objects);
    let plan = make(&source, &items, &units, args.period)?;
    for (path, bytes) in &units.beside {
        out.put(path, bytes)?;
    }
    out.put(LEFT_OUT, left_out_csv(&plan.left_out).as_bytes())?;
    entries::write(&out, &plan.entries)?;
    tell(args, &plan, &out, &units)
}

fn make(source: &Store, items: &[Item], units: &Units, period: Period) -> anyhow::Result<Plan> {
    let by_folder: BTreeMap<&str, &UnitRow> = units.rows.iter().map(|row| (row.folder.as_str(), row)).collect();
    let (found, left_out) = look_at_each(items, "objects read", |item| {
        let Some(row) = owner(&item.path, &by_folder) else {
            return Ok(Err(LeftOut {
                path: item.path.clone(),
                unit: String::new(),
                reason: Reason::UnknownUnit,
                words: "lies in the folder of no unit of the table".to_owned(),
            }));
        };
        let reading = Reading { row, sheet: units.sheets.get(&row.sheet), map: units.maps.get(&row.map), period };
        look(item, source, &reading)
    })?;
    let mut plan = plan(&source.address(), PROGRAM, &units.how, found);
    plan.left_out.extend(left_out);
    plan.left_out.sort();
    Ok(plan)
}

fn tell(args: &Args, plan: &Plan, out: &Store, units: &Units) -> anyhow::Result<Outcome> {
    let mut counts: BTreeMap<Reason, usize> = BTreeMap::new();
    for one in &plan.left_out {
        *counts.entry(one.reason).or_default() += 1;
    }
    let recordings: usize = plan.entries.iter().map(|entry| entry.bags.len()).sum();
    if args.json {
        let left_out: BTreeMap<_, _> = counts.iter().map(|(reason, count)| (reason.id(), count)).collect();
        let whole = json!({
            "schema": "govtwin-fleet-plan/1", "entries": plan.entries.len(), "recordings": recordings, "units": units.rows.len(),
            "left_out": left_out, "units_without_recordings": plan.idle_units,
        });
        print(&format!("{whole:#}\n"))?;
    } else {
        let (entries, total) = (plan.entries.len(), units.rows.len());
        print(&format!(
            "{entries} entries of {} of {total} units, {recordings} recordings\n",
            total - plan.idle_units.len()
        ))?;
        if !counts.is_empty() {
            let mut table = Table::new().words("left out").numbers("objects");
            for (reason, count) in &counts {
                table.row([reason.id().to_owned(), count.to_string()]);
            }
            print(&format!("\n{}", table_text(&table)))?;
        }
        print(&format!("\nplan: {0}/{ENTRIES}, what is left out: {0}/{LEFT_OUT}\n", out.address()))?;
        if let Some(last) = plan.entries.len().checked_sub(1) {
            print(&format!("next: govtwin fleet run {} --index I --out STORE, I being 0 to {last}\n", out.address()))?;
        }
    }
    for one in plan.left_out.iter().filter(|one| one.reason != Reason::NoRecording) {
        let of = if one.unit.is_empty() { String::new() } else { format!("unit `{}`: ", one.unit) };
        warn(&format!("{of}{}: {} (left out)", one.path, one.words));
    }
    for unit in &plan.idle_units {
        warn(&format!("unit `{unit}`: no recording can be used"));
    }
    let is_sound = plan.idle_units.is_empty() && counts.keys().all(|reason| *reason == Reason::NoRecording);
    Ok(if is_sound { Outcome::Ok } else { Outcome::Warnings })
}
