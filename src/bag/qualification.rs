//! Data qualification: the one place that decides which data is disqualified, warned of, or only noted.
//!
//! Limits are physical where a governor's hydraulics set them, and statistical where they do not; each has its reason beside it. They were
//! set beforehand, from data sheets, standards and clocks, and not from recordings. The limitation of a statistical limit is stated beside it.
//!
//! | severity | what is found |
//! |---|---|
//! | disqualified | signals that cannot be of one machine and its time (`chain.rs`), streams of clocks more than a second apart, values out of every physical range, a tank pressure of zero, stamps that are no time or far from their neighbours, a required servo state without one number |
//! | warning | several senders, stamps of another clock, held values, stamps ahead, clocks that drift apart, lost messages, outliers, frozen and saturated signals, a pressure of no oil supply, nothing measured, commands beyond the stroke, and everything in [`Warning`](super::Warning) |
//! | note | messages of another definition of their type, drift that all streams share, recordings that were played, signals that are absent or constant, small overshoot of a command, files without checksum or count |

use std::path::Path;

use super::chain::{ChainEvidence, Impossible};
use super::channel::Channel;
use super::evidence::{RowEvidence, Still, StreamEvidence};
use super::findings::{self, Found};
use super::{BagError, FileHealth, Finding, Kind, Severity, Stream, StreamHealth};
use govtwin_model::signal::Signal;

/// A physically possible range.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    what: &'static str,
    unit: &'static str,
    least: f64,
    most: f64,
}

/// A command outside this range asks for no guide-vane opening that exists, overshoot included.
pub(super) const COMMAND_LIMITS: Limits = Limits { what: "opening", unit: "pu", least: -0.5, most: 1.5 };
/// A command in an unknown unit.
pub(super) const ANY_COMMAND_LIMITS: Limits = Limits { what: "opening", ..ANY_LIMITS };
/// From vacuum to ten times the pressure of any governor's tank.
pub(super) const PRESSURE_LIMITS: Limits = Limits { what: "pressure", unit: "Pa", least: -1.1e5, most: 1.0e8 };
/// Forces on a piston; the largest servomotors have some 10 MN.
pub(super) const FORCE_LIMITS: Limits = Limits { what: "force", unit: "N", least: -1.0e8, most: 1.0e8 };
/// Positions in pu; a transducer may overshoot its span, not multiply it.
pub(super) const POSITION_LIMITS: Limits = Limits { what: "position", unit: "pu", least: -10.0, most: 10.0 };
/// Positions in an unknown unit.
pub(super) const ANY_LIMITS: Limits = Limits { what: "position", unit: "in any unit", least: -1.0e12, most: 1.0e12 };

/// Guide-vane commands in percent lie here.
const PERCENT: std::ops::RangeInclusive<f64> = 2.0..=105.0;

/// Pressures of a governor's oil supply, Pa: from the oldest open-type governors to piston accumulators.
pub const TANK_PA: std::ops::RangeInclusive<f64> = 5.0e5..=5.0e7;
/// Units in which a pressure may have been written, Pa.
pub(crate) const PRESSURES_PA: [(&str, f64); 5] =
    [("bar", 1e5), ("MPa", 1e6), ("kPa", 1e3), ("psi", 6_894.757), ("Pa", 1.0)];
/// A pressure of the kind that such a supply has most often, Pa.
const USUAL_PA: std::ops::RangeInclusive<f64> = 1.5e6..=2.5e7;

/// The unit in which a number is a usual tank pressure.
pub fn unit_of_pressure(number: f64) -> Option<&'static str> {
    PRESSURES_PA.iter().find(|(_, in_pa)| USUAL_PA.contains(&(number * in_pa))).map(|(name, _)| *name)
}

/// A tank at no more than this has no pressure at all, Pa: no transducer's noise is that small, so that nothing is connected to it, or
/// the message was not filled in.
const NO_PRESSURE_PA: f64 = 0.5;

impl Limits {
    /// The value, or what disqualifies it.
    pub(super) fn check(self, value: f64) -> Result<f64, String> {
        let Self { what, unit, least, most } = self;
        if (least..=most).contains(&value) {
            return Ok(value);
        }
        let hint = if unit == "pu" && PERCENT.contains(&value) { "; was it sent in percent?" } else { "" };
        Err(format!("{what} is {value} {unit}, expected {least} to {most} {unit}{hint}"))
    }

    /// NaN means "not available" and passes.
    pub(super) fn check_signal(self, value: f64, faults: &mut Vec<String>) -> f64 {
        if value.is_nan() {
            return value;
        }
        self.check(value).unwrap_or_else(|fault| {
            faults.push(fault);
            f64::NAN
        })
    }
}

/// A tank pressure, or what disqualifies it.
pub(super) fn check_tank_pressure(pressure_pa: f64) -> Result<f64, String> {
    if pressure_pa.abs() < NO_PRESSURE_PA {
        return Err("pressure is 0 Pa, which moves nothing; expected that of the tank, or no such topic".into());
    }
    PRESSURE_LIMITS.check(pressure_pa)
}

/// An outlier is so many times as far from the middle of its neighbours as half of all samples are: some 16 standard deviations of
/// Gaussian noise, which 10^50 samples do not reach. A spike smaller than that, or of more than one sample, is not found.
const OUTLIER_MEDIANS: f64 = 20.0;

/// Two senders' stamps may wander, a `frame_id` may change when a sender starts anew; it does not change back and forth.
const SWITCHES: u64 = 3;

/// A sender that starts anew counts from the beginning; it does so once or twice, not in this share of its messages.
const COUNTED_BACK: f64 = 0.01;

/// Of one sender's messages few share a stamp; where this share does, with other values, two senders have one clock.
const CONFLICTS: f64 = 0.1;

/// Of one sender's values few come and go faster than any plant moves; where this share does, and so many at least, they are of two courses.
const LONE_SHARE: f64 = 0.02;
const LONE: u64 = 8;

/// Signs in the values of a channel that they are of two senders.
pub(crate) fn two_courses(channel: &Channel) -> Option<String> {
    if channel.alternating as f64 > LONE_SHARE * channel.count as f64 {
        return Some(format!("{} values alternate between two courses", channel.alternating));
    }
    jumps_away(channel)
}

/// Values that are too fast for any servo system, again and again.
pub(crate) fn jumps_away(channel: &Channel) -> Option<String> {
    let lone = channel.lone();
    let many = lone >= LONE && lone as f64 > LONE_SHARE * channel.count as f64;
    many.then(|| format!("{lone} values jump away and back, faster than any servo system moves"))
}

/// Streams that are shifted against each other by this much, s, are not of one instant: a servomotor at full speed moves 1 % of its
/// stroke in 20 ms. Clocks of quartz differ by up to 1 part in 10,000, so that a minute does not show it and an hour does.
const DRIFT_S: f64 = 0.01;

/// A drift is believed where the least delays are this many times nearer to its line than it is long.
const DRIFT_SCATTERS: f64 = 5.0;

/// No clock is wrong by more than this share: a bag was played at another speed.
const PLAYED: f64 = 0.01;

/// A servo system follows a command that moves by 5 % of the stroke, far beyond the dead band of any governor (IEC 61362 asks for less
/// than 0.1 %).
const MOVED_PU: f64 = 0.05;

/// As long as this it may take to begin, s, and as many equal samples may be chance where a transducer has coarse steps.
const FROZEN_S: f64 = 2.0;
const FROZEN_SAMPLES: u64 = 20;

/// Samples at one end of the range, at least, and their share, where hardly another sample repeats the one before it, and how often the
/// signal comes there: noise is cut off. A signal without noise rests at one end, comes there once or twice, and is not accused.
const SATURATED: u64 = 10;
const SATURATED_SHARE: f64 = 0.01;
const REPEATS_SHARE: f64 = 0.05;
const SATURATED_VISITS: u64 = 3;

/// A stop is this near to the end of a stroke, pu: a position that is cut off there may be one that the plant itself ends.
const STOP_PU: f64 = 0.005;

/// Least delays that differ by more are of two clocks, s: on its way to the recorder a message that nothing holds up takes milliseconds.
const CLOCKS_S: f64 = 0.1;
/// And by more than this no row can be right.
pub(super) const OTHER_CLOCK_S: f64 = 1.0;

/// Governors press the servomotor into its stops by some per cent of the stroke.
const PRESSED_PU: f64 = 0.05;
/// Rounding is no overshoot, pu.
const ROUNDED_PU: f64 = 0.001;

/// Fewer numbers than this are no evidence of their kind.
const FEW: u64 = 20;

/// Streams whose stamps lie behind (above 0) or ahead of those of the middle clock: topic, that of the other, and by how much, s. Of two streams the
/// earlier clock counts as right.
fn apart<'a>(streams: impl Iterator<Item = (&'a str, &'a StreamEvidence)>) -> Vec<(&'a str, &'a str, f64)> {
    let many = streams.filter(|(_, evidence)| evidence.samples >= FEW);
    let mut delays: Vec<(&str, f64)> =
        many.filter_map(|(topic, evidence)| Some((topic, evidence.clock.least_delay_s()?))).collect();
    delays.sort_by(|a, b| a.1.total_cmp(&b.1));
    let Some(middle) = delays.get(delays.len().saturating_sub(1) / 2).copied() else { return vec![] };
    let others = delays.iter().map(|(topic, delay_s)| (*topic, middle.0, delay_s - middle.1));
    others.filter(|(_, _, by_s)| by_s.abs() > CLOCKS_S).collect()
}

/// Refuses a bag whose streams are stamped by clocks that have nothing to do with each other.
///
/// # Errors
/// Where stamps of streams that were recorded together differ by more than a second, or command and measured state have no time in common.
pub(super) fn check_clocks(
    path: &Path,
    healths: &[StreamHealth],
    evidence: &[StreamEvidence; 4],
) -> Result<(), BagError> {
    let streams = || healths.iter().zip(evidence).map(|(health, evidence)| (&*health.topic, evidence));
    let far = apart(streams()).into_iter().find(|(_, _, by_s)| by_s.abs() > OTHER_CLOCK_S);
    let far = far.map(|(topic, other, by_s)| format!("{topic}: {}", findings::other_clock(other, by_s)));
    let span_ns = |evidence: &StreamEvidence| evidence.clock.span_ns().filter(|_| evidence.samples >= FEW);
    let later = || {
        let ((command, commands), (measured, state)) = (streams().next()?, streams().next_back()?);
        let (commands_ns, measured_ns) = (span_ns(commands)?, span_ns(state)?);
        let [from_ns, to_ns] = [0, 1].map(|end| measured_ns[end].saturating_sub(commands_ns[1 - end]));
        let by_ns = if from_ns > 0 { from_ns } else { to_ns.min(0) };
        (by_ns != 0).then(|| format!("{measured}: {}", findings::another_time(command, by_ns)))
    };
    let problem = far.or_else(later);
    problem.map_or(Ok(()), |problem| Err(BagError::Clocks { path: path.to_owned(), problem }))
}

/// The findings on the streams, in the order of [`Stream::ALL`]: by topic, evidence, and how many samples conflicted; whether commands are in pu.
pub(super) fn of_streams(streams: &mut [(&str, &mut StreamEvidence, u64)], in_pu: bool) -> Vec<Finding> {
    let mut found = vec![];
    for (topic, evidence, conflicts) in &mut *streams {
        let mut found = Found::new(topic, &mut found);
        senders(&mut found, evidence, *conflicts);
        let count = evidence.channel.count;
        if evidence.clock.ahead > 0 {
            found.warn(Kind::StampsAhead, findings::ahead(&evidence.clock));
        }
        if let Some(outliers) = evidence.channel.outliers(OUTLIER_MEDIANS).filter(|_| count >= FEW) {
            found.warn(Kind::Outliers, findings::outliers(outliers, count));
        }
    }
    // A clock that is ahead of the recorder's has been told of.
    let ahead = |topic: &str| streams.iter().any(|(name, evidence, _)| *name == topic && evidence.clock.ahead > 0);
    for (topic, other, by_s) in apart(streams.iter().map(|(topic, evidence, _)| (*topic, &**evidence))) {
        if by_s < 0.0 && ahead(topic) {
            continue;
        }
        Found::new(topic, &mut found).warn(Kind::OtherClock, findings::other_clock(other, by_s));
    }
    drift(streams, &mut found);
    for (stream, (topic, evidence, _)) in Stream::ALL.into_iter().zip(streams) {
        let channel = &evidence.channel;
        let mut found = Found::new(topic, &mut found);
        match stream {
            Stream::Command if in_pu => {
                let beyond = (-channel.least).max(channel.most - 1.0);
                let severity = if beyond > PRESSED_PU { Severity::Warning } else { Severity::Note };
                if beyond > ROUNDED_PU && channel.count > 0 {
                    found.add(severity, Kind::BeyondStroke, findings::beyond(channel));
                }
            }
            Stream::TankPressure if channel.count >= FEW => {
                if !TANK_PA.contains(&channel.most) {
                    found.warn(Kind::OtherUnit, findings::other_pressure(channel.most));
                }
                if channel.least == channel.most {
                    found.note(Kind::Constant, findings::constant(channel.least, "Pa"));
                }
            }
            _ => {}
        }
    }
    found
}

/// More than one sender on a topic, and messages that did not arrive.
fn senders(found: &mut Found<'_>, evidence: &StreamEvidence, conflicts: u64) {
    let messages = evidence.samples.max(FEW);
    let two_frames = evidence.frames.len() > 1 && evidence.switches >= SWITCHES;
    let goes_back = evidence.counted_back as f64 > COUNTED_BACK * messages as f64 && evidence.counted_back >= SWITCHES;
    let two_values = conflicts as f64 > CONFLICTS * messages as f64;
    let courses = two_courses(&evidence.channel);
    if two_frames || goes_back || two_values || courses.is_some() {
        let mut signs = vec![];
        if two_frames {
            signs.push(findings::frames(&evidence.frames, evidence.switches));
        }
        if goes_back {
            signs.push(format!("the messages' own count goes back {} times", evidence.counted_back));
        }
        if two_values {
            signs.push(format!("{conflicts} stamps have two values"));
        }
        signs.extend(courses);
        found.warn(Kind::SeveralSenders, findings::senders(&signs));
    } else if evidence.offered > 1 {
        found.note(Kind::SeveralSenders, findings::offered(evidence.offered));
    }
    if evidence.lost > 0 && !goes_back {
        found.warn(Kind::Lost, findings::lost(evidence.lost));
    }
}

/// Clocks that drift: from each other, or all of them from the recorder's.
fn drift(streams: &[(&str, &mut StreamEvidence, u64)], found: &mut Vec<Finding>) {
    let drifts = streams.iter().filter_map(|(topic, evidence, _)| {
        let drift = evidence.clock.drift()?;
        (drift.scatter_s * DRIFT_SCATTERS < drift.shift_s.abs().max(DRIFT_S)).then_some((*topic, drift))
    });
    let (played, drifts): (Vec<_>, Vec<_>) = drifts.partition(|(_, drift)| drift.rate_excess.abs() > PLAYED);
    for (topic, drift) in played {
        Found::new(topic, found).note(Kind::Played, findings::played(drift));
    }
    let by_shift = |a: &&(&str, _), b: &&(&str, _)| {
        let shift_s = |drift: &super::clock::Drift| drift.shift_s;
        shift_s(&a.1).total_cmp(&shift_s(&b.1))
    };
    let (Some(least), Some(most)) = (drifts.iter().min_by(by_shift), drifts.iter().max_by(by_shift)) else { return };
    if most.1.shift_s - least.1.shift_s > DRIFT_S {
        let words = findings::apart(least, most);
        Found::new(most.0, found).warn(Kind::ClockDrift, words);
    } else if most.1.shift_s.abs().max(least.1.shift_s.abs()) > DRIFT_S {
        Found::new(most.0, found).note(Kind::ClockDrift, findings::together(most.1));
    }
}

/// The findings on the servo state's topic, which has so many samples, and of its rows.
pub(super) fn of_rows(topic: &str, servo_state: &StreamEvidence, rows: &mut RowEvidence) -> Vec<Finding> {
    let mut found = vec![];
    if servo_state.samples > 0 && servo_state.channel.count == 0 {
        Found::new(topic, &mut found).warn(Kind::NothingMeasured, findings::nothing_measured(servo_state.samples));
    }
    if rows.signals.iter().all(|signal| signal.channel.count == 0) {
        return found;
    }
    let impossible: Vec<Impossible> = rows.chain.iter().flat_map(ChainEvidence::found).collect();
    // A servomotor that rests elsewhere is frozen too, which need not be said twice.
    let rests =
        impossible.iter().any(|one| matches!(one, Impossible::RestsElsewhere { .. } | Impossible::Scaled { .. }));
    for impossible in impossible {
        Found::new(topic, &mut found).add(impossible.severity(), Kind::Impossible, impossible.words());
    }
    for signal in &mut rows.signals {
        let mut found = Found::new(topic, &mut found).of(signal.signal);
        let unit = signal.signal.unit();
        let count = signal.channel.count;
        if count == 0 {
            found.note(Kind::NotMeasured, "is NaN throughout: not measured".into());
            continue;
        }
        if count < FEW {
            continue;
        }
        if let Some(outliers) = signal.channel.outliers(OUTLIER_MEDIANS) {
            found.warn(Kind::Outliers, findings::outliers(outliers, count));
        }
        if let Some(sign) = two_courses(&signal.channel) {
            found.warn(Kind::SeveralSenders, findings::senders(&[sign]));
        }
        let at_stop = |value: f64| unit == "pu" && [0.0, 1.0].iter().any(|stop| (value - stop).abs() < STOP_PU);
        let frozen = signal.frozen.filter(|frozen| {
            frozen.moved_pu > MOVED_PU && frozen.samples >= FROZEN_SAMPLES && frozen.duration_s() >= FROZEN_S
        });
        // A signal that is cut off stays at the end of its range more than once.
        let cut_off = |frozen: &Still| {
            let ends = [(0, signal.channel.least), (1, signal.channel.most)];
            let varies = signal.channel.least < signal.channel.most;
            varies
                && ends
                    .iter()
                    .any(|(end, value)| *value == frozen.value && signal.channel.at_ends[*end] > frozen.samples)
        };
        let stopped = |frozen: &Still| signal.signal == Signal::ServomotorPosition && at_stop(frozen.value);
        if let Some(frozen) = frozen.filter(|frozen| !cut_off(frozen) && !stopped(frozen)) {
            if rests && signal.signal == Signal::ServomotorPosition {
                continue;
            }
            found.warn(Kind::Frozen, findings::frozen(&frozen, unit));
        } else if signal.channel.least == signal.channel.most {
            found.note(Kind::Constant, findings::constant(signal.channel.least, unit));
        }
        for (end, value) in [(0, signal.channel.least), (1, signal.channel.most)] {
            let there = signal.channel.at_ends[end];
            let cut = there >= SATURATED
                && there as f64 > SATURATED_SHARE * count as f64
                && there < count
                && signal.channel.visits[end] >= SATURATED_VISITS
                && signal.channel.repeats_elsewhere(end) < REPEATS_SHARE;
            if cut {
                let severity = if at_stop(value) { Severity::Note } else { Severity::Warning };
                found.add(severity, Kind::Saturated, findings::saturated(there, count, value, unit));
            }
        }
    }
    found
}

/// A command of which a historian kept few points, as its files say.
pub(super) fn of_command(topic: &str, deviation_pu: f64) -> Vec<Finding> {
    let mut found = vec![];
    let mut there = Found::new(topic, &mut found);
    if deviation_pu == f64::INFINITY {
        there.add(Severity::Disqualified, Kind::Compressed, findings::COMPRESSED_UNSAID.to_owned());
    } else if deviation_pu > 0.0 {
        there.warn(Kind::Compressed, findings::compressed(deviation_pu));
    }
    found
}

/// The findings on the files beside damage, and of a bag whose metadata states how many messages it has.
pub(super) fn of_files(files: &[FileHealth], is_counted: bool) -> Vec<Finding> {
    let mut found = vec![];
    for file in files.iter().filter(|file| file.messages > 0) {
        let path = file.path.display().to_string();
        let mut found = Found::new(&path, &mut found);
        if file.unchecked_messages > 0 {
            found.note(Kind::NoChecksum, findings::unchecked(file));
        }
        if file.stated_messages.is_none() && !is_counted && file.finished {
            found.note(Kind::NoCount, findings::uncounted());
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::two_courses;
    use crate::channel::{Behaviour, Channel};

    /// A thousand values of a course, of which some alternate with another one.
    fn channel(alternating: std::ops::Range<i64>) -> Channel {
        let mut channel = Channel::new(Behaviour { worth: 0.01, fastest_per_s: 1.0 });
        for k in 0..1000 {
            let other = alternating.contains(&k) && k % 2 == 0;
            channel.push(k * 10_000_000, if other { 0.8 } else { 0.2 });
        }
        channel
    }

    #[test]
    fn a_controller_that_chatters_once_is_no_second_sender() {
        assert_eq!(two_courses(&channel(500..517)), None);
        assert!(two_courses(&channel(500..700)).is_some_and(|sign| sign.contains("alternate between two courses")));
    }
}
