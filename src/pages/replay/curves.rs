//! The pictures of one recording: measured, simulated and their difference over time.

use crate::diagnosis::{WORST_S, worst_stretch};
use crate::draw::{Svg, svg};
use crate::ink::Ink;
use crate::picture::{EventLine, Panel, Picture, Span};
use govtwin_diagnosis::replay_validation::Check;
use govtwin_model::frame::EsvState;
use govtwin_model::parameters::{Sensor, Sensors};
use govtwin_model::recording::Recording;
use govtwin_model::replay::Replayed;
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// Half height of the panel that shows the spool at rest: the dead band's jumps, and the range of
/// −3.5 % to 2 % that Liu et al. 2025 find hardest (section 4.2), pu.
const NEAR_NEUTRAL_PU: f64 = 0.06;

/// Recordings longer than this get a second picture of their liveliest stretch, s.
const LONG_S: f64 = 60.0;

/// Length of that stretch, s.
const CLOSE_UP_S: f64 = 20.0;

/// The pictures of one recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pictures {
    /// The whole recording.
    pub whole: Svg,
    /// Its liveliest stretch, where the whole is too long to show it.
    pub close_up: Option<Svg>,
    /// The two seconds in which the twin is farthest off, where the recording is much longer.
    pub worst: Option<Svg>,
    /// The pilot signals, where they were measured.
    pub pilot: Option<Svg>,
    /// Stretches in which limits are broken, each with the limits.
    pub broken: Vec<(Svg, Vec<String>)>,
}

/// What stands beside the twin on the same recording.
#[derive(Clone, Copy, Debug)]
pub enum Beside<'a> {
    /// Another unit.
    Unit {
        /// What it is called.
        title: &'a str,
        /// What it makes of the recording.
        replayed: &'a Replayed,
    },
    /// The same unit with a learned residual.
    Residual {
        /// The signal that is corrected; the others are the twin's.
        signal: Signal,
        /// The corrected recording.
        replayed: &'a Replayed,
        /// Half the width of its band row by row, in the signal's unit.
        half_width: &'a [f64],
        /// Share of the measured values that the band is to hold; none where the model has no band.
        coverage_share: Option<f64>,
    },
}

impl Pictures {
    /// Draws them, beside another unit or a learned residual on the same recording if one is given.
    pub fn draw(replayed: &Replayed, beside: Option<Beside<'_>>, sensors: &Sensors) -> Self {
        let curves = Curves::new(replayed, beside);
        let window_s = replayed.recording.duration_s() > LONG_S;
        let close_up = window_s.then(|| curves.liveliest_s());
        let pilot = curves.has(Signal::PilotValvePosition) || curves.has(Signal::ControlPressure);
        Self {
            whole: svg(&curves.positions(sensors, None)),
            close_up: close_up.map(|window_s| svg(&curves.positions(sensors, Some(window_s)))),
            worst: curves.worst_s().map(|window_s| svg(&curves.positions(sensors, Some(window_s)))),
            pilot: pilot.then(|| svg(&curves.pilot(sensors, close_up))),
            broken: Vec::new(),
        }
    }

    /// The same with the stretches in which these limits are broken.
    #[must_use]
    pub fn with_broken(mut self, judged: &Replayed, broken: &[&Check], sensors: &Sensors) -> Self {
        let curves = Curves::new(judged, None);
        let mut stretches: Vec<([f64; 2], bool, Vec<String>)> = Vec::new();
        for check in broken {
            let Some(at) = check.stretch else { continue };
            let (window_s, is_pilot) = ([at.from_s, at.to_s], !Signal::POSITIONS.contains(&check.signal));
            match stretches.iter_mut().find(|(known_s, pilot, _)| *known_s == window_s && *pilot == is_pilot) {
                Some((.., limits)) => limits.push(check.to_string()),
                None => stretches.push((window_s, is_pilot, vec![check.to_string()])),
            }
        }
        for (window_s, is_pilot, limits) in stretches {
            let around = Some([(window_s[0] - 0.5).max(0.0), window_s[1] + 0.5]);
            let picture = if is_pilot { curves.pilot(sensors, around) } else { curves.positions(sensors, around) };
            self.broken.push((svg(&picture), limits));
        }
        self
    }
}

/// The stretch of two seconds in which a signal is farthest off, s from the start; the whole recording where it is not much longer.
pub fn worst_stretch_of(replayed: &Replayed, signal: Signal) -> Option<[f64; 2]> {
    let curves = Curves::new(replayed, None);
    let squares = curves.squares(signal);
    let whole = || Some([*curves.time_s.first()?, *curves.time_s.last()?]);
    worst_stretch(&curves.time_s, &squares, WORST_S).or_else(whole)
}

/// One recording as curves over seconds from its start.
struct Curves<'a> {
    replayed: &'a Replayed,
    beside: Option<Beside<'a>>,
    time_s: Vec<f64>,
}

impl<'a> Curves<'a> {
    fn new(replayed: &'a Replayed, beside: Option<Beside<'a>>) -> Self {
        let frames = &replayed.recording.frames;
        let start_ns = frames.first().map_or(0, |frame| frame.time_ns);
        let time_s = frames.iter().map(|frame| seconds_from_nanos(frame.time_ns - start_ns)).collect();
        Self { replayed, beside, time_s }
    }

    fn has(&self, signal: Signal) -> bool {
        self.replayed.recording.frames.iter().any(|frame| signal.of(&frame.measured).is_finite())
    }

    fn measured(&self, signal: Signal, scale: f64) -> Vec<[f64; 2]> {
        let frames = self.replayed.recording.frames.iter().map(|frame| signal.of(&frame.measured) * scale);
        self.time_s.iter().zip(frames).filter(|(_, y)| y.is_finite()).map(|(&t, y)| [t, y]).collect()
    }

    fn simulated(&self, replayed: &Replayed, signal: Signal, scale: f64) -> Vec<[f64; 2]> {
        let estimates = replayed.estimates.iter().map(|estimate| signal.of(&estimate.signals) * scale);
        self.time_s.iter().zip(estimates).map(|(&t, y)| [t, y]).collect()
    }

    fn difference(&self, replayed: &Replayed, signal: Signal, scale: f64) -> Vec<[f64; 2]> {
        let pairs = self.replayed.recording.frames.iter().zip(&replayed.estimates);
        let difference = pairs.map(|(f, e)| (signal.of(&e.signals) - signal.of(&f.measured)) * scale);
        self.time_s.iter().zip(difference).filter(|(_, y)| y.is_finite()).map(|(&t, y)| [t, y]).collect()
    }

    /// The command as the regulator sees it, %, held from row to row.
    fn command(&self) -> Vec<[f64; 2]> {
        let mut points: Vec<[f64; 2]> = Vec::new();
        for (&time_s, frame) in self.time_s.iter().zip(&self.replayed.recording.frames) {
            let value = 100.0 * frame.inputs.opening_command_pu;
            match points.last() {
                Some(&[_, last]) if last.to_bits() == value.to_bits() => {}
                Some(&[_, last]) => points.extend([[time_s, last], [time_s, value]]),
                None => points.push([time_s, value]),
            }
        }
        let last = points.last().map_or(f64::NAN, |point| point[1]);
        points.extend(self.time_s.last().map(|&end_s| [end_s, last]));
        points
    }

    /// The stretch of [`CLOSE_UP_S`] around an ESV trip, else that in which the servomotor travels
    /// farthest, a little rest before it.
    fn liveliest_s(&self) -> [f64; 2] {
        let end_s = self.time_s.last().copied().unwrap_or(0.0);
        let around = |begins_s: f64| {
            let from_s = (begins_s - 0.2 * CLOSE_UP_S).min(end_s - CLOSE_UP_S).max(0.0);
            [from_s, from_s + CLOSE_UP_S]
        };
        let tripped = self.replayed.recording.frames.iter().position(|frame| frame.inputs.esv == EsvState::Shutdown);
        if let Some(trip) = tripped.filter(|&trip| trip > 0) {
            return around(self.time_s[trip]);
        }
        let position = if self.has(Signal::ServomotorPosition) {
            self.measured(Signal::ServomotorPosition, 1.0)
        } else {
            self.simulated(self.replayed, Signal::ServomotorPosition, 1.0)
        };
        let within = |from_s: f64, to_s: f64| {
            let (start, end) =
                (position.partition_point(|p| p[0] < from_s), position.partition_point(|p| p[0] <= to_s));
            &position[start..end]
        };
        let travel = |points: &[[f64; 2]]| {
            let (low, high) =
                points.iter().fold((f64::MAX, f64::MIN), |(low, high), p| (low.min(p[1]), high.max(p[1])));
            high - low
        };
        let (mut best_s, mut best_pu) = (0.0, 0.0);
        let mut from_s = 0.0;
        while from_s < end_s {
            let travel_pu = travel(within(from_s, from_s + 0.8 * CLOSE_UP_S));
            if travel_pu > 1.02 * best_pu {
                (best_s, best_pu) = (from_s, travel_pu);
            }
            from_s += 1.0;
        }
        let stretch = within(best_s, end_s);
        let moves = |p: &&[f64; 2]| (p[1] - stretch[0][1]).abs() > 0.03 * best_pu;
        let begins_s = stretch.iter().find(moves).map_or(best_s, |p| p[0]);
        around(begins_s)
    }

    /// Squared error of a signal row by row; 0 where it was not measured.
    fn squares(&self, signal: Signal) -> Vec<f64> {
        let pairs = self.replayed.recording.frames.iter().zip(&self.replayed.estimates);
        let squares = pairs.map(|(frame, twin)| (signal.of(&twin.signals) - signal.of(&frame.measured)).powi(2));
        squares.map(|square| if square.is_finite() { square } else { 0.0 }).collect()
    }

    /// The stretch of [`WORST_S`] in which the positions are farthest off, each over its error in the whole recording.
    fn worst_s(&self) -> Option<[f64; 2]> {
        let mut squares = vec![0.0; self.time_s.len()];
        for signal in Signal::POSITIONS {
            let off = self.squares(signal);
            let all: f64 = off.iter().sum();
            if all > 0.0 {
                squares.iter_mut().zip(off).for_each(|(sum, square)| *sum += square / all);
            }
        }
        worst_stretch(&self.time_s, &squares, WORST_S)
    }

    fn compared(&self, signal: Signal, title: &str, scale: f64) -> Panel {
        let panel = if self.has(signal) {
            Panel::new(title).thick_line("measured", self.measured(signal, scale))
        } else {
            Panel::new(title)
        };
        let own = self.simulated(self.replayed, signal, scale);
        let Some((replayed, [before, after])) = self.beside(signal) else {
            return panel.line(Ink::Simulated, "simulated", own).x_name("time from the start, s");
        };
        let line = self.simulated(replayed, signal, scale);
        let (panel, after) = match self.beside {
            Some(Beside::Unit { title, .. }) => (panel, format!("{after}: {title}")),
            Some(Beside::Residual { half_width, coverage_share: Some(share), .. }) => {
                let widths = half_width.iter().map(|width| width * scale);
                let band = line.iter().zip(widths).map(|(&[t, y], width)| [t, y - width, y + width]).collect();
                (panel.band(Ink::Band, &format!("{:.0} % band", 100.0 * share), band), after.to_owned())
            }
            _ => (panel, after.to_owned()),
        };
        panel
            .dashed_line(Ink::Difference, before, own)
            .line(Ink::Simulated, &after, line)
            .x_name("time from the start, s")
    }

    /// What stands beside the twin in a signal, with what twin and other are called; none where it is the twin's own.
    fn beside(&self, signal: Signal) -> Option<(&'a Replayed, [&'static str; 2])> {
        match self.beside? {
            Beside::Unit { replayed, .. } => Some((replayed, ["before", "after"])),
            Beside::Residual { signal: corrected, replayed, .. } => {
                (corrected == signal).then_some((replayed, ["twin alone", "with the residual"]))
            }
        }
    }

    fn missed(&self, signal: Signal, unit: &str, scale: f64, sensors: &Sensors) -> Panel {
        let noise = 2.0 * spread(signal.sensor(sensors)) * scale;
        let end_s = self.time_s.last().copied().unwrap_or(0.0);
        let panel = Panel::new(format!("Simulated − measured, {unit}"))
            .height(84)
            .band(Ink::Band, "±2σ of the transducer", vec![[0.0, -noise, noise], [end_s, -noise, noise]])
            .x_name("time from the start, s");
        let own = self.difference(self.replayed, signal, scale);
        match self.beside(signal) {
            None => panel.line(Ink::Difference, "difference", own),
            Some((replayed, [before, after])) => panel.dashed_line(Ink::Difference, before, own).line(
                Ink::Simulated,
                after,
                self.difference(replayed, signal, scale),
            ),
        }
    }

    fn positions(&self, sensors: &Sensors, window_s: Option<[f64; 2]>) -> Picture {
        let servomotor = self.compared(Signal::ServomotorPosition, "Guide-vane opening, % of stroke", 100.0);
        let servomotor = Panel {
            marks: [Panel::new("").line(Ink::Command, "command", self.command()).marks, servomotor.marks].concat(),
            ..servomotor
        };
        let spool = |title: &str| self.compared(Signal::SpoolPosition, title, 100.0);
        // The spool's rest positions show in the whole, or in the long stretch that represents it.
        let is_whole = window_s.is_none_or(|[from_s, to_s]| to_s - from_s > WORST_S);
        let mut panels = vec![servomotor.height(180)];
        if self.has(Signal::ServomotorPosition) {
            panels.push(self.missed(Signal::ServomotorPosition, "% of stroke", 100.0, sensors));
        }
        panels.push(spool("Spool position, % of reference stroke").height(150));
        if is_whole {
            let range = 100.0 * NEAR_NEUTRAL_PU;
            panels.push(spool("Spool near neutral, % of reference stroke").height(110).y_range(-range, range));
        }
        if self.has(Signal::SpoolPosition) {
            panels.push(self.missed(Signal::SpoolPosition, "% of reference stroke", 100.0, sensors));
        }
        self.stacked("positions", panels, window_s)
    }

    fn pilot(&self, sensors: &Sensors, window_s: Option<[f64; 2]>) -> Picture {
        let mut panels = vec![];
        for (signal, unit, scale) in
            [(Signal::PilotValvePosition, "% of stroke", 100.0), (Signal::ControlPressure, "MPa", 1e-6)]
        {
            if self.has(signal) {
                panels.push(self.compared(signal, &format!("{}, {unit}", signal.title()), scale).height(130));
                panels.push(self.missed(signal, unit, scale, sensors));
            }
        }
        self.stacked("pilot signals", panels, window_s)
    }

    fn stacked(&self, what: &str, panels: Vec<Panel>, window_s: Option<[f64; 2]>) -> Picture {
        let Recording { name, process, .. } = &self.replayed.recording;
        let panels = match window_s {
            Some([from_s, to_s]) => panels.into_iter().map(|panel| panel.x_range(from_s, to_s)).collect(),
            None => panels,
        };
        let description = format!("Recording {name}, {}: measured and simulated {what} over time", process.title());
        let mut picture = Picture::stacked(description, panels);
        let inside = |x: f64| window_s.is_none_or(|[from_s, to_s]| x >= from_s && x <= to_s);
        let mut tripped_s = None;
        for (i, frame) in self.replayed.recording.frames.iter().enumerate() {
            let (now_s, esv) = (self.time_s[i], frame.inputs.esv);
            match (tripped_s, esv) {
                (None, EsvState::Shutdown) => {
                    tripped_s = Some(now_s);
                    picture.events.push(EventLine { x: now_s, label: "ESV trips".into(), ink: Ink::Alarm });
                }
                (Some(from_s), EsvState::Normal) => {
                    tripped_s = None;
                    picture.spans.push(Span { x: [from_s, now_s], ink: Ink::Alarm });
                    picture.events.push(EventLine { x: now_s, label: "ESV normal".into(), ink: Ink::Good });
                }
                _ => {}
            }
        }
        if let (Some(from_s), Some(&end_s)) = (tripped_s, self.time_s.last()) {
            picture.spans.push(Span { x: [from_s, end_s], ink: Ink::Alarm });
        }
        picture.events.retain(|event| inside(event.x));
        picture
    }
}

/// Standard deviation of noise and quantisation together, in the sensor's unit.
pub(crate) fn spread(sensor: Sensor) -> f64 {
    (sensor.noise.powi(2) + sensor.step.powi(2) / 12.0).sqrt()
}
