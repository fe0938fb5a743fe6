//! `govtwin fleet gather`: all results of a store in one page, one table and one file for machines.

use std::collections::BTreeMap;
use std::path::PathBuf;

use anyhow::{Context, bail};
use govtwin_diagnosis::fleet::changes::{Change, Standing};
use govtwin_diagnosis::fleet::entry::Entry;
use govtwin_diagnosis::fleet::gathered::{Gathered, Status, gather};
use govtwin_diagnosis::fleet::result::EntryResult as Kept;
use govtwin_diagnosis::fleet::table;
use govtwin_diagnosis::fleet::urgency::{Look, look_first};
use govtwin_files::digest::sha256;
use govtwin_files::store::{Store, StoreError};
use govtwin_model::params;
use govtwin_pages::table::Table;
use serde_json::json;

use super::entries::PlanFile;
use super::look_at_each;
use crate::commands::Outcome;
use crate::commands::output::{Output, print, table_text, warn, warn_all};
use crate::commands::provenance::{self, PROGRAM};
use crate::commands::report_file::text_if_there;

/// Where a gathered fleet stands in its store.
const FOLDER: &str = "fleet";
/// What a gathered fleet consists of; the Parquet table stands there in builds that have it.
const NAMES: [&str; 4] = ["fleet.csv", PARQUET, "fleet.html", JSON];
const PARQUET: &str = "fleet.parquet";
const JSON: &str = "fleet.json";
/// More than the figures of a million units take.
const LARGEST_BYTES: u64 = 1 << 32;
/// Units that the summary names.
const SHOWN: usize = 10;

/// Arguments of `govtwin fleet gather`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Folder or object store of results.
    #[arg(value_name = "STORE")]
    store: String,
    /// Plan; its entries without a result are listed as missing [default: entries.jsonl in STORE, if there is one].
    #[arg(long, value_name = "UNITS")]
    plan: Option<String>,
    /// Folder for fleet.html, fleet.csv, fleet.parquet and fleet.json [default: STORE/fleet].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON instead of a summary: the content of fleet.json.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
fleet.html lists the units that need attention first, the changes since the last `gather`, the
causes of each unit with sizes, sizes that changed over time, and failed or missing entries. Units
link to their own reports.

fleet.csv and fleet.parquet (cargo feature `parquet`) have one line per unit and period (`row` is
`entry`), followed by one line per cause and per parameter, with probabilities, sizes, 90 %
intervals, whether the recordings determine it, and the cumulative sum of its change. They are the
same to the last byte on every engine and in any order of the work.

Without a plan, all results of this program version count; if a unit and period has several results,
the one with the most recordings counts.

Examples:
  govtwin fleet gather store
  govtwin fleet gather s3://plant/diagnosis --out fleet

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 some entries failed or are missing.";

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let store = Store::open(&args.store).context("STORE")?;
    let target = PageTarget::new(args, &store)?;
    store.tidy("results");
    store.tidy("reports");
    let file = PlanFile::open(args.plan.as_ref().unwrap_or(&args.store))?;
    // One that is named must be there.
    let plan = if args.plan.is_some() || file.is_there()? { Some(file.all()?) } else { None };
    let (outcomes, damaged) = outcomes(&store)?;
    if outcomes.is_empty() && damaged.is_empty() && plan.is_none() {
        bail!("{}: expected results, found none; `govtwin fleet run` writes them", store.address());
    }
    let total = outcomes.len();
    let gathered = gather(plan.as_deref(), outcomes, &notes(&store)?, PROGRAM);
    if gathered.rows.is_empty() && total == 0 {
        let why = format!("{}: no result can be read, and no plan says which are missing", store.address());
        bail!("{}", [vec![why], damaged].concat().join("\n  "));
    }
    if gathered.rows.is_empty() {
        bail!(
            "{}: none of the {total} results is of {PROGRAM}; plan and run anew, or gather with the version that made them",
            store.address()
        );
    }
    let all = All::of(&gathered, damaged, plan.as_deref(), &target)?;
    let json = all.json()?;
    all.write(target, &json)?;
    all.tell(args, &json)
}

/// All results, and what stands among them and is none.
fn outcomes(store: &Store) -> anyhow::Result<(Vec<Kept>, Vec<String>)> {
    look_at_each(&store.list("results")?, "results read", |object| {
        let key = object.path.rsplit('/').next().and_then(|name| name.strip_suffix(".json"));
        let bytes = store.get(&object.path)?;
        let Some(key) = key else {
            return Ok(Err(format!("{}: expected a result, KEY.json; not counted", object.path)));
        };
        let damaged = |error| format!("{}: {error:#}; remove it, so that its entry is done anew", object.path);
        let outcome = match Kept::read(&bytes, key) {
            Ok(outcome) => outcome,
            Err(error) => return Ok(Err(damaged(error.into()))),
        };
        match agrees(&outcome, store) {
            Ok(()) => Ok(Ok(outcome)),
            Err(error) if error.is::<StoreError>() => Err(error),
            Err(error) => Ok(Err(damaged(error))),
        }
    })
}

/// The files of a report are those that were written with the result; reports may also be kept elsewhere.
fn agrees(outcome: &Kept, store: &Store) -> anyhow::Result<()> {
    let Some(folder) = &outcome.report else { return Ok(()) };
    let own = format!("reports/{}/", outcome.key);
    if !folder.starts_with(&own) {
        bail!("report: expected a folder of {own}, found {folder}");
    }
    for (name, stated) in &outcome.files {
        let path = format!("{folder}/{name}");
        if !store.has(&path)? {
            continue;
        }
        let found = sha256(store.get(&path)?);
        if found != *stated {
            bail!(
                "{path}: expected the file that was written with the result (SHA-256 {stated:.12}), found another ({found:.12})"
            );
        }
    }
    Ok(())
}

/// What was noted of tries without a result, by key.
fn notes(store: &Store) -> anyhow::Result<BTreeMap<String, Vec<String>>> {
    let mut notes: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for object in store.list("notes")? {
        let Some(key) = object.path.split('/').nth(1) else { continue };
        let text = String::from_utf8_lossy(&store.get(&object.path)?).into_owned();
        notes.entry(key.to_owned()).or_default().push(text);
    }
    for texts in notes.values_mut() {
        texts.sort();
    }
    Ok(notes)
}

/// Where the fleet is written to.
struct PageTarget<'a> {
    /// A folder on this machine, claimed.
    folder: Option<Output>,
    /// Otherwise the store itself.
    store: &'a Store,
    /// What people are shown.
    shown: String,
    /// From the page to the top of the store.
    to_store: String,
    /// What stood there before.
    before: Option<Standing>,
}

impl<'a> PageTarget<'a> {
    fn new(args: &Args, store: &'a Store) -> anyhow::Result<Self> {
        let inside = store.local(FOLDER);
        let to_store = match (&args.out, &inside) {
            (None, _) => "../".to_owned(),
            (Some(_), _) => format!("{}/", store.address()),
        };
        let folder = args.out.clone().or(inside);
        let shown = folder
            .as_ref()
            .map_or_else(|| format!("{}/{FOLDER}", store.address()), |folder| folder.display().to_string());
        let earlier = format!("{FOLDER}/{JSON}");
        let bytes = match &folder {
            Some(folder) => text_if_there(&folder.join(JSON), LARGEST_BYTES)?.map(String::into_bytes),
            None if store.has(&earlier)? => Some(store.get(&earlier)?),
            None => None,
        };
        let before = bytes.map(|bytes| standing(&bytes, &format!("{shown}/{JSON}"))).transpose()?;
        let folder = folder.map(|folder| Output::claim(&folder, &NAMES)).transpose()?;
        Ok(Self { folder, store, shown, to_store, before })
    }
}

fn standing(bytes: &[u8], shown: &str) -> anyhow::Result<Standing> {
    let whole: serde_json::Value = serde_json::from_slice(bytes).with_context(|| shown.to_owned())?;
    serde_json::from_value(whole["standing"].clone())
        .with_context(|| format!("{shown}: expected the figures of a fleet that was gathered before; name another folder with --out, or remove it"))
}

/// A gathered fleet with all that is said of it.
struct All<'a> {
    gathered: &'a Gathered,
    looks: Vec<Look>,
    changes: Vec<Change>,
    before: Option<String>,
    standing: Standing,
    damaged: Vec<String>,
    page: String,
    shown: String,
}

impl<'a> All<'a> {
    fn of(
        gathered: &'a Gathered,
        damaged: Vec<String>,
        plan: Option<&[Entry]>,
        target: &PageTarget,
    ) -> anyhow::Result<Self> {
        let made = provenance::new("fleet gather", &params::reference_sheet(), None)?;
        let standing = Standing::of(gathered, &made.date);
        let changes = target.before.as_ref().map(|before| before.changes(&standing)).unwrap_or_default();
        let looks = look_first(gathered);
        let before = target.before.as_ref().map(|before| before.date.clone());
        let facts = [
            ("program", format!("{} fleet gather", made.program)),
            ("date", made.date.clone()),
            (
                "plan",
                plan.map_or_else(
                    || "none: all results of this version count".to_owned(),
                    |plan| format!("{} entries", plan.len()),
                ),
            ),
            ("results of other plans or versions", gathered.superseded.len().to_string()),
        ];
        let context = govtwin_pages::fleet::Context {
            looks: &looks,
            changes: &changes,
            before: before.as_deref(),
            damaged: &damaged,
            to_store: &target.to_store,
            facts: facts.into_iter().map(|(name, value)| (name.to_owned(), value)).collect(),
        };
        let page = govtwin_pages::fleet::page(gathered, &context).to_html();
        Ok(Self { gathered, looks, changes, before, standing, damaged, page, shown: target.shown.clone() })
    }

    fn json(&self) -> anyhow::Result<String> {
        let works = || self.gathered.rows.iter().filter_map(|row| row.work.as_ref());
        let processor: Option<f64> = works().map(|work| work.processor_s).sum();
        let whole = json!({
            "schema": "govtwin-fleet/1",
            "program": PROGRAM,
            "entries": self.gathered.rows.len(),
            "done": self.gathered.count(Status::Done),
            "failed": self.gathered.count(Status::Failed),
            "missing": self.gathered.count(Status::Missing),
            "damaged": self.damaged,
            "superseded": self.gathered.superseded,
            "limit": self.gathered.limit,
            "look_first": self.looks,
            "since": self.before,
            "changes": self.changes,
            "work": {
                "processor_s": processor,
                "elapsed_s": works().map(|work| work.elapsed_s).sum::<f64>(),
                "peak_memory_bytes": works().filter_map(|work| work.peak_memory_bytes).max(),
            },
            "standing": self.standing,
        });
        Ok(serde_json::to_string_pretty(&whole).context("cannot write the figures as JSON")? + "\n")
    }

    fn write(&self, target: PageTarget, json: &str) -> anyhow::Result<()> {
        let lines = table::lines(self.gathered);
        let csv = table::csv(&lines);
        // The file from which changes are computed comes last: after an interruption they are reported again.
        let mut files: Vec<(&str, Vec<u8>)> = vec![("fleet.csv", csv.into_bytes())];
        #[cfg(feature = "parquet")]
        files.push((PARQUET, govtwin_diagnosis::fleet::parquet_table::bytes(&lines)?));
        files.push(("fleet.html", self.page.clone().into_bytes()));
        files.push((JSON, json.as_bytes().to_vec()));
        let Some(mut folder) = target.folder else {
            for (name, bytes) in &files {
                target.store.put(&format!("{FOLDER}/{name}"), bytes)?;
            }
            return Ok(());
        };
        for (name, bytes) in &files {
            folder.add(name, bytes)?;
        }
        // One of an earlier run with another build would not be of these results.
        if files.iter().all(|(name, _)| *name != PARQUET) {
            folder.remove(PARQUET);
        }
        folder.place()
    }

    fn tell(&self, args: &Args, json: &str) -> anyhow::Result<Outcome> {
        let rows = &self.gathered.rows;
        if args.json {
            print(json)?;
        } else {
            let count = |status: Status| self.gathered.count(status);
            let mut text = format!(
                "{} units in periods: {} diagnosed, {} failed, {} missing; {} sizes changed beyond their intervals\n",
                rows.len(),
                count(Status::Done),
                count(Status::Failed),
                count(Status::Missing),
                self.gathered.changed().count()
            );
            if !self.looks.is_empty() {
                let mut table = Table::new().words("look first").words("why");
                for look in self.looks.iter().take(SHOWN) {
                    table.row([look.unit.as_str(), look.reasons.first().map_or("", String::as_str)]);
                }
                text += &format!("\n{}", table_text(&table));
                if self.looks.len() > SHOWN {
                    text += &format!("and {} more\n", self.looks.len() - SHOWN);
                }
            }
            if let Some(before) = &self.before {
                text += &format!("\n{} changes since {before}\n", self.changes.len());
            }
            text += &format!("\npage: {0}/fleet.html, table: {0}/fleet.csv\n", self.shown);
            if cfg!(not(feature = "parquet")) {
                text += "fleet.parquet is not in this build; `cargo install --path . --features parquet` makes one that writes it\n";
            }
            print(&text)?;
        }
        for row in rows.iter().filter(|row| row.status != Status::Done) {
            warn(&format!("unit `{}`, {}: {}: {}", row.unit, row.period, row.status.id(), row.words));
        }
        warn_all(&self.damaged);
        let sound = self.damaged.is_empty() && rows.iter().all(|row| row.status == Status::Done);
        Ok(if sound { Outcome::Ok } else { Outcome::Warnings })
    }
}
