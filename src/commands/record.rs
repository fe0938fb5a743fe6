//! `govtwin record`: what is heard on DDS, into a bag.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Context, bail};
use govtwin::bag::Writer;
use govtwin::node::arguments::Arguments;
use govtwin::node::bus::Bus;
use govtwin::node::realtime::{Until, pause};
use govtwin::node::recorder::{DEFAULT_TOPICS, OPTIONS, record};

use serde_json::json;

use super::output;
use super::run::{duration, environment, stop_on_signals};
use crate::commands::Outcome;

/// Arguments of `govtwin record`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder of the bag to write.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Only these topics; a type is looked up on the bus unless given as `TOPIC:package/msg/Type`.
    #[arg(long, value_name = "TOPIC", num_args = 1..)]
    topics: Vec<String>,
    /// End after so many seconds; record until told to stop by default.
    #[arg(long = "duration", value_name = "S")]
    duration_s: Option<f64>,
    /// Look so long for a topic's type.
    #[arg(long = "wait", value_name = "S", default_value_t = 10.0)]
    wait_s: f64,
    /// Peers drop a node that they did not hear for so long; it is announced five times in that span.
    #[arg(long = "lease", value_name = "S", default_value_t = 10.0)]
    lease_s: f64,
    /// Print JSON instead of text.
    #[arg(long)]
    json: bool,
    /// What every ROS 2 program takes: `-r FROM:=TO`, `-r __ns:=/NAME`.
    #[arg(long = "ros-args", num_args = 0.., allow_hyphen_values = true, value_terminator = "--", value_name = "ARGS")]
    ros: Vec<String>,
}

/// Records until a signal or the duration ends it.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    Writer::check(&args.out, OPTIONS).context("--out")?;
    let wait = duration(Some(args.wait_s), "--wait")?.unwrap_or_default();
    let length = duration(args.duration_s, "--duration")?;
    let environment = environment(args.lease_s)?;
    for remark in &environment.remarks {
        output::warn(remark);
    }
    let stop = stop_on_signals()?;
    let mut bus = Bus::open(&environment, Arguments::parse(&args.ros, "govtwin_record")?)?;
    let topics = topics(args, &bus, wait, &stop)?;
    let recorded = record(&mut bus, &topics, &args.out, length, &stop, &mut || {
        output::say("recording");
    })?;
    for words in bus.arguments().remarks.iter().chain(&bus.idle_arguments()) {
        output::warn(words);
    }
    drop(bus);
    let mut text = String::new();
    for (topic, count) in &recorded.messages {
        text.push_str(&format!("{topic:<24}{count:>8} recorded\n"));
    }
    for (topic, type_name) in &recorded.foreign {
        output::warn(&format!("{topic}: a sender publishes `{type_name}`; its samples are not recorded"));
    }
    if recorded.undecodable > 0 {
        output::warn(&format!("{} samples were not of their type", recorded.undecodable));
    }
    let silence = recorded.silence(environment.domain);
    for words in &silence {
        output::warn(words);
    }
    text.push_str(&format!("bag: {}\n", recorded.bag.display()));
    if args.json {
        text = format!(
            "{:#}\n",
            json!({
                "schema": "govtwin-record/1", "bag": recorded.bag.display().to_string(), "messages": recorded.messages,
                "undecodable": recorded.undecodable, "foreign": recorded.foreign.iter().map(|(topic, _)| topic).collect::<Vec<_>>(),
            })
        );
    }
    output::print(&text)?;
    let clean = recorded.undecodable == 0 && recorded.foreign.is_empty() && silence.is_empty();
    Ok(if clean { Outcome::Ok } else { Outcome::Warnings })
}

/// Names and types of what is to be recorded.
fn topics(args: &Args, bus: &Bus, wait: Duration, stop: &AtomicBool) -> anyhow::Result<Vec<(String, String)>> {
    if args.topics.is_empty() {
        return Ok(DEFAULT_TOPICS.map(|(topic, type_name)| (topic.to_owned(), type_name.to_owned())).to_vec());
    }
    let until = Until::after(Some(wait));
    args.topics
        .iter()
        .map(|topic| match topic.split_once(':') {
            Some((name, type_name)) => Ok((name.to_owned(), type_name.to_owned())),
            None => type_of(topic, bus, until, stop).map(|type_name| (topic.clone(), type_name)),
        })
        .collect()
}

/// The type of a topic: one of the usual ones, or what its senders announce.
fn type_of(topic: &str, bus: &Bus, until: Until, stop: &AtomicBool) -> anyhow::Result<String> {
    let usual = DEFAULT_TOPICS.iter().find(|(name, _)| *name == topic.trim_start_matches('/'));
    if let Some((_, type_name)) = usual {
        return Ok((*type_name).to_owned());
    }
    let full_name = bus.arguments().resolve(topic)?;
    loop {
        if let Some((_, (_, type_name))) = bus.writers().into_iter().find(|(_, (name, _))| *name == full_name) {
            return Ok(type_name);
        }
        if stop.load(Ordering::Relaxed) || until.is_past() {
            bail!("nobody publishes `{full_name}`, so its type is not known; give it as {topic}:package/msg/Type");
        }
        pause(Duration::from_millis(50));
    }
}
