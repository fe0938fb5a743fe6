//! `govtwin calibrate`: learn the weights of the diagnosis's posterior from judged units whose faults are known.

use govtwin_lab::benchmark::scored_report::ScoredReport as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use govtwin_diagnosis::decision::weights::{Questions, Weights};
use govtwin_diagnosis::result::Interval;
use govtwin_diagnosis::result::schema::DiagnosisReport;
use govtwin_files::read_text;
use govtwin_lab::battery::Label;
use govtwin_lab::benchmark::learn::{
    Example, LearningResult, examples, explained_fraction_widening, learn, log_score, size_spread,
};
use govtwin_lab::benchmark::rejudge::{EvidenceLeftOut, rejudged};
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
    /// Keep the shipped weights for this question; may be repeated.
    ///
    /// Use it for a question whose evidence has not changed, if the units from which the shipped weights were learned
    /// are not available.
    #[arg(long, value_name = "QUESTION")]
    keep: Vec<LearnedQuestion>,
    /// File for the learned weights.
    #[arg(long, value_name = "FILE", default_value = "diagnosis_weights.json")]
    out: PathBuf,
    /// Print JSON instead of tables: the weights, as in FILE.
    #[arg(long)]
    json: bool,
}

/// A question that is answered by weights of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum LearnedQuestion {
    /// Which fault set is present, if nothing is unknown.
    Sets,
    /// Whether something unknown is present.
    Unknown,
    /// At which stage the unknown is.
    Stages,
    /// How wide the intervals of sizes and of the explained fraction are.
    Intervals,
}

/// Weights with those of the questions that are kept.
fn with_kept(mut weights: Weights, shipped: &Weights, kept: &[LearnedQuestion]) -> Weights {
    for question in kept {
        match question {
            LearnedQuestion::Sets => weights.sets.clone_from(&shipped.sets),
            LearnedQuestion::Unknown => weights.unknown.clone_from(&shipped.unknown),
            LearnedQuestion::Stages => weights.stages.clone_from(&shipped.stages),
            LearnedQuestion::Intervals => {
                weights.size_spread = shipped.size_spread;
                weights.explained_fraction_widening = shipped.explained_fraction_widening;
            }
        }
    }
    weights
}

const HELP: &str = "\
Because no equation is exact, the posterior gives the evidence learned weights. This command reads
the evidence tables in DIR/UNIT/report.json and the answers in DIR/answers/labels.yaml, and fits
the few weights by log score. It scores them on units that were not used in learning: with several
folders each is scored with the weights of the others; one folder is cut into five parts.

For comparison, the same units are scored with
  as shipped       the shipped weights; too favourable if they were learned on these folders
  not learned      the evidence as it is, by Bayes' theorem
  no model error   evidence without the equation error, learned again
  single effects   evidence without sets of several effects, learned again
  no unknown       evidence without something unknown, learned again
Nothing is simulated.

The program contains the weights of params/diagnosis_weights.json, of assumed_sheet_weights.json
for units without a data sheet (`blind --no-sheet`), and of stage_weights.json for servomotor stages
alone; to use others, replace that file and rebuild. Weights for units without a data sheet are
learned as deviations from those for units with one.

Example:
  govtwin calibrate 8201 8202 8203 8204    # folders of `blind --generate`

Exit codes: 0 ok, 1 not possible, 2 wrong usage.";

/// A unit: its answer, what was said of it, and which share of the gap was closed on recordings made afterwards.
struct JudgedUnit {
    label: Label,
    report: DiagnosisReport,
    /// By how much the interval of the share explained was widened.
    widened_by: f64,
    came_true: Option<f64>,
}

impl JudgedUnit {
    /// What it claims of the share explained, with the interval as it was before it was widened.
    fn explained_fraction(&self, report: &DiagnosisReport) -> Option<Interval> {
        Some(report.explained_fraction()?.widened(1.0 / self.widened_by))
    }

    /// What it would have been judged to be by other weights, with a part of the evidence left out and the interval of the share widened.
    fn rejudged(&self, left_out: EvidenceLeftOut, weights: &Weights, widening: f64) -> ScoredUnit {
        let mut report = rejudged(&self.report, &left_out.of(&self.report.evidence.table), weights);
        if let Some(claim) = self.explained_fraction(&report) {
            report.gap.explained_fraction = claim.widened(widening);
        }
        let (label, realised_fraction) = (self.label.clone(), self.came_true);
        ScoredUnit { report, label, realised_fraction, expected_log_bayes_factor: None }
    }

    /// The same of the report, beside what came true.
    fn claim(&self) -> Option<(Interval, f64)> {
        Some((self.explained_fraction(&self.report)?, self.came_true?))
    }
}

/// Whose weights judge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum WeightsOf {
    /// Those learned on the other parts.
    Others,
    /// Evidence as it is, by Bayes' theorem.
    Bayes,
    /// Those that the program ships with.
    Shipped,
}

/// Variants that are scored on units not seen, by name: what is left out of the evidence, and whose weights judge.
const VARIANTS: [(&str, EvidenceLeftOut, WeightsOf); 6] = [
    ("learned", EvidenceLeftOut::Nothing, WeightsOf::Others),
    ("as shipped", EvidenceLeftOut::Nothing, WeightsOf::Shipped),
    ("not learned", EvidenceLeftOut::Nothing, WeightsOf::Bayes),
    ("no model error", EvidenceLeftOut::ModelError, WeightsOf::Others),
    ("single effects", EvidenceLeftOut::SeveralEffects, WeightsOf::Others),
    ("no unknown", EvidenceLeftOut::Unknown, WeightsOf::Others),
];

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let _claim = claim_place("--out", &args.out)?;
    let batteries = args.dirs.iter().map(|dir| read(dir)).collect::<anyhow::Result<Vec<_>>>()?;
    let questions = questions(&batteries)?;
    let shipped = questions.shipped();
    let parts: Vec<Vec<&JudgedUnit>> = match batteries.as_slice() {
        [one] => (0..PARTS)
            .map(|part| one.iter().skip(part).step_by(PARTS).collect::<Vec<_>>())
            .filter(|part| !part.is_empty())
            .collect(),
        several => several.iter().map(|units| units.iter().collect()).collect(),
    };
    let mut scores = Vec::new();
    let mut by_folder = Vec::new();
    let mut whole: Option<LearningResult> = None;
    for (name, left_out, weights_of) in VARIANTS {
        let of = |units: &Vec<&JudgedUnit>| -> Vec<Example> {
            let table = |report: &DiagnosisReport| left_out.of(&report.evidence.table);
            units.iter().flat_map(|unit| examples(&unit.label, &table(&unit.report))).collect()
        };
        let examples: Vec<Vec<Example>> = parts.iter().map(of).collect();
        let learned = learn(&examples, questions, &|weights| with_kept(weights, &shipped, &args.keep));
        let weights = |part: usize| match weights_of {
            WeightsOf::Others => learned.of_others[part].clone(),
            WeightsOf::Bayes => questions.bayes(),
            WeightsOf::Shipped => shipped.clone(),
        };
        let mut cases = Vec::new();
        for (part, units) in parts.iter().enumerate() {
            let others = parts.iter().enumerate().filter(|(other, _)| *other != part).flat_map(|(_, units)| units);
            let widening = match weights_of {
                WeightsOf::Shipped => shipped.explained_fraction_widening,
                WeightsOf::Others | WeightsOf::Bayes => {
                    explained_fraction_widening(&others.filter_map(|unit| unit.claim()).collect::<Vec<_>>())
                }
            };
            let weights = weights(part);
            let judged: Vec<ScoredUnit> =
                units.iter().map(|unit| unit.rejudged(left_out, &weights, widening)).collect();
            if whole.is_none() && batteries.len() > 1 {
                by_folder.push((folder(&args.dirs[part]), log_score(&examples[part], &weights), score(&judged)));
            }
            cases.extend(judged);
        }
        let mean = match weights_of {
            WeightsOf::Others => learned.held_out,
            WeightsOf::Bayes => learned.bayes,
            WeightsOf::Shipped => log_score(&examples.concat(), &shipped),
        };
        scores.push((name.to_owned(), mean, score(&cases)));
        whole.get_or_insert(learned);
    }
    let Some(learned) = whole else { bail!("there is nothing to learn from") };
    let all: Vec<&JudgedUnit> = batteries.iter().flatten().collect();
    let pairs: Vec<(&Label, &DiagnosisReport)> = all.iter().map(|unit| (&unit.label, &unit.report)).collect();
    let claims: Vec<(Interval, f64)> = all.iter().filter_map(|unit| unit.claim()).collect();
    let learned_weights = Weights {
        size_spread: size_spread(&pairs),
        explained_fraction_widening: explained_fraction_widening(&claims),
        provenance: serde_json::json!({
            "program": env!("CARGO_PKG_VERSION"),
            "folders": args.dirs.iter().map(|dir| folder(dir)).collect::<Vec<_>>(),
            "units": all.len(),
            "units_are": "synthetic, made by `govtwin blind --generate`",
            "log_score": {"not_learned": learned.bayes, "held_out": learned.held_out, "seen": learned.seen},
            "first_word_right_held_out": learned.held_out_right,
            "reliability": reliability(&scores),
            "kept": kept(&args.keep, &shipped),
        }),
        ..learned.weights.clone()
    };
    let weights = with_kept(learned_weights, &shipped, &args.keep);
    let mut text = serde_json::to_string_pretty(&weights)?;
    text.push('\n');
    write_atomically(&args.out, text.as_bytes())?;
    let mut lines = format!(
        "{} units. Mean log score: {:.3} not learned; {:.3} learned, on held-out units; {:.3} learned, on the same units.\n\
         Most probable answer right on held-out units: {:.0} %.\n\n",
        all.len(),
        learned.bayes,
        learned.held_out,
        learned.seen,
        100.0 * learned.held_out_right
    );
    let groups = ["Fault sets", "Something unknown", "Stages"].into_iter().zip(&weights.features);
    for ((group, names), of) in groups.zip([&weights.sets, &weights.unknown, &weights.stages]) {
        lines += &format!("{group}:\n");
        for (name, weight) in names.iter().zip(of) {
            lines += &format!("{weight:9.3}  {name}\n");
        }
    }
    lines += &told("On held-out units", &scores);
    lines += &bins(&scores);
    lines += &told("By folder, each with the weights of the others", &by_folder);
    print(if args.json { &text } else { &lines })?;
    Ok(Outcome::Ok)
}

/// What is asked of these units: whole chains, or servomotor stages alone.
fn questions(batteries: &[Vec<JudgedUnit>]) -> anyhow::Result<&'static Questions> {
    let mut asked = batteries.iter().flatten().map(|unit| Questions::of(&unit.report.evidence.table));
    let Some(first) = asked.next() else { bail!("there is nothing to learn from") };
    if asked.any(|other| !std::ptr::eq(other, first)) {
        bail!(
            "expected units of one kind, found several of whole chains with a data sheet, without one, and servomotor stages alone: learn \
             each from folders of its own"
        );
    }
    Ok(first)
}

/// Questions whose weights were kept, and where these were learned.
fn kept(questions: &[LearnedQuestion], shipped: &Weights) -> serde_json::Value {
    let names = questions.iter().filter_map(clap::ValueEnum::to_possible_value).map(|name| name.get_name().to_owned());
    let names: Vec<String> = names.collect();
    let of = |key: &str| shipped.provenance[key].clone();
    if names.is_empty() {
        return serde_json::Value::Null;
    }
    serde_json::json!({"questions": names, "learned_on": {"folders": of("folders"), "units": of("units")}})
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
        let widened_by = report
            .evidence
            .explained_fraction_widened_by
            .unwrap_or_else(|| Questions::of(&report.evidence.table).shipped().explained_fraction_widening);
        units.push(JudgedUnit { label: Label { strength_ratio, ..label }, report, widened_by, came_true });
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
