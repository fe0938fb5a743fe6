//! `govtwin generate`: synthetic recordings of the four processes, from the twin itself.

pub mod effect;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::ValueEnum;
use govtwin_bag::msg;
use govtwin_bag::{Qos, Sealed, Topics, Writer, WriterOptions};
use govtwin_diagnosis::generate::noise::{Purpose, RandomStreams};
use govtwin_diagnosis::generate::streams::GeneratedStreams;
use govtwin_diagnosis::generate::{self, Scenario};
use govtwin_files::Claim;
use govtwin_model::parameters::Unit;
use govtwin_model::params::{self, Overlay};
use govtwin_model::recording::Process;
use govtwin_model::units;
use jiff::Timestamp;

use crate::commands::choice::{Choice, PROCESSES, choice};
use crate::commands::output::{Output, Progress, print};
use crate::commands::{Outcome, expect, number, sheet_of};

/// The unit that was simulated.
const TRUTH: &str = "truth.yaml";
/// This command, which simulates the twin itself.
const COMMAND: &str = "generate";

/// Arguments of `govtwin generate`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Processes to record, separated by commas.
    #[arg(long, value_parser = choice(processes()), value_name = "PROCESS", value_delimiter = ',', default_value = "all")]
    process: Vec<Option<Process>>,
    /// Effect to add: `ID=VALUE[,VALUE…]` in the order of its parameters, or `ID.parameter=VALUE`; may be repeated.
    #[arg(long = "effect", value_name = "ID=VALUE")]
    effects: Vec<String>,
    /// Data sheet (parameter file) of the unit; without it, the shipped reference unit.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Rate of command and servo state, Hz.
    #[arg(long = "rate", value_name = "HZ", default_value_t = 100.0, value_parser = number)]
    rate_hz: f64,
    /// Length of each recording, s.
    #[arg(long = "duration", value_name = "S", default_value_t = 40.0, value_parser = number)]
    duration_s: f64,
    /// Also record pilot-valve position and control pressure.
    #[arg(long)]
    rich: bool,
    /// Draw the parameters of the unit from the tolerances of the sheet; `off` takes the sheet as it is.
    #[arg(long, value_enum, default_value_t = Switch::On)]
    spread: Switch,
    /// Seed of all random numbers.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Time at which the recordings begin, such as 2024-03-01T06:00:00Z [default: 2023-11-14T22:13:20Z].
    #[arg(long, value_name = "TIME")]
    start: Option<Timestamp>,
    /// Folder for the bags and `truth.yaml`; must be empty or not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Print JSON instead of text: the bags, the file of the true unit, and the effects.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Each process is written to a bag folder DIR/PROCESS, and the simulated unit to the parameter file
DIR/truth.yaml. `govtwin replay --params DIR/truth.yaml DIR` shows the error that remains with a
perfect model. The metadata of the bags states that they are synthetic, but not the true parameters.

The command comes from a governor with start-up limit, PID and droop, in a loop with a simple
machine of rotor and water column. Transducers have the noise and steps of the sheet, including those that
the regulator reads. All processes are of the same unit, and the same seed gives the same recordings
on any number of cores.

The recordings come from the twin's own equations. Real units, and the units under bags/, which come
from an independent simulator, differ from the twin by more than the effects chosen here.

Examples:
  govtwin generate --effect backlash=0.004 --out made
  govtwin replay --params made/truth.yaml made
  govtwin diagnose made --out found

Exit codes: 0 ok, 1 not possible, 2 wrong usage.";

/// Processes to record; all where none is named.
fn processes() -> impl Iterator<Item = Choice<Option<Process>>> {
    let each = PROCESSES.map(|(word, help, process)| (word, help, Some(process)));
    [("all", "All four processes", None)].into_iter().chain(each)
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Switch {
    On,
    Off,
}

/// Writes the bags and the truth beside them.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    within("--rate", args.rate_hz, 1.0, 1000.0, "Hz")?;
    within("--duration", args.duration_s, 30.0, 3600.0, "s")?;
    let mut unit = sheet_of(args.params.as_deref())?.unit;
    effect::add(&args.effects, &mut unit)?;
    if args.spread == Switch::On {
        unit = generate::spread(&unit, args.seed);
        refuse_what_cannot_be(&unit, args.seed)?;
    }
    let mut output = Output::claim(&args.out, &[TRUTH])?;
    let reading = || format!("--out: cannot read the folder {}", args.out.display());
    let entries = args.out.read_dir().and_then(Iterator::collect::<std::io::Result<Vec<_>>>).with_context(reading)?;
    if entries.iter().any(|entry| !Claim::is_lock(&entry.file_name())) {
        bail!("{}: not empty; give a folder that does not exist", args.out.display());
    }

    let is_asked = |process: &Process| args.process.iter().any(|asked| asked.is_none_or(|asked| asked == *process));
    let processes: Vec<Process> = Process::ALL.into_iter().filter(is_asked).collect();
    let written = Progress::each(&processes, "recordings", |process| {
        let scenario = Scenario {
            unit: unit.clone(),
            process: *process,
            rate_hz: args.rate_hz,
            duration_s: args.duration_s,
            rich: args.rich,
            seed: args.seed,
        };
        record(&scenario, args.start, &args.out.join(process.id()))
    });
    let written = written.into_iter().collect::<anyhow::Result<Vec<_>>>()?;
    let (bags, mut lines): (Vec<Sealed>, Vec<String>) = written.into_iter().unzip();
    output.add_bags(bags);
    let truth = output.path(TRUTH);
    output.add(TRUTH, params::overlay_text(&truth, &label(args, &unit))?.as_bytes())?;
    output.place()?;
    lines.push(format!("{}: the unit simulated, {}", truth.display(), effects_text(&unit)));
    if args.json {
        let bags: Vec<_> = processes.iter().map(|process| args.out.join(process.id()).display().to_string()).collect();
        let effects: Vec<_> = unit.effects.iter().map(|setting| effect::text(&unit, setting)).collect();
        let made = serde_json::json!({
            "schema": "govtwin-generate/1", "synthetic": true, "bags": bags, "truth": truth.display().to_string(), "effects": effects,
            "seed": args.seed,
        });
        print(&format!("{made:#}\n"))?;
    } else {
        print(&format!("{}\n", lines.join("\n")))?;
    }
    Ok(Outcome::Ok)
}

/// Tolerances may let a draw contradict itself; no other is taken in its place, as that would be no draw from the tolerances.
fn refuse_what_cannot_be(unit: &Unit, seed: u64) -> anyhow::Result<()> {
    let conflicts: Vec<String> = params::conflicts(&unit.parameters).map(|conflict| conflict.to_string()).collect();
    if !conflicts.is_empty() {
        let conflicts = conflicts.join("\n  ");
        bail!(
            "seed {seed} draws a unit that cannot be; give another --seed, narrower tolerances, or --spread off:\n  {conflicts}"
        );
    }
    Ok(())
}

fn within(option: &str, value: f64, min: f64, max: f64, unit: &str) -> anyhow::Result<()> {
    expect((min..=max).contains(&value), || format!("{option}: expected {min} to {max} {unit}, found {value}"))
}

/// Simulates a scenario and writes its bag.
fn record(scenario: &Scenario, start: Option<Timestamp>, dir: &Path) -> anyhow::Result<(Sealed, String)> {
    let mut streams = generate::streams(scenario);
    if let Some(start) = start {
        let start_ns = i64::try_from(start.as_nanosecond()).ok().filter(|start_ns| *start_ns >= 0);
        let start_ns =
            start_ns.with_context(|| format!("--start: expected a time from 1970 to 2262, found {start}"))?;
        streams = streams.later(start_ns - generate::EPOCH_NS);
    }
    let sealed = write((COMMAND, govtwin_bag::TWIN), scenario.process, scenario.seed, &streams, dir)?;
    let rows = streams.servo_state.len();
    Ok((sealed, format!("{}: {rows} rows of servo state at {} Hz", dir.display(), scenario.rate_hz)))
}

/// One message on its way to the bag.
enum BagMessage {
    Command(msg::GovernorCommand),
    Esv(msg::EsvState),
    TankPressure(msg::FluidPressure),
    ServoState(msg::ServoState),
}

/// Writes the messages of a process as a bag folder under a temporary name; it says that it is synthetic, by which command, and whose equations it
/// follows.
pub fn write(
    by: (&str, &str),
    process: Process,
    seed: u64,
    streams: &GeneratedStreams,
    dir: &Path,
) -> anyhow::Result<Sealed> {
    put(by, process, seed, streams, dir).with_context(|| format!("cannot write {}", dir.display()))
}

fn put(
    (by, simulator): (&str, &str),
    process: Process,
    seed: u64,
    streams: &GeneratedStreams,
    dir: &Path,
) -> anyhow::Result<Sealed> {
    let mut bag = Writer::create(dir, WriterOptions::default())?;
    let topics = Topics::default();
    let command = bag.topic(&topics.command, Qos::DEFAULT)?;
    let esv = bag.topic(&topics.esv, Qos::DEFAULT)?;
    let tank_pressure = bag.topic(&topics.tank_pressure, Qos::SENSOR)?;
    let servo_state = bag.topic(&topics.servo_state, Qos::SENSOR)?;
    let about = [
        ("synthetic", "true".to_owned()),
        ("generator", format!("govtwin {} {by}", env!("CARGO_PKG_VERSION"))),
        (govtwin_bag::SIMULATOR, simulator.to_owned()),
        ("process", process.id().to_owned()),
        ("note", "simulated, not measured; for trying benches and diagnoses".to_owned()),
    ];
    bag.describe(
        govtwin_bag::GOVTWIN,
        about.map(|(key, value)| (key.to_owned(), value)).into_iter().collect::<BTreeMap<_, _>>(),
    )?;
    for (log_time_ns, message) in messages(process, seed, streams) {
        match &message {
            BagMessage::Command(message) => bag.write(command, log_time_ns, message)?,
            BagMessage::Esv(message) => bag.write(esv, log_time_ns, message)?,
            BagMessage::TankPressure(message) => bag.write(tank_pressure, log_time_ns, message)?,
            BagMessage::ServoState(message) => bag.write(servo_state, log_time_ns, message)?,
        }
    }
    Ok(bag.seal()?)
}

/// All messages in the order in which a recorder would have got them.
fn messages(process: Process, seed: u64, streams: &GeneratedStreams) -> Vec<(i64, BagMessage)> {
    let mut draws = RandomStreams { seed, process }.of(Purpose::LogTime);
    let mut all: Vec<(i64, BagMessage)> = vec![];
    let mut put = |stamp_ns: i64, message| {
        all.push((stamp_ns + units::nanos_from_seconds(draws.between(1.5e-4, 9.0e-4)), message));
    };
    for (stamp_ns, opening) in &streams.command {
        let header = msg::Header::at(*stamp_ns);
        put(*stamp_ns, BagMessage::Command(msg::GovernorCommand { header, opening: *opening }));
    }
    for (stamp_ns, state) in &streams.esv {
        put(*stamp_ns, BagMessage::Esv(msg::EsvState::of(*stamp_ns, *state)));
    }
    for (stamp_ns, pressure_pa) in &streams.tank_pressure {
        let header = msg::Header::at(*stamp_ns);
        put(
            *stamp_ns,
            BagMessage::TankPressure(msg::FluidPressure { header, fluid_pressure: *pressure_pa, variance: 0.0 }),
        );
    }
    for (stamp_ns, signals) in &streams.servo_state {
        put(*stamp_ns, BagMessage::ServoState(msg::ServoState::of(*stamp_ns, signals)));
    }
    all.sort_by_key(|(log_time_ns, _)| *log_time_ns);
    all
}

/// The truth as a parameter file.
fn label(args: &Args, unit: &Unit) -> Overlay {
    let head = vec![
        "Truth of synthetic recordings: the unit that was simulated. A diagnosis must not read this file.".to_owned(),
        format!(
            "Made by govtwin {} generate: seed {}, {} Hz, {} s, spread {}, pilot signals {}.",
            env!("CARGO_PKG_VERSION"),
            args.seed,
            args.rate_hz,
            args.duration_s,
            if args.spread == Switch::On { "on" } else { "off" },
            if args.rich { "recorded" } else { "not recorded" },
        ),
        effects_text(unit),
    ];
    let name = "synthetic unit".to_owned();
    Overlay { unit: unit.clone(), name, source: String::new(), head, comments: BTreeMap::new() }
}

fn effects_text(unit: &Unit) -> String {
    if unit.effects.is_empty() {
        return "no effect beyond the sheet".to_owned();
    }
    format!("with {}", unit.effects.iter().map(|setting| effect::text(unit, setting)).collect::<Vec<_>>().join("; "))
}
