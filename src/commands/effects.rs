//! `govtwin effects`: what the catalogue holds, and the documentation of one effect.

use govtwin_model::effects::{CATALOGUE, EffectParameter, EffectSpec, Stage};
use govtwin_model::params::{number_text, quantity_text};
use govtwin_pages::table;
use serde_json::{Value, json};

use crate::commands::output::{print, width};
use crate::commands::{Outcome, unknown};

/// Arguments of `govtwin effects`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Effect to document; without it, all effects are listed.
    id: Option<String>,
    /// Print JSON instead of text.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
An effect is a departure of a real unit from the nominal model: a dead zone, a delay, a clogged
filter. Each effect has one to three parameters, and neutral values at which it is exactly absent.
Every command that takes a parameter file simulates the effects that the file names:

  effects:
    port_overlap: {extra_overlap_m: 2.0e-4}
    esv_delay: {delay_s: 0.3}

A parameter that is not given is neutral. Effects combine, and their order does not matter.

Examples:
  govtwin effects
  govtwin effects backlash
  govtwin effects --json | jq '.effects[] | {id, summary}'

Exit codes: 0 ok, 2 wrong usage, such as an effect that does not exist.";

/// Prints the catalogue, or one effect.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let text = match (&args.id, args.json) {
        (None, false) => listing(),
        (None, true) => to_text(&json!({"schema": "govtwin-effects/1", "effects": entries(CATALOGUE)})),
        (Some(id), json) => {
            let Some(spec) = govtwin_model::effects::find(id) else {
                let known = CATALOGUE.iter().map(|spec| spec.id);
                return Err(unknown(&format!("there is no effect `{id}`"), id, known, "govtwin effects"));
            };
            if json { to_text(&entry(spec)) } else { page(spec) }
        }
    };
    print(&text)?;
    Ok(Outcome::Ok)
}

fn listing() -> String {
    let mut text = String::new();
    for stage in Stage::ALL {
        text.push_str(&format!("{}\n", stage.id()));
        for spec in CATALOGUE.iter().filter(|spec| spec.stage == stage) {
            let summary = plain(&spec.head().summary);
            let name = summary.split(':').next().unwrap_or_default().trim_end_matches('.');
            text.push_str(&format!("  {:16} {name}\n", spec.id));
            for parameter in spec.parameters {
                text.push_str(&format!("  {:16}   {}: {}\n", "", parameter.name, range(parameter)));
            }
        }
    }
    text.push_str("\n`govtwin effects ID` shows equation, source, symptom and limits.\n");
    text
}

fn page(spec: &EffectSpec) -> String {
    let head = spec.head();
    let mut text = format!("{} (stage {})\n\n{}\n\n", spec.id, spec.stage.id(), wrapped(&head.summary));
    text.push_str(&format!("Equation\n{}\n\n", wrapped(&head.equation)));
    let width = |k: usize| head.symbols.iter().map(|row| plain(&row[k]).chars().count()).max().unwrap_or(0);
    let (first, second) = (width(0), width(1));
    for [symbol, meaning, unit] in &head.symbols {
        text.push_str(&format!("  {:first$}  {:second$}  {unit}\n", plain(symbol), plain(meaning)));
    }
    text.push_str("\nParameters\n");
    for parameter in spec.parameters {
        text.push_str(&format!("  {}: {}\n    {}\n", parameter.name, parameter.doc, range(parameter)));
    }
    text.push_str(&format!("\nSymptom\n{}\n\nLimits\n{}\n\n", wrapped(&head.symptom), wrapped(&head.limits)));
    text.push_str("In a parameter file\n");
    for line in snippet(spec).lines() {
        text.push_str(&format!("  {line}\n"));
    }
    text
}

/// The lines that switch it on in a parameter file, at its typical size.
fn snippet(spec: &EffectSpec) -> String {
    let values: Vec<String> = spec
        .parameters
        .iter()
        .map(|parameter| format!("{}: {}", parameter.name, number_text(parameter.typical)))
        .collect();
    format!("effects:\n  {}: {{{}}}\n", spec.id, values.join(", "))
}

fn range(parameter: &EffectParameter) -> String {
    let scaling = parameter.scaling.words().map_or(String::new(), |words| {
        format!("; on another unit range and typical value are in proportion to {words}")
    });
    format!(
        "neutral {}, range {} to {}, typical {}{scaling}",
        number_text(parameter.neutral),
        number_text(parameter.min),
        quantity_text(parameter.max, parameter.unit),
        quantity_text(parameter.typical, parameter.unit),
    )
}

fn entries(specs: &[EffectSpec]) -> Vec<Value> {
    specs.iter().map(entry).collect()
}

fn entry(spec: &EffectSpec) -> Value {
    let head = spec.head();
    let parameters: Vec<Value> = spec
        .parameters
        .iter()
        .map(|p| {
            json!({
                "name": p.name, "unit": p.unit, "doc": p.doc,
                "neutral": p.neutral, "min": p.min, "max": p.max, "typical": p.typical,
                "proportional_to": p.scaling.words(),
            })
        })
        .collect();
    let symbols: Vec<Value> = head
        .symbols
        .iter()
        .map(|[symbol, meaning, unit]| json!({"symbol": symbol, "meaning": plain(meaning), "unit": unit}))
        .collect();
    json!({
        "id": spec.id, "stage": spec.stage.id(), "summary": plain(&head.summary), "equation": head.equation,
        "symbols": symbols, "parameters": parameters, "symptom": plain(&head.symptom), "limits": plain(&head.limits),
        "yaml": snippet(spec),
    })
}

fn to_text(value: &Value) -> String {
    format!("{value:#}\n")
}

/// Without the marks of code and emphasis.
fn plain(text: &str) -> String {
    text.replace(['`', '*'], "")
}

/// Lines of at most 98 characters, or as many as the terminal has room for, indented by two.
fn wrapped(text: &str) -> String {
    let lines = table::wrapped(&plain(text), width().min(100) - 2);
    lines.into_iter().map(|line| format!("  {line}")).collect::<Vec<_>>().join("\n")
}
