//! `govtwin sheet`: a parameter file from a name plate and a manual.

use govtwin_diagnosis::sheet::plate_file;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use clap::Subcommand;
use govtwin_diagnosis::sheet::matter::{Help, Matter, PARTS, Shows, matter};
use govtwin_diagnosis::sheet::recorded::{Filled, fill};
use govtwin_diagnosis::sheet::{Derived, GivenValue, Plate, derive};
use govtwin_files::{Place, place_of};
use govtwin_model::parameters::{ENTRIES, Tolerance, Unit};
use govtwin_model::params::{self, WholeSheet, number_text, tolerance_text};
use govtwin_pages::table::Table;
use serde_json::json;

use super::bags::{self, MapArgs, TopicArgs};
use super::output::{Progress, claim_place, print, table_text, warn_all, write_atomically};
use crate::commands::Outcome;

/// Seed of the recordings by which it is found out what matters.
const SEED: u64 = 1;
/// Items that are named as worth finding out.
const MOST_ITEMS: usize = 8;
/// Faults that are named for each of them.
const MOST_EFFECTS: usize = 4;

/// Make a parameter file from what stands on a name plate and in a manual.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Make a complete data sheet from a name plate, and report which missing values matter most.
    New(New),
}

/// Arguments of `govtwin sheet new`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
struct New {
    /// Plate file; `--template` prints one to fill in.
    #[arg(value_name = "PLATE", required_unless_present_any = ["template", "set", "from"])]
    plate: Option<PathBuf>,
    /// Value of the plate, such as `--set "tank_pressure=63 bar"`; replaces that of the file; may be repeated.
    #[arg(long, value_name = "KEY=VALUE", value_parser = plate_file::plate_value)]
    set: Vec<(&'static str, GivenValue)>,
    /// Print a plate file to fill in: every item with its meaning, where to find it, and an example.
    #[arg(long, conflicts_with_all = ["plate", "set", "from", "out"])]
    template: bool,
    /// Recordings of the unit, to estimate what the plate does not state; may be repeated.
    ///
    /// They give tank pressure, stops, stroke times, position gain and noise.
    #[arg(long, value_name = "BAG")]
    from: Vec<PathBuf>,
    #[command(flatten)]
    topics: TopicArgs,
    #[command(flatten)]
    map: MapArgs,
    /// Parameter file to write, which must not exist; without it, the sheet is printed.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Skip the simulation of which missing values matter most for which faults.
    #[arg(long)]
    quick: bool,
    /// Print JSON instead of tables: values, sources, and what matters most.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Values that the plate does not state follow from the reference unit by similarity: the ports from
the opening and closing times, valve sizes from the ports, forces from pressure times area, volumes from
strokes. Every value of the file has its formula or its place on the plate as `source`, and a
tolerance as wide as the estimate is uncertain. docs/import.md lists the formulas.

To find out which missing values matter most, the four processes are simulated with each tolerance
and each fault of the catalogue. A fault counts as hidden if tolerances can imitate it to within the
noise.

Examples:
  govtwin sheet new --template > plate.yaml
  govtwin sheet new plate.yaml --out unit3.yaml
  govtwin sheet new --set \"tank_pressure=63 bar\" --set \"servomotor_stroke=600 mm\" \\
      --set \"servomotor_volume=120 L\" --set \"closing_time=6.5 s\"
  govtwin sheet new plate.yaml --from monday.mcap --from tuesday.mcap --out unit3.yaml
  govtwin diagnose export.csv --map map.yaml --params unit3.yaml

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 finished, with assumptions to check.";

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let Command::New(args) = &args.command;
    if args.template {
        print(&plate_file::plate_template())?;
        return Ok(Outcome::Ok);
    }
    let _claim = args.out.as_deref().map(|out| claim_place("--out", out)).transpose()?;
    if let Some(out) = &args.out
        && place_of(out).with_context(|| format!("--out: cannot look at {}", out.display()))? == Place::Ours
    {
        bail!(
            "--out: {}: a sheet is there, which may have been mended by hand; name another file, or move it away",
            out.display()
        );
    }
    let mut plate = match &args.plate {
        Some(path) => plate_file::load_plate(path)?,
        None => Plate::default(),
    };
    plate.values.extend(args.set.iter().cloned());
    let name = args.plate.as_deref().map_or_else(|| "the plate".to_owned(), |path| path.display().to_string());
    let reference = params::reference();
    let recorded = recorded(args, &mut plate, &reference)?;
    let derived = match derive(&plate, &reference) {
        Ok(derived) => with_recorded(derived, recorded),
        Err(problems) => {
            bail!("{name}: {}; `govtwin sheet new --template` lists what a plate may say", problems.join("; "))
        }
    };
    let conflicts: Vec<String> =
        params::conflicts(&derived.unit.parameters).map(|conflict| conflict.to_string()).collect();
    if !conflicts.is_empty() {
        bail!("{name}: makes a unit that cannot be:\n  {}", conflicts.join("\n  "));
    }
    let matter = (!args.quick).then(|| {
        let progress = Progress::new(PARTS, "simulations of missing values");
        matter(&derived.unit, &plate, SEED, &|| progress.step())
    });
    let path = args.out.clone().unwrap_or_else(|| PathBuf::from("sheet.yaml"));
    let text = params::whole_text(&path, &derived.unit, &whole(&plate, &derived, matter.as_ref()))?;
    match (&args.out, args.json) {
        (Some(out), _) => write_atomically(out, text.as_bytes())?,
        (None, false) => print(&text)?,
        (None, true) => {}
    }
    if args.json {
        print(&format!("{:#}\n", figures(&plate, &derived, matter.as_ref())))?;
    } else if let Some(out) = &args.out {
        print(&summary(&derived, matter.as_ref(), out))?;
    }
    warn_all(&derived.assumed);
    Ok(if derived.assumed.is_empty() { Outcome::Ok } else { Outcome::Warnings })
}

/// Puts what recordings say onto the plate.
fn recorded(args: &New, plate: &mut Plate, reference: &Unit) -> anyhow::Result<Option<Filled>> {
    if args.from.is_empty() {
        return Ok(None);
    }
    let mapped = args.map.open(&args.from)?;
    let read = bags::read_for_sheet(&mapped.paths, &args.topics.topics(), reference)?;
    warn_all(mapped.warnings.iter().chain(&read.warnings));
    let filled = fill(plate, &read.recordings, reference);
    Ok(Some(filled.map_err(|reason| anyhow::anyhow!("--from: {reason}"))?))
}

/// A unit derived from a plate, with what recordings say of its transducers and leave open.
pub(super) fn with_recorded(mut derived: Derived, recorded: Option<Filled>) -> Derived {
    if let Some(Filled { sensors, assumed }) = recorded {
        derived.unit.sensors = sensors;
        derived.assumed.splice(0..0, assumed);
    }
    derived
}

fn effects_text(effects: &[(&'static str, f64)]) -> String {
    let one = |(id, ratio): &(&str, f64)| format!("{id} ×{ratio:.1}");
    let mut words: Vec<String> = effects.iter().take(MOST_EFFECTS).map(one).collect();
    if effects.len() > MOST_EFFECTS {
        words.push(format!("and {} more", effects.len() - MOST_EFFECTS));
    }
    words.join(", ")
}

/// The values most worth looking up, and the faults that tolerances hide.
fn worth_telling(matter: &Matter) -> (impl Iterator<Item = &Help>, String) {
    let helps = matter.missing.iter().filter(|help| !help.effects.is_empty()).take(MOST_ITEMS);
    (helps, matter.hidden().map(|fault| fault.effect).collect::<Vec<_>>().join(", "))
}

/// The head of the file and the sources of its values.
pub(super) fn whole(plate: &Plate, derived: &Derived, matter: Option<&Matter>) -> WholeSheet {
    let mut head = vec![
        format!(
            "Made by govtwin {}: {} values from plate, manual or recordings, the others by the formulas that stand with them.",
            env!("CARGO_PKG_VERSION"),
            plate.values.len()
        ),
        "Tolerances are one standard deviation. Mend what you know better: a value, its tolerance, its source."
            .to_owned(),
    ];
    head.extend(derived.assumed.iter().map(|assumed| format!("Assumed: {assumed}.")));
    if let Some(matter) = matter {
        head.push("Worth finding out, the most helpful first, with the faults that it would show sharper:".to_owned());
        let (helps, hidden) = worth_telling(matter);
        head.extend(helps.map(|help| format!("  {}: {}", help.item.key, effects_text(&help.effects))));
        if !hidden.is_empty() {
            head.push(format!("Hidden behind the tolerances at their typical sizes: {hidden}."));
        }
    }
    let source = |key: &str| derived.sources.get(key).map(|sourced| sourced.source.clone()).unwrap_or_default();
    WholeSheet { name: plate.name.clone(), head, sources: ENTRIES.iter().map(|entry| source(entry.key)).collect() }
}

fn summary(derived: &Derived, matter: Option<&Matter>, out: &Path) -> String {
    let mut table = Table::new().words("parameter").numbers("value").words("unit").words("tolerance").words("source");
    for (entry, tolerance) in ENTRIES.iter().zip(&derived.unit.tolerances) {
        let sourced = derived.sources.get(entry.key);
        let words = tolerance.map_or_else(String::new, |tolerance: Tolerance| tolerance_text(tolerance, entry.unit));
        let source = sourced.map(|sourced| sourced.source.clone()).unwrap_or_default();
        table.row([
            entry.key.to_owned(),
            number_text((entry.get)(&derived.unit.parameters)),
            entry.unit.to_owned(),
            words,
            source,
        ]);
    }
    let [opening_s, closing_s] = derived.times_s;
    let mut text = format!(
        "{}Full stroke through the ports: {opening_s:.2} s opening, {closing_s:.2} s closing.\n",
        table_text(&table)
    );
    if let Some(matter) = matter {
        let mut table =
            Table::new().words("value to look up").words("meaning").words("faults that it shows more clearly");
        let (helps, hidden) = worth_telling(matter);
        for help in helps {
            table.row([help.item.key.to_owned(), help.item.doc.to_owned(), effects_text(&help.effects)]);
        }
        text.push_str(&format!("\n{}", table_text(&table)));
        if hidden.is_empty() {
            text.push_str("The tolerances hide no fault of typical size.\n");
        } else {
            text.push_str(&format!("Faults that the tolerances hide at their typical sizes: {hidden}.\n"));
        }
    }
    text.push_str(&format!("Sheet: {}\n", out.display()));
    text
}

fn figures(plate: &Plate, derived: &Derived, matter: Option<&Matter>) -> serde_json::Value {
    let parameters = ENTRIES.iter().zip(&derived.unit.tolerances).map(|(entry, tolerance)| {
        let sourced = derived.sources.get(entry.key);
        json!({
            "key": entry.key,
            "value": (entry.get)(&derived.unit.parameters),
            "unit": entry.unit,
            "tolerance": tolerance.map(|tolerance| tolerance_text(tolerance, entry.unit)),
            "source": sourced.map(|sourced| sourced.source.clone()),
            "given": sourced.is_some_and(|sourced| sourced.given),
        })
    });
    let missing = |matter: &Matter| {
        let help = |help: &Help| {
            let effects = help.effects.iter().map(|(id, ratio)| json!({"effect": id, "sharper": ratio}));
            json!({"item": help.item.key, "gain": help.gain, "effects": effects.collect::<Vec<_>>()})
        };
        matter.missing.iter().map(help).collect::<Vec<_>>()
    };
    let faults = |matter: &Matter| {
        let fault = |fault: &Shows| json!({"effect": fault.effect, "deviations": fault.with_sheet_ratio, "deviations_at_best": fault.at_best_ratio});
        matter.faults.iter().map(fault).collect::<Vec<_>>()
    };
    json!({
        "name": plate.name,
        "given": plate.values.keys().collect::<Vec<_>>(),
        "parameters": parameters.collect::<Vec<_>>(),
        "opening_s": derived.times_s[0],
        "closing_s": derived.times_s[1],
        "assumed": derived.assumed,
        "missing": matter.map(missing),
        "faults": matter.map(faults),
    })
}
