//! The command of a compressing historian: few points at its corners, between which it runs straight (swinging door), or holds (on change).
//!
//! Measured signals stay at their points: these are measurements, and what lies between is not. The command drives the twin, so that it matters what
//! it does between two points. Which of the two is meant the servomotor shows, which follows it.

use govtwin_model::units::nanos_from_seconds;
use std::collections::VecDeque;

use super::row::{ImportedRow, Target};
use govtwin_model::metrics::median;
use govtwin_model::units::seconds_from_nanos;

/// Time between points that are added on a line, ns.
const PERIOD_NS: i64 = 20_000_000;
/// More rows do not wait for the next point of the command.
const MOST_WAITING: usize = 1_000_000;
/// More points than this are no compressed command.
pub(super) const MOST_POINTS: usize = 20_000;
/// A command with points further apart is looked at, s.
const SPARSE_S: f64 = 0.3;
/// Steps that differ by a smaller share are even; of fewer points nobody knows.
const EVEN: f64 = 0.2;
const FEW: usize = 20;
/// The servomotor follows about so late, s.
const FOLLOWS_S: f64 = 0.2;
/// What the servomotor must prefer, as a ratio of errors, and how near it must then be, pu; and differences that matter, pu.
const CLEAR: f64 = 0.6;
const FITS_PU: f64 = 0.05;
const MATTERS_PU: f64 = 0.01;

/// What a command does between its points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Between {
    /// The servomotor decides where points are few.
    #[default]
    Found,
    /// It holds until the next.
    Hold,
    /// It runs straight to the next.
    Line,
}

/// Points of command and servomotor.
#[derive(Clone, Debug, Default)]
pub(super) struct SparsePoints {
    command: Vec<(i64, f64)>,
    servomotor: Vec<(i64, f64)>,
}

/// What the points of a command are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Course {
    /// Many, or nothing depends on what lies between.
    Dense,
    /// The servomotor follows straight lines.
    Line { points: usize },
    /// It follows steps.
    Hold,
    /// It does not show it: how far both are apart at most, pu.
    Unknown { points: usize, apart_pu: f64 },
}

impl Course {
    /// How far the command may have been from what was taken, pu, where its map does not say it; infinite where nothing tells.
    pub(super) fn deviation_pu(self) -> f64 {
        match self {
            Self::Dense | Self::Hold => 0.0,
            Self::Line { .. } => f64::INFINITY,
            Self::Unknown { apart_pu, .. } => apart_pu,
        }
    }

    /// Notes and warnings: how the command was taken, with what is left to say; `stated_pu` is what the map says of its deviation.
    pub(super) fn words(self, added: u64, stated_pu: Option<f64>) -> (Option<String>, Option<String>) {
        match self {
            Self::Line { points } => {
                let note = format!(
                    "opening_command: {points} points at its corners, as a compressing historian keeps them; the servomotor follows straight \
                     lines between them, on which {added} points were added; measured signals stay at their points"
                );
                let question = "opening_command: how far the historian lets it be from its lines, the file does not say; `fit` and `diagnose` need \
                                `deviation_percent` in the map, or what was not compressed";
                (Some(note), stated_pu.is_none().then(|| question.to_owned()))
            }
            Self::Unknown { points, apart_pu } => {
                let question = format!(
                    "opening_command: {points} points, between which it may hold or run straight, {:.0} % of the stroke apart, and the servomotor \
                     does not show which; it is taken to hold; give `between: line` in the map where a historian has compressed it, or `between: hold`",
                    apart_pu * 100.0
                );
                (None, Some(question))
            }
            Self::Dense | Self::Hold => (None, None),
        }
    }
}

impl SparsePoints {
    /// Takes a row; false once there are too many.
    pub(super) fn take(&mut self, row: &ImportedRow) -> bool {
        self.command.extend(row.value(Target::OpeningCommand).map(|value| (row.time_ns, value)));
        self.servomotor.extend(row.value(Target::ServomotorPosition).map(|value| (row.time_ns, value)));
        self.command.len() <= MOST_POINTS && self.servomotor.len() <= 10 * MOST_POINTS
    }

    /// How many points the command has.
    pub(super) fn commands(&self) -> usize {
        self.command.len()
    }

    /// What the command does between its points.
    pub(super) fn course(&self) -> Course {
        let points = self.command.len();
        let steps = self.command.windows(2).map(|pair| seconds_from_nanos(pair[1].0.saturating_sub(pair[0].0)));
        let steps: Vec<f64> = steps.collect();
        let span_s = steps.iter().sum::<f64>();
        // What is sampled evenly is no choice of points, however slow, or interrupted.
        let middle_s = median(steps.clone());
        let even = steps.iter().filter(|step_s| (*step_s - middle_s).abs() < EVEN * middle_s).count();
        if points < 3 || span_s / (points as f64) < SPARSE_S || 2 * even > steps.len() && points > FEW {
            return Course::Dense;
        }
        let (mut hold, mut line, mut apart_pu) = (vec![], vec![], 0.0_f64);
        for (time_ns, position) in &self.servomotor {
            let Some((held, straight)) = self.at(time_ns - nanos_from_seconds(FOLLOWS_S)) else { continue };
            apart_pu = apart_pu.max((held - straight).abs());
            if (held - straight).abs() > MATTERS_PU {
                hold.push((position - held).abs());
                line.push((position - straight).abs());
            }
        }
        for pair in self.command.windows(2) {
            // A corner that the servomotor was not recorded at.
            apart_pu = apart_pu.max(if hold.is_empty() { (pair[1].1 - pair[0].1).abs() } else { 0.0 });
        }
        if apart_pu < MATTERS_PU {
            return Course::Dense;
        }
        if hold.is_empty() {
            return Course::Unknown { points, apart_pu };
        }
        let (hold, line) = (median(hold), median(line));
        if line < CLEAR * hold && line < FITS_PU {
            Course::Line { points }
        } else if hold < CLEAR * line && hold < FITS_PU {
            Course::Hold
        } else {
            Course::Unknown { points, apart_pu }
        }
    }

    /// The command at a time, held and on a straight line, pu.
    fn at(&self, time_ns: i64) -> Option<(f64, f64)> {
        let next = self.command.partition_point(|(at_ns, _)| *at_ns <= time_ns);
        let (from, to) = (self.command.get(next.checked_sub(1)?)?, self.command.get(next)?);
        let share = (time_ns - from.0) as f64 / (to.0 - from.0).max(1) as f64;
        Some((from.1, from.1 + share * (to.1 - from.1)))
    }
}

/// Adds points between those of the command, on straight lines.
#[derive(Debug, Default)]
pub(super) struct Lines {
    last: Option<(i64, f64)>,
    waiting: VecDeque<ImportedRow>,
    ready: VecDeque<ImportedRow>,
    pub(super) added: u64,
}

impl Lines {
    /// Takes a row; rows come in the order of time.
    pub(super) fn push(&mut self, row: ImportedRow) {
        let Some(value) = row.value(Target::OpeningCommand) else {
            let waits = self.last.is_some() && self.waiting.len() < MOST_WAITING;
            if waits {
                self.waiting.push_back(row);
            } else {
                self.flush(Some(row));
            }
            return;
        };
        if let Some((from_ns, from)) = self.last.filter(|(from_ns, _)| row.time_ns > *from_ns) {
            let mut time_ns = from_ns.saturating_add(PERIOD_NS);
            while time_ns < row.time_ns {
                while self.waiting.front().is_some_and(|waiting| waiting.time_ns < time_ns) {
                    self.ready.extend(self.waiting.pop_front());
                }
                let share = (time_ns - from_ns) as f64 / (row.time_ns - from_ns) as f64;
                let here = self.waiting.front_mut().filter(|waiting| waiting.time_ns == time_ns);
                let on_line = from + share * (value - from);
                if let Some(here) = here {
                    here.set(Target::OpeningCommand, on_line);
                } else {
                    let mut point = ImportedRow::at(time_ns);
                    point.set(Target::OpeningCommand, on_line);
                    self.ready.push_back(point);
                }
                self.added += 1;
                time_ns = time_ns.saturating_add(PERIOD_NS);
            }
        }
        self.last = Some((row.time_ns, value));
        self.flush(Some(row));
    }

    /// Hands on what waits, and what comes behind it.
    pub(super) fn flush(&mut self, behind: Option<ImportedRow>) {
        self.ready.extend(self.waiting.drain(..).chain(behind));
    }

    /// The next row that is complete.
    pub(super) fn pop(&mut self) -> Option<ImportedRow> {
        self.ready.pop_front()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(time_ms: i64, command: Option<f64>, servomotor: Option<f64>) -> ImportedRow {
        let mut row = ImportedRow::at(time_ms * 1_000_000);
        command.into_iter().for_each(|value| row.set(Target::OpeningCommand, value));
        servomotor.into_iter().for_each(|value| row.set(Target::ServomotorPosition, value));
        row
    }

    /// A command of corners, and a servomotor that follows it on lines or on steps.
    fn points(follows: impl Fn(f64) -> f64) -> SparsePoints {
        let corners = [(0, 0.2), (4000, 0.2), (14_000, 0.8), (30_000, 0.8)];
        let mut found = SparsePoints::default();
        for (time_ms, value) in corners {
            found.take(&row(time_ms, Some(value), None));
        }
        for time_ms in (0..30_000).step_by(700) {
            found.take(&row(time_ms, None, Some(follows(time_ms as f64 / 1e3 - 0.2))));
        }
        found
    }

    #[test]
    fn the_servomotor_shows_what_its_command_does_between_points() {
        let line = points(|t| {
            if t < 4.0 {
                0.2
            } else if t < 14.0 {
                0.2 + 0.06 * (t - 4.0)
            } else {
                0.8
            }
        });
        assert_eq!(line.course(), Course::Line { points: 4 });
        assert_eq!(points(|t| if t < 14.0 { 0.2 } else { 0.8 }).course(), Course::Hold);
        let elsewhere = points(|_| 0.5);
        assert!(matches!(elsewhere.course(), Course::Unknown { points: 4, .. }), "{:?}", elsewhere.course());
    }

    #[test]
    fn lines_are_drawn_between_the_rows_of_others() {
        let mut lines = Lines::default();
        for one in
            [row(0, Some(0.0), None), row(35, None, Some(0.5)), row(60, None, Some(0.6)), row(100, Some(1.0), None)]
        {
            lines.push(one);
        }
        let rows: Vec<ImportedRow> = std::iter::from_fn(|| lines.pop()).collect();
        assert!(rows.windows(2).all(|pair| pair[0].time_ns < pair[1].time_ns));
        for row in rows.iter().filter(|row| row.value(Target::OpeningCommand).is_some()) {
            let command = row.value(Target::OpeningCommand).unwrap();
            assert!((command - row.time_ns as f64 / 1e8).abs() < 1e-12, "{row:?}");
        }
        assert_eq!((rows.len(), lines.added), (7, 4));
    }
}
