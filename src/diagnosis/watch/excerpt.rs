//! What a fit takes of a long recording: the processes in it, cut out as its rows pass by, so that memory follows what happened and not how
//! long was recorded.
//!
//! A recording of up to [`WHOLE_S`] is one process, or a few, and is taken whole; one of a servomotor stage alone, which has no processes, up to [`MOST_ROWS`]. Of a longer one each process becomes a recording of its own; rest and a
//! grid's unrest are dropped. Where the processes have more rows than a fit should hold, [`choose`] keeps some of each kind.

use std::collections::BTreeSet;

use crate::watch::cut::{CutProcess, Cutter, Ended};
use govtwin_model::frame::Frame;
use govtwin_model::recording::{Process, Recording};
use govtwin_model::signal::{Signal, span, widened};
use govtwin_model::units::seconds_from_nanos;

/// A recording that lasts no longer is taken whole, s: twice the longest process that is cut out, some 700,000 rows at 100 Hz.
pub const WHOLE_S: f64 = 600.0;

/// Rows that are kept of all long recordings together: a quarter of an hour on a grid of 1 ms, some twenty processes. It bounds memory, and no verdict
/// depends on it but by what is left out.
pub const MOST_ROWS: usize = 1_000_000;

/// A process that was found, without its rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundProcess {
    /// The process that its inputs show.
    pub process: Process,
    /// Whether its command, or else its position, ends higher than it began.
    pub rises: bool,
    /// It begins at rest, and is not what goes on of one that was cut at its longest.
    pub from_rest: bool,
    /// Stamp of its first row, ns.
    pub from_ns: i64,
    /// Its length, s.
    pub duration_s: f64,
    /// Its rows.
    pub rows: usize,
    /// How far the position moved, or where it was not measured the command, in its own unit.
    pub moved: f64,
}

impl FoundProcess {
    fn of(cut: &CutProcess, from_rest: bool) -> Self {
        let frames = &cut.recording.frames;
        let commands = || frames.iter().map(|frame| frame.inputs.opening_command_pu).filter(|value| value.is_finite());
        let positions = || {
            let values = frames.iter().map(|frame| Signal::ServomotorPosition.of(&frame.measured));
            values.filter(|value| value.is_finite())
        };
        let rise = |first: Option<f64>, last: Option<f64>| first.zip(last).map(|(first, last)| last > first);
        let by_command = rise(commands().next(), commands().next_back());
        let moved = span(positions()).or_else(|| span(commands())).unwrap_or(0.0);
        Self {
            process: cut.recording.process,
            rises: by_command.or_else(|| rise(positions().next(), positions().next_back())).unwrap_or(false),
            from_rest,
            from_ns: frames.first().map_or(0, |frame| frame.time_ns),
            duration_s: cut.recording.duration_s(),
            rows: frames.len(),
            moved,
        }
    }

    /// What it is told from: the process, and for a change of load whether it is one up or down. What goes on of a process is a kind of its own, which
    /// comes last: what moved at its beginning is not known.
    fn kind(&self) -> (bool, Process, bool) {
        (!self.from_rest, self.process, self.rises && self.process == Process::LoadIncrease)
    }
}

/// What is done with the processes of a long recording.
#[derive(Clone, Debug)]
enum Keep {
    /// Their rows are kept.
    All,
    /// They are listed.
    None,
    /// The rows of these are kept, by their place.
    Chosen(BTreeSet<usize>),
}

/// Takes the rows of a recording, whole where it is short and its processes where it is long.
#[derive(Clone, Debug)]
pub struct Excerpts {
    stroke: Option<f64>,
    /// Whether length alone makes nothing long, but rows do.
    by_rows: bool,
    keep: Keep,
    cutter: Cutter,
    goes_on: bool,
    /// All rows, as long as the recording is short.
    whole: Vec<Frame>,
    span_ns: Option<(i64, i64)>,
    positions: Option<(f64, f64)>,
    found: Vec<FoundProcess>,
    kept: Vec<(usize, Recording)>,
    /// Rows of these.
    kept_rows: usize,
    is_long: bool,
}

impl Excerpts {
    /// Takes recordings whose positions cover so much of their own unit over the stroke, 1 for pu. Where that is not known, what is long is looked
    /// through for its [`stroke`](Self::stroke), and nothing is cut out.
    pub fn new(stroke: Option<f64>) -> Self {
        Self {
            stroke,
            by_rows: false,
            keep: Keep::All,
            cutter: Cutter::of_stroke(stroke.unwrap_or(1.0)),
            goes_on: false,
            whole: vec![],
            span_ns: None,
            positions: None,
            found: vec![],
            kept: vec![],
            kept_rows: 0,
            is_long: false,
        }
    }

    /// The same, whole up to [`MOST_ROWS`] however long it lasted.
    #[must_use]
    pub fn by_rows(self) -> Self {
        Self { by_rows: true, ..self }
    }

    /// Takes these processes alone, by their place among those that were found before.
    pub fn of(stroke: Option<f64>, chosen: BTreeSet<usize>) -> Self {
        Self { keep: Keep::Chosen(chosen), ..Self::new(stroke) }
    }

    /// Begins again.
    pub fn restart(&mut self) {
        *self = Self { keep: self.keep.clone(), by_rows: self.by_rows, ..Self::new(self.stroke) };
    }

    /// Takes a row.
    pub fn row(&mut self, frame: &Frame) {
        let from_ns = self.span_ns.map_or(frame.time_ns, |(from_ns, _)| from_ns);
        self.span_ns = Some((from_ns, frame.time_ns));
        self.positions = widened(self.positions, Signal::ServomotorPosition.of(&frame.measured));
        if self.is_long {
            self.cut(frame);
        } else {
            self.whole.push(*frame);
            self.is_long = if self.by_rows {
                self.whole.len() > MOST_ROWS
            } else {
                seconds_from_nanos(frame.time_ns - from_ns) > WHOLE_S
            };
            if self.is_long {
                for frame in std::mem::take(&mut self.whole) {
                    self.cut(&frame);
                }
            }
        }
    }

    /// Rows that are held, but for those of the process that goes on.
    pub fn held(&self) -> usize {
        self.whole.len() + self.kept_rows
    }

    /// From here on processes are listed only, and those that were kept are let go; true where that is so by now.
    pub fn list_only(&mut self) -> bool {
        if self.is_long && matches!(self.keep, Keep::All) {
            self.keep = Keep::None;
            (self.kept, self.kept_rows) = (vec![], 0);
        }
        matches!(self.keep, Keep::None)
    }

    /// The rows have ended.
    pub fn end(&mut self) {
        if let Some(cut) = self.cutter.end() {
            self.take(cut);
        }
        self.whole.shrink_to_fit();
    }

    /// Whether it is longer than what is taken whole.
    pub fn is_long(&self) -> bool {
        self.is_long
    }

    /// From first to last row, s.
    pub fn duration_s(&self) -> f64 {
        self.span_ns.map_or(0.0, |(from_ns, to_ns)| seconds_from_nanos(to_ns - from_ns))
    }

    /// How far the position moved altogether; nothing if it rested or was not measured.
    pub fn stroke(&self) -> Option<f64> {
        self.positions.map(|(low, high)| high - low).filter(|stroke| *stroke > 0.0)
    }

    /// All processes of a long recording.
    pub fn found(&self) -> &[FoundProcess] {
        &self.found
    }

    /// The rows of a short recording.
    pub fn into_whole(self, name: &str) -> Recording {
        Recording::new(name, self.whole)
    }

    /// The processes of a long recording that were kept and are chosen, each named by its place; none where they have to be read again.
    pub fn into_chosen(self, name: &str, chosen: &BTreeSet<usize>) -> Option<Vec<Recording>> {
        let kept = self.kept.into_iter().filter(|(place, _)| chosen.contains(place));
        let named = kept.map(|(place, recording)| Recording { name: format!("{name}#{}", place + 1), ..recording });
        let named: Vec<Recording> = named.collect();
        (named.len() == chosen.len()).then_some(named)
    }

    fn cut(&mut self, frame: &Frame) {
        // Where the stroke is not known, it is being looked for.
        if self.stroke.is_some()
            && let Some(cut) = self.cutter.row(frame)
        {
            self.take(cut);
        }
    }

    fn take(&mut self, mut cut: CutProcess) {
        // A twin starts from what was measured: on a grid it may be rows later.
        let frames = &mut cut.recording.frames;
        let first = frames.iter().position(|frame| Signal::ServomotorPosition.of(&frame.measured).is_finite());
        frames.drain(..first.unwrap_or(0));
        let place = self.found.len();
        self.found.push(FoundProcess::of(&cut, !self.goes_on));
        self.goes_on = cut.ended == Ended::TooLong;
        let is_kept = match &self.keep {
            Keep::All => true,
            Keep::None => false,
            Keep::Chosen(chosen) => chosen.contains(&place),
        };
        if is_kept {
            self.kept_rows += cut.recording.frames.len();
            self.kept.push((place, cut.recording));
        }
    }
}

/// Which processes of several long recordings are kept where there is room for so many rows; for each recording their places.
///
/// Each kind in turn gets one more of its processes, as long as there is room: what distinguishes faults differs between kinds, and a second
/// process of a kind adds less than the first of another. Of a kind the processes are parted evenly in the order of time, and of each part the one that moved most is
/// kept: a long movement shows most, and what drifts shows over the whole time. The result depends on nothing but what was found.
pub fn choose(found: &[Vec<FoundProcess>], room: usize) -> Vec<BTreeSet<usize>> {
    let all: Vec<(usize, usize, &FoundProcess)> = found
        .iter()
        .enumerate()
        .flat_map(|(recording, found)| found.iter().enumerate().map(move |(place, one)| (recording, place, one)))
        .collect();
    let mut kinds: Vec<_> = all.iter().map(|(_, _, one)| one.kind()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let mut groups: Vec<ProcessesOfKind<'_>> = kinds
        .iter()
        .map(|kind| ProcessesOfKind {
            members: all.iter().filter(|(_, _, one)| one.kind() == *kind).copied().collect(),
            kept: vec![],
            goes_on: kind.0,
        })
        .collect();
    for goes_on in [false, true] {
        loop {
            let mut any = false;
            for group in 0..groups.len() {
                let more = groups[group].goes_on == goes_on && groups[group].kept.len() < groups[group].members.len();
                let next = if more { groups[group].best(groups[group].kept.len() + 1) } else { continue };
                let others = groups.iter().enumerate().filter(|(other, _)| *other != group);
                let rows = others.map(|(_, other)| other.rows(&other.kept)).sum::<usize>() + groups[group].rows(&next);
                // One process is kept, whatever its size.
                if rows <= room || groups.iter().all(|group| group.kept.is_empty()) {
                    groups[group].kept = next;
                    any = true;
                }
            }
            if !any {
                break;
            }
        }
    }
    let mut chosen = vec![BTreeSet::new(); found.len()];
    for group in &groups {
        for (recording, place, _) in group.kept.iter().map(|&member| group.members[member]) {
            chosen[recording].insert(place);
        }
    }
    chosen
}

/// Processes of a kind, and which of them are kept.
struct ProcessesOfKind<'a> {
    members: Vec<(usize, usize, &'a FoundProcess)>,
    kept: Vec<usize>,
    goes_on: bool,
}

impl ProcessesOfKind<'_> {
    /// Of so many even parts the member that moved most, the first of those that moved alike.
    fn best(&self, parts: usize) -> Vec<usize> {
        let count = self.members.len();
        let part = |k: usize| k * count / parts..(k + 1) * count / parts;
        let most = |a: &usize, b: &usize| self.members[*a].2.moved.total_cmp(&self.members[*b].2.moved).then(b.cmp(a));
        (0..parts).filter_map(|k| part(k).max_by(most)).collect()
    }

    fn rows(&self, kept: &[usize]) -> usize {
        kept.iter().map(|&member| self.members[member].2.rows).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use govtwin_model::frame::{EsvState, Inputs, Signals};

    /// A row each 0.1 s; the position follows the command.
    fn row(k: i64, opening: f64, scale: f64) -> Frame {
        Frame {
            time_ns: k * 100_000_000,
            inputs: Inputs {
                opening_command_pu: opening,
                esv: EsvState::Normal,
                tank_pressure_pa: 6e6,
                piston_force_n: 0.0,
            },
            measured: Signals { servomotor_position_pu: opening * scale, ..Signals::NONE },
        }
    }

    /// Steps of the command, each ten minutes after the one before, of twice the size.
    fn steps(count: i64, scale: f64) -> Vec<Frame> {
        let opening = |k: i64| 0.3 + 0.02 * (1 << (k / 6000)) as f64;
        (0..count * 6000 + 3000).map(|k| row(k, opening(k), scale)).collect()
    }

    fn taken(mut excerpts: Excerpts, frames: &[Frame]) -> Excerpts {
        frames.iter().for_each(|frame| excerpts.row(frame));
        excerpts.end();
        excerpts
    }

    /// What was not measured is no number, and equals itself as text only.
    fn text(rows: &impl std::fmt::Debug) -> String {
        format!("{rows:?}")
    }

    #[test]
    fn a_short_recording_is_whole_and_a_long_one_its_processes() {
        let frames = steps(4, 1.0);
        let short = taken(Excerpts::new(Some(1.0)), &frames[..6001]);
        assert!(!short.is_long() && short.found().is_empty());
        assert!(text(&short.into_whole("a").frames) == text(&&frames[..6001]));
        let long = taken(Excerpts::new(Some(1.0)), &frames);
        assert!(long.is_long() && (long.duration_s() - 2699.9).abs() < 1e-9);
        // The first step is too small to begin a process; the others begin 4 s before the last row at rest.
        assert_eq!(
            long.found().iter().map(|one| one.from_ns).collect::<Vec<_>>(),
            [11_959, 17_959, 23_959].map(|row| row * 100_000_000)
        );
        assert_eq!(long.held(), long.found().iter().map(|one| one.rows).sum::<usize>());
        let rows = long.held();
        let chosen = BTreeSet::from([0, 2]);
        let again = taken(Excerpts::of(Some(1.0), chosen.clone()), &frames);
        assert_eq!((again.found(), rows > again.held()), (long.found(), true));
        let (of_all, of_chosen) = (long.into_chosen("a", &chosen).unwrap(), again.into_chosen("a", &chosen).unwrap());
        assert!(text(&of_all) == text(&of_chosen));
        assert_eq!(of_all.iter().map(|one| one.name.as_str()).collect::<Vec<_>>(), ["a#1", "a#3"]);
    }

    #[test]
    fn a_stage_alone_is_whole_however_long_it_lasted() {
        let frames = steps(4, 1.0);
        let whole = taken(Excerpts::new(None).by_rows(), &frames);
        assert!(!whole.is_long() && whole.found().is_empty());
        assert!(text(&whole.into_whole("a").frames) == text(&frames));
    }

    #[test]
    fn what_was_let_go_is_read_again() {
        let frames = steps(3, 1.0);
        let mut excerpts = Excerpts::new(Some(1.0));
        frames[..12_500].iter().for_each(|frame| excerpts.row(frame));
        assert!(excerpts.held() > 0 && excerpts.list_only() && excerpts.held() == 0);
        let excerpts = taken(excerpts, &frames[12_500..]);
        assert_eq!((excerpts.found().len(), excerpts.held()), (2, 0));
        assert!(excerpts.into_chosen("a", &BTreeSet::from([1])).is_none());
    }

    #[test]
    fn positions_in_any_unit_are_cut_by_their_stroke() {
        let frames = steps(4, 0.01);
        let bare: Vec<Frame> = frames
            .iter()
            .map(|frame| {
                let mut frame = *frame;
                frame.inputs.opening_command_pu = f64::NAN;
                frame
            })
            .collect();
        let look = taken(Excerpts::new(None), &bare);
        assert!(look.is_long() && look.found().is_empty() && look.held() == 0);
        assert!(taken(Excerpts::new(Some(1.0)), &bare).found().is_empty());
        assert_eq!(taken(Excerpts::new(look.stroke()), &bare).found().len(), 4);
    }

    #[test]
    fn each_kind_gets_its_share_of_the_room_and_the_largest_are_kept_over_all_the_time() {
        let one = |process, k: usize, moved, from_rest| FoundProcess {
            process,
            rises: true,
            from_rest,
            from_ns: k as i64,
            duration_s: 10.0,
            rows: 100,
            moved,
        };
        let mut day: Vec<FoundProcess> =
            (0..20).map(|k| one(Process::LoadIncrease, k, if k % 5 == 3 { 0.5 } else { 0.1 }, true)).collect();
        day.push(one(Process::Shutdown, 20, 0.9, true));
        day.push(one(Process::LoadIncrease, 21, 0.9, false));
        let chosen = choose(&[day.clone(), vec![]], 500);
        assert_eq!(chosen, [BTreeSet::from([3, 8, 13, 18, 20]), BTreeSet::new()]);
        assert_eq!(choose(&[day.clone()], 10_000)[0].len(), day.len(), "all, where there is room");
        assert_eq!(choose(&[day], 10)[0].len(), 1, "one, where there is none");
        assert!(choose(&[vec![]], 10)[0].is_empty());
    }
}
