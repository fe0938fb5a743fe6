//! `govtwin run`: runs the twin as a ROS 2 node.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use anyhow::Context;
use govtwin_model::parameters::Unit;
use govtwin_model::twin::Twin;
use govtwin_node::arguments::Arguments;
use govtwin_node::bus_map::InputNames;
use govtwin_node::core::{NodeInput, OnStale};
use govtwin_node::live::{self, NodeResidual, RunEnd, RunOptions};
use govtwin_node::realtime::Wishes;
use govtwin_node::settings::{InputSettings, NodeSettings};
use serde_json::json;

use super::network::{NetworkArgs, within};
use super::{bus_map, model, output};
use crate::commands::{Outcome, expect, number, sheet_of, usage};

const HELP: &str = "\
Subscribes to governor/command, governor/esv and governor/tank_pressure, and publishes the simulated
state on sim/servo_state and sim/joint_states. docs/ros2.md describes all topics and services.

With --map, the node takes command, ESV and tank pressure, and with --adapt also the measured
positions, from the topics of a plant, of any type. `govtwin record --map` records these topics, and
`govtwin replay --map` reads the recording, by the same map. The node subscribes to a topic when it
has a publisher, and finds its definition as `govtwin record` does. A constant of the map is the
default of its input; an input that the map does not name keeps its default. Fields that cannot be
used are reported with their signal.

Examples:
  govtwin run --optional esv tank_pressure         # a command alone is enough
  govtwin run --params unit3.yaml --bag live --ros-args -r __ns:=/unit3
  govtwin run --params unit3.yaml --map unit3_map.yaml --definitions ~/plant/src

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 ended by the fail-safe, or the bag ended early.";

/// Arguments of `govtwin run`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
#[expect(clippy::struct_excessive_bools, reason = "each is an option of its own")]
pub struct Args {
    /// Data sheet (parameter file) of the unit; without it, the shipped reference unit.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Run several units in this process, each as a node in the namespace NAME; may be repeated.
    ///
    /// FILE is the data sheet of the unit; without it, the shipped reference unit.
    #[arg(long = "unit", value_name = "NAME[=FILE]", conflicts_with_all = ["params", "residual", "publish_clock"])]
    units: Vec<String>,
    /// Integration threads, over which the units of --unit are distributed.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=64), requires = "units")]
    threads: u8,
    /// Correct the twin with this residual model of `govtwin train`, or `none`; without it, with the shipped model if the
    /// sheet is that of the shipped reference unit.
    ///
    /// The corrected state is published on `sim/corrected/servo_state`, and the limits of its band on
    /// `sim/corrected/lower` and `sim/corrected/upper`, in addition to `sim/servo_state`. A parameter of the unit that
    /// changes while the node runs ends the correction. Units of --unit are not corrected.
    #[arg(long, value_name = "MODEL")]
    residual: Option<PathBuf>,
    /// Adapt the residual model to a unit that ages.
    ///
    /// A test of `plant/servo_state` detects drift. The correction then follows by a bounded bias and gain, or by
    /// retrained leaves of its trees.
    #[arg(long, requires = "residual")]
    adapt: bool,
    /// Import map (`govtwin import`): take the inputs from fields of any type instead of the topics of this project.
    #[arg(long, value_name = "MAP")]
    map: Option<PathBuf>,
    /// Folders with definitions of the types that the map needs: DIR/package/msg/Type.msg.
    #[arg(long, value_name = "DIR", num_args = 1.., requires = "map")]
    definitions: Vec<PathBuf>,
    /// Ticks of the model per second, Hz.
    #[arg(long = "rate", value_name = "HZ", default_value_t = 1000.0, value_parser = number)]
    rate_hz: f64,
    /// Published states per second, Hz.
    #[arg(long = "publish-rate", value_name = "HZ", default_value_t = 100.0, value_parser = number)]
    publish_rate_hz: f64,
    /// Core of the integration thread; further integration threads use the cores after it.
    #[arg(long, value_name = "CORE")]
    cpu: Option<usize>,
    /// `SCHED_FIFO` priority of the integration thread, 1 to 99; 0 for an ordinary thread.
    #[arg(long, value_name = "N", default_value_t = 80, value_parser = clap::value_parser!(u8).range(0..=99))]
    priority: u8,
    /// Duration of the run, s; without it, the node runs until it is stopped.
    #[arg(long = "duration", value_name = "S", value_parser = number)]
    duration_s: Option<f64>,
    /// Age from which an input is stale, s; the ESV state arrives only once a second.
    #[arg(long = "stale-after", value_name = "S", default_value_t = 2.5, value_parser = number)]
    stale_after_s: f64,
    /// Time for which a stale input is held before the fail-safe acts, s.
    #[arg(long = "hold", value_name = "S", default_value_t = 1.0, value_parser = number)]
    hold_s: f64,
    /// Fail-safe of a stale input.
    ///
    /// `trip` treats it as an ESV trip, `hold` keeps the last value, `stop` ends the node, and `default` returns to
    /// the default of the input.
    #[arg(long, value_name = "WHAT", default_value = "trip", value_parser = OnStale::NAMES)]
    on_stale: String,
    /// Refuse samples whose stamp is older than this, or as far ahead, s; without it, any stamp is taken.
    ///
    /// Stamps are held against the machine's clock, or `/clock` with use_sim_time. A sample without a stamp is refused.
    #[arg(long = "max-stamp-age", value_name = "S", value_parser = number)]
    max_stamp_age_s: Option<f64>,
    /// End the trip of a fail-safe as soon as all inputs are back; without it, the trip stays until `~/reset_trip`.
    #[arg(long)]
    auto_reset: bool,
    /// Let callers ask, and change nothing: no parameters, no reset, no steps, no logger levels.
    #[arg(long)]
    read_only: bool,
    /// Nodes that may command, by full name (`/governor`, `/bench/*`) or by the beginning of an id; without it, all.
    ///
    /// What others send on inputs and `/clock` is ignored, and they may ask, but change nothing by a call. Names and
    /// ids are what senders say of themselves: this keeps out mistakes, not attackers.
    #[arg(long, value_name = "NODE", num_args = 1.., value_delimiter = ',')]
    commanders: Vec<String>,
    #[command(flatten)]
    network: NetworkArgs,
    /// Count time from 0, and publish it on `/clock` for other nodes.
    #[arg(long = "publish-clock")]
    publish_clock: bool,
    /// Start paused, until `~/step_simulation` or `~/set_simulation_state` starts the simulation.
    #[arg(long)]
    paused: bool,
    /// Inputs of which each order to step waits for a new sample.
    ///
    /// They are read reliably, so that a sample that the network loses is sent again: a lock-step run then gives the
    /// same result to the last bit, or a step is refused. Write one sample of each before every step.
    #[arg(long = "step-waits-for", value_name = "INPUT", num_args = 1.., value_delimiter = ',', value_parser = NodeInput::NAMES)]
    step_waits_for: Vec<String>,
    /// How long a step waits for these inputs before it is refused, s.
    #[arg(long = "step-timeout", value_name = "S", default_value_t = 1.0, value_parser = number, requires = "step_waits_for")]
    step_timeout_s: f64,
    /// Inputs that may be absent; their defaults apply until the first sample.
    #[arg(long, value_name = "INPUT", num_args = 1.., value_delimiter = ',', value_parser = NodeInput::NAMES)]
    optional: Vec<String>,
    /// Write a bag of the inputs as the twin used them, and of its estimates.
    #[arg(long, value_name = "DIR")]
    bag: Option<PathBuf>,
    /// Write the figures of the run to this file, as JSON.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print the figures of the run as JSON instead of text.
    #[arg(long)]
    json: bool,
    /// ROS 2 arguments: `-r FROM:=TO`, `-p NAME:=VALUE`, `--params-file FILE`, `--log-level LEVEL`.
    #[arg(long = "ros-args", num_args = 0.., allow_hyphen_values = true, value_terminator = "--", value_name = "ARGS")]
    ros: Vec<String>,
}

/// Runs the node until a signal, its duration or the fail-safe ends it.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let Args { rate_hz, publish_rate_hz, .. } = args;
    within("--rate", *rate_hz, 1.0..=10_000.0, " Hz")?;
    expect((0.1..=*rate_hz).contains(publish_rate_hz), || {
        format!("--publish-rate is {publish_rate_hz}: expected 0.1 Hz to --rate, {rate_hz} Hz")
    })?;
    within("--stale-after", args.stale_after_s, 0.001..=86_400.0, " s")?;
    args.max_stamp_age_s.map_or(Ok(()), |limit_s| within("--max-stamp-age", limit_s, 0.001..=86_400.0, " s"))?;
    within("--step-timeout", args.step_timeout_s, 0.001..=3600.0, " s")?;
    within("--hold", args.hold_s, 0.0..=86_400.0, " s")?;
    let settings = NodeSettings {
        rate_hz: args.rate_hz,
        publish_rate_hz: args.publish_rate_hz,
        stale_after_s: args.stale_after_s,
        hold_s: args.hold_s,
        on_stale: OnStale::named(&args.on_stale).unwrap_or_default(),
        inputs: NodeInput::NAMES.map(|name| InputSettings {
            required: name != "load" && !args.optional.iter().any(|optional| optional == name),
            ..InputSettings::default()
        }),
        publish_clock: args.publish_clock,
        paused: args.paused,
        max_stamp_age_s: args.max_stamp_age_s,
        latch_trip: !args.auto_reset,
        step_inputs: NodeInput::NAMES.map(|name| args.step_waits_for.iter().any(|awaited| awaited == name)),
        step_timeout_s: args.step_timeout_s,
        wishes: Wishes { cpu: args.cpu, priority: args.priority },
        ..NodeSettings::default()
    };
    let _claim = args.out.as_deref().map(|out| output::claim_place("--out", out)).transpose()?;
    let environment = args.network.environment()?;
    let whole = Arguments::parse(&args.ros, "govtwin")?;
    let map = bus_map::for_node(args.map.as_deref(), &args.definitions, args.adapt)?;
    let inputs = InputNames::new(map.as_ref());
    let of_one = |arguments: Arguments, params: Option<&Path>, bag: Option<PathBuf>| {
        anyhow::Ok(RunOptions {
            environment: environment.clone(),
            arguments,
            map: map.clone(),
            unit: unit(params)?,
            residual: residual(args)?,
            adapt: args.adapt,
            settings,
            read_only: args.read_only,
            commanders: args.commanders.join(","),
            duration: duration(args.duration_s, "--duration")?,
            bag,
        })
    };
    let options = if args.units.is_empty() {
        vec![of_one(whole, args.params.as_deref(), args.bag.clone())?]
    } else {
        let units = named_units(&args.units)?;
        if let Some(folder) = &args.bag {
            std::fs::create_dir_all(folder).with_context(|| format!("cannot make the folder {}", folder.display()))?;
        }
        let of_unit = |(name, params): (&str, Option<&Path>)| {
            let namespace = format!("__ns:={}/{name}", whole.namespace.trim_end_matches('/'));
            let words = [&args.ros[..], &["-r".to_owned(), namespace]].concat();
            let arguments = Arguments::parse(&words, "govtwin").with_context(|| format!("--unit {name}"))?;
            of_one(arguments, params, args.bag.as_ref().map(|folder| folder.join(name)))
        };
        units.into_iter().map(of_unit).collect::<anyhow::Result<Vec<_>>>()?
    };
    let stop = stop_on_signals()?;
    let ended = live::run_together(&options, usize::from(args.threads), &stop, &mut |level, words| {
        output::say(&format!("{level:?}: {words}"));
    })?;
    let names = options.iter().map(|one| one.arguments.full_name());
    let (mut figures, text) = if let ([one], true) = (&ended[..], args.units.is_empty()) {
        (figures(one, &inputs), text(one, &inputs))
    } else {
        let named: Vec<_> = names.zip(&ended).collect();
        let rows = named.iter().map(|(name, one)| (name.clone(), figures(one, &inputs)));
        let texts = named.iter().map(|(name, one)| format!("{name}\n{}", text(one, &inputs)));
        (json!({"units": rows.collect::<serde_json::Map<_, _>>()}), texts.collect())
    };
    figures["program"] = concat!("govtwin ", env!("CARGO_PKG_VERSION")).into();
    let figures = serde_json::to_string_pretty(&figures)? + "\n";
    if let Some(path) = &args.out {
        output::write_atomically(path, figures.as_bytes())?;
    }
    output::print(&if args.json { figures } else { text })?;
    output::warn_all(ended.iter().filter_map(|one| one.bag_ended.as_ref()));
    let has_ended_early = |one: &RunEnd| one.by_fail_safe || one.bag_ended.is_some();
    Ok(if ended.iter().any(has_ended_early) { Outcome::Warnings } else { Outcome::Ok })
}

/// Reads a unit, the shipped one by default.
fn unit(params: Option<&Path>) -> anyhow::Result<Unit> {
    let mut unit = sheet_of(params)?.unit;
    if Twin::new(&unit).plant().lookahead_s > 0.0 {
        unit.effects.retain(|setting| setting.id != "clock_offset");
        output::warn(
            "the effect clock_offset asks for inputs from the future, which has no meaning live; it is left out",
        );
    }
    Ok(unit)
}

/// The learned residual: of one unit, the shipped one by default.
fn residual(args: &Args) -> anyhow::Result<NodeResidual> {
    match &args.residual {
        Some(path) if model::is_none(path) && args.adapt => {
            Err(usage("--adapt needs a residual; found --residual none"))
        }
        Some(path) if model::is_none(path) => Ok(NodeResidual::None),
        Some(path) => Ok(NodeResidual::Given(Box::new(model::load(path)?))),
        None if args.units.is_empty() => Ok(NodeResidual::Shipped),
        None => Ok(NodeResidual::None),
    }
}

/// Names and parameter files of several units.
fn named_units(units: &[String]) -> anyhow::Result<Vec<(&str, Option<&Path>)>> {
    let named = units.iter().map(|unit| match unit.split_once('=') {
        Some((name, file)) => (name, Some(Path::new(file))),
        None => (unit.as_str(), None),
    });
    let named: Vec<_> = named.collect();
    for (index, (name, file)) in named.iter().enumerate() {
        expect(!name.is_empty() && !name.contains('/'), || {
            format!(
                "--unit {}: expected NAME or NAME=FILE, where NAME is one part of a namespace, such as unit1",
                units[index]
            )
        })?;
        expect(file.is_none_or(|file| !file.as_os_str().is_empty()), || {
            format!("--unit {}: expected a parameter file after `=`", units[index])
        })?;
        expect(named[..index].iter().all(|(other, _)| other != name), || {
            format!("--unit {name} is given twice: each unit needs a name of its own")
        })?;
    }
    Ok(named)
}

/// A flag that SIGINT and SIGTERM set.
pub fn stop_on_signals() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // A second signal ends the process at once, should leaving hang.
        signal_hook::flag::register_conditional_shutdown(signal, 1, Arc::clone(&stop))
            .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&stop)))
            .context("cannot listen to signals")?;
    }
    Ok(stop)
}

/// Seconds from the command line as a duration.
pub fn duration(seconds_s: Option<f64>, flag: &str) -> anyhow::Result<Option<Duration>> {
    let convert = |seconds_s| {
        Duration::try_from_secs_f64(seconds_s).map_err(|_| usage(format!("{flag} is {seconds_s}: expected seconds")))
    };
    seconds_s.map(convert).transpose()
}

fn figures(ended: &RunEnd, names: &InputNames) -> serde_json::Value {
    let inputs: serde_json::Map<String, serde_json::Value> = NodeInput::ALL
        .into_iter()
        .map(|input| {
            let counts = ended.counts[input as usize];
            let mut row = json!({"used": counts.used, "refused": counts.all_refused(), "restarts": counts.restarts, "lost": counts.lost});
            let label = &names.labels[input as usize];
            if label != input.topic() {
                row["from"] = json!(label);
            }
            (input.topic().to_owned(), row)
        })
        .collect();
    json!({
        "loop": ended.summary,
        "inputs": inputs,
        "lost_publications": ended.lost_publications,
        "ended_by_fail_safe": ended.by_fail_safe,
        "bags": ended.bags,
        "bag_ended": ended.bag_ended,
    })
}

fn text(ended: &RunEnd, names: &InputNames) -> String {
    let mut text = ended.summary.text();
    for input in NodeInput::ALL {
        let counts = ended.counts[input as usize];
        let (name, used, refused, lost) =
            (&names.labels[input as usize], counts.used, counts.all_refused(), counts.lost);
        text.push_str(&format!("{name:<24}{used:>8} used {refused:>8} refused {lost:>8} lost in transport\n"));
    }
    for bag in &ended.bags {
        text.push_str(&format!("bag: {}\n", bag.display()));
    }
    text
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::named_units;

    fn named(units: &[&str]) -> Result<Vec<(String, Option<String>)>, String> {
        let units: Vec<String> = units.iter().map(|&unit| unit.to_owned()).collect();
        let own = |file: &Path| file.to_string_lossy().into_owned();
        let named = named_units(&units).map_err(|error| error.to_string())?;
        Ok(named.into_iter().map(|(name, file)| (name.to_owned(), file.map(own))).collect())
    }

    #[test]
    fn units_have_names_of_their_own_and_files_where_given() {
        let expected = vec![("a".to_owned(), None), ("b".to_owned(), Some("b.yaml".to_owned()))];
        assert_eq!(named(&["a", "b=b.yaml"]), Ok(expected));
        for (units, words) in [
            (&["a", "a=x.yaml"][..], "--unit a is given twice"),
            (&["=x.yaml"], "expected NAME or NAME=FILE"),
            (&["a/b"], "one part of a namespace"),
            (&["a="], "expected a parameter file"),
        ] {
            let said = named(units).unwrap_err();
            assert!(said.contains(words), "{said}");
        }
    }
}
