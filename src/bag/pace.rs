//! How evenly times follow each other: rate, jitter, gaps, steps backwards; in memory that does not grow with their number.

use std::collections::VecDeque;

use super::distribution::Distribution;
use super::topic_survey::PaceSurvey;
use govtwin_model::units::seconds_from_nanos;

/// An interval longer than this many medians is a gap.
const GAP_MEDIANS: i64 = 5;

/// A time may come so many places late and is still put in order; one that comes later makes no interval.
const REORDER: usize = 1024;

/// Times in the order of arrival.
#[derive(Clone, Debug, Default)]
pub(super) struct Pace {
    /// The latest times, in order.
    latest: VecDeque<i64>,
    first_ns: Option<i64>,
    newest_ns: Option<i64>,
    /// The last time that went into an interval.
    previous_ns: Option<i64>,
    backwards: u64,
    intervals: Distribution,
    /// The longest interval and its beginning, ns.
    longest: Option<(i64, i64)>,
}

impl Pace {
    pub(super) fn push(&mut self, time_ns: i64) {
        if self.newest_ns.is_some_and(|newest_ns| time_ns < newest_ns) {
            self.backwards += 1;
            let place = self.latest.partition_point(|other_ns| *other_ns <= time_ns);
            self.latest.insert(place, time_ns);
        } else {
            self.newest_ns = Some(time_ns);
            self.latest.push_back(time_ns);
        }
        self.first_ns = Some(self.first_ns.map_or(time_ns, |first_ns| first_ns.min(time_ns)));
        if self.latest.len() > REORDER {
            self.pass();
        }
    }

    /// Takes the earliest time out of the order.
    fn pass(&mut self) {
        let Some(time_ns) = self.latest.pop_front() else { return };
        if let Some(previous_ns) = self.previous_ns {
            if time_ns < previous_ns {
                return;
            }
            let interval_ns = time_ns.saturating_sub(previous_ns);
            self.intervals.push(interval_ns);
            if self.longest.is_none_or(|(longest_ns, _)| interval_ns >= longest_ns) {
                self.longest = Some((interval_ns, previous_ns));
            }
        }
        self.previous_ns = Some(time_ns);
    }

    pub(super) fn finish(mut self) -> PaceSurvey {
        while !self.latest.is_empty() {
            self.pass();
        }
        let (Some(first_ns), Some(last_ns)) = (self.first_ns, self.newest_ns) else { return PaceSurvey::default() };
        let start = PaceSurvey { first_ns, last_ns, backwards: self.backwards, ..PaceSurvey::default() };
        let Some((longest_ns, longest_gap_at_ns)) = self.longest else { return start };
        let mut intervals = self.intervals;
        let median_ns = intervals.median();
        let gap_ns = median_ns.saturating_mul(GAP_MEDIANS);
        PaceSurvey {
            rate_hz: if median_ns > 0 { 1.0 / seconds_from_nanos(median_ns) } else { 0.0 },
            jitter_s: seconds_from_nanos(intervals.distance_at(median_ns, 99)),
            gaps: intervals.count_where(|interval_ns| interval_ns > gap_ns),
            longest_gap_s: seconds_from_nanos(longest_ns),
            longest_gap_at_ns,
            repeated: intervals.count_where(|interval_ns| interval_ns == 0),
            ..start
        }
    }
}
