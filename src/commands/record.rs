//! `govtwin record`: what is heard on DDS, into a bag.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::Context;
use govtwin_bag::import::{Import, MappedField, topics_of};
use govtwin_bag::{Writer, broken_off};
use govtwin_node::arguments::Arguments;
use govtwin_node::bus::Bus;
use govtwin_node::recorder::{DEFAULT_TOPICS, OPTIONS, Selection, record};

use serde_json::json;

use super::network::NetworkArgs;
use super::run::{duration, stop_on_signals};
use super::{bus_map, output};
use crate::commands::{Outcome, number};

/// Record from DDS into a bag.
///
/// Records topics of any type as they stand on the wire, with their type hashes and the qualities of service that their publishers
/// offer. Definitions of types are those of this program, of ROS where it is installed (AMENT_PREFIX_PATH), of --definitions, and
/// of publishers that answer `get_type_description` (Jazzy and later); where nobody knows one, the bytes are recorded without it.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Bag folder to write.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Topics to record.
    ///
    /// The type is the one stated as `TOPIC:package/msg/Type`, else that of this project for the topics of the servo
    /// system, else that of the first publisher.
    #[arg(long, value_name = "TOPIC", num_args = 1..)]
    topics: Vec<String>,
    /// Import map (`govtwin import`): record the topics that it names, of any type.
    #[arg(long, value_name = "MAP")]
    map: Option<PathBuf>,
    /// Record every published topic, including those that appear later.
    #[arg(long)]
    all: bool,
    /// Folders with definitions of types: DIR/package/msg/Type.msg.
    #[arg(long, value_name = "DIR", num_args = 1..)]
    definitions: Vec<PathBuf>,
    /// Duration of the recording, s; without it, the recorder runs until it is stopped.
    #[arg(long = "duration", value_name = "S", value_parser = number)]
    duration_s: Option<f64>,
    #[command(flatten)]
    network: NetworkArgs,
    /// Print JSON instead of text.
    #[arg(long)]
    json: bool,
    /// ROS 2 arguments: `-r FROM:=TO`, `-r __ns:=/NAME`.
    #[arg(long = "ros-args", num_args = 0.., allow_hyphen_values = true, value_terminator = "--", value_name = "ARGS")]
    ros: Vec<String>,
}

const HELP: &str = "\
Without --topics, --map and --all, the topics of the servo system are recorded (docs/ros2.md).

With --map, the topics of the map are recorded unchanged, so that `govtwin replay RUN --map MAP`
reads the values that `govtwin run --map MAP` received. At the end the bag is checked by the map: if
it cannot be read, the reason is reported and the exit code is 3.

Until the recording ends it is in `.NAME.unfinished` beside DIR, with a complete chunk each second.
If the recorder is killed, `govtwin recover DIR` saves it. If the disk is full, the recording ends,
and the bag is completed in 8 MiB that are reserved for this.

Examples:
  govtwin record --out run
  govtwin record --out run --all --duration 60
  govtwin record --out run --topics /clock /rosout /diagnostics /plant/servo_state
  govtwin record --out run --map unit3_map.yaml
  govtwin record --out run --topics /head:bench_msgs/msg/Head --definitions ~/bench/src

Exit codes: 0 recorded, 1 the bag or the bus failed, 2 wrong usage, 3 recorded, with warnings.";

/// Records until a signal or the duration ends it.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    Writer::check(&args.out, OPTIONS).context("--out")?;
    let length = duration(args.duration_s, "--duration")?;
    let environment = args.network.environment()?;
    output::warn_all(&environment.remarks);
    let map = args.map.as_deref().map(bus_map::for_recording).transpose()?;
    let selection = selection(args, map.as_ref().map_or(&[], |(_, fields)| fields));
    let stop = stop_on_signals()?;
    let mut bus = Bus::open(&environment, Arguments::parse(&args.ros, "govtwin_record")?)?;
    let recorded = record(&mut bus, &selection, &args.out, length, &stop, &mut |words| output::say(words))
        .with_context(|| what_is_kept(&args.out))?;
    output::warn_all(bus.arguments().remarks.iter().chain(&bus.idle_arguments()));
    drop(bus);
    let mut text = String::new();
    for (topic, count) in &recorded.messages {
        text.push_str(&format!("{topic:<24}{count:>8} recorded\n"));
    }
    for (topic, type_name) in &recorded.foreign {
        output::warn(&format!("{topic}: a sender publishes {type_name}; its samples are not recorded"));
    }
    for (topic, type_name) in &recorded.undefined {
        output::warn(&format!("{topic}: recorded without the definition of `{type_name}`, which nobody knows"));
    }
    if recorded.unreadable > 0 {
        output::warn(&format!("{} samples in a layout that is not known are not recorded", recorded.unreadable));
    }
    if recorded.disk_full {
        output::warn("the disk was full: the bag ends before the recording was told to");
    }
    // Of all that is published some topics may stay silent, such as /parameter_events.
    let finds = args.all && args.topics.is_empty() && recorded.messages.values().any(|count| *count > 0);
    let silence = if finds { Vec::new() } else { recorded.silence(environment.domain) };
    output::warn_all(&silence);
    let unread = map.and_then(|(map, _)| Import::open(std::slice::from_ref(&recorded.bag), &map).err());
    if let Some(problem) = &unread {
        output::warn(&format!("by the map the bag cannot be read: {problem}"));
    }
    text.push_str(&format!("bag: {}\n", recorded.bag.display()));
    if args.json {
        let topics = |pairs: &[(String, String)]| pairs.iter().map(|(topic, _)| topic.clone()).collect::<Vec<_>>();
        text = format!(
            "{:#}\n",
            json!({
                "schema": "govtwin-record/2", "bag": recorded.bag.display().to_string(), "messages": recorded.messages,
                "foreign": topics(&recorded.foreign), "without_definition": topics(&recorded.undefined),
                "unreadable": recorded.unreadable, "disk_full": recorded.disk_full,
            })
        );
    }
    output::print(&text)?;
    let complete = recorded.undefined.is_empty() && recorded.unreadable == 0 && !recorded.disk_full;
    let clean = complete && recorded.foreign.is_empty() && silence.is_empty() && unread.is_none();
    Ok(if clean { Outcome::Ok } else { Outcome::Warnings })
}

/// What a user may do after an error.
fn what_is_kept(out: &Path) -> String {
    match broken_off(out) {
        Some(kept) => {
            format!(
                "the recording broke off; what was heard is kept in {}; save it with `govtwin recover {}`",
                kept.display(),
                out.display()
            )
        }
        None => "nothing was recorded".to_owned(),
    }
}

/// What is to be recorded.
fn selection(args: &Args, fields: &[MappedField]) -> Selection {
    let named = args.topics.iter().map(|topic| match topic.split_once(':') {
        Some((name, type_name)) => (name.to_owned(), Some(type_name.to_owned())),
        None => (topic.clone(), usual(topic)),
    });
    let usual = DEFAULT_TOPICS.map(|(topic, type_name)| (topic.to_owned(), Some(type_name.to_owned())));
    let mapped = topics_of(fields).into_iter().map(|topic| (topic, None));
    let mut topics: Vec<_> = named.chain(mapped).collect();
    if topics.is_empty() && !args.all {
        topics = usual.to_vec();
    }
    let mut seen = BTreeSet::new();
    topics.retain(|(topic, _)| seen.insert(topic.clone()));
    Selection { topics, all: args.all, definitions: args.definitions.clone() }
}

/// The type of one of the usual topics.
fn usual(topic: &str) -> Option<String> {
    let known = DEFAULT_TOPICS.iter().find(|(name, _)| *name == topic.trim_start_matches('/'));
    known.map(|(_, type_name)| (*type_name).to_owned())
}
