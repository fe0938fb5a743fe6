//! A grid under rows as they come in: command and pressure run from sample to sample, in memory that does not grow.
//!
//! A row waits until the samples are there that lie behind it:
//! three of the command, by which a sharp bend is known, and one of the pressure. Below a recording that is followed while it is made, a row
//! waits no longer than a minute of the recording, and what is later than the row by more plays no part in it.

use std::collections::VecDeque;

use super::Interpolation;
use super::align::{Cursor, ROW_LIMIT};
use super::streams::{OpeningCommand, Pressure, Sample};
use govtwin_model::frame::{Frame, Signals};
use govtwin_model::units::NANOS_PER_SECOND;

/// All samples are needed at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Irregular;

/// Samples of the command on either side of a row, by which a sharp bend is known.
const AROUND: usize = 3;
/// How far ahead of a row samples play a part in it, where a recording is followed.
const AHEAD_NS: i64 = 60 * NANOS_PER_SECOND;
/// Rows that may wait, where all samples can be had at once instead.
const MOST_WAITING: usize = 200_000;
/// Samples that are passed and kept, before they are let go together.
const PASSED: usize = 1024;
/// A recording whose grid has more points than [`ROW_LIMIT`] has no more than so many for each row that was recorded (one a second, at 1 ms)...
const POINTS_A_ROW: i64 = 1_000;
/// ...and no more than so many: 11 days at 1 ms. Work stays bounded by what is in the file.
const MOST_POINTS: i64 = 1_000_000_000;

/// Samples around the row that is made.
#[derive(Debug)]
struct Window<V> {
    samples: Vec<Sample<V>>,
    /// Of these, at or before the last row.
    passed: usize,
}

impl<V: Copy> Window<V> {
    fn new() -> Self {
        Self { samples: Vec::new(), passed: 0 }
    }

    fn push(&mut self, sample: Sample<V>) {
        if self.passed > PASSED {
            self.samples.drain(..self.passed - AROUND);
            self.passed = AROUND;
        }
        self.samples.push(sample);
    }

    /// The last time behind which there are so many samples; any where there is no such stream.
    fn known_until_ns(&self, ahead: usize) -> i64 {
        if self.samples.is_empty() {
            return i64::MAX;
        }
        let sample = self.samples.len().checked_sub(ahead).and_then(|place| self.samples.get(place));
        sample.map_or(i64::MIN, |sample| sample.stamp_ns - 1)
    }

    /// A value at a time, which must not fall from call to call, by what is no more than so far ahead; what holds where there is no such stream.
    fn at(&mut self, time_ns: i64, ahead_ns: i64, holds: f64, value: impl Fn(&Cursor<'_, V>) -> f64) -> f64 {
        let until_ns = time_ns.saturating_add(ahead_ns);
        let near = self.samples.iter().rposition(|sample| sample.stamp_ns <= until_ns).map_or(0, |last| last + 1);
        if near == 0 {
            return holds;
        }
        let mut cursor = Cursor { samples: &self.samples[..near], passed: self.passed };
        cursor.pass(time_ns);
        self.passed = cursor.passed;
        value(&cursor)
    }
}

/// Lays the grid.
#[derive(Debug)]
pub(super) struct Grid {
    period_ns: i64,
    /// Sharp bends of the command are set where they are.
    sharp: bool,
    /// How far ahead of a row samples play a part in it.
    ahead_ns: i64,
    command: Window<OpeningCommand>,
    pressure: Window<Pressure>,
    /// Rows that wait for the samples behind them.
    rows: VecDeque<Frame>,
    /// The newest row.
    newest_ns: Option<i64>,
    taken: i64,
    points: i64,
    /// The row that was made last, and the next point of the grid.
    last: Option<(Frame, i64)>,
}

impl Grid {
    /// The grid that an interpolation asks for.
    pub(super) fn new(interpolation: Interpolation) -> Option<Self> {
        Some(Self {
            period_ns: interpolation.period_ns()?,
            sharp: matches!(interpolation, Interpolation::Sharp { .. }),
            ahead_ns: i64::MAX,
            command: Window::new(),
            pressure: Window::new(),
            rows: VecDeque::new(),
            newest_ns: None,
            taken: 0,
            points: 0,
            last: None,
        })
    }

    /// The same below a recording that is followed: rows wait for a minute, and there may be as many as come.
    pub(super) fn following(self) -> Self {
        Self { ahead_ns: AHEAD_NS, ..self }
    }

    /// Time between its points, ns; none where no points are laid: without a command there is nothing to bend.
    pub(super) fn period_ns(&self) -> Option<i64> {
        (!self.sharp || !self.command.samples.is_empty()).then_some(self.period_ns)
    }

    /// Lays all of it, below rows whose samples were all taken.
    pub(super) fn below(mut self, rows: Vec<Frame>, on_row: &mut dyn FnMut(&Frame)) {
        self.rows = rows.into();
        self.lay(true, on_row);
    }

    /// Takes a sample in the order of stamps.
    pub(super) fn command(&mut self, sample: Sample<OpeningCommand>) {
        self.command.push(sample);
    }

    /// Takes a sample in the order of stamps.
    pub(super) fn pressure(&mut self, sample: Sample<Pressure>) {
        self.pressure.push(sample);
    }

    /// Takes a row, whose inputs hold.
    ///
    /// # Errors
    /// Where the grid would have too many points, or too many rows wait.
    pub(super) fn row(&mut self, frame: Frame) -> Result<(), Irregular> {
        let step_ns = self.newest_ns.map_or(0, |newest_ns| frame.time_ns.saturating_sub(newest_ns));
        self.newest_ns = Some(frame.time_ns);
        self.taken += 1;
        self.points = self.points.saturating_add(step_ns / self.period_ns);
        let most = ROW_LIMIT.max(self.taken.saturating_mul(POINTS_A_ROW).min(MOST_POINTS));
        let is_followed = self.ahead_ns < i64::MAX;
        let are_many = self.points > most && self.period_ns().is_some();
        if !is_followed && (are_many || self.rows.len() > MOST_WAITING) {
            return Err(Irregular);
        }
        self.rows.push_back(frame);
        Ok(())
    }

    /// Makes the rows that can be made, and all that are left where the recording has ended.
    pub(super) fn lay(&mut self, ended: bool, on_row: &mut dyn FnMut(&Frame)) {
        let known_ns = self.command.known_until_ns(AROUND).min(self.pressure.known_until_ns(1));
        let waited_ns = self.newest_ns.map_or(i64::MIN, |newest_ns| newest_ns.saturating_sub(self.ahead_ns));
        let until_ns = if ended { i64::MAX } else { known_ns.max(waited_ns) };
        let is_laid = self.period_ns().is_some();
        while let Some(row) = self.rows.front().copied().filter(|row| row.time_ns <= until_ns) {
            self.rows.pop_front();
            let mut next_ns = row.time_ns.saturating_add(self.period_ns);
            if let Some((before, point_ns)) = self.last.take() {
                next_ns = point_ns;
                while is_laid && next_ns < row.time_ns {
                    self.make(Frame { time_ns: next_ns, measured: Signals::NONE, ..before }, on_row);
                    next_ns = next_ns.saturating_add(self.period_ns);
                }
                if next_ns == row.time_ns {
                    next_ns = next_ns.saturating_add(self.period_ns);
                }
            }
            self.make(row, on_row);
            self.last = Some((row, next_ns));
        }
    }

    /// A row whose command and pressure run from sample to sample.
    fn make(&mut self, mut frame: Frame, on_row: &mut dyn FnMut(&Frame)) {
        let Self { sharp, ahead_ns, .. } = *self;
        let (time_ns, inputs) = (frame.time_ns, &mut frame.inputs);
        inputs.opening_command_pu = self.command.at(time_ns, ahead_ns, inputs.opening_command_pu, |command| {
            if sharp { command.bent(time_ns, |value| value.0) } else { command.between(time_ns, |value| value.0) }
        });
        inputs.tank_pressure_pa = self
            .pressure
            .at(time_ns, ahead_ns, inputs.tank_pressure_pa, |pressure| pressure.between(time_ns, |value| value.0));
        on_row(&frame);
    }
}
