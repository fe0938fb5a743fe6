//! The bag of a replay: everything that was recorded, and the simulated state beside it.

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;

use anyhow::Context;
use govtwin_bag::msg::{Header, ServoState};
use govtwin_bag::{BagError, Health, Qos, RawMessage, Sealed, Stream, Topic, Topics, Writer, WriterOptions};
use govtwin_files::make_folder;
use govtwin_model::frame::{Estimate, Frame};
use govtwin_model::provenance::RecordingGiven;
use govtwin_model::replay::{Replayed, is_measured};

use crate::commands::provenance;

/// Topic of the simulated state.
const TOPIC: &str = "/sim/servo_state";

/// Messages that wait for the rows at their time hold at most so many bytes; beyond, they are written as they come.
const MOST_WAITING_BYTES: usize = 1 << 24;

/// How the bags of a replay are written: one replaces another of the same place, and nothing else.
const OPTIONS: WriterOptions = WriterOptions { mark: Some("govtwin.replay"), keep_unfinished: false };

/// Whether the bag folder `dir` may be written: nothing is there but what a replay wrote before.
pub fn check(dir: &Path) -> anyhow::Result<()> {
    Writer::check(dir, OPTIONS).context("--out: only simulated bags of an earlier replay are replaced")
}

/// Writes the bag folder `dir` under a temporary name: a copy of the bag at `source`, and [`TOPIC`].
///
/// The simulated state is given wherever the real one was measured, or where nothing was, in every
/// row. Its stamps are those of the rows; its log times follow the recorded messages' own clock. A
/// simulated state that the bag already holds is left behind.
pub fn write(
    source: &Path,
    dir: &Path,
    replayed: &Replayed,
    topics: &Topics,
    about: &BTreeMap<String, String>,
) -> anyhow::Result<Sealed> {
    let mut bag = ResultBag::begin(dir, about)?;
    bag.lag_ns = Some(lag_ns(source, topics)?);
    let mut on_estimate = bag.taking(replayed.scores.are_measured());
    let rows = replayed.recording.frames.iter().zip(&replayed.estimates);
    rows.for_each(|(frame, estimate)| on_estimate(frame, *estimate));
    drop(on_estimate);
    // No estimate comes any more.
    bag.done_ns = i64::MAX;
    for message in govtwin_bag::messages(source)? {
        bag.take(message?)?;
    }
    bag.seal()
}

/// Estimates and messages on their way into a bag, each where its log time belongs.
pub struct ResultBag {
    writer: Writer,
    topic: Topic<ServoState>,
    /// How much later than its stamp a message is logged, once one told it, ns.
    pub lag_ns: Option<i64>,
    estimates: VecDeque<Estimate>,
    messages: VecDeque<RawMessage>,
    waiting_bytes: usize,
    /// All estimates up to here have come.
    done_ns: i64,
}

impl ResultBag {
    /// Begins the bag folder `dir` under a temporary name.
    pub fn begin(dir: &Path, about: &BTreeMap<String, String>) -> anyhow::Result<Self> {
        let failed = || format!("cannot write the simulated bag {}", dir.display());
        if let Some(parent) = dir.parent() {
            make_folder(parent).with_context(failed)?;
        }
        let mut writer = Writer::create(dir, OPTIONS)?;
        writer.describe(govtwin_bag::GOVTWIN, about.clone())?;
        let topic = writer.topic::<ServoState>(TOPIC, Qos::SENSOR)?;
        let (estimates, messages) = (VecDeque::new(), VecDeque::new());
        Ok(Self { writer, topic, lag_ns: None, estimates, messages, waiting_bytes: 0, done_ns: i64::MIN })
    }

    /// Takes estimates as they come: those of the rows in which the real state was measured, or of all rows.
    pub fn taking(&mut self, measured: bool) -> impl FnMut(&Frame, Estimate) {
        move |frame, estimate| {
            self.done_ns = estimate.time_ns;
            if !measured || is_measured(frame) {
                self.estimates.push_back(estimate);
            }
        }
    }

    /// Takes the next message. A simulated state that the bag already holds is left behind.
    pub fn take(&mut self, message: RawMessage) -> anyhow::Result<()> {
        if message.topic.name != TOPIC {
            self.waiting_bytes += message.data.len();
            self.messages.push_back(message);
        }
        self.write(false)
    }

    /// Writes the rest.
    pub fn seal(mut self) -> anyhow::Result<Sealed> {
        self.write(true)?;
        Ok(self.writer.seal()?)
    }

    /// Writes what has its place by now; all of it at the end.
    fn write(&mut self, all: bool) -> anyhow::Result<()> {
        let lag_ns = self.lag_ns.unwrap_or_default();
        let done_ns = self.done_ns.saturating_add(lag_ns);
        let is_due = |message: &RawMessage, bytes| all || message.log_time_ns <= done_ns || bytes > MOST_WAITING_BYTES;
        while self.messages.front().is_some_and(|message| is_due(message, self.waiting_bytes)) {
            let Some(message) = self.messages.pop_front() else { break };
            self.waiting_bytes -= message.data.len();
            self.before(message.log_time_ns, lag_ns)?;
            self.writer.copy(&message)?;
        }
        if all { self.before(i64::MAX, lag_ns) } else { Ok(()) }
    }

    /// Writes the estimates before a log time.
    fn before(&mut self, log_time_ns: i64, lag_ns: i64) -> anyhow::Result<()> {
        let is_before = |estimate: &Estimate| {
            let logged_ns = estimate.time_ns.saturating_add(lag_ns);
            logged_ns < log_time_ns || log_time_ns == i64::MAX
        };
        while self.estimates.front().is_some_and(is_before) {
            let Some(estimate) = self.estimates.pop_front() else { break };
            self.writer.write(self.topic, estimate.time_ns.saturating_add(lag_ns), &state(&estimate))?;
        }
        Ok(())
    }
}

/// What a simulated bag says of itself: whose it is a replay of, and whether what was recorded there is synthetic, which must not get lost.
pub fn about(name: &str, health: &Health, marked: &RecordingGiven) -> BTreeMap<String, String> {
    let mut about = BTreeMap::from([
        ("generator".to_owned(), format!("{} replay", provenance::PROGRAM)),
        ("replay_of".to_owned(), name.to_owned()),
        ("note".to_owned(), format!("{TOPIC} is simulated; everything else as recorded")),
    ]);
    if marked.synthetic {
        about.insert(govtwin_bag::SYNTHETIC.to_owned(), "true".to_owned());
    }
    about.extend(marked.origin.clone().map(|origin| (govtwin_bag::ORIGIN.to_owned(), origin)));
    about.extend(
        health.about(govtwin_bag::SIMULATOR).map(|simulator| (govtwin_bag::SIMULATOR.to_owned(), simulator.to_owned())),
    );
    about
}

/// How much later than its stamp the first message of the known topics that has one was logged, ns.
fn lag_ns(source: &Path, topics: &Topics) -> Result<i64, BagError> {
    for message in govtwin_bag::messages(source)? {
        if let Some(lag_ns) = lag_of(&message?, topics) {
            return Ok(lag_ns);
        }
    }
    Ok(0)
}

/// How much later than its stamp a message of the known topics was logged, where it has one, ns.
pub fn lag_of(message: &RawMessage, topics: &Topics) -> Option<i64> {
    Stream::ALL.iter().find(|stream| topics.of(**stream) == message.topic.name)?;
    // All four types begin with their header, which is all that is read here.
    let header = govtwin_bag::cdr::decode::<Header>(&message.data).ok()?;
    // A stamp of 0 is no time.
    let stamp_ns = header.stamp.nanos().filter(|stamp_ns| *stamp_ns != 0)?;
    Some(message.log_time_ns.saturating_sub(stamp_ns))
}

fn state(estimate: &Estimate) -> ServoState {
    let mut state = ServoState::of(estimate.time_ns, &estimate.signals);
    "govtwin".clone_into(&mut state.header.frame_id);
    state
}
