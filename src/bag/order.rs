//! Samples into the order of their stamps: clock jumps found, late ones put in place, repeated ones dropped.

use super::StreamHealth;
use super::streams::{Sample, Value, note};
use govtwin_model::units::NANOS_PER_SECOND;

/// A stamp this far behind its predecessor is a clock set back; less is a late sample.
pub(super) const SET_BACK_NS: i64 = NANOS_PER_SECOND;

/// A stamp that runs this far ahead of the time of recording is a clock set forward; less may be a
/// recording that was played fast.
pub(super) const SET_FORWARD_NS: i64 = 600 * NANOS_PER_SECOND;

/// Clocks of several streams that jump within this time of recording jump together.
const TOGETHER_NS: i64 = 2 * NANOS_PER_SECOND;

/// Clocks that were never set show times before this, ns.
const YEAR_2000_NS: i64 = 946_684_800 * NANOS_PER_SECOND;

/// A jump of the clock that stamps one stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Jump {
    /// The first sample after it.
    index: usize,
    log_time_ns: i64,
    pub(super) topic: String,
    pub(super) from_ns: i64,
    pub(super) to_ns: i64,
    /// Stamps and log times advanced alike: a pause, unless a clock that was never set shows a time before 2000.
    pub(super) pause: bool,
}

/// A time in which no stream of the bag got a sample, by the log times: a pause, or the recorder's own clock set forward.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Silence {
    begin_ns: i64,
    end_ns: i64,
}

/// The silences between the log times of all streams.
pub(super) fn silences(mut log_times_ns: Vec<i64>) -> Vec<Silence> {
    log_times_ns.sort_unstable();
    let pairs = log_times_ns.windows(2).map(|pair| Silence { begin_ns: pair[0], end_ns: pair[1] });
    pairs.filter(|silence| silence.length_ns() > TOGETHER_NS).collect()
}

impl Silence {
    fn length_ns(self) -> i64 {
        self.end_ns.saturating_sub(self.begin_ns)
    }
}

/// The longest silence between a sample and those that arrive after it, each silence looked at once.
struct Between<'a> {
    later: &'a [Silence],
    longest: Option<Silence>,
}

impl<'a> Between<'a> {
    fn after<V>(silences: &'a [Silence], sample: &Sample<V>) -> Self {
        let first = silences.partition_point(|silence| silence.begin_ns < sample.log_time_ns);
        Self { later: silences.get(first..).unwrap_or_default(), longest: None }
    }

    /// The longest up to a sample, which must not arrive before the one last asked for. That an ESV says nothing while others speak
    /// is none.
    fn until<V>(&mut self, sample: &Sample<V>) -> Option<Silence> {
        while let Some((next, later)) = self.later.split_first().filter(|(next, _)| next.end_ns <= sample.log_time_ns) {
            self.longest = self.longest.into_iter().chain([*next]).max_by_key(|silence| silence.length_ns());
            self.later = later;
        }
        self.longest
    }
}

/// Whether the clock of the stamps jumps; a silence counts as no time of recording.
fn jumps<V>(before: &Sample<V>, after: &Sample<V>, silence: Option<Silence>) -> bool {
    let stamp_step_ns = after.stamp_ns.saturating_sub(before.stamp_ns);
    let log_step_ns = after.log_time_ns.saturating_sub(before.log_time_ns);
    let heard_ns = log_step_ns.saturating_sub(silence.map_or(0, Silence::length_ns));
    stamp_step_ns < -SET_BACK_NS || stamp_step_ns.saturating_sub(heard_ns) > SET_FORWARD_NS
}

/// Whether stamps and log times went on alike, between times that are none of a clock that was never set.
fn is_pause<V>(before: &Sample<V>, after: &Sample<V>) -> bool {
    let stamp_step_ns = after.stamp_ns.saturating_sub(before.stamp_ns);
    let log_step_ns = after.log_time_ns.saturating_sub(before.log_time_ns);
    let alike = stamp_step_ns.saturating_sub(log_step_ns).saturating_abs() <= TOGETHER_NS;
    let unset = |stamp_ns: i64| stamp_ns < YEAR_2000_NS;
    alike && unset(before.stamp_ns) == unset(after.stamp_ns)
}

/// Whether a stamp other than 0 lies so near to it that 0, too, would be a time.
pub(super) fn is_near_zero<V>(samples: &[Sample<V>]) -> bool {
    samples.iter().any(|sample| sample.stamp_ns != 0 && sample.stamp_ns.saturating_abs() < SET_FORWARD_NS)
}

/// Gives samples of a sender without a clock, which leaves the stamp at 0, the time of recording; the live node does alike.
pub(super) fn date_by_log<V>(samples: &mut [Sample<V>], health: &mut StreamHealth) {
    for sample in samples.iter_mut().filter(|sample| sample.stamp_ns == 0) {
        sample.stamp_ns = sample.log_time_ns;
        health.unstamped += 1;
    }
}

/// Moves the stamps of a stream onto the recorder's clock: a message that nothing held up was recorded when it was stamped. Stamps of a sender without
/// a clock, 0 or standing still, are the time of recording.
pub(super) fn align_by_log<V>(samples: &mut [Sample<V>]) {
    let stands = samples.windows(2).all(|pair| pair[0].stamp_ns == pair[1].stamp_ns);
    let near_zero = is_near_zero(samples);
    let is_set = |sample: &Sample<V>| !stands && (sample.stamp_ns != 0 || near_zero);
    let delay_ns = |sample: &Sample<V>| sample.log_time_ns.saturating_sub(sample.stamp_ns);
    let least_ns = samples.iter().filter(|sample| is_set(sample)).map(delay_ns).min().unwrap_or_default();
    for sample in samples {
        sample.stamp_ns = if is_set(sample) { sample.stamp_ns.saturating_add(least_ns) } else { sample.log_time_ns };
    }
}

/// A state that is sent when it changes holds from its first sample on, which may be stamped long before: it was handed to the recorder when that began,
/// or is all that was recorded before a silence.
pub(super) fn hold_first<V>(samples: &mut [Sample<V>], silences: &[Silence]) {
    let [first, next, ..] = samples else { return };
    let delay_ns = |sample: &Sample<V>| sample.log_time_ns.saturating_sub(sample.stamp_ns);
    let late_ns = delay_ns(first).saturating_sub(delay_ns(next));
    let parts = |silence: &&Silence| silence.begin_ns == first.log_time_ns && jumps(first, next, Some(**silence));
    let silence = silences.first().filter(parts);
    if late_ns > SET_FORWARD_NS {
        first.stamp_ns = first.stamp_ns.saturating_add(late_ns);
    } else if let Some(silence) = silence {
        let moved_ns = |time_ns: i64| time_ns.saturating_add(silence.length_ns());
        (first.stamp_ns, first.log_time_ns) = (moved_ns(first.stamp_ns), moved_ns(first.log_time_ns));
    }
}

/// Drops single samples whose stamp jumps away while the next one is back: a bad stamp, no new clock.
pub(super) fn drop_strays<V: Value>(samples: &mut Vec<Sample<V>>, health: &mut StreamHealth) {
    let jumps = |before: &Sample<V>, after: &Sample<V>| jumps(before, after, None);
    let mut kept: Vec<Sample<V>> = Vec::with_capacity(samples.len());
    for (index, sample) in samples.iter().enumerate() {
        let stray = match (kept.last(), samples.get(index + 1)) {
            (Some(before), Some(after)) => (jumps(before, sample) || jumps(sample, after)) && !jumps(before, after),
            (Some(before), None) => jumps(before, sample),
            (None, Some(after)) => {
                jumps(sample, after) && !samples.get(index + 2).is_some_and(|next| jumps(after, next))
            }
            (None, None) => false,
        };
        if stray {
            health.bad_stamps += 1;
            let fault = format!("stamp {} ns is far from its neighbours", sample.stamp_ns);
            note(health, sample.log_time_ns, &fault);
        } else {
            kept.push(*sample);
        }
    }
    *samples = kept;
}

/// Finds the jumps of a stream whose samples come in the order of arrival.
pub(super) fn jumps_of<V>(samples: &[Sample<V>], silences: &[Silence], topic: &str) -> Vec<Jump> {
    let mut found = vec![];
    let mut newest: Option<(&Sample<V>, Between<'_>)> = None;
    for (index, sample) in samples.iter().enumerate() {
        let silence = newest.as_mut().and_then(|(_, between)| between.until(sample));
        let begin = || Some((sample, Between::after(silences, sample)));
        match newest.as_ref().map(|(before, _)| *before) {
            Some(before) if jumps(before, sample, silence) => {
                // After a silence all streams begin together, however late the first sample of one comes.
                found.push(Jump {
                    index,
                    log_time_ns: silence.map_or(sample.log_time_ns, |silence| silence.end_ns),
                    topic: topic.to_owned(),
                    from_ns: before.stamp_ns,
                    to_ns: sample.stamp_ns,
                    pause: is_pause(before, sample),
                });
                newest = begin();
            }
            // A late sample is no measure for its successor.
            Some(before) if sample.stamp_ns < before.stamp_ns => {}
            _ => newest = begin(),
        }
    }
    found
}

/// The jumps of all streams by time of recording, those of one moment as one: its first.
pub(super) fn together(mut jumps: Vec<Jump>) -> Vec<Jump> {
    jumps.sort_by_key(|jump| jump.log_time_ns);
    jumps.dedup_by(|later, first| later.log_time_ns.saturating_sub(first.log_time_ns) <= TOGETHER_NS);
    jumps
}

/// The run of each sample: how many of the common jumps lie before it.
///
/// A stream's own jump decides where it has one at that moment, the time of recording where it has none.
pub(super) fn runs<V>(samples: &[Sample<V>], own: &[Jump], common: &[Jump]) -> Vec<usize> {
    let mut own = own.iter().peekable();
    let mut run = 0;
    let mut runs = Vec::with_capacity(samples.len());
    for (index, sample) in samples.iter().enumerate() {
        while let Some(jump) = common.get(run) {
            while own.next_if(|mine| mine.log_time_ns < jump.log_time_ns).is_some() {}
            let mine = own.peek().filter(|mine| mine.log_time_ns.saturating_sub(jump.log_time_ns) <= TOGETHER_NS);
            let passed = match mine {
                Some(mine) => index >= mine.index,
                None => sample.log_time_ns >= jump.log_time_ns,
            };
            if !passed {
                break;
            }
            run += 1;
        }
        runs.push(run);
    }
    runs
}

/// Keeps the samples of one run; counts the others.
pub(super) fn keep_run<V: Value>(samples: &mut Vec<Sample<V>>, runs: &[usize], run: usize, health: &mut StreamHealth) {
    let all = samples.len();
    let mut runs = runs.iter();
    samples.retain(|_| runs.next().is_some_and(|mine| *mine == run));
    health.other_run = (all - samples.len()) as u64;
}

/// The finding on two samples with one stamp.
pub(super) fn second_value(stamp_ns: i64) -> String {
    format!("a second value for stamp {stamp_ns} ns; the later one stays")
}

/// Sorts samples by stamp and leaves one for each stamp.
///
/// `samples` come in the order of arrival. Of samples with one stamp the last to arrive stays.
pub(super) fn by_stamp<V: Value>(samples: &mut Vec<Sample<V>>, health: &mut StreamHealth) {
    let mut newest_ns = i64::MIN;
    for sample in samples.iter() {
        if sample.stamp_ns < newest_ns {
            health.late += 1;
        }
        newest_ns = newest_ns.max(sample.stamp_ns);
    }
    // Stable: arrival order stays within one stamp.
    samples.sort_by_key(|sample| sample.stamp_ns);
    samples.dedup_by(|later, kept| {
        let doubled = later.stamp_ns == kept.stamp_ns;
        if doubled && later.value.same(kept.value) {
            health.duplicates += 1;
        } else if doubled {
            health.conflicts += 1;
            note(health, later.log_time_ns, &second_value(later.stamp_ns));
            *kept = *later;
        }
        doubled
    });
}
