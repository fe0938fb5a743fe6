//! `govtwin accept`: measures of a servo system beside limits, as it is and without each of its faults.

mod faults;

use govtwin_diagnosis::acceptance::limits_file;
use std::path::PathBuf;

use anyhow::bail;
use govtwin_bag::Health;
use govtwin_diagnosis::acceptance::counterfactual::{self, Compared};
use govtwin_diagnosis::acceptance::limits::{AcceptanceLimits, LimitStanding};
use govtwin_diagnosis::acceptance::series::Series;
use govtwin_diagnosis::acceptance::summary::{AcceptanceSummary, DiagnosedTwin, csv, summarise};
use govtwin_model::parameters::Unit;
use govtwin_model::provenance::Provenance;
use govtwin_model::recording::Recording;
use govtwin_model::replay::simulate;
use govtwin_model::twin::Twin;
use govtwin_pages::acceptance::{Drawn, measures_table, page, without_table};

use super::bags::{self, GivenBag, MapArgs, Recordings, TopicArgs};
use super::output::{Output, Progress, print, table_text, warn_all};
use super::provenance;
use crate::commands::{Outcome, sheet_of};
use faults::FoundFaults;

/// The files.
const NAMES: [&str; 3] = ["acceptance.json", "acceptance.csv", "acceptance.html"];

/// Arguments of `govtwin accept`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Recordings of one unit: bags, bag folders, or folders that contain them.
    #[arg(value_name = "BAG", required_unless_present = "template")]
    bags: Vec<PathBuf>,
    #[command(flatten)]
    topics: TopicArgs,
    #[command(flatten)]
    map: MapArgs,
    /// Limits that the unit must keep; `--template` prints a file to fill in. Without limits, measures are only
    /// shown.
    #[arg(long, value_name = "FILE")]
    limits: Option<PathBuf>,
    /// Data sheet (parameter file) of the unit; without it, the shipped reference unit.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Folder of an existing diagnosis of the unit; without it, the recordings are diagnosed.
    ///
    /// The folder is that of `govtwin diagnose`, with report.json and fitted.yaml.
    #[arg(long, value_name = "DIR", conflicts_with = "measure_only")]
    diagnosis: Option<PathBuf>,
    /// Only measure the recordings: no diagnosis and no twin.
    #[arg(long)]
    measure_only: bool,
    /// Print a limits file to fill in, with every measure and how it is computed.
    #[arg(long, conflicts_with_all = ["bags", "limits", "out"])]
    template: bool,
    /// Folder for the report [default: acceptance/UNIT].
    ///
    /// The files are acceptance.html, acceptance.json and acceptance.csv; those of an earlier report are replaced.
    /// UNIT is the folder that contains the recordings, or the name of the single recording.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print JSON instead of tables: the content of DIR/acceptance.json.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Measures dead time, dead band, hysteresis, opening and closing times, cushion time, overshoot,
settling time, tracking error and frequency response, each with a 90 % interval. All measures use
only the opening command and the servomotor position. For each fault that the diagnosis names, the
report states what the unit would measure without it:
  Without backlash the dead time falls from 0.174 s to 0.108 s (0.0471 s to 0.168 s): passes.
A measure that no recording shows, such as the full rate of a running unit, is taken on the twin in
a simulated test and marked.

A limit passes if the whole interval keeps it, fails if the whole interval breaks it, and is
undecided otherwise. The page has room for signatures and prints to PDF from any browser.
docs/acceptance.md defines the measures.

Examples:
  govtwin accept --template > limits.yaml
  govtwin accept bags/practice/case_03 --limits limits.yaml
  govtwin accept RUN --limits limits.yaml --params unit3.yaml --diagnosis diagnosis/unit3
  govtwin accept RUN --measure-only --json | jq '.measures[] | {id, as_found}'

Exit codes: 0 all limits are kept, or there are none; 1 not possible; 2 wrong usage; 3 a limit is
broken, undecided or not shown, or there are warnings.";

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    if args.template {
        print(&limits_file::limits_template())?;
        return Ok(Outcome::Ok);
    }
    let limits = args.limits.as_ref().map(|path| limits_file::load_limits(path)).transpose()?.unwrap_or_default();
    let sheet = sheet_of(args.params.as_deref())?;
    let name = provenance::unit_of(&args.bags);
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from("acceptance").join(&name));
    let output = Output::claim(&out, &NAMES)?;
    let known = args.diagnosis.as_ref().map(|folder| FoundFaults::load(folder)).transpose()?;
    let mut made = provenance::new("accept", &sheet, None)?;
    let mapped = args.map.open(&args.bags)?;
    let topics = args.topics.topics();
    let Recordings { recordings, mut warnings, notes, read } = bags::read(&mapped.paths, &topics, &sheet.unit)?;
    let (recordings, read) = trusted(recordings, read)?;
    warnings.splice(0..0, mapped.warnings.iter().cloned());
    made.recordings = provenance::inputs(&read, &mapped)?;
    made.unit = name;
    if !recordings.iter().any(|recording| Series::measured(recording).is_some()) {
        bail!(
            "no recording holds an opening command and a servomotor position in 20 samples or more, which every measure takes; `govtwin info BAG` \
             says what is in a bag"
        );
    }
    let faults = match known {
        _ if args.measure_only => None,
        Some(known) => {
            warnings.extend(known.doubt(&made));
            Some(known)
        }
        None => Some(FoundFaults::diagnose(&recordings, &sheet.unit)?),
    };
    let (summary, drawn) = judge(&recordings, faults.as_ref(), &limits, &sheet.unit);
    warnings.extend(faults.iter().flat_map(|faults| faults.notes.clone()));
    // What the sheet and the recordings leave open is said already, and belongs to the report.
    describe(&mut made, args, &[&warnings[..], &notes].concat())?;
    let summary = AcceptanceSummary { provenance: Some(made), ..summary };
    write(output, &summary, &drawn)?;
    if args.json {
        print(&(serde_json::to_string_pretty(&summary)? + "\n"))?;
    } else {
        print(&text(&summary))?;
        print(&format!("\nreport: {}\n", out.join("acceptance.html").display()))?;
    }
    warn_all(&warnings);
    let kept = matches!(summary.standing, None | Some(LimitStanding::Passes));
    Ok(if kept && warnings.is_empty() && notes.is_empty() { Outcome::Ok } else { Outcome::Warnings })
}

/// Leaves out the recordings whose figures would not be those of the unit: no limit is kept by what cannot be trusted.
fn trusted(mut recordings: Vec<Recording>, mut read: Vec<GivenBag>) -> anyhow::Result<(Vec<Recording>, Vec<GivenBag>)> {
    for given in read.iter_mut().filter(|given| given.left_out.is_none()) {
        let Some(doubt) = given.health.as_ref().and_then(Health::untrusted) else { continue };
        given.left_out = Some(doubt);
        let of_given = |name: &str| {
            name == given.name || name.strip_prefix(&given.name).is_some_and(|rest| rest.starts_with(['#', ' ']))
        };
        recordings.retain(|recording| !of_given(&recording.name));
    }
    if recordings.is_empty() {
        let why = |given: &GivenBag| Some(format!("{}: {}", given.name, given.left_out.as_ref()?));
        bail!("no recording can be measured:\n  {}", read.iter().filter_map(why).collect::<Vec<_>>().join("\n  "));
    }
    Ok((recordings, read))
}

/// Measures recordings and twins, and holds them against the limits.
fn judge(
    recordings: &[Recording],
    faults: Option<&FoundFaults>,
    limits: &AcceptanceLimits,
    sheet: &Unit,
) -> (AcceptanceSummary, Vec<Drawn>) {
    let Some(faults) = faults else {
        // The sheet's twin replaces it where nothing is compared with it; none of its figures are shown.
        let compared = counterfactual::measured_alone(recordings);
        let drawn = draw(recordings, None, &[]);
        return (summarise(&compared, &DiagnosedTwin::default(), limits), drawn);
    };
    let named: Vec<String> = faults.named.clone();
    let unit = Unit { recorded: sheet.recorded, ..faults.unit.clone() };
    let progress = Progress::new(counterfactual::simulations(&unit, &named, &faults.sizes), "simulated units");
    let compared: Compared = counterfactual::compare(recordings, &unit, &named, &faults.sizes, &|| progress.step());
    drop(progress);
    let diagnosed = DiagnosedTwin { verdict: faults.verdict.clone(), faults: named.clone() };
    let drawn = draw(recordings, Some(&unit), &named);
    (summarise(&compared, &diagnosed, limits), drawn)
}

/// The recordings as the page draws them.
fn draw(recordings: &[Recording], unit: Option<&Unit>, named: &[String]) -> Vec<Drawn> {
    let twin =
        |unit: &Unit, recording: &Recording| Series::simulated(recording, &simulate(&mut Twin::new(unit), recording));
    let of = |recording: &Recording| {
        let bare = unit.filter(|_| !named.is_empty()).map(|unit| counterfactual::without(unit, named));
        Some(Drawn {
            measured: Series::measured(recording)?,
            found: unit.and_then(|unit| twin(unit, recording)),
            without: bare.and_then(|unit| twin(&unit, recording)),
        })
    };
    recordings.iter().filter_map(of).take(4).collect()
}

fn describe(made: &mut Provenance, args: &Args, warnings: &[String]) -> anyhow::Result<()> {
    made.warnings = warnings.to_vec();
    provenance::note_files(made, "limits", &args.limits)?;
    provenance::note_files(made, "diagnosis", args.diagnosis.as_ref().map(|folder| folder.join(faults::REPORT)))?;
    provenance::note(made, "measure-only", args.measure_only.then_some("given"));
    provenance::options(&args.topics, &args.map, made)
}

fn write(mut output: Output, summary: &AcceptanceSummary, drawn: &[Drawn]) -> anyhow::Result<()> {
    output.add("acceptance.html", page(summary, drawn).to_html().as_bytes())?;
    output.add("acceptance.csv", csv(summary).as_bytes())?;
    output.add_json("acceptance.json", summary)?;
    output.place()
}

fn text(summary: &AcceptanceSummary) -> String {
    let mut text = table_text(&measures_table(summary));
    if summary.measures.iter().any(|asked| asked.as_found.as_ref().is_some_and(|figure| figure.from == "standard test"))
    {
        text += "* measured on the twin in a simulated test; the recordings do not show it.\n";
    }
    if let Some(table) = without_table(summary) {
        text += &format!("\n{}", table_text(&table));
    }
    for sentence in &summary.sentences {
        text += &format!("\n{sentence}");
    }
    if !summary.verdict.is_empty() && summary.faults.is_empty() {
        text += &format!("\nThe diagnosis names no fault ({}), so there is no counterfactual.", summary.verdict);
    }
    for origin in summary.provenance.iter().flat_map(Provenance::origins) {
        text += &format!("\n{origin}");
    }
    if !text.ends_with('\n') {
        text.push('\n');
    }
    text
}
