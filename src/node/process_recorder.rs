//! A recorder that cuts: a bag for each process, from a little before it begins until the unit rests again, and nothing of the rest between.
//!
//! Bags wait in a folder until somebody has read them, so that a slow reader loses nothing and a process that is killed loses a second.

use std::collections::VecDeque;
use std::fs;
use std::path::{Path, PathBuf};

use super::realtime::monotonic_ns;
use super::recorder::{OPTIONS, Sink};
use govtwin_bag::{BagError, Newest, RawMessage, ReadOptions, Stream, Writer, broken_off, intended_place, recover};
use govtwin_diagnosis::watch::cut::{Cutter, GAP_S, LEAD_S};
use govtwin_files::Claim;
use govtwin_model::frame::Frame;
use govtwin_model::units::{NANOS_PER_SECOND, nanos_from_seconds, seconds_from_nanos};

/// Recorded before the movement that begins a process: what the reader keeps, and as much again by which it finds the beginning, s.
const BEFORE_S: f64 = 2.0 * LEAD_S;
/// Recorded after a process has ended: the reader, which sees straight lines between samples, may find its end a little later, s.
const AFTER_S: f64 = 3.0;
/// A state so much older than the newest came late; one that is older still shows a clock that was set back, s.
const LATE_S: f64 = 1.0;
/// A process ends where nothing is heard for so long, whatever the stamps say, ns.
const SILENCE_NS: i64 = 10 * NANOS_PER_SECOND;
/// Messages kept before a process begins, and between two measured states.
const MOST_LATELY: usize = 200_000;
/// Recordings that may wait for their reader.
const MOST_WAITING: usize = 500;

/// What is being heard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Hearing {
    /// No measured state for a while.
    #[default]
    Nothing,
    /// A unit at rest.
    Rest,
    /// A unit in a process, which is being recorded.
    Process,
}

/// What was heard so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Listening {
    /// What is being heard.
    pub hearing: Hearing,
    /// Samples of each stream, and those of them that could not be used, in the order of [`Stream::ALL`].
    pub samples: [(u64, u64); 4],
    /// Samples that senders numbered and that never came.
    pub lost: u64,
    /// Processes that were recorded.
    pub processes: u64,
    /// Processes that were not recorded, or not to their end.
    pub left_out: u64,
    /// Recordings that wait for their reader.
    pub waiting: usize,
}

/// A bag in the making.
struct Open {
    writer: Writer,
    name: String,
    /// The process has ended, and its bag ends here, ns.
    until_ns: Option<i64>,
}

/// Records processes into bags.
pub struct ProcessRecorder {
    folder: PathBuf,
    name: Box<dyn FnMut() -> String>,
    newest: Newest,
    cutter: Cutter,
    /// Messages of the last seconds, with the time of the state that they came with.
    lately: VecDeque<(i64, RawMessage)>,
    /// Messages since the last state: they go into the bag with the next one, unless time jumps in between.
    behind: Vec<RawMessage>,
    open: Option<Open>,
    /// The process that is going on is not recorded.
    skips: bool,
    time_ns: Option<i64>,
    heard_ns: i64,
    listening: Listening,
    words: Vec<String>,
}

impl ProcessRecorder {
    /// Begins to record into `folder`; `name` gives each bag a name that no other has.
    pub fn new(folder: &Path, options: &ReadOptions, name: Box<dyn FnMut() -> String>) -> Self {
        Self {
            folder: folder.to_owned(),
            name,
            newest: Newest::new(options),
            cutter: Cutter::default(),
            lately: VecDeque::new(),
            behind: vec![],
            open: None,
            skips: false,
            time_ns: None,
            heard_ns: 0,
            listening: Listening::default(),
            words: vec![],
        }
    }

    /// What was heard so far.
    pub fn listening(&self) -> Listening {
        let samples = Stream::ALL.map(|stream| self.newest.counts(stream));
        Listening { samples, ..self.listening }
    }

    /// What a user should read, once.
    pub fn words(&mut self) -> Vec<String> {
        std::mem::take(&mut self.words)
    }

    /// The bag in the making, where there is one.
    pub fn in_the_making(&self) -> Option<&str> {
        self.open.as_ref().map(|open| open.name.as_str())
    }

    /// Takes a state's row into account, and what came since the one before it.
    fn state(&mut self, time_ns: i64, row: &Frame) {
        let step_s = self.time_ns.map_or(0.0, |last_ns| seconds_from_nanos(time_ns - last_ns));
        let is_late = (-LATE_S..0.0).contains(&step_s);
        if !is_late {
            let ended = self.cutter.row(row).is_some();
            if !(0.0..=GAP_S).contains(&step_s) {
                self.complete_or_discard(ended);
                self.lately.clear();
            }
            self.time_ns = Some(time_ns);
            let is_moving = self.cutter.is_moving();
            // A process that is cut for its length goes on in the next at once.
            if !is_moving || ended {
                self.skips = false;
                if let Some(open) = &mut self.open {
                    open.until_ns.get_or_insert(time_ns + nanos_from_seconds(AFTER_S));
                }
            }
            if is_moving && !self.skips && self.open.as_ref().is_none_or(|open| open.until_ns.is_some()) {
                self.complete();
                self.begin();
            }
            self.listening.hearing = if is_moving { Hearing::Process } else { Hearing::Rest };
        }
        let now_ns = self.time_ns.unwrap_or(time_ns);
        for message in std::mem::take(&mut self.behind) {
            self.write(&message);
            self.lately.push_back((now_ns, message));
        }
        if self.open.as_ref().and_then(|open| open.until_ns).is_some_and(|until_ns| until_ns <= now_ns) {
            self.complete();
        }
        let first_ns = now_ns - nanos_from_seconds(BEFORE_S);
        while self.lately.len() > MOST_LATELY || self.lately.front().is_some_and(|(time_ns, _)| *time_ns < first_ns) {
            self.lately.pop_front();
        }
    }

    fn begin(&mut self) {
        if waiting(&self.folder).len() >= MOST_WAITING {
            self.leave_out(&format!("{MOST_WAITING} recordings wait to be diagnosed, and there is room for no more"));
            return;
        }
        let name = (self.name)();
        match Writer::create(&self.folder.join(&name), OPTIONS) {
            Ok(writer) => self.open = Some(Open { writer, name, until_ns: None }),
            Err(error) => return self.leave_out(&error.to_string()),
        }
        for (time_ns, message) in std::mem::take(&mut self.lately) {
            self.write(&message);
            self.lately.push_back((time_ns, message));
        }
    }

    fn leave_out(&mut self, why: &str) {
        self.skips = true;
        self.listening.left_out += 1;
        self.words.push(format!("a process is not recorded, or not to its end: {why}"));
    }

    fn write(&mut self, message: &RawMessage) {
        let Some(open) = &mut self.open else { return };
        match open.writer.copy(message) {
            Ok(()) if open.writer.is_full() => {
                self.leave_out("the disk is full");
                self.complete();
            }
            Ok(()) => {}
            Err(error) => {
                // What was written stays, for the next start.
                self.open = None;
                self.leave_out(&error.to_string());
            }
        }
    }

    /// Gives the bag in the making its name where it holds a process, which may be too short to be one.
    fn complete_or_discard(&mut self, ended: bool) {
        match self.open.take() {
            Some(open) if !ended && open.until_ns.is_none() => {
                drop(open.writer);
                if let Some(kept) = broken_off(&self.folder.join(&open.name)) {
                    // What stays is taken up at the next start.
                    let _ = fs::remove_dir_all(kept);
                }
            }
            others => {
                self.open = others;
                self.complete();
            }
        }
    }

    /// Gives the bag in the making its name.
    fn complete(&mut self) {
        let Some(open) = self.open.take() else { return };
        match open.writer.finish() {
            Ok(_) => self.listening.processes += 1,
            Err(error) => self.leave_out(&error.to_string()),
        }
    }
}

impl Sink for ProcessRecorder {
    fn take(&mut self, message: RawMessage) -> Result<(), BagError> {
        let row = self.newest.take(&message);
        if self.behind.len() >= MOST_LATELY {
            self.behind.clear();
        }
        self.behind.push(message);
        if let Some(row) = row {
            self.heard_ns = monotonic_ns();
            self.state(row.time_ns, &row);
        }
        Ok(())
    }

    fn second(&mut self, lost: u64) -> Result<(), BagError> {
        self.listening.lost = lost;
        self.listening.waiting = waiting(&self.folder).len();
        if let Some(Err(error)) = self.open.as_mut().map(|open| open.writer.flush()) {
            self.open = None;
            self.leave_out(&error.to_string());
        }
        if self.time_ns.is_some() && monotonic_ns() - self.heard_ns > SILENCE_NS {
            let ended = self.cutter.end().is_some();
            self.complete_or_discard(ended);
            self.lately.clear();
            self.behind.clear();
            self.skips = false;
            self.time_ns = None;
            self.listening.hearing = Hearing::Nothing;
        }
        Ok(())
    }

    fn is_full(&self) -> bool {
        false
    }
}

/// The recordings that wait in a folder, oldest first by their names.
pub fn waiting(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let is_hidden = |path: &Path| path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
    let mut found: Vec<PathBuf> = entries.filter(|path| path.is_dir() && !is_hidden(path)).collect();
    found.sort();
    found
}

/// Makes whole bags of what an earlier run was recording when it ended, so that they wait with the others; says what became of each.
pub fn take_up(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut words = vec![];
    for kept in entries.filter(|path| path.is_dir()) {
        let Some(place) = intended_place(&kept) else { continue };
        let name = place.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let saved = if place.exists() { Ok(()) } else { recover(&kept, &place).map(|_| ()) };
        let outcome = saved.map_err(|error| error.to_string()).and_then(|()| {
            fs::remove_dir_all(&kept).map_err(|error| format!("cannot remove {}: {error}", kept.display()))
        });
        // A watch that was killed left the lock of its name as well; whoever holds it next removes it.
        drop(Claim::name(&place));
        words.push(match outcome {
            Ok(()) => {
                format!("{name} was being recorded when the last watch ended; it is diagnosed as far as it was heard")
            }
            Err(reason) => format!("{name} was being recorded when the last watch ended, and is lost: {reason}"),
        });
    }
    words
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{Hearing, ProcessRecorder, Sink, take_up, waiting};
    use crate::messages as wire;
    use govtwin_bag::{
        Interpolation, Qos, RawMessage, ReadOptions, Stream, Topics, Writer, WriterOptions, messages, read,
    };
    use govtwin_diagnosis::generate::{self, Scenario};
    use govtwin_diagnosis::watch::cut::{CutProcess, Cutter, Ended};
    use govtwin_model::frame::Frame;
    use govtwin_model::recording::Process;
    use govtwin_model::units::nanos_from_seconds;

    /// What is sent of a unit that begins at `from_s`, moves, and rests for a minute; the bag that holds all of it.
    fn sent(folder: &Path, from_s: f64, process: Process) -> (Vec<RawMessage>, std::path::PathBuf) {
        let unit = govtwin_model::params::reference();
        let mut frames =
            generate::recording(&Scenario { unit, process, rate_hz: 50.0, duration_s: 40.0, rich: false, seed: 4 })
                .frames;
        let (first, last) = (frames[0], *frames.last().unwrap());
        let shift_ns = nanos_from_seconds(from_s) - first.time_ns;
        let before = (1..=1000).rev().map(|i| Frame { time_ns: first.time_ns - 20_000_000 * i, ..first });
        let after = (1..=3000).map(|i| Frame { time_ns: last.time_ns + 20_000_000 * i, ..last });
        frames = before.chain(frames).chain(after).collect();
        let bag = folder.join(format!("all_{from_s}"));
        let mut writer = Writer::create(&bag, WriterOptions::default()).unwrap();
        let topics = Topics::default();
        let command = writer.topic(&topics.command, Qos::DEFAULT).unwrap();
        let esv = writer.topic(&topics.esv, Qos::DEFAULT).unwrap();
        let pressure = writer.topic(&topics.tank_pressure, Qos::DEFAULT).unwrap();
        let state = writer.topic(&topics.servo_state, Qos::DEFAULT).unwrap();
        for frame in &frames {
            let time_ns = frame.time_ns + shift_ns;
            writer.write(command, time_ns, &wire::command(&frame.inputs, time_ns)).unwrap();
            writer.write(esv, time_ns, &wire::esv(&frame.inputs, time_ns)).unwrap();
            writer.write(pressure, time_ns, &wire::tank_pressure(&frame.inputs, time_ns)).unwrap();
            let message = govtwin_bag::msg::ServoState::of(time_ns, &frame.measured);
            writer.write(state, time_ns, &message).unwrap();
        }
        writer.finish().unwrap();
        (messages(&bag).unwrap().map(Result::unwrap).collect(), bag)
    }

    fn options() -> ReadOptions {
        ReadOptions {
            interpolation: Interpolation::Sharp { period_ns: 1_000_000 },
            required: vec![Stream::ServoState],
            ..ReadOptions::default()
        }
    }

    fn recorder(folder: &Path) -> ProcessRecorder {
        let mut number = 0;
        let name = move || {
            number += 1;
            format!("p{number}")
        };
        ProcessRecorder::new(folder, &options(), Box::new(name))
    }

    fn cuts(bag: &Path) -> Vec<CutProcess> {
        let mut cutter = Cutter::default();
        let frames = read(bag, &options()).unwrap().recording.frames;
        let mut cuts: Vec<CutProcess> = frames.iter().filter_map(|frame| cutter.row(frame)).collect();
        cuts.extend(cutter.end());
        cuts
    }

    #[test]
    fn each_process_gets_a_bag_that_gives_the_cut_of_the_whole_stream() {
        let dir = tempfile::tempdir().unwrap();
        let queue = dir.path().join("waiting");
        let mut recorder = recorder(&queue);
        let (mut expected, mut processes) = (vec![], vec![]);
        for (from_s, process) in [(1.8e9, Process::LoadRejection), (1.8e9 + 3600.0, Process::Startup)] {
            let (messages, bag) = sent(dir.path(), from_s, process);
            for message in messages {
                recorder.take(message).unwrap();
            }
            expected.extend(cuts(&bag));
            processes.push(process);
        }
        assert!(recorder.words().is_empty() && recorder.in_the_making().is_none());
        assert_eq!(recorder.listening().hearing, Hearing::Rest);
        let found: Vec<CutProcess> = waiting(&queue).iter().flat_map(|bag| cuts(bag)).collect();
        assert!(found.iter().all(|cut| cut.ended == Ended::AtRest));
        let ids = |cuts: &[CutProcess]| {
            cuts.iter().map(|cut| (cut.recording.process, cut.recording.frames.len())).collect::<Vec<_>>()
        };
        assert_eq!(ids(&found), ids(&expected));
        assert!(processes.iter().all(|process| found.iter().any(|cut| cut.recording.process == *process)));
        let listening = recorder.listening();
        assert_eq!((listening.processes, listening.left_out), (found.len() as u64, 0));
        assert_eq!(listening.samples.map(|(_, refused)| refused), [0; 4]);
    }

    #[test]
    fn a_process_in_the_making_survives_a_kill_and_one_that_is_too_short_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let queue = dir.path().join("waiting");
        let (messages, _) = sent(dir.path(), 1.8e9, Process::LoadRejection);
        let mut killed = recorder(&queue);
        let begins = messages.iter().position(|message| {
            killed.take(message.clone()).unwrap();
            killed.in_the_making().is_some()
        });
        let begins = begins.expect("the process begins");
        messages[begins + 1..begins + 4000].iter().for_each(|message| killed.take(message.clone()).unwrap());
        killed.second(0).unwrap();
        drop(killed);
        assert!(waiting(&queue).is_empty());
        // A process that is killed leaves its lock.
        std::fs::write(queue.join(".govtwin-p1.lock"), "").unwrap();
        let words = take_up(&queue);
        assert_eq!(std::fs::read_dir(&queue).unwrap().count(), 1, "one bag and nothing else");
        assert!(words.len() == 1 && words[0].contains("p1 was being recorded"), "{words:?}");
        let cuts = cuts(&waiting(&queue)[0]);
        assert_eq!((cuts.len(), cuts[0].ended, cuts[0].recording.process), (1, Ended::OfRows, Process::LoadRejection));
        assert!(take_up(&queue).is_empty());

        let other = dir.path().join("other");
        let mut short = recorder(&other);
        for message in &messages[..begins + 40] {
            short.take(message.clone()).unwrap();
        }
        assert!(short.in_the_making().is_some());
        // An hour later it all begins anew.
        sent(dir.path(), 1.8e9 + 3600.0, Process::Startup).0[..100]
            .iter()
            .for_each(|message| short.take(message.clone()).unwrap());
        assert_eq!((short.in_the_making(), std::fs::read_dir(&other).unwrap().count()), (None, 0));
    }
}
