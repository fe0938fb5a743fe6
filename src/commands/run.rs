//! `govtwin run`: runs the twin as a ROS 2 node.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use anyhow::Context;
use govtwin::node::arguments::Arguments;
use govtwin::node::bus_map::InputNames;
use govtwin::node::core::{NodeInput, OnStale};
use govtwin::node::environment::Environment;
use govtwin::node::live::{self, RunEnd, RunOptions};
use govtwin::node::realtime::Wishes;
use govtwin::node::settings::{InputSettings, NodeSettings};
use govtwin::parameters::Unit;
use govtwin::params;
use govtwin::twin::Twin;
use serde_json::json;

use super::{bus_map, model, output};
use crate::commands::{Outcome, expect, number, usage};

const HELP: &str = "\
With --map the node takes from the topics of a plant, whatever their types, what the map names: command, ESV and tank pressure, and, with --adapt, the
measured positions. It is the map by which `govtwin record --map` records and `govtwin replay --map` reads what was recorded. A topic is subscribed to
when it has a publisher; its definition is found as `govtwin record` finds it. A constant of the map, and what it does not name, stands as the default of its
input. What cannot be used is said by its signal and field.

Examples:
  govtwin run --optional esv tank_pressure
  govtwin run --params unit3.yaml --bag live --ros-args -r __ns:=/unit3
  govtwin run --params unit3.yaml --map unit3_map.yaml --definitions ~/plant/src

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 the fail-safe ended the node, or the bag ended before it.";

/// Arguments of `govtwin run`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
#[expect(clippy::struct_excessive_bools, reason = "each is an option of its own")]
pub struct Args {
    /// Parameter file of the unit; the shipped unit by default.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Run several units in this process, each as a node in the namespace NAME: from its parameter file, or as the shipped unit.
    #[arg(long = "unit", value_name = "NAME[=FILE]", conflicts_with_all = ["params", "residual", "publish_clock"])]
    units: Vec<String>,
    /// Threads that integrate, among which the units are shared out.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=64), requires = "units")]
    threads: u8,
    /// Correct the twin by this model of `govtwin train` and publish `sim/corrected/servo_state` and its band beside `sim/servo_state`.
    #[arg(long, value_name = "MODEL")]
    residual: Option<PathBuf>,
    /// Let the residual adapt to a unit that ages: watch `plant/servo_state` for drift and follow it by a bounded bias and gain, or by retrained leaves.
    #[arg(long, requires = "residual")]
    adapt: bool,
    /// Hear the inputs by this map of `govtwin import`, from fields of any type, instead of as messages of our own types.
    #[arg(long, value_name = "MAP")]
    map: Option<PathBuf>,
    /// Folders with definitions of the types that the map needs: DIR/package/msg/Type.msg.
    #[arg(long, value_name = "DIR", num_args = 1.., requires = "map")]
    definitions: Vec<PathBuf>,
    /// Ticks of the model per second.
    #[arg(long = "rate", value_name = "HZ", default_value_t = 1000.0, value_parser = number)]
    rate_hz: f64,
    /// Published states per second.
    #[arg(long = "publish-rate", value_name = "HZ", default_value_t = 100.0, value_parser = number)]
    publish_rate_hz: f64,
    /// Keep the integration thread on this core, further ones on those after it.
    #[arg(long, value_name = "CORE")]
    cpu: Option<usize>,
    /// `SCHED_FIFO` priority of the integration thread, 1 to 99; 0 for an ordinary thread.
    #[arg(long, value_name = "N", default_value_t = 80, value_parser = clap::value_parser!(u8).range(0..=99))]
    priority: u8,
    /// End after so many seconds; run until told to stop by default.
    #[arg(long = "duration", value_name = "S", value_parser = number)]
    duration_s: Option<f64>,
    /// An input older than this is stale; the ESV state comes only once a second.
    #[arg(long = "stale-after", value_name = "S", default_value_t = 2.5, value_parser = number)]
    stale_after_s: f64,
    /// Hold a stale input for so long before the fail-safe.
    #[arg(long = "hold", value_name = "S", default_value_t = 1.0, value_parser = number)]
    hold_s: f64,
    /// The fail-safe: treat a stale input as an ESV trip, hold it for ever, stop the node, or go back to its default.
    #[arg(long, value_name = "WHAT", default_value = "trip", value_parser = OnStale::NAMES)]
    on_stale: String,
    /// Peers drop a node that they did not hear for so long; it is announced five times in that span.
    #[arg(long = "lease", value_name = "S", default_value_t = 10.0, value_parser = number)]
    lease_s: f64,
    /// Count time from 0 and publish it as `/clock`, for others to follow.
    #[arg(long = "publish-clock")]
    publish_clock: bool,
    /// Stand still at first, until `~/step_simulation` or `~/set_simulation_state` lets the simulation go.
    #[arg(long)]
    paused: bool,
    /// Inputs that may stay away: their defaults are taken until they are heard.
    #[arg(long, value_name = "INPUT", num_args = 1.., value_delimiter = ',', value_parser = NodeInput::NAMES)]
    optional: Vec<String>,
    /// Write a bag of the inputs as the twin took them and of its estimates.
    #[arg(long, value_name = "DIR")]
    bag: Option<PathBuf>,
    /// Write the figures of the run as JSON to this file.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Print the figures of the run as JSON instead of text.
    #[arg(long)]
    json: bool,
    /// What every ROS 2 program takes: `-r FROM:=TO`, `-p NAME:=VALUE`, `--params-file FILE`, `--log-level LEVEL`.
    #[arg(long = "ros-args", num_args = 0.., allow_hyphen_values = true, value_terminator = "--", value_name = "ARGS")]
    ros: Vec<String>,
}

/// Runs the node until a signal, its duration or the fail-safe ends it.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let Args { rate_hz, publish_rate_hz, stale_after_s, hold_s, .. } = args;
    expect((1.0..=10_000.0).contains(rate_hz), || format!("--rate is {rate_hz}: expected 1 to 10000 Hz"))?;
    expect((0.1..=*rate_hz).contains(publish_rate_hz), || {
        format!("--publish-rate is {publish_rate_hz}: expected 0.1 Hz to --rate, {rate_hz} Hz")
    })?;
    expect((0.001..=86_400.0).contains(stale_after_s), || {
        format!("--stale-after is {stale_after_s}: expected 0.001 to 86400 s")
    })?;
    expect((0.0..=86_400.0).contains(hold_s), || format!("--hold is {hold_s}: expected 0 to 86400 s"))?;
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
        wishes: Wishes { cpu: args.cpu, priority: args.priority },
        ..NodeSettings::default()
    };
    let _claim = args.out.as_deref().map(|out| output::claim_place("--out", out)).transpose()?;
    let environment = environment(args.lease_s)?;
    let whole = Arguments::parse(&args.ros, "govtwin")?;
    let map = bus_map::for_node(args.map.as_deref(), &args.definitions, args.adapt)?;
    let inputs = InputNames::new(map.as_ref());
    let of_one = |arguments: Arguments, params: Option<&Path>, bag: Option<PathBuf>| {
        anyhow::Ok(RunOptions {
            environment: environment.clone(),
            arguments,
            map: map.clone(),
            unit: unit(params)?,
            residual: args.residual.as_deref().map(model::load).transpose()?,
            adapt: args.adapt,
            settings,
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
    for words in ended.iter().filter_map(|one| one.bag_ended.as_ref()) {
        output::warn(words);
    }
    let has_ended_early = |one: &RunEnd| one.by_fail_safe || one.bag_ended.is_some();
    Ok(if ended.iter().any(has_ended_early) { Outcome::Warnings } else { Outcome::Ok })
}

/// Reads a unit, the shipped one by default.
fn unit(params: Option<&Path>) -> anyhow::Result<Unit> {
    let mut unit = params.map_or_else(|| Ok(params::reference()), params::load)?;
    if Twin::new(&unit).plant().lookahead_s > 0.0 {
        unit.effects.retain(|setting| setting.id != "clock_offset");
        output::warn(
            "the effect clock_offset asks for inputs from the future, which has no meaning live; it is left out",
        );
    }
    Ok(unit)
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

/// The environment of the process with the lease from the command line.
pub fn environment(lease_s: f64) -> anyhow::Result<Environment> {
    expect((1.0..=3600.0).contains(&lease_s), || format!("--lease is {lease_s}: expected 1 to 3600 s"))?;
    Ok(Environment { lease: Duration::from_secs_f64(lease_s), ..Environment::of_process()? })
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
        text.push_str(&format!("{name:<24}{used:>8} used {refused:>8} refused {lost:>8} lost on the way\n"));
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
