//! `govtwin calibrate`: learn the numbers of the diagnosis's posterior from judged units whose faults are known.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use govtwin_diagnosis::decision::hyperparameters::Hyperparameters;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_files::read_text;
use govtwin_lab::battery::Label;
use govtwin_lab::benchmark::learn::{Example, examples, learn, log_score, size_spread};
use govtwin_lab::benchmark::rejudge::rejudged;
use govtwin_lab::benchmark::score::{Score, score};
use govtwin_lab::benchmark::scored::ScoredUnit;
use govtwin_lab::labels;

use super::output::{claim_place, print, write_atomically};
use super::report_file;
use super::report_file::{LARGEST_BYTES, is_there, text_if_there};
use crate::commands::Outcome;

/// Parts that a single battery is cut into, each judged by what the others taught.
const PARTS: usize = 5;

/// Arguments of `govtwin calibrate`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Folders that `govtwin blind --generate` has generated, diagnosed and scored.
    #[arg(value_name = "DIR", required = true)]
    dirs: Vec<PathBuf>,
    /// File for the learned numbers.
    #[arg(long, value_name = "FILE", default_value = "posterior.json")]
    out: PathBuf,
    /// Print JSON instead of tables: the numbers, as in FILE.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
The posterior of the diagnosis has seven global numbers that say how far equations and noise may be
trusted, and one that says how wide intervals of sizes are. This command reads the evidence tables in
DIR/UNIT/report.json and the answers in DIR/answers/labels.yaml, and fits the numbers by log score.
It scores them on units that were not used in learning: with several folders each is scored with
the numbers of the others. One folder is cut by the mismatch of its plants, or into five parts.

For comparison, the same units are scored with
  as shipped       the shipped numbers; too favourable if they were learned on these folders
  not learned      round numbers of the right size
Nothing is simulated.

The program contains the numbers of params/posterior.json; to use others, replace that file and
rebuild. What the folders do not show stays as shipped.

Example:
  govtwin calibrate 8201 8202 8203 8204    # folders of `blind --generate`

Exit codes: 0 ok, 1 not possible, 2 wrong usage.";

/// A unit: its answer, what was said of it, and which share of the gap was closed on recordings made afterwards.
struct JudgedUnit {
    label: Label,
    report: DiagnosisReport,
    came_true: Option<f64>,
}

impl JudgedUnit {
    /// What it would have been judged to be by other numbers.
    fn rejudged(&self, numbers: &Hyperparameters) -> ScoredUnit {
        let report = rejudged(&self.report, &self.report.evidence.table, numbers);
        let (label, realised_fraction) = (self.label.clone(), self.came_true);
        ScoredUnit { report, label, realised_fraction, expected_log_bayes_factor: None }
    }
}

/// Whose numbers judge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum NumbersOf {
    /// Those learned on the other parts.
    Others,
    /// Nothing learned.
    Usual,
    /// Those that the program ships with.
    Shipped,
}

/// Whose numbers are scored, by name.
const VARIANTS: [(&str, NumbersOf); 3] =
    [("learned", NumbersOf::Others), ("as shipped", NumbersOf::Shipped), ("not learned", NumbersOf::Usual)];

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let _claim = claim_place("--out", &args.out)?;
    let batteries = args.dirs.iter().map(|dir| read(dir)).collect::<anyhow::Result<Vec<_>>>()?;
    let shipped = Hyperparameters::shipped();
    let (names, parts) = parted(&args.dirs, &batteries);
    let of = |units: &Vec<&JudgedUnit>| -> Vec<Example> {
        units.iter().flat_map(|unit| examples(&unit.label, &unit.report.evidence.table)).collect()
    };
    let all: Vec<Vec<Example>> = parts.iter().map(of).collect();
    let learned = learn(&all);
    let mut scores = Vec::new();
    let mut by_part = Vec::new();
    for (name, numbers_of) in VARIANTS {
        let mut cases = Vec::new();
        for (part, units) in parts.iter().enumerate() {
            let numbers = match numbers_of {
                NumbersOf::Others => {
                    let others =
                        parts.iter().enumerate().filter(|(other, _)| *other != part).flat_map(|(_, units)| units);
                    counted(learned.of_others[part].clone(), &others.copied().collect::<Vec<_>>(), &shipped)
                }
                NumbersOf::Usual => counted(Hyperparameters::usual(), &[], &shipped),
                NumbersOf::Shipped => shipped.clone(),
            };
            let judged: Vec<ScoredUnit> = units.iter().map(|unit| unit.rejudged(&numbers)).collect();
            if let Some(name) = names.get(part).filter(|_| numbers_of == NumbersOf::Others) {
                by_part.push((name.clone(), log_score(&all[part], &numbers), score(&judged)));
            }
            cases.extend(judged);
        }
        let mean = match numbers_of {
            NumbersOf::Others => learned.held_out,
            NumbersOf::Usual => learned.usual,
            NumbersOf::Shipped => log_score(&all.concat(), &shipped),
        };
        scores.push((name.to_owned(), mean, score(&cases)));
    }
    let units: Vec<&JudgedUnit> = batteries.iter().flatten().collect();
    let numbers = Hyperparameters {
        provenance: serde_json::json!({
            "program": env!("CARGO_PKG_VERSION"),
            "folders": args.dirs.iter().map(|dir| folder(dir)).collect::<Vec<_>>(),
            "units": units.len(),
            "units_are": "synthetic, made by `govtwin blind --generate`",
            "log_score": {"not_learned": learned.usual, "held_out": learned.held_out, "seen": learned.seen},
            "first_word_right_held_out": learned.held_out_right,
            "reliability": reliability(&scores),
        }),
        ..counted(learned.numbers.clone(), &units, &shipped)
    };
    let mut text = serde_json::to_string_pretty(&numbers)?;
    text.push('\n');
    write_atomically(&args.out, text.as_bytes())?;
    let mut lines = format!(
        "{} units. Mean log score: {:.3} not learned; {:.3} learned, on held-out units; {:.3} learned, on the same units.\n\
         Most probable answer right on held-out units: {:.0} %.\n\n",
        units.len(),
        learned.usual,
        learned.held_out,
        learned.seen,
        100.0 * learned.held_out_right
    );
    for (name, value) in numbers.named() {
        lines += &format!("{value:9.3}  {name}\n");
    }
    lines += &told("On held-out units", &scores);
    lines += &bins(&scores);
    lines += &told("By folder or mismatch, each with the numbers of the others", &by_part);
    print(if args.json { &text } else { &lines })?;
    Ok(Outcome::Ok)
}

/// The units in parts that are each judged by what the others taught, with the names of the parts where they have any: folders, the mismatches of one
/// folder, or every fifth unit.
fn parted<'a>(dirs: &[PathBuf], batteries: &'a [Vec<JudgedUnit>]) -> (Vec<String>, Vec<Vec<&'a JudgedUnit>>) {
    let [one] = batteries else {
        return (
            dirs.iter().map(|dir| folder(dir)).collect(),
            batteries.iter().map(|units| units.iter().collect()).collect(),
        );
    };
    let mut levels: Vec<f64> = one.iter().map(|unit| unit.label.mismatch).filter(|level| level.is_finite()).collect();
    levels.sort_by(f64::total_cmp);
    levels.dedup();
    if levels.len() > 1 {
        let of = |level: &f64| one.iter().filter(|unit| unit.label.mismatch == *level).collect();
        return (levels.iter().map(|level| format!("mismatch {level}")).collect(), levels.iter().map(of).collect());
    }
    let fifth = |part: usize| one.iter().skip(part).step_by(PARTS).collect::<Vec<_>>();
    (Vec::new(), (0..PARTS).map(fifth).filter(|part| !part.is_empty()).collect())
}

/// The numbers with those that are counted on these units; what they do not show stays as shipped.
fn counted(numbers: Hyperparameters, units: &[&JudgedUnit], shipped: &Hyperparameters) -> Hyperparameters {
    let pairs: Vec<(&Label, &DiagnosisReport)> = units.iter().map(|unit| (&unit.label, &unit.report)).collect();
    Hyperparameters { size_spread: size_spread(&pairs).unwrap_or(shipped.size_spread), ..numbers }
}

/// The name of a folder.
fn folder(dir: &Path) -> String {
    dir.file_name().map_or_else(|| dir.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// How often what was said with a probability was so, on units not seen: pages set it beside such claims.
fn reliability(scores: &[(String, f64, Score)]) -> Vec<serde_json::Value> {
    let bins = scores.first().into_iter().flat_map(|(_, _, learned)| &learned.reliability);
    bins.map(|bin| serde_json::json!({"said": bin.stated_probability, "was": bin.was.value, "units": bin.was.cases}))
        .collect()
}

/// The units of a battery that have a report, with their answers.
fn read(dir: &Path) -> anyhow::Result<Vec<JudgedUnit>> {
    let path = dir.join("answers/labels.yaml");
    let text = read_text(&path, LARGEST_BYTES)
        .with_context(|| format!("cannot read {}; was `govtwin blind --generate` run to the end?", path.display()))?;
    let known = labels::read(&text).with_context(|| path.display().to_string())?;
    let strengths = text_if_there(&dir.join("answers/strengths.yaml"), LARGEST_BYTES)?.unwrap_or_default();
    let strengths = labels::read_strengths(&strengths).unwrap_or_default();
    // Closures are examined after all units are judged; a battery that was broken off has none.
    let scored = text_if_there(&dir.join("score.json"), LARGEST_BYTES)?.unwrap_or_default();
    let scored: serde_json::Value = serde_json::from_str(&scored).unwrap_or_default();
    let mut units = Vec::new();
    for label in known {
        let path = dir.join(&label.name).join("report.json");
        if !is_there(&path)? {
            continue;
        }
        let report = report_file::diagnosis(&path)?;
        if report.evidence.table.rows.is_empty() {
            bail!("{}: expected an evidence table, found none; is it a report of an older program?", path.display());
        }
        let came_true = scored["closures"][label.name.as_str()].as_f64();
        let strength_ratio = strengths.get(&label.name).copied().unwrap_or(label.strength_ratio);
        units.push(JudgedUnit { label: Label { strength_ratio, ..label }, report, came_true });
    }
    if units.is_empty() {
        bail!("{}: expected reports beside the answers, found none", dir.display());
    }
    Ok(units)
}

/// All measures, one column a score; nothing where there is none.
fn told(title: &str, scores: &[(String, f64, Score)]) -> String {
    let Some((_, _, first)) = scores.first() else { return String::new() };
    let mut text = format!("\n{title}:\n");
    let row = |text: &mut String, name: &str, cells: &mut dyn Iterator<Item = String>| {
        *text += &format!("{name:<58}");
        cells.for_each(|cell| *text += &format!("{cell:>16}"));
        *text += "\n";
    };
    row(&mut text, "", &mut scores.iter().map(|(name, ..)| name.clone()));
    row(&mut text, "mean log score", &mut scores.iter().map(|(_, log_score, _)| format!("{log_score:.3}")));
    for (k, measure) in first.measures.iter().enumerate() {
        if scores.iter().all(|(_, _, score)| score.measures[k].measured.cases == 0) || measure.id == "seconds" {
            continue;
        }
        let cell = |score: &Score| {
            let measured = score.measures[k].measured;
            if measured.cases == 0 { "none".to_owned() } else { format!("{:.2} of {}", measured.value, measured.cases) }
        };
        row(&mut text, measure.name, &mut scores.iter().map(|(_, _, score)| cell(score)));
    }
    text
}

/// Probabilities said on units not seen, and how often it was so.
fn bins(scores: &[(String, f64, Score)]) -> String {
    let mut text = "\nStated probability, and share that was true:\n".to_owned();
    for bin in scores.first().into_iter().flat_map(|(_, _, learned)| &learned.reliability) {
        let was = bin.was;
        text += &format!(
            "{:6.2}   {:.2} [{:.2}, {:.2}] of {}\n",
            bin.stated_probability, was.value, was.low, was.high, was.cases
        );
    }
    text
}
