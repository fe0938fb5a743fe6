//! What is wrong with data, found while they pass: gaps, frozen and saturated channels, and units or signs that cannot be meant.

mod meant;
mod pace;

use crate::chain::{ChainEvidence, Impossible};
use crate::channel::Channel;
use crate::evidence::{COMMAND, MEASURED, PRESSURE};
use crate::qualification::jumps_away;
use govtwin_model::frame::{EsvState, Frame, Inputs, Signals};
use govtwin_model::signal::Signal;

use super::map::Map;
use super::row::{ImportedRow, Target};
use govtwin_model::units::seconds_from_nanos;

pub use meant::Range;
use pace::IntervalBins;

/// Equal samples one after another, and for so long, that a lively channel never has, s.
const FROZEN: (u64, f64) = (50, 2.0);
/// A channel is lively where so many of its other samples differ from the one before.
const LIVELY_SHARE: f64 = 0.5;
/// Equal samples in a row at an end of the range that make it saturated.
const SATURATED_RUN: u64 = 10;
/// And the share of all samples that must stand there.
const SATURATED_SHARE: f64 = 0.02;
/// A movement of a position that its neighbours in the chain must answer, pu.
const MOVES_PU: f64 = 0.03;
/// Gaps shorter than this are no news, s.
const GAP_S: f64 = 0.1;
/// Positions that go beyond are in another unit, pu.
const IN_PU: f64 = 1.6;
/// A value that is farther from all others than so many times their range is none of theirs.
const STANDS_IN: f64 = 3.0;
/// The share of samples with the time of the one before that is worth a word.
const REPEATED_SHARE: f64 = 0.01;

/// What is known of one signal after an import.
#[derive(Clone, Debug, PartialEq)]
pub struct SignalFindings {
    /// The signal.
    pub target: Target,
    /// Its column or field; empty for a constant.
    pub place: String,
    /// Its unit as the map says; empty where it says none.
    pub unit: String,
    /// Samples with a value.
    pub samples: u64,
    /// Least and greatest value, in the unit of the import.
    pub ends: [f64; 2],
    /// Samples per second: one over the median interval.
    pub rate_hz: f64,
    /// Longest interval, s.
    pub longest_gap_s: f64,
}

/// Equal samples one after another.
#[derive(Clone, Copy, Debug)]
struct EqualSamples {
    value: f64,
    count: u64,
    begin_ns: i64,
    end_ns: i64,
}

impl EqualSamples {
    fn length_s(&self) -> f64 {
        seconds_from_nanos(self.end_ns - self.begin_ns)
    }
}

/// Samples at one end of the range.
#[derive(Clone, Copy, Debug, Default)]
struct AtEnd {
    count: u64,
    run: u64,
    longest: u64,
    /// The farthest of all other values.
    next: Option<f64>,
}

/// One signal while it passes.
#[derive(Clone, Debug)]
struct SignalWatch {
    target: Target,
    place: String,
    unit: String,
    /// Whether the map gives a range, so that another unit cannot be meant.
    ranged: bool,
    range: Range,
    pace: IntervalBins,
    changes: u64,
    run: Option<EqualSamples>,
    longest: Option<EqualSamples>,
    at_end: [AtEnd; 2],
    /// Signs of a second sender; none of signals of which no limit is known.
    course: Option<Channel>,
}

/// What the values of one sender keep to.
fn course(target: Target) -> Option<Channel> {
    let [servomotor, spool, pilot_valve, _] =
        [Signal::ServomotorPosition, Signal::SpoolPosition, Signal::PilotValvePosition, Signal::ControlPressure]
            .map(|signal| MEASURED[signal as usize]);
    Some(Channel::new(match target {
        Target::OpeningCommand => COMMAND,
        Target::TankPressure => PRESSURE,
        Target::ServomotorPosition => servomotor,
        Target::SpoolPosition => spool,
        Target::PilotValvePosition => pilot_valve,
        Target::Esv | Target::ControlPressure => return None,
    }))
}

impl SignalWatch {
    fn take(&mut self, time_ns: i64, value: f64) {
        self.pace.push(time_ns);
        if let Some(course) = &mut self.course {
            course.push(time_ns, value);
        }
        let before = self.range.ends();
        self.range.take(value);
        let ends = self.range.ends();
        for (side, at_end) in self.at_end.iter_mut().enumerate() {
            if ends[side] != before[side] {
                *at_end = AtEnd { next: before[side].is_finite().then_some(before[side]), ..AtEnd::default() };
            } else if value != ends[side] {
                let farther = if side == 0 { f64::min } else { f64::max };
                at_end.next = Some(at_end.next.map_or(value, |next| farther(next, value)));
            }
            if value == ends[side] {
                at_end.count += 1;
                at_end.run += 1;
                at_end.longest = at_end.longest.max(at_end.run);
            } else {
                at_end.run = 0;
            }
        }
        match &mut self.run {
            Some(run) if run.value == value => {
                run.count += 1;
                run.end_ns = time_ns;
            }
            run => {
                self.changes += u64::from(run.is_some());
                *run = Some(EqualSamples { value, count: 1, begin_ns: time_ns, end_ns: time_ns });
            }
        }
        if let Some(run) = self.run
            && self.longest.is_none_or(|longest| run.count > longest.count)
        {
            self.longest = Some(run);
        }
    }

    /// Where it stood still although it is lively elsewhere.
    fn frozen(&self) -> Option<EqualSamples> {
        let run = self.longest.filter(|run| run.count >= FROZEN.0 && run.length_s() >= FROZEN.1)?;
        let others = self.range.count.saturating_sub(run.count);
        (others > 0 && self.changes as f64 >= LIVELY_SHARE * others as f64).then_some(run)
    }

    /// A value far from all others that comes again to the last digit, with their ends: it stands for no value.
    fn stand_in(&self) -> Option<(f64, u64, [f64; 2])> {
        let possible = match self.target {
            Target::TankPressure => 1.0..5e7,
            Target::ControlPressure => -2e5..1e8,
            _ => -IN_PU..IN_PU,
        };
        let [low, high] = [self.at_end[0].next?, self.at_end[1].next?];
        let ends = self.range.ends();
        // Beside such a value the other end is the other values' own.
        let of = |side: usize| if side == 0 { [low, ends[1]] } else { [ends[0], high] };
        let found = ends.into_iter().zip(&self.at_end).enumerate().find(|(side, (value, end))| {
            let [least, most] = of(*side);
            let apart = (least - value).max(value - most);
            !possible.contains(value) && end.count > 1 && most > least && apart > STANDS_IN * (most - least)
        });
        found.map(|(side, (value, end))| (value, end.count, of(side)))
    }

    /// The end of the range at which it stands still again and again.
    fn saturated(&self) -> Option<(f64, u64)> {
        let count = self.range.count.max(1) as f64;
        let at_ends: u64 = self.at_end.iter().map(|end| end.count).sum();
        let inside = self.range.count.saturating_sub(at_ends);
        // Coarse steps stand still everywhere, and what has two levels is a switch.
        if (self.changes as f64) < LIVELY_SHARE * inside as f64
            || self.range.span() == 0.0
            || inside < self.range.count / 10
        {
            return None;
        }
        let saturated = |end: &AtEnd| end.longest >= SATURATED_RUN && end.count as f64 > SATURATED_SHARE * count;
        let ends = self.range.ends().into_iter().zip(&self.at_end);
        ends.into_iter().rev().find(|(_, end)| saturated(end)).map(|(value, end)| (value, end.count))
    }
}

/// All signals of an import while its rows pass.
#[derive(Debug)]
pub struct Findings {
    watched: Vec<SignalWatch>,
    meant: meant::Meant,
    /// What a reader of the bag would find in it.
    chain: ChainEvidence,
    inputs: Inputs,
}

impl Findings {
    /// Begins to watch the signals of a map.
    pub fn new(map: &Map) -> Self {
        let watch = |signal: &super::map::SignalMap| SignalWatch {
            target: signal.target,
            place: signal.place().unwrap_or_default().to_owned(),
            unit: signal.unit.clone(),
            ranged: signal.conversion.range.is_some(),
            range: Range::default(),
            pace: IntervalBins::default(),
            changes: 0,
            run: None,
            longest: None,
            at_end: [AtEnd::default(); 2],
            course: course(signal.target),
        };
        let from_files = map.signals.iter().filter(|signal| signal.place().is_some());
        Self {
            watched: from_files.map(watch).collect(),
            meant: meant::Meant::default(),
            chain: ChainEvidence::default(),
            inputs: Inputs {
                opening_command_pu: f64::NAN,
                esv: EsvState::Normal,
                tank_pressure_pa: f64::NAN,
                piston_force_n: 0.0,
            },
        }
    }

    /// Watches a row.
    pub fn take(&mut self, row: &ImportedRow) {
        for watch in &mut self.watched {
            if let Some(value) = row.value(watch.target) {
                watch.take(row.time_ns, value);
            }
        }
        self.meant.take(row);
        let newest = |target: Target, last: f64| row.value(target).unwrap_or(last);
        self.inputs = Inputs {
            opening_command_pu: newest(Target::OpeningCommand, self.inputs.opening_command_pu),
            esv: row.esv().unwrap_or(self.inputs.esv),
            tank_pressure_pa: newest(Target::TankPressure, self.inputs.tank_pressure_pa),
            piston_force_n: 0.0,
        };
        let measured = |target: Target| row.value(target).unwrap_or(f64::NAN);
        let measured = Signals {
            spool_position_pu: measured(Target::SpoolPosition),
            servomotor_position_pu: measured(Target::ServomotorPosition),
            ..Signals::NONE
        };
        self.chain.row(&Frame { time_ns: row.time_ns, inputs: self.inputs, measured });
    }

    /// What is known of the signals, and what a user should look into.
    pub fn finish(self) -> (Vec<SignalFindings>, Vec<String>) {
        let mut warnings = vec![];
        let moves = |watch: &&SignalWatch| {
            !watch.target.is_pressure() && watch.target != Target::Esv && watch.range.span() > MOVES_PU
        };
        let something_moves = self.watched.iter().any(|watch| moves(&watch));
        for watch in &self.watched {
            let id = watch.target.id();
            let place = &watch.place;
            let mut say = |words: String| warnings.push(format!("{id} (`{place}`): {words}"));
            if watch.range.count == 0 {
                say("holds no value at all".into());
                continue;
            }
            let unit = watch.target.unit();
            // A command stands still, and at its limits, by right.
            let commanded = watch.target == Target::OpeningCommand;
            let is_input = matches!(watch.target, Target::OpeningCommand | Target::TankPressure);
            if watch.target != Target::Esv {
                if let Some((value, count, [least, most])) = watch.stand_in() {
                    say(format!(
                        "stands at {value} {unit} in {count} of {} samples, to the last digit, while all others lie between {least} and {most}: does \
                         it stand for no value? Then add what the file holds there to `file: {{missing: […]}}` in the map",
                        watch.range.count
                    ));
                    continue;
                }
                if watch.range.span() == 0.0 && watch.range.count > 1 && something_moves && !is_input {
                    let value = watch.range.ends()[0];
                    say(format!(
                        "stands at {value} {unit} throughout while the unit moves: a dead channel, or another signal?"
                    ));
                } else if let Some(run) = watch.frozen().filter(|_| !commanded) {
                    let (length_s, count) = (run.length_s(), run.count);
                    let after_s = seconds_from_nanos(run.begin_ns - watch.pace.first_ns());
                    say(format!(
                        "frozen at {} {unit} for {length_s:.1} s ({count} samples), {after_s:.1} s after its beginning, while elsewhere it \
                         changes from sample to sample: a stuck transducer or logger, unless the unit was at rest and shows no noise",
                        run.value
                    ));
                } else if let Some((value, count)) = watch.saturated().filter(|_| !commanded) {
                    say(format!(
                        "stands at its {} of {value} {unit} in {count} of {} samples, to the last digit: saturated there, or clipped by \
                         an export",
                        if value == watch.range.ends()[1] { "most" } else { "least" },
                        watch.range.count
                    ));
                }
            }
            if let Some(words) = meant::unit(watch.target, &watch.range, &watch.unit, watch.ranged) {
                say(words);
            }
            if let Some(sign) = watch.course.as_ref().and_then(jumps_away) {
                say(format!("more than one sender, by all signs: {sign}"));
            }
            watch.pace.warnings(watch.target == Target::Esv).into_iter().for_each(say);
        }
        warnings.extend(self.meant.warnings());
        // What signs and units explain needs no second word.
        let in_range =
            self.watched.iter().all(|watch| watch.target.is_pressure() || watch.range.ends()[1].abs() <= IN_PU);
        if in_range && self.meant.warnings().is_empty() {
            warnings.extend(self.chain.found().iter().map(Impossible::words));
        }
        let found = |watch: SignalWatch| SignalFindings {
            target: watch.target,
            place: watch.place,
            unit: watch.unit,
            samples: watch.range.count,
            ends: watch.range.ends(),
            rate_hz: watch.pace.rate_hz(),
            longest_gap_s: watch.pace.longest_gap_s(),
        };
        (self.watched.into_iter().map(found).collect(), warnings)
    }
}
