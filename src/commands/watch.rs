//! `govtwin watch`: follow the bags of a unit or listen to it, diagnose each process when it has ended, and say when a fault has grown.

#[cfg(feature = "node")]
mod bus;
mod chronicle;
mod follow;

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::builder::RangedU64ValueParser;
use govtwin_bag::Positions;
use govtwin_diagnosis::DiagnosisSettings;
use govtwin_diagnosis::watch::history;

use super::bags::{self, TopicArgs};
use super::output::{Output, print, warn};
use super::{provenance, report_file};
use crate::commands::{Outcome, expect, number, sheet_of, unknown};
use chronicle::Chronicle;
use follow::Follower;

/// The history, the page, and the state for machines.
const NAMES: [&str; 3] = ["history.jsonl", "watch.html", "watch.json"];

/// A history of so many bytes is of a few decades.
const LARGEST_BYTES: u64 = 1 << 28;

/// Arguments of `govtwin watch`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// Recordings of one unit: folders in which bags appear, and bags, which may still grow.
    #[cfg_attr(feature = "node", arg(value_name = "FOLDER|BAG", required_unless_present = "bus"))]
    #[cfg_attr(not(feature = "node"), arg(value_name = "FOLDER|BAG", required = true))]
    paths: Vec<PathBuf>,
    #[cfg(feature = "node")]
    #[command(flatten)]
    bus: bus::BusArgs,
    #[command(flatten)]
    topics: TopicArgs,
    /// Data sheet (parameter file) of the unit; without it, the shipped reference unit.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Folder of history.jsonl, watch.html and watch.json [default: watch/UNIT].
    ///
    /// UNIT is the folder that contains the recordings.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Diagnose what is there, then end; for a timer. The next run continues the history.
    #[arg(long)]
    once: bool,
    /// Time between two looks at the recordings, s.
    #[arg(long, value_name = "S", default_value_t = 5, value_parser = RangedU64ValueParser::<u64>::new().range(1..=86_400))]
    every: u64,
    /// Time without growth after which a bag, and the last process in it, counts as ended, s.
    #[arg(long, value_name = "S", default_value_t = 30, value_parser = RangedU64ValueParser::<u64>::new().range(1..=86_400))]
    settled: u64,
    /// Mean number of processes between two false warnings of one size, if nothing changes.
    ///
    /// The limit of the cumulative sum follows from it.
    #[arg(long, value_name = "N", default_value_t = 1000.0, value_parser = number)]
    between_false_alarms: f64,
    /// Consider only this effect, which is faster; may be repeated.
    #[arg(long, value_name = "ID")]
    only: Vec<String>,
    /// Print a line of JSON for each process, as in the history, instead of text.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Start-ups, load changes, shutdowns and load rejections are cut out of the recordings or, with --bus,
out of the received topics. Each process is diagnosed alone, once nothing has moved for 25 s or its
bag has ended. Its verdict, and sizes with intervals, enter the history. A fault that was named once
is followed from then on, also in processes whose verdict does not name it.

A warning reports that a size has moved, since which process, and how far. To detect this, each size
is ranked among the earlier sizes from the same kind of process, by its distance from their mean
divided by its interval. The ranks of all kinds enter one cumulative sum, whose limit follows from
--between-false-alarms.

The history is complete at any moment, so the watch may be stopped and restarted. A process is
identified by the digest of its rows and entered only once, even if its bag is copied, renamed or
still growing. A recording of `govtwin record` in a watched folder is followed while it is written.

With --bus, each process is recorded into a bag of its own, which waits in OUT/waiting for its
diagnosis while listening continues. A process that is being recorded when the watch ends is
diagnosed after the next start, as far as it was recorded.

With --map, the topics of a plant are received, of any type. The map is that of `govtwin import`,
and must name `servomotor_position`.

Examples:
  govtwin watch --bus --params unit3.yaml --map unit3_map.yaml
  govtwin watch --bus --params unit3.yaml --ros-args -r __ns:=/unit3
  govtwin watch /data/unit3 --params unit3.yaml
  govtwin watch /data/unit3 --params unit3.yaml --publish
  govtwin watch /data/unit3 --once || mail -s 'unit 3' operator < watch/unit3/watch.json
  govtwin watch /data/unit3 --json | jq -c 'select(.warnings != [])'

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 with --once: a size has moved, or something could
not be read; with --bus: samples or processes were lost. Without --once it runs until it is stopped.";

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let between = args.between_false_alarms;
    expect((10.0..=1e6).contains(&between), || {
        format!("--between-false-alarms: expected 10 to 1000000 processes, found {between}")
    })?;
    if let Some(path) = args.paths.iter().find(|path| !follow::may_come(path)) {
        bail!(
            "{}: expected a folder, a bag, or a place where one is being recorded; found nothing there",
            path.display()
        );
    }
    #[cfg(feature = "node")]
    args.bus.check()?;
    let mut chronicle = chronicle(args)?;
    #[cfg(feature = "node")]
    if args.bus.bus {
        return bus::listen(args, chronicle);
    }
    let options = bags::options(args.topics.topics(), Positions::of(chronicle.unit.recorded));
    let mut follower = Follower::new(&args.paths, options, args.settled);
    #[cfg(feature = "node")]
    if args.bus.publish {
        return bus::publish(args, chronicle, follower);
    }
    loop {
        look(&mut follower, &mut chronicle, args.once, &mut |_| ())?;
        if args.once {
            break;
        }
        wait(Duration::from_secs(args.every));
    }
    chronicle.place()?;
    let courses = chronicle.courses();
    let moved = courses.iter().any(|course| course.warning().is_some());
    if !args.json {
        print(&chronicle.closing(&courses))?;
    }
    Ok(if moved || chronicle.warned { Outcome::Warnings } else { Outcome::Ok })
}

/// Looks once; `entered` hears of each process that was entered.
fn look(
    follower: &mut Follower,
    chronicle: &mut Chronicle,
    only_look: bool,
    entered: &mut dyn FnMut(&Chronicle),
) -> anyhow::Result<()> {
    let troubles = follower.look(only_look, &mut |given, cut| {
        if chronicle.take(given, cut)? {
            entered(chronicle);
        }
        Ok(())
    })?;
    for trouble in troubles {
        warn(&trouble);
        chronicle.warned = true;
    }
    Ok(())
}

/// Claims the folder of the history and reads what is in it.
fn chronicle(args: &Args) -> anyhow::Result<Chronicle> {
    let unit = sheet_of(args.params.as_deref())?.unit;
    // Who listens has no folder of recordings: the unit is called by its folder or its sheet.
    let instead: Vec<PathBuf> = args.out.iter().chain(&args.params).take(1).cloned().collect();
    let name = match if args.paths.is_empty() { &instead } else { &args.paths } {
        none if none.is_empty() => "unit".to_owned(),
        some => provenance::unit_of(some),
    };
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from("watch").join(&name));
    let settings = settings(&args.only)?;
    // What else stands as a history is told with its line, when it is read.
    let claim = Output::claim(&out, &NAMES[1..])?;
    let history = out.join(NAMES[0]);
    let text = report_file::text_if_there(&history, LARGEST_BYTES)?.unwrap_or_default();
    let way_out = "move the file away to begin a new history";
    let (entries, torn) = history::read(&text).with_context(|| format!("{}: {way_out}", history.display()))?;
    if torn {
        warn(&format!("{}: the last line was broken off; its process is diagnosed anew", history.display()));
    }
    Ok(Chronicle {
        unit,
        name,
        out,
        settings,
        only: args.only.clone(),
        between_false_alarms: args.between_false_alarms,
        json: args.json,
        entries,
        warned: torn,
        _claim: claim,
    })
}

#[expect(clippy::disallowed_methods, reason = "nobody says when a bag has grown; it is looked at now and then")]
fn wait(duration: Duration) {
    std::thread::sleep(duration);
}

fn settings(only: &[String]) -> anyhow::Result<DiagnosisSettings> {
    let mut settings = DiagnosisSettings::default();
    for id in only {
        let known = settings.catalogue.iter().map(|spec| spec.id);
        if !known.clone().any(|known| known == id) {
            return Err(unknown(&format!("--only {id}: there is no such effect"), id, known, "govtwin effects"));
        }
    }
    if !only.is_empty() {
        settings.catalogue.retain(|spec| only.iter().any(|id| id == spec.id));
    }
    Ok(settings)
}
