//! Rows out of streams. As the messages come in, in memory that does not grow: each row as soon as no later message can belong before it.
//!
//! The result is that of all samples put in order first, or none: a bag that needs all of them (a clock that jumps, stamps of 0, a stream that
//! lags behind the others by more than is waited for) is found out on the way, and is read anew.

mod track;

use std::collections::{BTreeSet, VecDeque};

use super::align::{FARTHEST_NS, most_ticks};
use super::collect::Collected;
use super::edges::Edges;
use super::evidence::RowEvidence;
use super::grid::{Grid, Irregular};
use super::order;
use super::read::Read;
use super::streams::{OpeningCommand, PistonForce, Pressure, Sample};
use super::topic::RawView;
use super::{ReadOptions, Stream};
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::units::TICK_NS;
use track::Track;

/// Stamps and log times that part by more, or silences that last longer, may be a jump of time.
const DOUBTFUL_NS: i64 = order::SET_FORWARD_NS / 4;

/// Samples and rows that may wait, those above a grid not counted.
const MOST_WAITING: usize = 200_000;

/// Rows are looked for each time so many samples have come in.
const TOGETHER: usize = 64;

/// How samples come.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Course {
    /// All are there, in order.
    Whole,
    /// One by one out of a bag.
    Streamed,
    /// One by one while the bag is made.
    Followed,
}

/// The streams on their way into rows, which are handed on one by one.
pub(super) struct Live {
    pub(super) collected: Collected,
    command: Track<OpeningCommand>,
    esv: Track<EsvState>,
    tank_pressure: Track<Pressure>,
    servo_state: Track<Signals>,
    /// Nobody waits for its first sample: a node's own bag has the topic whether a force ever came or not.
    load: Track<PistonForce>,
    newest_log_ns: Option<i64>,
    untried: usize,
    /// Stamps are to be moved onto the recorder's clock, for which all of them are needed.
    by_log: bool,
    /// Rows up to here are made.
    done_ns: i64,
    /// Rows since the last command or servo state: they count once another one comes.
    pending: VecDeque<Frame>,
    previous_ns: Option<i64>,
    /// The first row, and how many there are: those of a recording that is followed may be few.
    first_ns: Option<i64>,
    taken: usize,
    course: Course,
    /// The grid below the rows, where one is asked for.
    grid: Option<Grid>,
    /// Rows that were handed on, the grid's not counted.
    pub(super) count: usize,
    pub(super) evidence: RowEvidence,
    edges: Edges,
}

impl Live {
    /// Begins; `topics` are those of the bag, where its summary lists them.
    pub(super) fn new(options: &ReadOptions, topics: Option<&BTreeSet<String>>) -> Self {
        let absent = |stream| topics.is_some_and(|topics| !topics.contains(options.topics.of(stream)));
        Self {
            grid: Grid::new(options.interpolation),
            collected: Collected::new(options),
            command: Track::new(absent(Stream::Command)),
            esv: Track::new(absent(Stream::Esv)),
            tank_pressure: Track::new(absent(Stream::TankPressure)),
            servo_state: Track::new(absent(Stream::ServoState)),
            load: Track::new(false),
            newest_log_ns: None,
            untried: 0,
            by_log: options.topics.by_log,
            done_ns: i64::MIN,
            pending: VecDeque::new(),
            previous_ns: None,
            first_ns: None,
            taken: 0,
            course: Course::Streamed,
            count: 0,
            evidence: RowEvidence::new(options.positions),
            edges: Edges::default(),
        }
    }

    /// The same for a recording that is followed while it is made.
    pub(super) fn following(options: &ReadOptions, topics: &BTreeSet<String>) -> Self {
        let this = Self::new(options, Some(topics));
        Self { grid: this.grid.map(Grid::following), course: Course::Followed, ..this }
    }

    /// The rows of samples that are all there and in order; inputs hold, and a grid is still to be laid below them.
    pub(super) fn whole(collected: Collected, options: &ReadOptions) -> (Vec<Frame>, Option<Grid>, Read) {
        let mut live = Self { grid: None, course: Course::Whole, collected, ..Self::new(options, None) };
        let Collected { command, esv, tank_pressure, servo_state, load, .. } = &mut live.collected;
        let grid = Grid::new(options.interpolation).map(|mut grid| {
            command.samples.iter().for_each(|sample| grid.command(*sample));
            tank_pressure.samples.iter().for_each(|sample| grid.pressure(*sample));
            grid
        });
        (live.command, live.esv) = (Track::of(command), Track::of(esv));
        (live.tank_pressure, live.servo_state) = (Track::of(tank_pressure), Track::of(servo_state));
        live.load = Track::of(load);
        let mut rows = vec![];
        // Of these no row is irregular.
        let _ = live.finish(&mut |frame| rows.push(*frame));
        (rows, grid, live.conclude())
    }

    /// Streams without messages so far, although the bag may hold them.
    pub(super) fn unheard(&self) -> impl Iterator<Item = Stream> {
        let silent = [
            (Stream::Command, self.command.newest.is_none() && !self.command.absent),
            (Stream::Esv, self.esv.newest.is_none() && !self.esv.absent),
            (Stream::TankPressure, self.tank_pressure.newest.is_none() && !self.tank_pressure.absent),
            (Stream::ServoState, self.servo_state.newest.is_none() && !self.servo_state.absent),
        ];
        silent.into_iter().filter(|(_, silent)| *silent).map(|(stream, _)| stream)
    }

    /// Takes a message; rows that are complete by it go to `on_row`.
    pub(super) fn take(&mut self, message: RawView<'_>, on_row: &mut dyn FnMut(&Frame)) -> Result<(), Irregular> {
        if !self.collected.take(message) {
            return Ok(());
        }
        if self.by_log {
            return Err(Irregular);
        }
        if self.newest_log_ns.is_some_and(|newest_ns| message.log_time_ns.saturating_sub(newest_ns) > DOUBTFUL_NS) {
            return Err(Irregular);
        }
        self.newest_log_ns = self.newest_log_ns.max(Some(message.log_time_ns));
        let Collected { command, esv, tank_pressure, servo_state, load, .. } = &mut self.collected;
        self.command.qualify(command, self.done_ns)?;
        self.esv.qualify(esv, self.done_ns)?;
        self.tank_pressure.qualify(tank_pressure, self.done_ns)?;
        self.servo_state.qualify(servo_state, self.done_ns)?;
        self.load.qualify(load, self.done_ns)?;
        self.untried += 1;
        if self.untried < TOGETHER {
            return Ok(());
        }
        self.untried = 0;
        let log_time_ns = self.newest_log_ns.unwrap_or(i64::MIN);
        let final_ns = [
            self.command.final_ns(log_time_ns),
            self.esv.final_ns(log_time_ns),
            self.tank_pressure.final_ns(log_time_ns),
            self.servo_state.final_ns(log_time_ns),
            self.load.newest.map_or(i64::MAX, |_| self.load.final_ns(log_time_ns)),
        ];
        self.rows(final_ns.into_iter().min().unwrap_or(i64::MIN), on_row)?;
        let waiting = self.command.waiting.len()
            + self.esv.waiting.len()
            + self.tank_pressure.waiting.len()
            + self.servo_state.waiting.len()
            + self.load.waiting.len()
            + self.pending.len();
        if waiting > MOST_WAITING { Err(Irregular) } else { Ok(()) }
    }

    /// Makes all rows up to a time.
    fn rows(&mut self, final_ns: i64, on_row: &mut dyn FnMut(&Frame)) -> Result<(), Irregular> {
        loop {
            let next = [
                self.command.next_ns(),
                self.esv.next_ns(),
                self.tank_pressure.next_ns(),
                self.servo_state.next_ns(),
                self.load.next_ns(),
            ];
            let Some(time_ns) = next.into_iter().flatten().min().filter(|time_ns| *time_ns <= final_ns) else {
                return Ok(());
            };
            self.done_ns = time_ns;
            self.row(time_ns, on_row)?;
        }
    }

    fn row(&mut self, time_ns: i64, on_row: &mut dyn FnMut(&Frame)) -> Result<(), Irregular> {
        let Collected { command, esv, tank_pressure, servo_state, load, .. } = &mut self.collected;
        let commanded = self.command.advance(time_ns, &mut command.evidence);
        self.esv.advance(time_ns, &mut esv.evidence);
        let pressed = self.tank_pressure.advance(time_ns, &mut tank_pressure.evidence);
        let measured = self.servo_state.advance(time_ns, &mut servo_state.evidence);
        self.load.advance(time_ns, &mut load.evidence);
        if let Some(grid) = &mut self.grid {
            self.command.current.filter(|_| commanded).into_iter().for_each(|sample| grid.command(sample));
            self.tank_pressure.current.filter(|_| pressed).into_iter().for_each(|sample| grid.pressure(sample));
        }
        let in_force = [self.command.is_settled(), self.esv.is_settled(), self.tank_pressure.is_settled()];
        if self.edges.count(in_force) {
            return Ok(());
        }
        let is_far = self.previous_ns.is_some_and(|previous_ns| time_ns.saturating_sub(previous_ns) > FARTHEST_NS);
        if is_far && self.course != Course::Whole {
            return Err(Irregular);
        }
        self.previous_ns = Some(time_ns);
        let first_ns = *self.first_ns.get_or_insert(time_ns);
        self.taken += 1;
        if self.course == Course::Streamed && time_ns.saturating_sub(first_ns) / TICK_NS > most_ticks(self.taken) {
            return Err(Irregular);
        }
        let value = |sample: Option<Sample<Signals>>| sample.map_or(Signals::NONE, |sample| sample.value);
        self.pending.push_back(Frame {
            time_ns,
            inputs: Inputs {
                opening_command_pu: self.command.current.map_or(f64::NAN, |sample| sample.value.0),
                esv: self.esv.current.map_or(EsvState::Normal, |sample| sample.value),
                tank_pressure_pa: self.tank_pressure.current.map_or(f64::NAN, |sample| sample.value.0),
                piston_force_n: self.load.current.map_or(0.0, |sample| sample.value.0),
            },
            measured: value(self.servo_state.current.filter(|_| measured)),
        });
        if commanded || measured {
            self.hand_on(usize::MAX, false, on_row)?;
        }
        Ok(())
    }

    /// Hands on so many of the rows that wait.
    fn hand_on(&mut self, count: usize, ended: bool, on_row: &mut dyn FnMut(&Frame)) -> Result<(), Irregular> {
        let Self { pending, grid, evidence, .. } = self;
        let mut hand_on = |frame: &Frame| {
            evidence.row(frame);
            on_row(frame);
        };
        let count = count.min(pending.len());
        self.count += count;
        for frame in pending.drain(..count) {
            match grid {
                Some(grid) => grid.row(frame)?,
                None => hand_on(&frame),
            }
        }
        if let Some(grid) = grid {
            grid.lay(ended, &mut hand_on);
        }
        Ok(())
    }

    /// Makes the last rows, and gives health, evidence and edges.
    pub(super) fn finish(&mut self, on_row: &mut dyn FnMut(&Frame)) -> Result<(), Irregular> {
        self.rows(i64::MAX, on_row)?;
        // A topic without one usable sample counts as absent, which was not known before.
        if !(self.command.is_settled() && self.esv.is_settled() && self.tank_pressure.is_settled()) {
            return Err(Irregular);
        }
        let nobody = self.command.current.is_none() && self.servo_state.current.is_none();
        // Inputs that begin after the last command or measurement make the one row in which they begin.
        let last = if nobody { usize::MAX } else { usize::from(self.count == 0) };
        self.hand_on(last, true, on_row)
    }

    /// What was read, once it is finished.
    pub(super) fn conclude(mut self) -> Read {
        let translated = std::mem::take(&mut self.collected.translated);
        let (mut healths, evidence) = self.collected.finish();
        if let [command, esv, tank_pressure, servo_state, load @ ..] = &mut healths[..] {
            self.command.finish(command);
            self.esv.finish(esv);
            self.tank_pressure.finish(tank_pressure);
            self.servo_state.finish(servo_state);
            if let Some(load) = load.first_mut() {
                self.load.finish(load);
            }
        }
        Read { healths, evidence, rows: self.evidence, edges: self.edges, jump: None, count: self.count, translated }
    }
}
