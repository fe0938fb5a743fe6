//! Findings in words, with figures and units; what they follow from is decided in `qualification`.

use super::channel::{Channel, Outlier};
use super::clock::{Clock, Drift};
use super::evidence::Still;
use super::qualification::{TANK_PA, unit_of_pressure};
use super::topic::shown;
use super::{FileHealth, Finding, Kind, Severity};
use govtwin_model::signal::Signal;
use govtwin_model::units::seconds_from_nanos;

/// Findings on one topic or file.
pub(super) struct Found<'a> {
    subject: &'a str,
    signal: Option<&'static str>,
    all: &'a mut Vec<Finding>,
}

impl<'a> Found<'a> {
    pub(super) fn new(subject: &'a str, all: &'a mut Vec<Finding>) -> Self {
        Self { subject, signal: None, all }
    }

    /// The same on one signal of several.
    pub(super) fn of(self, signal: Signal) -> Self {
        Self { signal: Some(signal.id()), ..self }
    }

    pub(super) fn add(&mut self, severity: Severity, what: Kind, words: String) {
        let (subject, signal) = (self.subject.to_owned(), self.signal);
        self.all.push(Finding { what, severity, subject, signal, words });
    }

    pub(super) fn warn(&mut self, what: Kind, words: String) {
        self.add(Severity::Warning, what, words);
    }

    pub(super) fn note(&mut self, what: Kind, words: String) {
        self.add(Severity::Note, what, words);
    }
}

/// A bag without a measured state that holds a simulated one is one of a simulation.
pub(super) fn only_simulated(measured: &str, simulated: &str) -> Finding {
    Finding {
        what: Kind::NotMeasured,
        severity: Severity::Note,
        subject: measured.to_owned(),
        signal: None,
        words: format!("not in the bag: nothing was measured, {} was simulated", shown(simulated)),
    }
}

/// A command that a historian compressed, nobody knows how much.
pub(super) const COMPRESSED_UNSAID: &str = "a historian kept few points of the command, and nothing says how far it was from the lines between them; give \
     `deviation_percent` of `opening_command` in the map (the historian's deviations of compression and exception, in % of the stroke), or export what was \
     not compressed";

/// A command that a historian compressed.
pub(super) fn compressed(deviation_pu: f64) -> String {
    format!(
        "between the few points that a historian kept, the command may have been off by {:.2} % of the stroke; a fit and a diagnosis count that as \
         uncertainty, and measures of how the unit follows its command are not taken",
        deviation_pu * 100.0
    )
}

/// Messages of another definition of their type, which were read by the names of their fields.
pub(super) fn translated(topic: &str, difference: &str, count: u64) -> Finding {
    Finding {
        what: Kind::OtherDefinition,
        severity: Severity::Note,
        subject: topic.to_owned(),
        signal: None,
        words: format!(
            "{count} messages are of another version of the type ({}); they are read by the names of its fields",
            shown(difference)
        ),
    }
}

/// Streams whose clocks differ.
pub(super) fn other_clock(other: &str, by_s: f64) -> String {
    let side = if by_s > 0.0 { "behind" } else { "ahead of" };
    format!(
        "its stamps lie {:.3} s {side} those of {other}, while both were recorded at the same time: two clocks, or one of them late; \
         `--stamp log` aligns all topics by the time of recording",
        by_s.abs()
    )
}

/// A stream that begins so long after the end of another, ns; below 0 it ends so long before the begin.
pub(super) fn another_time(other: &str, by_ns: i64) -> String {
    let by_s = seconds_from_nanos(by_ns);
    let place = if by_ns > 0 {
        format!("begins {by_s:.3} s after the end")
    } else {
        format!("ends {:.3} s before the begin", -by_s)
    };
    format!(
        "it {place} of {other}, so that no row has both: they were not recorded together, or one clock is wrong; shift the stamps of one, or record \
         both at once"
    )
}

pub(super) fn senders(signs: &[String]) -> String {
    format!("more than one sender, by all signs: {}; record one, or name its topic with --topic", signs.join(", "))
}

pub(super) fn frames(frames: &[String], switches: u64) -> String {
    let names: Vec<String> = frames.iter().map(|frame| format!("`{}`", shown(&short(frame)))).collect();
    format!("frame_id changes {switches} times between {}", names.join(" and "))
}

pub(super) fn offered(count: usize) -> String {
    format!("the recorder saw {count} senders; the values show one")
}

pub(super) fn lost(count: u64) -> String {
    format!("{count} messages are missing by the sender's own count; their neighbours' values hold")
}

pub(super) fn ahead(clock: &Clock) -> String {
    let by_s = seconds_from_nanos(clock.most_ahead_ns);
    let count = clock.ahead;
    format!("{count} stamps lie after the time of recording, up to {by_s:.3} s: sender's and recorder's clocks differ")
}

pub(super) fn apart(least: &(&str, Drift), most: &(&str, Drift)) -> String {
    let apart_s = most.1.shift_s - least.1.shift_s;
    let ppm = (most.1.rate_excess - least.1.rate_excess) * 1e6;
    format!(
        "its clock and that of {} drift apart, by {apart_s:.3} s from begin to end ({ppm:.0} parts in a million); samples of one stamp \
         are not of one instant",
        least.0
    )
}

pub(super) fn together(drift: Drift) -> String {
    let (shift_s, ppm) = (drift.shift_s, drift.rate_excess * 1e6);
    format!(
        "the stamps' clock and the recorder's drift apart, by {shift_s:.3} s from begin to end ({ppm:.0} parts in a million); the \
         streams do not differ"
    )
}

pub(super) fn played(drift: Drift) -> String {
    let speed = 1.0 / (1.0 + drift.rate_excess);
    format!(
        "the stamps run {speed:.2} times as fast as the time of recording, as when a bag is played at another speed"
    )
}

pub(super) fn outliers((count, worst): (u64, Outlier), of: u64) -> String {
    let Outlier { time_ns, value, expected } = worst;
    format!(
        "{count} of {of} samples lie alone, far from both neighbours; the farthest is {} at {time_ns} ns, where {} was expected",
        number(value),
        number(expected)
    )
}

pub(super) fn beyond(channel: &Channel) -> String {
    format!("commands from {} to {} pu; the stroke is 0 to 1 pu", number(channel.least), number(channel.most))
}

pub(super) fn constant(value: f64, unit: &str) -> String {
    format!("is {} {unit} in every sample, to the last bit: a set value rather than a measurement?", number(value))
}

/// A tank pressure that no governor's oil supply has, Pa.
pub(crate) fn other_pressure(most_pa: f64) -> String {
    let meant = unit_of_pressure(most_pa).map(|name| format!("; was it sent in {name}?"));
    let [least, most] = [TANK_PA.start(), TANK_PA.end()];
    format!(
        "reaches {} Pa, expected {least:.1e} to {most:.1e} Pa of a governor's oil supply{}",
        number(most_pa),
        meant.unwrap_or_default()
    )
}

pub(super) fn nothing_measured(samples: u64) -> String {
    format!("nothing is measured: {samples} samples, and no number in any of the four signals")
}

pub(super) fn frozen(still: &Still, unit: &str) -> String {
    let Still { value, from_ns, samples, moved_pu, .. } = *still;
    let (duration_s, moved) = (still.duration_s(), moved_pu * 100.0);
    format!(
        "stays at {} {unit} to the last bit for {duration_s:.1} s from {from_ns} ns on ({samples} samples) while command or \
         servomotor move by {moved:.0} % of the stroke: frozen?",
        number(value)
    )
}

pub(super) fn saturated(there: u64, of: u64, value: f64, unit: &str) -> String {
    format!("{there} of {of} samples are {} {unit} exactly, the end of its range: cut off?", number(value))
}

pub(super) fn unchecked(file: &FileHealth) -> String {
    let (count, of) = (file.unchecked_messages, file.messages);
    format!("no checksum protects {count} of {of} messages: a value that was damaged cannot be told from a sound one")
}

pub(super) fn uncounted() -> String {
    "nothing states how many messages there should be: lost ones cannot be told".into()
}

impl Still {
    /// How long it is, s.
    pub(super) fn duration_s(&self) -> f64 {
        seconds_from_nanos(self.to_ns.saturating_sub(self.from_ns))
    }
}

/// A number with at most six digits.
fn number(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e7).contains(&size) {
        return format!("{value:.3e}");
    }
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.to_owned() }
}

/// The beginning of a name.
fn short(name: &str) -> String {
    name.chars().take(60).collect()
}
