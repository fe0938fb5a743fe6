//! `govtwin calibrate`: learn the weights of the diagnosis's posterior from judged units whose faults are known.

use std::path::PathBuf;

use anyhow::{Context, bail};
use govtwin::battery::Label;
use govtwin::blind::learn::{Example, examples, learn, size_spread};
use govtwin::blind::said::Said;
use govtwin::diagnosis::posterior::Weights;
use govtwin::diagnosis::table::Table;
use govtwin::params::labels;

use super::output::{print, write_atomically};
use crate::commands::Outcome;

/// Parts that a single battery is cut into, each judged by what the others taught.
const PARTS: usize = 5;

/// Arguments of `govtwin calibrate`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Folders that `govtwin blind --generate` made and judged to the end.
    #[arg(value_name = "DIR", required = true)]
    dirs: Vec<PathBuf>,
    /// File to write the weights to.
    #[arg(long, value_name = "FILE", default_value = "diagnosis_weights.json")]
    out: PathBuf,
}

const HELP: &str = "\
The diagnosis weighs every fault set by its evidence; how far evidence can be trusted where no equation is exact, it has to learn. This
command reads the evidence tables in DIR/UNIT/report.json and the answers in DIR/answers/labels.yaml, fits the few weights by log score, and
says how they do on units that they have not seen: with several folders each is judged by the others, with one it is cut into five parts.

The program ships with the weights in params/diagnosis_weights.json; it takes others when it is built anew with that file replaced.

Exit codes: 0 ok, 1 not possible, 2 wrong usage.";

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let mut batteries: Vec<Vec<(Label, Table)>> = Vec::new();
    for dir in &args.dirs {
        let path = dir.join("answers/labels.yaml");
        let text = std::fs::read_to_string(&path).with_context(|| {
            format!("cannot read {}; was `govtwin blind --generate` run to the end?", path.display())
        })?;
        let known = labels::read(&text).with_context(|| path.display().to_string())?;
        let mut units = Vec::new();
        for label in known {
            let path = dir.join(&label.name).join("report.json");
            let Ok(text) = std::fs::read_to_string(&path) else { continue };
            let table = Said::read(&text).with_context(|| path.display().to_string())?.evidence.table;
            if table.rows.is_empty() {
                bail!(
                    "{}: expected an evidence table, found none; is it a report of an older program?",
                    path.display()
                );
            }
            units.push((label, table));
        }
        if units.is_empty() {
            bail!("{}: expected reports beside the answers, found none", dir.display());
        }
        batteries.push(units);
    }
    let all: Vec<&(Label, Table)> = batteries.iter().flatten().collect();
    let of = |units: &[&(Label, Table)]| -> Vec<Example> {
        units.iter().flat_map(|(label, table)| examples(label, table)).collect()
    };
    let parts: Vec<Vec<Example>> = match batteries.as_slice() {
        [one] => (0..PARTS)
            .map(|part| of(&one.iter().skip(part).step_by(PARTS).collect::<Vec<_>>()))
            .filter(|part| !part.is_empty())
            .collect(),
        several => several.iter().map(|units| of(&units.iter().collect::<Vec<_>>())).collect(),
    };
    let learned = learn(&parts);
    let pairs: Vec<(&Label, &Table)> = all.iter().map(|(label, table)| (label, table)).collect();
    let bayes = Weights::bayes();
    let weights = Weights {
        weights: learned.weights.clone(),
        size_spread: size_spread(&pairs),
        provenance: serde_json::json!({
            "program": env!("CARGO_PKG_VERSION"),
            "folders": args.dirs.iter().map(|dir| dir.file_name().map(|name| name.to_string_lossy().into_owned())).collect::<Vec<_>>(),
            "units": all.len(),
            "units_are": "synthetic, made by `govtwin blind --generate`",
            "log_score": {"bayes": learned.bayes, "held_out": learned.held_out, "seen": learned.seen},
            "first_word_right_held_out": learned.held_out_right,
        }),
        ..bayes
    };
    let mut text = serde_json::to_string_pretty(&weights)?;
    text.push('\n');
    write_atomically(&args.out, text.as_bytes())?;
    let mut lines = format!(
        "{} units. Mean log score: {:.3} by evidence alone, {:.3} learned, on units not seen; {:.3} on those seen.\n\
         First word right on units not seen: {:.0} %.\n",
        all.len(),
        learned.bayes,
        learned.held_out,
        learned.seen,
        100.0 * learned.held_out_right
    );
    for (name, weight) in weights.features.iter().zip(&weights.weights) {
        lines += &format!("{weight:9.3}  {name}\n");
    }
    print(&lines)?;
    Ok(Outcome::Ok)
}
