//! One stream on its way into rows: its samples that wait, and the one in force.

use std::collections::VecDeque;

use super::DOUBTFUL_NS;
use crate::StreamHealth;
use crate::collect::Collector;
use crate::evidence::StreamEvidence;
use crate::grid::Irregular;
use crate::order;
use crate::pace::Pace;
use crate::streams::{Sample, Value, note};
use govtwin_model::units::NANOS_PER_SECOND;

/// A sample may be so late behind the newest of its own stream; one that is later shows a clock that was set back.
const LATE_NS: i64 = order::SET_BACK_NS;

/// A silent stream is waited for as long as its messages have taken at most, and so much longer.
const LAG_NS: i64 = 10 * NANOS_PER_SECOND;

/// One stream on its way into rows.
#[derive(Debug)]
pub(super) struct Track<V> {
    /// Samples that no row holds yet, strictly rising in stamp.
    pub(super) waiting: VecDeque<Sample<V>>,
    /// The sample in force.
    pub(super) current: Option<Sample<V>>,
    /// Stamp and log time.
    pub(super) newest: Option<(i64, i64)>,
    most_delay_ns: i64,
    /// It has no topic in the bag.
    pub(super) absent: bool,
    pace: Pace,
    kept: u64,
    conflict: Option<(i64, String)>,
}

impl<V: Value> Track<V> {
    pub(super) fn new(absent: bool) -> Self {
        Self {
            waiting: VecDeque::new(),
            current: None,
            newest: None,
            most_delay_ns: i64::MIN,
            absent,
            pace: Pace::default(),
            kept: 0,
            conflict: None,
        }
    }

    /// All samples of a collector, in order.
    pub(super) fn of(collector: &mut Collector<V>) -> Self {
        let waiting = VecDeque::from(std::mem::take(&mut collector.samples));
        Self { absent: waiting.is_empty(), waiting, ..Self::new(false) }
    }

    /// Takes the sample that a collector has just decoded.
    pub(super) fn qualify(&mut self, collector: &mut Collector<V>, done_ns: i64) -> Result<(), Irregular> {
        let Some(sample) = collector.samples.pop() else { return Ok(()) };
        if sample.stamp_ns == 0 || self.absent {
            return Err(Irregular);
        }
        let delay_ns = sample.log_time_ns.saturating_sub(sample.stamp_ns);
        let mut place = self.waiting.len();
        if let Some((stamp_ns, log_time_ns)) = self.newest {
            let step_ns = sample.stamp_ns.saturating_sub(stamp_ns);
            let log_step_ns = sample.log_time_ns.saturating_sub(log_time_ns);
            let parted_ns = step_ns.saturating_sub(log_step_ns).saturating_abs();
            if log_step_ns < 0 || step_ns < -LATE_NS || parted_ns > DOUBTFUL_NS {
                return Err(Irregular);
            }
            if step_ns < 0 {
                collector.health.late += 1;
            }
            if step_ns <= 0 {
                place = self.waiting.partition_point(|other| other.stamp_ns < sample.stamp_ns);
            }
        }
        if sample.stamp_ns <= done_ns {
            return Err(Irregular);
        }
        self.newest = Some((self.newest.map_or(i64::MIN, |newest| newest.0).max(sample.stamp_ns), sample.log_time_ns));
        self.most_delay_ns = self.most_delay_ns.max(delay_ns);
        match self.waiting.get_mut(place).filter(|other| other.stamp_ns == sample.stamp_ns) {
            Some(other) if sample.value.same(other.value) => collector.health.duplicates += 1,
            Some(other) => {
                collector.health.conflicts += 1;
                self.conflict.get_or_insert_with(|| (sample.log_time_ns, order::second_value(sample.stamp_ns)));
                *other = sample;
            }
            None => self.waiting.insert(place, sample),
        }
        Ok(())
    }

    /// The stamp up to which no sample will come any more, at this time of recording.
    pub(super) fn final_ns(&self, log_time_ns: i64) -> i64 {
        let Some((newest_ns, _)) = self.newest else { return if self.absent { i64::MAX } else { i64::MIN } };
        let by_delay_ns = log_time_ns.saturating_sub(self.most_delay_ns.max(0)).saturating_sub(LAG_NS);
        by_delay_ns.max(newest_ns.saturating_sub(LATE_NS + 1))
    }

    pub(super) fn is_settled(&self) -> bool {
        self.absent || self.current.is_some()
    }

    pub(super) fn next_ns(&self) -> Option<i64> {
        self.waiting.front().map(|sample| sample.stamp_ns)
    }

    /// Brings the sample of this stamp into force, where there is one.
    pub(super) fn advance(&mut self, time_ns: i64, evidence: &mut StreamEvidence) -> bool {
        if self.next_ns() != Some(time_ns) {
            return false;
        }
        let Some(sample) = self.waiting.pop_front() else { return false };
        self.kept += 1;
        self.pace.push(sample.stamp_ns);
        evidence.sample(sample.stamp_ns, sample.log_time_ns, sample.value.number());
        self.current = Some(sample);
        true
    }

    pub(super) fn finish(self, health: &mut StreamHealth) {
        health.kept = self.kept;
        health.pace = self.pace.finish();
        if let Some((log_time_ns, fault)) = self.conflict {
            note(health, log_time_ns, &fault);
        }
    }
}
