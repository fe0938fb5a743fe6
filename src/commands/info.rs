//! `govtwin info`: reports what is in bags, this project's or any other.

mod text;

use std::path::{Path, PathBuf};

use govtwin_bag::{BagError, Overview, ReadOptions, StreamHealth, Survey, Warning};
use serde::Serialize;

use super::bags::{self, TopicArgs};
use super::output::{Progress, print};
use crate::commands::Outcome;

/// Say what is in a bag: topics, types, counts, rates, gaps, jitter, health.
///
/// Any bag will do: MCAP files and bag folders of any ROS 2 system, split, unindexed or cut short, and
/// sqlite3 bags, compressed as files or message by message.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Bags: files, bag folders, or folders that contain bags.
    #[arg(value_name = "BAG", required = true)]
    bags: Vec<PathBuf>,
    #[command(flatten)]
    topics: TopicArgs,
    /// Print JSON instead of tables: all of the tables and more, such as the range of each number.
    #[arg(long)]
    json: bool,
}

impl Args {
    /// The arguments for one bag.
    pub fn of(bag: PathBuf, json: bool) -> Self {
        Self { bags: vec![bag], topics: TopicArgs::default(), json }
    }
}

const HELP: &str = "\
Columns of the table of topics:
  rate        messages per second: 1 / the median interval
  jitter      deviation of the intervals from the median, 99th percentile
  gaps        number of intervals longer than five times the median, and the longest interval
  late        stamps that are earlier than one before them
  delay       time of recording minus stamp: median, smallest and largest
  NaN, inf    numbers in the messages that are not a number, or infinite

Rate, jitter and gaps are computed from `header.stamp`, or from the time of recording (*) if messages
have no stamp. Times are UTC. Warnings report what may make results wrong. Notes report what a reader
of the results should know; they do not change the exit code.

A recording of the servo system is recognised by its topics (/governor/command, /governor/esv,
/governor/tank_pressure, /plant/servo_state, or others given with --topic). For such a recording the
table also names its process, and what a reader would drop, sort or fill.

Examples:
  govtwin info bags/reference/startup_01.mcap
  govtwin info --json bags/practice/case_03 | jq '.[0].topics[] | {name, messages}'

Exit codes: 0 sound, 1 not readable as a bag, 2 wrong usage, 3 read, with warnings.";

/// What is said of one bag.
#[derive(Debug, Serialize)]
struct BagEntry {
    name: String,
    path: PathBuf,
    #[serde(flatten)]
    survey: Survey,
    recording: Option<RecordingEntry>,
    /// Why a bag with some of the servo system's topics is no recording of it.
    no_recording: Option<String>,
    warnings_in_words: Vec<String>,
    notes_in_words: Vec<String>,
}

/// A bag that is a recording of the servo system.
#[derive(Debug, Serialize)]
struct RecordingEntry {
    process: &'static str,
    title: &'static str,
    rows: usize,
    duration_s: f64,
    streams: Vec<StreamHealth>,
}

/// Looks through all bags and prints what is in those that can be read.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let found = bags::find(&args.bags)?;
    let options = ReadOptions { topics: args.topics.topics(), ..ReadOptions::default() };
    let progress = Progress::new(found.len(), "bags");
    let (mut entries, mut errors) = (vec![], vec![]);
    for bag in found {
        match look(bag.name, &bag.path, &options) {
            Ok(entry) => entries.push(entry),
            Err(error) => errors.push(error.to_string()),
        }
        progress.step();
    }
    drop(progress);
    if args.json {
        print(&format!("{}\n", serde_json::to_string_pretty(&entries)?))?;
    } else {
        let texts: Vec<String> = entries.iter().map(text::entry).collect();
        print(&texts.join("\n"))?;
    }
    if !errors.is_empty() {
        anyhow::bail!("{}", errors.join("\n"));
    }
    let sound = entries.iter().all(|entry| entry.warnings_in_words.is_empty());
    Ok(if sound { Outcome::Ok } else { Outcome::Warnings })
}

fn look(name: String, path: &Path, options: &ReadOptions) -> Result<BagEntry, BagError> {
    let (mut survey, overview) = govtwin_bag::look(path, options)?;
    // A bag of something else is not checked as a recording.
    let related = survey.topics.iter().any(|topic| topic.type_name.starts_with("governor_msgs/"));
    let mut recording = None;
    let mut no_recording = None;
    let mut in_doubt = None;
    match overview {
        Ok(Overview { process, rows, duration_s, health }) => {
            survey.warnings = health.warnings;
            survey.notes = health.notes;
            recording = Some(RecordingEntry {
                process: process.id(),
                title: process.title(),
                rows,
                duration_s,
                streams: health.streams,
            });
        }
        Err(BagError::Missing { missing, .. }) if related => no_recording = Some(missing.join("; ")),
        Err(error) if related => {
            no_recording = Some(error.to_string());
            // All streams are there, and what they hold is no recording of one time.
            in_doubt = match error {
                BagError::Clocks { problem, .. } => Some(problem),
                BagError::TwoClocks { .. } | BagError::TooManyRows { .. } => no_recording.clone(),
                _ => None,
            };
        }
        Err(_) => {}
    }
    let mut said: Vec<String> = survey.warnings.iter().map(Warning::to_string).collect();
    said.extend(in_doubt);
    said.extend(topics_in_doubt(&survey));
    let notes_in_words = survey.notes.iter().map(ToString::to_string).collect();
    Ok(BagEntry {
        name,
        path: path.to_owned(),
        survey,
        recording,
        no_recording,
        warnings_in_words: said,
        notes_in_words,
    })
}

/// Topics whose messages or hash are not those of the schema beside them.
pub(super) fn topics_in_doubt(survey: &Survey) -> impl Iterator<Item = String> {
    let undecodable = survey.topics.iter().filter(|topic| topic.undecodable > 0).map(|topic| {
        format!("{}: {} of {} messages do not fit their schema", topic.name, topic.undecodable, topic.messages)
    });
    let other = survey.topics.iter().filter(|topic| topic.type_hash_fits == Some(false)).map(|topic| {
        format!("{}: the stated type hash {} is not that of the schema beside it", topic.name, topic.type_hash)
    });
    undecodable.chain(other)
}
