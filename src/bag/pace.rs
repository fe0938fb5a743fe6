//! How evenly times follow each other: rate, jitter, gaps, steps backwards.

use super::survey::PaceSurvey;
use crate::units::seconds_from_nanos;

/// An interval longer than this many medians is a gap.
const GAP_MEDIANS: i64 = 5;

/// Times in the order of arrival.
#[derive(Clone, Debug, Default)]
pub(super) struct Pace {
    times_ns: Vec<i64>,
    newest_ns: Option<i64>,
    backwards: u64,
}

impl Pace {
    pub(super) fn push(&mut self, time_ns: i64) {
        if self.newest_ns.is_some_and(|newest_ns| time_ns < newest_ns) {
            self.backwards += 1;
        }
        self.newest_ns = self.newest_ns.max(Some(time_ns));
        self.times_ns.push(time_ns);
    }

    pub(super) fn finish(mut self) -> PaceSurvey {
        self.times_ns.sort_unstable();
        let (Some(&first_ns), Some(&last_ns)) = (self.times_ns.first(), self.times_ns.last()) else {
            return PaceSurvey::default();
        };
        let start = PaceSurvey { first_ns, last_ns, backwards: self.backwards, ..PaceSurvey::default() };
        let intervals = self.times_ns.windows(2).map(|pair| (pair[1].saturating_sub(pair[0]), pair[0]));
        let Some((longest_ns, longest_gap_at_ns)) = intervals.clone().max_by_key(|(interval_ns, _)| *interval_ns)
        else {
            return start;
        };
        let mut intervals_ns: Vec<i64> = intervals.map(|(interval_ns, _)| interval_ns).collect();
        intervals_ns.sort_unstable();
        let median_ns = intervals_ns[intervals_ns.len() / 2];
        let gaps = intervals_ns.iter().rev().take_while(|ns| **ns > median_ns.saturating_mul(GAP_MEDIANS)).count();
        let repeated = intervals_ns.iter().take_while(|ns| **ns == 0).count();
        for interval_ns in &mut intervals_ns {
            *interval_ns = (*interval_ns - median_ns).abs();
        }
        intervals_ns.sort_unstable();
        let jitter_ns = intervals_ns[(intervals_ns.len() - 1) * 99 / 100];
        PaceSurvey {
            rate_hz: if median_ns > 0 { 1.0 / seconds_from_nanos(median_ns) } else { 0.0 },
            jitter_s: seconds_from_nanos(jitter_ns),
            gaps: gaps as u64,
            longest_gap_s: seconds_from_nanos(longest_ns),
            longest_gap_at_ns,
            repeated: repeated as u64,
            ..start
        }
    }
}
