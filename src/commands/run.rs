//! `govtwin run`: runs the twin as a ROS 2 node.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use anyhow::Context;
use govtwin::node::arguments::Arguments;
use govtwin::node::core::{NodeInput, OnStale};
use govtwin::node::environment::Environment;
use govtwin::node::live::{self, RunEnd, RunOptions};
use govtwin::node::realtime::Wishes;
use govtwin::node::settings::{InputSettings, NodeSettings};
use govtwin::params;
use govtwin::twin::Twin;
use serde_json::json;

use super::{model, output};
use crate::commands::{Outcome, expect, number, usage};

/// Arguments of `govtwin run`.
#[derive(Debug, clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is an option of its own")]
pub struct Args {
    /// Parameter file of the unit; the shipped unit by default.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Correct the twin by this model of `govtwin train` and publish `sim/corrected/servo_state` and its band beside `sim/servo_state`.
    #[arg(long, value_name = "MODEL")]
    residual: Option<PathBuf>,
    /// Let the residual adapt to a unit that ages: watch `plant/servo_state` for drift and follow it by a bounded bias and gain.
    #[arg(long, requires = "residual")]
    adapt: bool,
    /// Ticks of the model per second.
    #[arg(long = "rate", value_name = "HZ", default_value_t = 1000.0, value_parser = number)]
    rate_hz: f64,
    /// Published states per second.
    #[arg(long = "publish-rate", value_name = "HZ", default_value_t = 100.0, value_parser = number)]
    publish_rate_hz: f64,
    /// Keep the integration thread on this core.
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
    let mut unit = args.params.as_deref().map_or_else(|| Ok(params::reference()), params::load)?;
    if Twin::new(&unit).plant().lookahead_s > 0.0 {
        unit.effects.retain(|setting| setting.id != "clock_offset");
        output::warn(
            "the effect clock_offset asks for inputs from the future, which has no meaning live; it is left out",
        );
    }
    let options = RunOptions {
        environment: environment(args.lease_s)?,
        arguments: Arguments::parse(&args.ros, "govtwin")?,
        unit,
        residual: args.residual.as_deref().map(model::load).transpose()?,
        adapt: args.adapt,
        settings,
        duration: duration(args.duration_s, "--duration")?,
        bag: args.bag.clone(),
    };
    let stop = stop_on_signals()?;
    let ended = live::run(&options, &stop, &mut |level, words| {
        output::say(&format!("{level:?}: {words}"));
    })?;
    let figures = serde_json::to_string_pretty(&figures(&ended))? + "\n";
    if let Some(path) = &args.out {
        output::write_atomically(path, figures.as_bytes())?;
    }
    output::print(&if args.json { figures } else { text(&ended) })?;
    if let Some(words) = &ended.bag_ended {
        output::warn(words);
    }
    Ok(if ended.by_fail_safe || ended.bag_ended.is_some() { Outcome::Warnings } else { Outcome::Ok })
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

fn figures(ended: &RunEnd) -> serde_json::Value {
    let inputs: serde_json::Map<String, serde_json::Value> = NodeInput::ALL
        .into_iter()
        .map(|input| {
            let counts = ended.counts[input as usize];
            let row = json!({"used": counts.used, "refused": counts.all_refused(), "restarts": counts.restarts, "lost": counts.lost});
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

fn text(ended: &RunEnd) -> String {
    let mut text = ended.summary.text();
    for input in NodeInput::ALL {
        let counts = ended.counts[input as usize];
        let (topic, used, refused, lost) = (input.topic(), counts.used, counts.all_refused(), counts.lost);
        text.push_str(&format!("{topic:<24}{used:>8} used {refused:>8} refused {lost:>8} lost on the way\n"));
    }
    for bag in &ended.bags {
        text.push_str(&format!("bag: {}\n", bag.display()));
    }
    text
}
