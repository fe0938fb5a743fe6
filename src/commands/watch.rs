//! `govtwin watch`: follow the bags of a unit, diagnose each process when it has ended, and say when a fault has grown.

mod follow;

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, bail};
use clap::builder::RangedU64ValueParser;
use govtwin::diagnosis::{Settings, diagnose};
use govtwin::parameters::Unit;
use govtwin::params;
use govtwin::report::table::quantity;
use govtwin::watch::cut::{Cut, Ended};
use govtwin::watch::history::{self, Course, Entry, SCHEMA};
use govtwin::watch::page::{Watched, page};

use super::bags::TopicArgs;
use super::output::{Output, Progress, print, warn};
use super::provenance::{self, PROGRAM};
use crate::commands::{Outcome, expect, number, usage};
use follow::Follower;

/// The history, the page, and the state for machines.
const NAMES: [&str; 3] = ["history.jsonl", "watch.html", "watch.json"];

/// A history of so many bytes is of a few decades.
const LARGEST_BYTES: u64 = 1 << 28;

/// Arguments of `govtwin watch`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = HELP)]
pub struct Args {
    /// What one unit records: folders in which bags appear, and bags, which may still grow.
    #[arg(value_name = "FOLDER|BAG", required = true)]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    topics: TopicArgs,
    /// The unit's data sheet; without it the shipped reference unit.
    #[arg(long, value_name = "FILE")]
    params: Option<PathBuf>,
    /// Folder of the history, history.jsonl, with watch.html and watch.json [default: watch/UNIT, UNIT being the folder that holds the recordings].
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Diagnose what is there and end, for a timer; the history goes on with the next run.
    #[arg(long)]
    once: bool,
    /// Time between two looks, s.
    #[arg(long, value_name = "S", default_value_t = 5, value_parser = RangedU64ValueParser::<u64>::new().range(1..=86_400))]
    every: u64,
    /// A bag that has not grown for so long has ended, s; the last process in it then counts as ended too.
    #[arg(long, value_name = "S", default_value_t = 30, value_parser = RangedU64ValueParser::<u64>::new().range(1..=86_400))]
    settled: u64,
    /// Processes between two false warnings of one size, where nothing moves: the limit of the cumulative sum follows from it.
    #[arg(long, value_name = "N", default_value_t = 1000.0, value_parser = number)]
    between_false_alarms: f64,
    /// Tries these effects alone, which is faster; may be repeated.
    #[arg(long, value_name = "ID")]
    only: Vec<String>,
    /// Print a line of JSON for each process instead of words: the line that the history holds.
    #[arg(long)]
    json: bool,
}

const HELP: &str = "\
Cuts start-ups, load changes, shutdowns and load rejections out of what is recorded, diagnoses each alone once nothing has moved for 25 s or its
bag has ended, and enters verdict and sizes with intervals into the history. A fault that was named once is followed from then on, also in
processes whose verdict does not name it. Its sizes go into a cumulative sum that weighs each by its interval; a warning says that the size has
moved, from which process on, and how far. Each process is compared with those of its kind, and all kinds add to the sum. The limit is not set by hand: it follows from --between-false-alarms.

The history is whole at any moment: stop and start as you like. What is in it is known by the digest of its rows, so that nothing is
entered twice, also where a bag was copied, renamed, or read while it grew. `govtwin record` into a watched folder is followed while it records.

Examples:
  govtwin watch /data/unit3 --params unit3.yaml
  govtwin watch /data/unit3 --once || mail -s 'unit 3' operator < watch/unit3/watch.json
  govtwin watch /data/unit3 --json | jq -c 'select(.warnings != [])'

Exit codes: 0 ok, 1 not possible, 2 wrong usage, 3 (with --once) a size has moved, or something could not be read. Without --once it goes on until it is
stopped.";

/// What is being watched.
struct Watch<'a> {
    args: &'a Args,
    unit: Unit,
    name: String,
    out: PathBuf,
    settings: Settings,
    entries: Vec<Entry>,
    warned: bool,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<Outcome> {
    let between = args.between_false_alarms;
    expect((10.0..=1e6).contains(&between), || {
        format!("--between-false-alarms: expected 10 to 1000000 processes, found {between}")
    })?;
    let unit = match &args.params {
        Some(path) => params::load(path)?,
        None => params::reference(),
    };
    let name = provenance::unit_of(&args.paths);
    let out = args.out.clone().unwrap_or_else(|| PathBuf::from("watch").join(&name));
    if let Some(path) = args.paths.iter().find(|path| !follow::may_come(path)) {
        bail!(
            "{}: expected a folder, a bag, or a place where one is being recorded; found nothing there",
            path.display()
        );
    }
    let output = Output::claim(&out, &NAMES)?;
    let history = out.join(NAMES[0]);
    let text = if history.is_file() {
        govtwin::files::read_text(&history, LARGEST_BYTES)
            .with_context(|| format!("cannot read {}", history.display()))?
    } else {
        String::new()
    };
    let way_out = "move the file away to begin a new history";
    let (entries, torn) = history::read(&text).with_context(|| format!("{}: {way_out}", history.display()))?;
    if torn {
        warn(&format!("{}: the last line was broken off; its process is diagnosed anew", history.display()));
    }
    let mut watch = Watch { args, unit, name, out, settings: settings(&args.only)?, entries, warned: torn };
    let mut follower = Follower::new(&args.paths, args.topics.topics(), &watch.unit, args.settled);
    loop {
        let look = follower.look(args.once, &mut |bag, cut| watch.take(bag, cut))?;
        for trouble in look {
            warn(&trouble);
            watch.warned = true;
        }
        if args.once {
            break;
        }
        wait(args.every);
    }
    watch.place()?;
    // The claim lasts as long as the watch.
    drop(output);
    let courses = watch.courses();
    let moved = courses.iter().any(|course| course.warning().is_some());
    if !args.json {
        print(&watch.closing(&courses))?;
    }
    Ok(if moved || watch.warned { Outcome::Warnings } else { Outcome::Ok })
}

#[expect(clippy::disallowed_methods, reason = "nobody says when a bag has grown; it is looked at now and then")]
fn wait(seconds: u64) {
    std::thread::sleep(Duration::from_secs(seconds));
}

fn settings(only: &[String]) -> anyhow::Result<Settings> {
    let mut settings = Settings::default();
    for id in only {
        let known = settings.catalogue.iter().map(|spec| spec.id);
        if !settings.catalogue.iter().any(|spec| spec.id == id) {
            let near = params::nearest(id, known).map(|near| format!("did you mean `{near}`?"));
            let way_out = near.unwrap_or_else(|| "`govtwin effects` lists them".to_owned());
            return Err(usage(format!("--only {id}: there is no such effect; {way_out}")));
        }
    }
    if !only.is_empty() {
        settings.catalogue.retain(|spec| only.iter().any(|id| id == spec.id));
    }
    Ok(settings)
}

impl Watch<'_> {
    fn courses(&self) -> Vec<Course> {
        history::courses(&self.entries, self.args.between_false_alarms)
    }

    /// Diagnoses a process that is not in the history yet, and enters it.
    fn take(&mut self, bag: &str, cut: Cut) -> anyhow::Result<()> {
        if self.entries.iter().any(|entry| entry.digest == cut.digest) {
            return Ok(());
        }
        let mut entry = self.entry(bag, cut);
        self.entries.push(entry.clone());
        let said: Vec<String> = self.courses().iter().filter_map(Course::warning).collect();
        entry.warnings = said;
        self.entries.pop();
        self.entries.push(entry.clone());
        self.place()?;
        if self.args.json {
            print(&(serde_json::to_string(&entry)? + "\n"))?;
        } else {
            print(&line(&entry))?;
        }
        for warning in &entry.warnings {
            warn(warning);
        }
        Ok(())
    }

    fn entry(&self, bag: &str, cut: Cut) -> Entry {
        let Cut { mut recording, digest, ended } = cut;
        bag.clone_into(&mut recording.name);
        let mut entry = Entry {
            schema: SCHEMA.to_owned(),
            digest,
            bag: bag.to_owned(),
            time_ns: recording.frames.first().map_or(0, |frame| frame.time_ns),
            duration_s: recording.duration_s(),
            process: recording.process.id().to_owned(),
            verdict: "not_diagnosed".to_owned(),
            closure: None,
            sizes: vec![],
            notes: vec![],
            warnings: vec![],
            program: PROGRAM.to_owned(),
        };
        entry.notes.extend(match ended {
            Ended::AtRest => None,
            Ended::Gap => Some("Time jumped, which ended the process.".to_owned()),
            Ended::TooLong => Some("It had not ended after 300 s and goes on in the next.".to_owned()),
            Ended::OfRows => Some("The bag ended before the unit was at rest.".to_owned()),
        });
        let mut followed = history::followed(&self.entries);
        followed.extend(self.args.only.iter().cloned());
        let progress = Progress::new(100, "%");
        match diagnose(vec![recording], &self.unit, &self.settings, &|what, share| progress.at(share, what)) {
            Ok(diagnosis) => {
                diagnosis.verdict.id().clone_into(&mut entry.verdict);
                entry.closure = Some(diagnosis.closure.value).filter(|share| share.is_finite());
                entry.sizes = history::sizes(&diagnosis, &followed);
                entry.notes.extend(diagnosis.notes);
            }
            Err(error) => entry.notes.push(error.to_string()),
        }
        entry
    }

    /// Writes history, page and state; the history is whole at any moment.
    fn place(&self) -> anyhow::Result<()> {
        let courses = self.courses();
        let times: Vec<String> = self.entries.iter().map(|entry| provenance::date_of(entry.time_ns)).collect();
        let between_false_alarms = self.args.between_false_alarms;
        let watched = Watched {
            unit: &self.name,
            entries: &self.entries,
            courses: &courses,
            between_false_alarms,
            times: &times,
        };
        let state = serde_json::json!({
            "schema": SCHEMA, "unit": self.name, "processes": self.entries.len(),
            "between_false_alarms": between_false_alarms,
            "warnings": courses.iter().filter_map(Course::warning).collect::<Vec<_>>(),
            "sizes": courses.iter().map(state_of).collect::<Vec<_>>(),
            "newest": self.entries.last(),
        });
        let mut files = govtwin::files::Together::default();
        let texts =
            [history::write(&self.entries)?, page(&watched)?.to_html(), serde_json::to_string_pretty(&state)? + "\n"];
        let writing = || format!("cannot write in {}", self.out.display());
        for (name, text) in NAMES.iter().zip(texts) {
            files.add(&self.out.join(name), text.as_bytes()).with_context(writing)?;
        }
        files.place().with_context(writing)
    }

    fn closing(&self, courses: &[Course]) -> String {
        let mut text = format!("{}: {} processes in the history\n", self.name, self.entries.len());
        for course in courses {
            let words = course.warning().unwrap_or_else(|| format!("{}: {} stays", course.effect, course.parameter));
            text += &format!("  {words}\n");
        }
        text + &format!("page: {}\n", self.out.join(NAMES[1]).display())
    }
}

/// One size for machines.
fn state_of(course: &Course) -> serde_json::Value {
    let (last, point) = (course.estimates.last(), course.points.last());
    serde_json::json!({
        "effect": course.effect, "parameter": course.parameter, "unit": course.unit, "estimates": course.estimates.len(),
        "value": last.map(|one| one.size), "process": last.map(|_| course.kind(course.estimates.len() - 1)), "ci90": last.map(|one| [one.low, one.high]), "mean_before": point.map(|point| point.mean),
        "growth": point.map(|point| point.sums.growth), "shrinkage": point.map(|point| point.sums.shrinkage), "limit": course.limit,
        "moved": point.is_some_and(|point| point.alarm),
        "since_process": point.and_then(|point| point.since).map(|since| course.entries[since]),
    })
}

/// A process in a line.
fn line(entry: &Entry) -> String {
    let named = entry.sizes.iter().filter(|size| size.named).map(|size| {
        let [low, high] = size.ci90.map(|end| quantity(end, &size.unit));
        format!(" {} {} ({low} to {high})", size.effect, quantity(size.value, &size.unit))
    });
    let sizes: Vec<String> = named.collect();
    let time = provenance::date_of(entry.time_ns);
    format!("{time} {} in {}: {}{}\n", entry.process, entry.bag, entry.verdict, sizes.join(","))
}
