//! Listening to a unit on the bus, and publishing what its history shows: the diagnosing goes on beside both.

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::Context;
use govtwin_bag::msg::{EsvState, FluidPressure, GovernorCommand, Interface, ServoState, UnitVerdict};
use govtwin_bag::{BagError, Positions, RawMessage, ReadOptions, Stream, Topics};
use govtwin_node::arguments::Arguments;
use govtwin_node::bus::Bus;
use govtwin_node::environment::Environment;
use govtwin_node::process_recorder::{ProcessRecorder, take_up, waiting};
use govtwin_node::realtime::wall_ns;
use govtwin_node::recorder::{Selection, Sink, hear};
use govtwin_node::translator::Translator;
use govtwin_node::verdict::{Herald, verdict};

use super::chronicle::Chronicle;
use super::follow::Follower;
use super::{Args, look, wait};
use crate::commands::bags;
use crate::commands::bus_map::load;
use crate::commands::network::environment;
use crate::commands::output::{say, warn, warn_all};
use crate::commands::run::stop_on_signals;
use crate::commands::{Outcome, expect};

/// Recordings of processes that wait to be diagnosed, and those that were.
const FOLDERS: [&str; 2] = ["waiting", "processes"];

/// Recordings of diagnosed processes that stay.
const KEPT: usize = 500;

/// Peers drop a node that they did not hear for so long, s.
const LEASE_S: f64 = 10.0;

/// Time between two looks at what waits, and between two reports.
const SECOND: Duration = Duration::from_secs(1);

/// Arguments of a watch on the bus.
#[derive(Debug, clap::Args)]
pub struct BusArgs {
    /// Listen on DDS instead of following bags.
    ///
    /// Each process is recorded into a bag in OUT/waiting, and diagnosed while listening continues.
    #[arg(long, conflicts_with_all = ["paths", "once", "settled", "every", "publish"])]
    pub bus: bool,
    /// Publish verdict and sizes on `~/verdict` and `/diagnostics` while bags are followed; --bus always does.
    #[arg(long, conflicts_with = "once")]
    pub publish: bool,
    /// With --bus: number of recordings of diagnosed processes to keep in OUT/processes [default: 500].
    #[arg(long, value_name = "N")]
    keep: Option<usize>,
    /// With --bus: import map (`govtwin import`), to take the signals from fields of any type.
    #[arg(long, value_name = "MAP", requires = "bus", conflicts_with = "named")]
    map: Option<PathBuf>,
    /// Folders with definitions of the types that the map needs: DIR/package/msg/Type.msg.
    #[arg(long, value_name = "DIR", num_args = 1.., requires = "map")]
    definitions: Vec<PathBuf>,
    /// With --bus or --publish: time after which other nodes drop this silent node, s [default: 10].
    #[arg(long = "lease", value_name = "S")]
    lease_s: Option<f64>,
    /// With --bus or --publish: ROS 2 arguments, `-r FROM:=TO`, `-r __ns:=/NAME`, `-r __node:=NAME`.
    #[arg(long = "ros-args", num_args = 0.., allow_hyphen_values = true, value_terminator = "--", value_name = "ARGS")]
    ros: Vec<String>,
}

impl BusArgs {
    /// Refuses what cannot be before anything is made.
    pub fn check(&self) -> anyhow::Result<()> {
        let is_node = self.bus || self.publish;
        // clap requires nothing that conflicts with what is there.
        expect(self.bus || self.keep.is_none(), || "--keep is for a watch with --bus".to_owned())?;
        expect(self.bus || (self.map.is_none() && self.definitions.is_empty()), || {
            "--map and --definitions are for a watch with --bus; import the bags by the map, and watch what comes of them".to_owned()
        })?;
        expect(is_node || (self.lease_s.is_none() && self.ros.is_empty()), || {
            "--lease and --ros-args are for a watch with --bus or --publish".to_owned()
        })?;
        if is_node { self.environment().map(|_| ()) } else { Ok(()) }
    }

    fn environment(&self) -> anyhow::Result<Environment> {
        environment(self.lease_s.unwrap_or(LEASE_S), &[])
    }
}

/// What diagnoses beside, and what it has to say.
struct Worker {
    thread: JoinHandle<anyhow::Result<()>>,
    verdicts: Receiver<UnitVerdict>,
}

impl Worker {
    /// Begins to work with the history as it is.
    fn begin(
        chronicle: Chronicle,
        work: impl FnOnce(Chronicle, &Sender<UnitVerdict>) -> anyhow::Result<()> + Send + 'static,
    ) -> anyhow::Result<Self> {
        let (news, verdicts) = channel();
        tell(&chronicle, &news);
        let thread = std::thread::Builder::new().spawn(move || work(chronicle, &news));
        Ok(Self { thread: thread.context("cannot start the thread that diagnoses")?, verdicts })
    }

    /// What it failed with, once it has.
    fn end(self) -> anyhow::Result<()> {
        if !self.thread.is_finished() {
            // A diagnosis may take minutes. Its recording waits, and is diagnosed after the next start.
            return Ok(());
        }
        self.thread.join().unwrap_or_else(|_| Err(anyhow::anyhow!("the diagnosis broke off")))
    }
}

/// Tells what the history shows now; at the end of the program there may be nobody to tell.
fn tell(chronicle: &Chronicle, news: &Sender<UnitVerdict>) {
    if let Some(verdict) = verdict(&chronicle.name, &chronicle.entries, &chronicle.courses()) {
        let _ = news.send(verdict);
    }
}

fn open(args: &BusArgs) -> anyhow::Result<(Bus, u16)> {
    let environment = args.environment()?;
    warn_all(&environment.remarks);
    let bus = Bus::open(&environment, Arguments::parse(&args.ros, "govtwin_watch")?)?;
    Ok((bus, environment.domain))
}

/// Says which arguments do nothing.
fn remark(bus: &Bus) {
    warn_all(bus.arguments().remarks.iter().chain(&bus.idle_arguments()));
}

/// Follows bags, and publishes what they show.
pub fn publish(args: &Args, chronicle: Chronicle, mut follower: Follower) -> anyhow::Result<Outcome> {
    let stop = stop_on_signals()?;
    let (mut bus, _) = open(&args.bus)?;
    let mut herald = Herald::open(&mut bus, &chronicle.name)?;
    remark(&bus);
    let every = Duration::from_secs(args.every);
    let worker = Worker::begin(chronicle, move |mut chronicle, news| {
        loop {
            look(&mut follower, &mut chronicle, false, &mut |chronicle| tell(chronicle, news))?;
            wait(every);
        }
    })?;
    while !stop.load(Ordering::Relaxed) && !worker.thread.is_finished() {
        worker.verdicts.try_iter().for_each(|verdict| herald.take(verdict));
        herald.second(None);
        wait(SECOND);
    }
    worker.end()?;
    Ok(Outcome::Ok)
}

/// Listens to a unit, and diagnoses each process when it has ended.
pub fn listen(args: &Args, chronicle: Chronicle) -> anyhow::Result<Outcome> {
    let translate = |path: &PathBuf| Ok::<_, anyhow::Error>(Translator::new(load(path)?, path, &Topics::default())?);
    let mut translator = args.bus.map.as_ref().map(translate).transpose()?;
    let stop = stop_on_signals()?;
    let [queue, done] = FOLDERS.map(|name| chronicle.out.join(name));
    std::fs::create_dir_all(&queue).with_context(|| format!("cannot make {}", queue.display()))?;
    if chronicle.warned {
        put_back(&chronicle, &done, &queue)?;
    }
    warn_all(take_up(&queue));
    let (mut bus, domain) = open(&args.bus)?;
    if let Some(translator) = &mut translator {
        translator.resolve(|given| bus.arguments().resolve(given))?;
    }
    let (selection, topics) = match &translator {
        Some(translator) => (mapped(translator, &args.bus.definitions), Topics::default()),
        None => selection(&bus, args)?,
    };
    let options = bags::options(topics, Positions::of(chronicle.unit.recorded));
    let herald = Herald::open(&mut bus, &chronicle.name)?;
    let recorder = ProcessRecorder::new(&queue, &options, Box::new(name_of_now));
    let keep = args.bus.keep.unwrap_or(KEPT);
    let (from, to) = (queue.clone(), done);
    let worker = Worker::begin(chronicle, move |mut chronicle, news| {
        loop {
            diagnose_waiting(&mut chronicle, &options, [&from, &to], keep, news)?;
            wait(SECOND);
        }
    })?;
    let mut listener = WatchListener { recorder, translator, herald, worker };
    let heard = hear(&mut bus, &selection, &mut listener, None, &stop, &mut |words| {
        say(if words == "recording" { "listening" } else { words });
    });
    remark(&bus);
    let (recorded, _) = heard?;
    warn_all(recorded.silence(domain));
    let listening = listener.recorder.listening();
    if let Some(name) = listener.recorder.in_the_making() {
        warn(&format!(
            "a process is not over: {name} is kept, and diagnosed as far as it was heard after the next start"
        ));
    }
    if listening.lost > 0 {
        warn(&format!("{} samples were lost on the way", listening.lost));
    }
    listener.worker.end()?;
    Ok(if listening.left_out > 0 || listening.lost > 0 { Outcome::Warnings } else { Outcome::Ok })
}

/// Hands on what is heard, and once a second what is to be said.
struct WatchListener {
    recorder: ProcessRecorder,
    /// Makes messages of our own types of those of others.
    translator: Option<Translator>,
    herald: Herald,
    worker: Worker,
}

impl Sink for WatchListener {
    fn take(&mut self, message: RawMessage) -> Result<(), BagError> {
        match &mut self.translator {
            Some(translator) => translator.take(&message).into_iter().try_for_each(|one| self.recorder.take(one)),
            None => self.recorder.take(message),
        }
    }

    fn second(&mut self, lost: u64) -> Result<(), BagError> {
        self.recorder.second(lost)?;
        let translator = self.translator.as_mut().map(Translator::words);
        warn_all(self.recorder.words().into_iter().chain(translator.into_iter().flatten()));
        self.worker.verdicts.try_iter().for_each(|verdict| self.herald.take(verdict));
        self.herald.second(Some(&self.recorder.listening()));
        Ok(())
    }

    fn is_full(&self) -> bool {
        self.worker.thread.is_finished()
    }
}

/// The topics of a map.
fn mapped(translator: &Translator, definitions: &[PathBuf]) -> Selection {
    let topics = translator.topics().map(|topic| (topic.to_owned(), None)).collect();
    Selection { topics, definitions: definitions.to_vec(), ..Selection::default() }
}

/// The topics to listen to, and what they are called in the bags.
fn selection(bus: &Bus, args: &Args) -> anyhow::Result<(Selection, Topics)> {
    let types = [GovernorCommand::TYPE_NAME, EsvState::TYPE_NAME, FluidPressure::TYPE_NAME, ServoState::TYPE_NAME];
    let (mut selection, mut topics) = (Selection::default(), Topics::default());
    for (stream, type_name) in Stream::ALL.into_iter().zip(types) {
        let named = args.topics.named.iter().rev().find(|(of, _)| *of == stream).map(|(_, name)| name.clone());
        // The usual names are below the node's namespace.
        let given = named.unwrap_or_else(|| Topics::default().of(stream).trim_start_matches('/').to_owned());
        topics.set(stream, &bus.arguments().resolve(&given)?);
        selection.topics.push((given, Some(type_name.to_owned())));
    }
    Ok((selection, topics))
}

/// A bag's name: when it begins.
fn name_of_now() -> String {
    let now = jiff::Timestamp::from_millisecond(wall_ns() / 1_000_000).unwrap_or_default();
    now.strftime("%Y%m%dT%H%M%S.%3fZ").to_string()
}

/// Diagnoses the recordings that wait, and files them away one by one.
fn diagnose_waiting(
    chronicle: &mut Chronicle,
    options: &ReadOptions,
    [queue, done]: [&Path; 2],
    keep: usize,
    news: &Sender<UnitVerdict>,
) -> anyhow::Result<()> {
    for bag in waiting(queue) {
        let mut follower = Follower::new(std::slice::from_ref(&bag), options.clone(), 0);
        look(&mut follower, chronicle, true, &mut |chronicle| tell(chronicle, news))?;
        move_into(&bag, done)?;
        let kept = waiting(done);
        for old in &kept[..kept.len().saturating_sub(keep)] {
            std::fs::remove_dir_all(old).with_context(|| format!("cannot remove {}", old.display()))?;
        }
    }
    Ok(())
}

fn move_into(bag: &Path, folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let place = folder.join(bag.file_name().unwrap_or_default());
    std::fs::rename(bag, &place).with_context(|| format!("cannot move {} to {}", bag.display(), place.display()))
}

/// Recordings whose line of the history was broken off wait again.
fn put_back(chronicle: &Chronicle, done: &Path, queue: &Path) -> anyhow::Result<()> {
    let entered = |bag: &PathBuf| {
        let name = bag.file_name().unwrap_or_default().to_string_lossy();
        chronicle.entries.iter().any(|entry| entry.bag == name)
    };
    waiting(done).iter().filter(|bag| !entered(bag)).try_for_each(|bag| move_into(bag, queue))
}
