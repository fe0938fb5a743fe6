//! `govtwin check`: validates a parameter file and prints the unit that it describes.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use govtwin_model::effects::find_in;
use govtwin_model::parameters::{ENTRIES, SENSOR_ENTRIES, Tolerance, Unit};
use govtwin_model::params::{self, Origin, Sheet, number_text, quantity_text, tolerance_text};
use serde_json::{Value, json};

use crate::commands::output::{print, warn};
use crate::commands::{Outcome, bags, info};

/// Arguments of `govtwin check`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Parameter file, YAML; a bag or a folder of bags is checked as by `govtwin info`.
    file: PathBuf,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
A parameter file contains only the differences from the shipped unit:

  name: unit 2 after the overhaul
  base: station.yaml         # optional: differs from that file; reference_unit is the shipped unit
  source: overhaul protocol  # optional: source of all values
  oil:
    bulk_modulus_pa: 1.1e9   # a bare number keeps the tolerance
    density_kg_m3: {value: 865.0, unit: kg/m3, tol: 0.01, source: laboratory}
  sensors:
    spool_position_pu: {noise: 5.0e-4, step: 1.22e-4}

`tol` is the tolerance, the standard deviation from unit to unit and the prior of a fit: a share of
the value; with `abs: true` in the unit of the value; with `log: true` of its natural logarithm.
`tol: ~` removes it. `unit` is optional and must be the expected unit: nothing is converted. All
values are in SI units; pressures are gauge.

Effects stand under `effects:`: those of `govtwin effects` as `backlash: {play_pu: 0.004}`, your own
with an expression in the state, as in docs/own_effect.md.

All errors of a file are reported together: unknown keys, wrong types and units, values outside
their physical range, and values that contradict each other. An empty file shows every key with its
unit and the shipped value.

Examples:
  govtwin check params/reference_unit.yaml
  touch empty.yaml && govtwin check empty.yaml

Exit codes: 0 valid, 1 not valid or not readable, 2 wrong usage, 3 a bag with warnings.";

/// Validates the file and prints the merged unit.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if is_bag(&args.file) {
        let is_folder = args.file.is_dir() && !bags::is_bag_folder(&args.file);
        let what = if is_folder { "a folder of recordings" } else { "a bag" };
        warn(&format!(
            "{} is {what} and no parameter file; here is what `govtwin info` says of it",
            args.file.display()
        ));
        return info::run(&info::Args::of(args.file.clone(), args.json));
    }
    let sheet = params::load_sheet(&args.file)?;
    let rows = rows(&sheet);
    let text = if args.json { format!("{:#}\n", to_json(&sheet, &rows)) } else { table(&args.file, &sheet, &rows) };
    print(&text)?;
    Ok(Outcome::Ok)
}

/// Whether somebody means recordings: a folder, or a file that bags are called like.
fn is_bag(path: &Path) -> bool {
    let named = path.extension().is_some_and(|suffix| suffix == "mcap" || suffix == "db3");
    named || path.is_dir()
}

/// One number of the merged unit beside the shipped one.
struct ParameterRow<'a> {
    key: String,
    value: f64,
    shipped: f64,
    unit: &'static str,
    tolerance: Option<Tolerance>,
    shipped_tolerance: Option<Tolerance>,
    origin: Option<&'a Origin>,
}

impl ParameterRow<'_> {
    fn differs(&self) -> bool {
        self.value.to_bits() != self.shipped.to_bits() || self.tolerance != self.shipped_tolerance
    }

    /// Where the value comes from: what the file says of it, and the place in the file.
    fn source(&self) -> String {
        let Some(origin) = self.origin else { return String::new() };
        let place = match (&origin.file, origin.line) {
            (None, _) => return origin.source.clone(),
            (Some(file), Some(line)) => format!("{}:{line}", file.display()),
            (Some(file), None) => file.display().to_string(),
        };
        if origin.source.is_empty() { place } else { format!("{} ({place})", origin.source) }
    }
}

fn rows(sheet: &Sheet) -> Vec<ParameterRow<'_>> {
    let shipped = params::reference();
    let tolerances = sheet.unit.tolerances.iter().zip(&shipped.tolerances);
    let parameters = ENTRIES.iter().zip(tolerances).map(|(entry, (tolerance, shipped_tolerance))| ParameterRow {
        key: entry.key.to_owned(),
        value: (entry.get)(&sheet.unit.parameters),
        shipped: (entry.get)(&shipped.parameters),
        unit: entry.unit,
        tolerance: *tolerance,
        shipped_tolerance: *shipped_tolerance,
        origin: sheet.origins.get(entry.key),
    });
    let sensors = SENSOR_ENTRIES.iter().flat_map(|entry| {
        let (sensor, shipped) = ((entry.get)(&sheet.unit.sensors), (entry.get)(&shipped.sensors));
        let key = format!("sensors.{}", entry.name);
        [("noise", sensor.noise, shipped.noise), ("step", sensor.step, shipped.step)].map(|(what, value, shipped)| {
            ParameterRow {
                key: format!("{key}.{what}"),
                value,
                shipped,
                unit: entry.unit,
                tolerance: None,
                shipped_tolerance: None,
                origin: sheet.origins.get(&key),
            }
        })
    });
    parameters.chain(sensors).collect()
}

fn table(file: &Path, sheet: &Sheet, rows: &[ParameterRow]) -> String {
    let name = if sheet.name.is_empty() { "unnamed unit" } else { &sheet.name };
    let layers: Vec<String> = sheet.files.iter().rev().map(|file| file.display().to_string()).collect();
    let differing = rows.iter().filter(|row| row.differs()).count();
    let mut lines = vec![
        format!("{}: valid ({name})", file.display()),
        format!(
            "{}, over the shipped reference unit; {differing} of {} values differ from it (*)",
            layers.join(", over "),
            rows.len()
        ),
        String::new(),
    ];

    let heads = ["", "key", "value", "tolerance", "shipped", "source"].map(str::to_owned);
    let cells = rows.iter().map(|row| {
        let tolerance =
            |tolerance: Option<Tolerance>| tolerance.map(|known| tolerance_text(known, row.unit)).unwrap_or_default();
        let mut shipped = String::new();
        if row.value.to_bits() != row.shipped.to_bits() {
            shipped = number_text(row.shipped);
        }
        if row.tolerance != row.shipped_tolerance {
            let _ = write!(
                shipped,
                " {}",
                row.shipped_tolerance.map_or_else(|| "none".to_owned(), |known| tolerance_text(known, row.unit))
            );
        }
        let mark = if row.differs() { "*" } else { "" }.to_owned();
        let value = quantity_text(row.value, row.unit);
        [mark, row.key.clone(), value, tolerance(row.tolerance), shipped.trim_start().to_owned(), row.source()]
    });
    let cells: Vec<[String; 6]> = std::iter::once(heads).chain(cells).collect();
    let mut widths = [0; 6];
    for row in &cells {
        for (width, cell) in widths.iter_mut().zip(row) {
            *width = cell.chars().count().max(*width);
        }
    }
    for row in &cells {
        let padded: Vec<String> = row.iter().zip(widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        lines.push(padded.join("  ").trim_end().to_owned());
    }

    lines.push(String::new());
    if sheet.unit.effects.is_empty() {
        lines.push("effects: none".to_owned());
    }
    for setting in &sheet.unit.effects {
        let values: Vec<String> = effect_values(&sheet.unit, &setting.id, &setting.values)
            .map(|(name, unit, value)| format!("{name} {}", quantity_text(value, unit)))
            .collect();
        lines.push(format!("effect {}: {}", setting.id, values.join(", ")));
        if let Some(own) = sheet.unit.own_effects.iter().find(|own| own.id == setting.id) {
            lines.push(format!("  adds to {}: {}", own.at, own.expression));
        }
    }
    lines.push(String::new());
    lines.join("\n")
}

fn effect_values<'a>(
    unit: &Unit,
    id: &str,
    values: &'a [f64],
) -> impl Iterator<Item = (&'static str, &'static str, f64)> + 'a {
    let known = find_in(unit, id).map_or(&[][..], |spec| spec.parameters);
    known.iter().zip(values).map(|(parameter, value)| (parameter.name, parameter.unit, *value))
}

fn to_json(sheet: &Sheet, rows: &[ParameterRow]) -> Value {
    let values: serde_json::Map<String, Value> = rows
        .iter()
        .map(|row| {
            let tolerance = row.tolerance.map(|tolerance| match tolerance {
                Tolerance::Relative(spread) => json!({"kind": "relative", "value": spread}),
                Tolerance::Absolute(spread) => json!({"kind": "absolute", "value": spread}),
                Tolerance::LogNormal(spread) => json!({"kind": "log_normal", "value": spread}),
            });
            let value = json!({
                "value": row.value, "unit": row.unit, "tolerance": tolerance, "shipped": row.shipped,
                "differs": row.differs(), "source": row.origin.map(|origin| &origin.source),
                "file": row.origin.and_then(|origin| origin.file.as_ref()),
                "line": row.origin.and_then(|origin| origin.line),
            });
            (row.key.clone(), value)
        })
        .collect();
    let effects: serde_json::Map<String, Value> = sheet
        .unit
        .effects
        .iter()
        .map(|setting| {
            let values = effect_values(&sheet.unit, &setting.id, &setting.values)
                .map(|(name, _, value)| (name.to_owned(), json!(value)));
            (setting.id.clone(), Value::Object(values.collect()))
        })
        .collect();
    json!({"schema": "govtwin-check/1", "name": sheet.name, "files": sheet.files, "values": values, "effects": effects})
}
