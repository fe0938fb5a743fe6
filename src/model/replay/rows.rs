//! A replay row by row: estimates as rows come in, figures of all rows, and as many rows as pictures need.

use std::collections::VecDeque;

use super::{Replayed, Scores};
use crate::frame::{Estimate, EsvState, Frame, Inputs, Signals};
use crate::recording::{ProcessWatch, Recording};
use crate::twin::{Cut, Twin};
use crate::units::nanos_from_seconds;

/// Rows that are kept at most; of more, every second, fourth, eighth and so on.
pub const MOST_KEPT: usize = 1 << 16;

/// Rows that are kept besides because the ESV switches there.
const MOST_SWITCHES: usize = 1000;

/// A twin that runs along rows as they come in.
#[derive(Debug)]
pub struct Simulator<'a> {
    twin: &'a mut Twin,
    lookahead_ns: i64,
    /// Inputs not yet in force, by when they will be.
    ahead: VecDeque<(i64, Inputs)>,
    /// Rows that wait for inputs which come later and act earlier.
    waiting: VecDeque<Frame>,
    inputs: Option<Inputs>,
    started: bool,
}

impl<'a> Simulator<'a> {
    /// Begins with the twin at rest.
    ///
    /// Where its plant has an input clock of its own ([`crate::plant::Plant::lookahead_s`]), commands and ESV edges reach the twin
    /// earlier than their rows, and estimates come as much later.
    pub fn new(twin: &'a mut Twin) -> Self {
        twin.reset();
        // Behind a spool cut neither command nor ESV counts.
        let lookahead_ns =
            if twin.cut() == Cut::Spool { 0 } else { nanos_from_seconds(twin.plant().lookahead_s).max(0) };
        let (ahead, waiting) = (VecDeque::new(), VecDeque::new());
        Self { twin, lookahead_ns, ahead, waiting, inputs: None, started: false }
    }

    /// Begins anew.
    pub fn restart(&mut self) {
        self.twin.reset();
        self.ahead.clear();
        self.waiting.clear();
        (self.inputs, self.started) = (None, false);
    }

    /// Takes a row; the estimates that it makes possible go to `on_estimate` with their rows, in order.
    pub fn row(&mut self, frame: &Frame, on_estimate: &mut dyn FnMut(&Frame, Estimate)) {
        if self.lookahead_ns == 0 {
            on_estimate(frame, self.twin.step(frame));
            return;
        }
        let acts_ns = frame.time_ns.saturating_sub(self.lookahead_ns);
        self.inputs.get_or_insert(frame.inputs);
        self.ahead.push_back((acts_ns, frame.inputs));
        self.waiting.push_back(*frame);
        while let Some(next) = self.waiting.front().copied().filter(|next| next.time_ns <= acts_ns) {
            self.waiting.pop_front();
            self.step(&next, on_estimate);
        }
    }

    /// Makes the last estimates.
    pub fn finish(&mut self, on_estimate: &mut dyn FnMut(&Frame, Estimate)) {
        while let Some(next) = self.waiting.pop_front() {
            self.step(&next, on_estimate);
        }
    }

    /// Runs to a row, with inputs that act earlier than their rows, between rows where they fall there.
    fn step(&mut self, frame: &Frame, on_estimate: &mut dyn FnMut(&Frame, Estimate)) {
        while let Some((time_ns, inputs)) = self.ahead.front().copied().filter(|(time_ns, _)| *time_ns <= frame.time_ns)
        {
            self.ahead.pop_front();
            self.inputs = Some(inputs);
            if time_ns < frame.time_ns && self.started {
                let inputs = Inputs { tank_pressure_pa: f64::NAN, piston_force_n: f64::NAN, ..inputs };
                self.twin.advance(&Frame { time_ns, inputs, measured: Signals::NONE });
            }
        }
        let Inputs { tank_pressure_pa, piston_force_n, .. } = frame.inputs;
        let inputs = Inputs { tank_pressure_pa, piston_force_n, ..self.inputs.unwrap_or(frame.inputs) };
        self.started = true;
        on_estimate(frame, self.twin.step(&Frame { inputs, ..*frame }));
    }
}

/// A replay that takes rows one by one, in memory that does not grow with their number.
#[derive(Debug)]
pub struct Replaying<'a> {
    simulator: Simulator<'a>,
    gathered: GatheredFigures,
}

#[derive(Debug, Default)]
struct GatheredFigures {
    scores: Scores,
    process: ProcessWatch,
    rows: usize,
    /// One in so many rows is kept.
    every: usize,
    kept: Vec<Kept>,
    last: Option<Kept>,
    switches: usize,
}

#[derive(Clone, Copy, Debug)]
struct Kept {
    number: usize,
    /// The ESV switches here.
    switches: bool,
    frame: Frame,
    estimate: Estimate,
}

impl<'a> Replaying<'a> {
    /// Begins with the twin at rest.
    pub fn new(twin: &'a mut Twin) -> Self {
        Self { simulator: Simulator::new(twin), gathered: GatheredFigures::new() }
    }

    /// Forgets all rows.
    pub fn restart(&mut self) {
        self.simulator.restart();
        self.gathered = GatheredFigures::new();
    }

    /// Takes a row.
    pub fn row(&mut self, frame: &Frame) {
        let Self { simulator, gathered } = self;
        simulator.row(frame, &mut |frame, estimate| gathered.take(frame, estimate));
    }

    /// The replay of all rows.
    pub fn finish(self, name: &str) -> Replayed {
        let Self { mut simulator, mut gathered } = self;
        simulator.finish(&mut |frame, estimate| gathered.take(frame, estimate));
        gathered.finish(name)
    }
}

impl GatheredFigures {
    fn new() -> Self {
        Self { every: 1, ..Self::default() }
    }

    fn take(&mut self, frame: &Frame, estimate: Estimate) {
        self.scores.push(frame, &estimate);
        self.process.row(frame);
        let esv = |kept: &Kept| kept.frame.inputs.esv;
        let before = self.last.as_ref().map_or(EsvState::Normal, esv);
        let switches = before != frame.inputs.esv && self.switches < MOST_SWITCHES;
        self.switches += usize::from(switches);
        let kept = Kept { number: self.rows, switches, frame: *frame, estimate };
        self.last = Some(kept);
        if switches || self.rows.is_multiple_of(self.every) {
            self.kept.push(kept);
        }
        self.rows += 1;
        if self.kept.len() > MOST_KEPT {
            self.every *= 2;
            let every = self.every;
            self.kept.retain(|kept| kept.switches || kept.number.is_multiple_of(every));
        }
    }

    fn finish(mut self, name: &str) -> Replayed {
        if let Some(last) = self.last
            && self.kept.last().is_none_or(|kept| kept.number < last.number)
        {
            self.kept.push(last);
        }
        let (frames, estimates) = self.kept.iter().map(|kept| (kept.frame, kept.estimate)).unzip();
        let recording = Recording { process: self.process.process(), ..Recording::new(name, frames) };
        Replayed { recording, estimates, scores: self.scores, rows: self.rows, every: self.every }
    }
}
