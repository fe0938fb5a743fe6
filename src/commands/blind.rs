//! `govtwin blind`: diagnose every unit of a folder, and score it where the truth is known.

mod battery;
mod cases;
mod expected;
mod later;
mod method;
mod next_test;
mod scoring;
mod shard;

use std::ffi::OsString;
use std::path::PathBuf;

use govtwin_files::is_same;
use govtwin_lab::battery::plan::BatteryRates;
use rayon::prelude::{ParallelBridge, ParallelIterator};

use self::battery::BatteryOf;
use self::cases::find;
use self::expected::ExpectedDigests;
use self::method::methods;
use self::shard::Shard;
use super::bags::TopicArgs;
use super::output::{Output, Progress, print, table_text, warn_all};
use super::provenance;
use super::replay::origin;
use super::report_file::is_there;
use crate::commands::{Outcome, sheet_of, usage};

/// Arguments of `govtwin blind`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
#[expect(clippy::struct_excessive_bools, reason = "each is an option of its own")]
pub struct Args {
    /// Folder of units: each folder in it that contains bags is one unit; --generate creates it.
    #[arg(value_name = "DIR")]
    dir: PathBuf,
    #[command(flatten)]
    topics: TopicArgs,
    /// Data sheet (parameter file) of the units; without it, the shipped reference unit.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Diagnose each unit with a sheet estimated from its recordings, as `diagnose --no-sheet` does.
    ///
    /// --params is then only the sheet from which --generate makes units.
    #[arg(long, conflicts_with_all = ["stages_alone", "baselines", "baselines_only"])]
    no_sheet: bool,
    /// Folder for reports and score; without it, DIR.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// True faults of the units, against which the verdicts are scored.
    #[arg(long, value_name = "FILE", conflicts_with = "generate")]
    labels: Option<PathBuf>,
    /// First generate N units with known faults, and score their verdicts at the end.
    #[arg(long, value_name = "N", conflicts_with = "named")]
    generate: Option<usize>,
    /// Generate and diagnose only part I of N of --generate, counted from 1, without a score.
    #[arg(long, value_name = "I/N", requires = "generate")]
    shard: Option<Shard>,
    /// Seed of all random numbers of --generate.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Rate of the generated recordings, Hz: `both` or a list.
    ///
    /// `both` is 5 Hz for a third of the units and 100 Hz for the others. Of a list one rate is drawn for each unit.
    #[arg(long, value_name = "HZ,...", default_value = "both", value_parser = rates)]
    rate: BatteryRates,
    /// Structural mismatch between generated plants and the twin, as multiples of the usual one: 0, or 0.5 to 5.
    ///
    /// Of a list one is drawn for each unit. At 0 the plant is the twin itself, which shows what the recordings allow at best.
    #[arg(long, value_name = "LEVEL,...", default_value = "1", value_parser = mismatch, value_delimiter = ',')]
    mismatch: Vec<f64>,
    /// Generate servomotor stages alone: recordings of spool and servomotor only.
    ///
    /// They are diagnosed with the data sheet of --params, or without a sheet.
    #[arg(long, requires = "generate", conflicts_with_all = ["rate", "mismatch", "baselines", "baselines_only"])]
    stages_alone: bool,
    /// Run the test that each report proposes on the unit's plant, and diagnose again with its answer.
    ///
    /// Only where the verdict leaves something open. The score says how often the verdict becomes right, and the bits promised and gained.
    #[arg(long, requires = "generate", conflicts_with_all = ["stages_alone", "baselines_only"])]
    next_test: bool,
    /// Also diagnose with the baseline methods.
    #[arg(long)]
    baselines: bool,
    /// Diagnose only with the baseline methods.
    #[arg(long, conflicts_with = "baselines")]
    baselines_only: bool,
    /// Also use reports that do not state their recordings and data sheet, or hold no digests, such as those of early programs.
    #[arg(long)]
    unchecked: bool,
    /// Print JSON instead of tables: the content of OUT/score.json, or the verdicts if there is no score.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
The reports of a unit are in OUT/UNIT. Existing reports are used if they are of the same recordings
and data sheet, by digest, so an interrupted benchmark continues where it stopped. Others are
reported and not counted. With --labels or --generate, OUT/score.json and OUT/score.html contain all
measures with 95 % intervals. Bags in UNIT/later are not diagnosed: claims of how far the gap shrinks
are checked on them.

--generate makes units with a separate simulator. It shares the data sheet with the twin but not
its equations: bristle friction, contact gaps, rounded edges, polytropic gas, inertia of lines. The
units are fault-free, have one effect, or two or three at once, have faults that no catalogue
lists, or effects that are then left out of the catalogue. DIR/answers/keys.sha256 commits to the
answers before the first diagnosis. DIR/answers/labels.yaml and strengths.yaml are written after
the last one, and explained fractions are validated on recordings made after that. If reports are
missing, answers and scores of an earlier run are removed first, so that no diagnosis can find
them, and written again at the end. A DIR or OUT of another seed, rate or data sheet is refused.

--stages-alone makes servomotor stages of which only spool and position are recorded. They follow
the twin's law or a plain law, each with an error of the law that is not a fault.

--shard I/N processes one part. Parts may run at once on one file system, in any order, and more
than once. The same command without --shard then reads all reports and scores them; the score is
the same for any split.

Examples:
  govtwin blind bags/practice --labels bags/practice/labels.yaml --out practice
  govtwin blind units --generate 50 --seed 9301
  seq 1 8 | xargs -P 8 -I I govtwin blind units --generate 50 --seed 9301 --shard I/8

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 finished with warnings.";

/// Rates of a battery as they are written in a command: each a whole number of milliseconds apart, since the plant runs in such steps.
fn rates(text: &str) -> Result<BatteryRates, String> {
    if text == "both" {
        return Ok(BatteryRates::Both);
    }
    let one = |text: &str| {
        let rate_hz: f64 = text.trim().parse().ok()?;
        let period_ms = 1000.0 / rate_hz;
        ((1.0..=1000.0).contains(&period_ms) && (period_ms - period_ms.round()).abs() < 1e-9).then_some(rate_hz)
    };
    let rates_hz: Option<Vec<f64>> = text.split(',').map(one).collect();
    rates_hz.map(BatteryRates::OneOf).ok_or_else(|| {
        "expected `both` or rates of 1 to 1000 Hz with whole milliseconds between samples, such as 50,20,10".to_owned()
    })
}

/// A structural mismatch as it is written in a command.
fn mismatch(text: &str) -> Result<f64, String> {
    let level = text.trim().parse().ok().filter(|level| *level == 0.0 || (0.5..=5.0).contains(level));
    level.ok_or_else(|| "expected 0, or a multiple of the usual mismatch from 0.5 to 5".to_owned())
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let sheet = sheet_of(args.params.as_deref())?;
    let unit = &sheet.unit;
    let out = args.out.as_ref().unwrap_or(&args.dir);
    // Parts run side by side in one folder; each claims the units that it works on, one by one.
    let whole = args.shard.is_none();
    let output = whole.then(|| Output::claim(out, &["score.json", "score.html"])).transpose()?;
    // With --generate the folder of units is written to as well.
    let other = whole && args.generate.is_some() && args.out.as_ref().is_some_and(|out| !is_same(out, &args.dir));
    let _units = other.then(|| Output::claim(&args.dir, &[])).transpose()?;
    let made = match args.generate {
        Some(0) => return Err(usage("--generate: expected at least 1 unit, found 0")),
        Some(count) => {
            let kind = if args.stages_alone {
                BatteryOf::Stages { with_sheet: args.params.is_some() }
            } else {
                BatteryOf::Chains { rates: args.rate.clone(), mismatches: args.mismatch.clone() }
            };
            Some(battery::make((&args.dir, out), unit, count, (args.seed, &kind), args.shard.unwrap_or_default())?)
        }
        None => None,
    };
    let mut cases = find(&args.dir, &args.topics, args.labels.is_some() && !args.no_sheet)?;
    if let Some(made) = &made {
        made.restrict(&mut cases, !args.no_sheet)?;
    }
    let methods = methods(args.baselines, args.baselines_only);
    if let Some(made) = &made {
        let paths = cases.iter().flat_map(|case| methods.iter().map(|method| method.report_path(out, &case.name)));
        let judged = paths.map(|path| is_there(&path)).collect::<anyhow::Result<Vec<_>>>()?;
        if judged.contains(&false) {
            made.close(out)?;
        }
    }
    let expected = ExpectedDigests::new(&cases, (!args.no_sheet).then_some(unit), args.unchecked)?;
    let progress = Progress::new(cases.len(), "units");
    let judged_by = judged_by(args);
    let threads = (rayon::current_num_threads() / cases.len().max(1)).max(1);
    // Dealt out one by one, so that what is broken off has the first units and not some of each half.
    let judged = cases.iter().par_bridge().map(|case| {
        let judged = method::judge(case, (&sheet, &expected), &judged_by, &methods, threads, out);
        progress.step();
        judged.map_err(|error| format!("{}: {error:#}", case.name))
    });
    let mut failed: Vec<String> = judged.filter_map(Result::err).collect();
    drop(progress);
    if let Some(made) = made.as_ref().filter(|_| args.next_test) {
        failed.extend(next_test::run_all(&cases, made, &judged_by, threads, out));
    }
    failed.sort();
    warn_all(&failed);
    let labels = match (&made, &args.labels) {
        // A part opens no answers: the others may still be judged.
        (Some(_), _) if !whole => None,
        (Some(made), _) => Some(made.answers()?),
        (None, Some(path)) => Some(scoring::read_labels(path)?),
        (None, None) => None,
    };
    let (Some(labels), Some(output)) = (labels, output) else {
        let verdicts = scoring::verdicts(&cases, &methods, (out, &expected))?;
        if args.json {
            print(&format!("{:#}\n", scoring::verdicts_json(&verdicts)))?;
        } else {
            let table = table_text(&scoring::verdicts_table(&verdicts));
            let next = if whole {
                "Add --labels FILE to score the verdicts."
            } else {
                "Without --shard the same command scores all parts."
            };
            print(&format!("{table}{next}\n"))?;
        }
        return Ok(outcome(&failed));
    };
    let (realised, unexamined) = match &made {
        Some(made) => made.validations(out, unit),
        None => later::of_folders(&cases, out, unit),
    };
    warn_all(&unexamined);
    failed.extend(unexamined);
    let origin = made.as_ref().map_or_else(|| origin::of(&args.dir), |made| Some(made.origin().to_owned()));
    let mut made_from = provenance::new("blind", &sheet, made.is_some().then_some(args.seed))?;
    made_from.unit = args.dir.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    made_from.recordings = expected.inputs(origin.as_deref());
    if args.no_sheet {
        made_from.options.insert("no-sheet".to_owned(), "each unit by a sheet made of its recordings".to_owned());
    }
    made_from.warnings.clone_from(&failed);
    let unscored =
        scoring::score_all(&labels, &realised, &methods, (&cases, &expected), &made_from, (out, output), args.json)?;
    warn_all(&unscored);
    failed.extend(unscored);
    Ok(outcome(&failed))
}

/// The arguments that say by which sheet the diagnosis judges.
fn judged_by(args: &Args) -> Vec<OsString> {
    match &args.params {
        _ if args.no_sheet => vec!["--no-sheet".into()],
        Some(params) => vec!["--params".into(), params.clone().into_os_string()],
        None => vec![],
    }
}

fn outcome(failed: &[String]) -> Outcome {
    if failed.is_empty() { Outcome::Ok } else { Outcome::Warnings }
}

#[cfg(test)]
mod tests {
    use govtwin_lab::battery::plan::BatteryRates;

    use super::{mismatch, rates};

    #[test]
    fn mismatches_are_none_or_such_as_the_plant_can_step() {
        assert_eq!(["0", "0.5", " 3", "5"].map(mismatch), [Ok(0.0), Ok(0.5), Ok(3.0), Ok(5.0)]);
        for refused in ["", "-1", "0.1", "6", "nan", "1,2"] {
            assert!(mismatch(refused).unwrap_err().contains("from 0.5 to 5"), "{refused}");
        }
    }

    #[test]
    fn rates_are_both_or_a_list_whose_periods_the_plant_can_step() {
        assert_eq!(rates("both"), Ok(BatteryRates::Both));
        assert_eq!(rates("5"), Ok(BatteryRates::OneOf(vec![5.0])));
        assert_eq!(rates("50, 20,10"), Ok(BatteryRates::OneOf(vec![50.0, 20.0, 10.0])));
        for refused in ["", "3", "0", "-10", "nan", "2000", "50,,10", "bench"] {
            assert!(rates(refused).unwrap_err().contains("such as 50,20,10"), "{refused}");
        }
    }
}
