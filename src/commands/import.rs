//! `govtwin import`: recordings as plants have them, made into bags.

pub mod bag;
mod suggest;

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::ValueHint;
use govtwin_bag::import::suggest::{ColumnUnit, Known};
use govtwin_bag::import::{ImportOutcome as Imported, Map};
use govtwin_files::Claim;
use govtwin_model::params::number_text;
use govtwin_pages::table::Table;
use serde_json::json;

use super::output::{Progress, print, table_text, warn_all};
use crate::commands::{Outcome, usage};

/// Make a bag of recordings as plants have them: CSV, Parquet, and bags with other topics and types.
///
/// A map says which column, or which field of a message, holds which signal, in which unit, and how time is written. --suggest
/// proposes one. Nothing is resampled, filled in or cut off unless the map asks for it, and then it is said.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Tables or bags of one recording: parts that follow each other in time, or that each hold some of the signals.
    #[arg(value_name = "FILE", required = true, value_hint = ValueHint::AnyPath)]
    files: Vec<PathBuf>,
    /// Map that assigns columns or fields to signals.
    #[arg(long, value_name = "MAP", required_unless_present = "suggest")]
    map: Option<PathBuf>,
    /// Propose a map for one file, with a page that shows how each column was understood.
    ///
    /// The proposal uses names, units, ranges and shapes of the columns. Of a map given with --map, `file` and `time`
    /// are used.
    #[arg(long)]
    suggest: bool,
    /// With --suggest: the column of time, where its name does not say so.
    #[arg(long, value_name = "NAME", requires = "suggest", conflicts_with = "rate_hz")]
    time_column: Option<String>,
    /// With --suggest: rows per second of a file without a column of time, Hz.
    #[arg(long, value_name = "HZ", requires = "suggest", value_parser = positive)]
    rate_hz: Option<f64>,
    /// With --suggest: the unit of a column that its file does not state; may be given again for another.
    #[arg(long = "unit", value_name = "NAME=UNIT", requires = "suggest", value_parser = column_unit)]
    units: Vec<ColumnUnit>,
    /// Bag folder to write; without it, the files are only checked.
    ///
    /// With --suggest: folder for map.yaml and suggestion.html, by default `import`.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
A map (docs/import.md describes every key):
  file: {separator: \";\", decimal: \",\"}            # inferred if missing
  time: {column: Zeit, format: \"%d.%m.%Y %H:%M:%S%.f\", zone: Europe/Zurich}
  signals:
    opening_command:     {column: Y_soll, unit: \"%\"}
    servomotor_position: {column: Y_ist, unit: mm, range: [0, 600]}      # closed, open
    spool_position:      {column: HSV, unit: V, range: [0, -10]}         # neutral, full opening
    tank_pressure:       {column: p_tank, unit: bar}                     # gauge; `bara` is absolute
    esv:                 {column: Trip, shutdown: 1}                     # or `esv: normal`
In a bag a signal is a field:
    servomotor_position: {field: \"/joint_states.position[servomotor]\", unit: m, range: [0, 0.6]}

`replay`, `fit` and `diagnose` take the same files directly with the same --map.

Examples:
  govtwin import --suggest export.csv --out first_look
  govtwin import --suggest rig.csv --rate-hz 500 --unit Y=mm
  govtwin import export.csv --map first_look/map.yaml --out bags/rejection
  govtwin diagnose export.csv --map first_look/map.yaml --params unit3.yaml

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 finished with warnings to check.";

/// A rate, above 0.
fn positive(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate: &f64| rate.is_finite() && *rate > 0.0);
    rate.ok_or_else(|| "expected rows per second, above 0".to_owned())
}

/// A column and its unit; names may hold the sign as well.
fn column_unit(text: &str) -> Result<ColumnUnit, String> {
    let (column, unit) = text
        .rsplit_once('=')
        .filter(|(column, unit)| !column.is_empty() && !unit.is_empty())
        .ok_or("expected a column and its unit, as in `Y=mm`")?;
    Ok(ColumnUnit { column: column.to_owned(), unit: unit.to_owned() })
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let map = args.map.as_deref().map(Map::load).transpose()?;
    if args.suggest {
        let [file] = &args.files[..] else {
            return Err(usage(format!(
                "--suggest looks at one file, found {}; give one after the other",
                args.files.len()
            )));
        };
        let out = args.out.clone().unwrap_or_else(|| PathBuf::from("import"));
        let mut known = Known { map: map.unwrap_or_default(), units: args.units.clone() };
        if let Some(column) = &args.time_column {
            known.map.time.columns = vec![column.clone()];
        }
        known.map.time.rate_hz = args.rate_hz.or(known.map.time.rate_hz);
        return suggest::run(file, &known, &out, args.json);
    }
    let map = map.context("--map is needed; `govtwin import --suggest FILE` proposes one")?;
    let imported = match &args.out {
        Some(out) => {
            let same =
                |file: &&PathBuf| file.canonicalize().is_ok_and(|file| out.canonicalize().is_ok_and(|out| file == out));
            if let Some(file) = args.files.iter().find(same) {
                anyhow::bail!(
                    "--out {}: the bag would take the place of what is read; choose another folder",
                    file.display()
                );
            }
            let _claim = Claim::name(out).context("--out")?;
            let (sealed, imported) = bag::write(&args.files, &map, out, true)?;
            sealed.place()?;
            imported
        }
        None => bag::check(&args.files, &map)?,
    };
    if args.json {
        print(&format!("{:#}\n", figures(&imported, args.out.as_deref())))?;
    } else {
        for note in &imported.notes {
            print(&format!("{note}\n"))?;
        }
        print(&table_text(&table(&imported)))?;
        match &args.out {
            Some(out) => print(&format!("{}: {} rows\n", out.display(), imported.rows))?,
            None => print("Nothing was written; add --out BAG.\n")?,
        }
    }
    warn_all(&imported.warnings);
    Ok(if imported.warnings.is_empty() { Outcome::Ok } else { Outcome::Warnings })
}

/// A bar on standard error over the share of the files that is read.
fn progress() -> Progress {
    Progress::new(100, "%")
}

fn table(imported: &Imported) -> Table {
    let mut table = Table::new()
        .words("signal")
        .words("from")
        .words("unit")
        .numbers("samples")
        .numbers("Hz")
        .numbers("least")
        .numbers("most");
    for found in &imported.signals {
        let [least, most] = found.ends.map(|end| number_text(significant(end)));
        let unit = if found.unit.is_empty() { found.target.unit().to_owned() } else { found.unit.clone() };
        let (samples, rate) = (found.samples.to_string(), format!("{:.1}", found.rate_hz));
        table.row([
            found.target.id().to_owned(),
            super::output::one_line(&found.place),
            unit,
            samples,
            rate,
            least,
            most,
        ]);
    }
    table
}

/// Four digits, which is what a table has room for.
fn significant(value: f64) -> f64 {
    if value == 0.0 || !value.is_finite() {
        return value;
    }
    format!("{value:.3e}").parse().unwrap_or(value)
}

fn figures(imported: &Imported, out: Option<&Path>) -> serde_json::Value {
    let signal = |found: &govtwin_bag::import::findings::SignalFindings| {
        json!({
            "signal": found.target.id(),
            "from": found.place,
            "unit_of_file": found.unit,
            "unit": found.target.unit(),
            "samples": found.samples,
            "rate_hz": found.rate_hz,
            "longest_gap_s": found.longest_gap_s,
            "least": found.ends[0],
            "most": found.ends[1],
        })
    };
    json!({
        "bag": out.map(|out| out.display().to_string()),
        "rows": imported.rows,
        "signals": imported.signals.iter().map(signal).collect::<Vec<_>>(),
        "notes": imported.notes,
        "warnings": imported.warnings,
    })
}
