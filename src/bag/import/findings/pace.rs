//! How evenly samples follow each other, in memory that does not grow with them.

use super::{GAP_S, REPEATED_SHARE};
use govtwin_model::units::seconds_from_nanos;

/// Bins of intervals to an octave, and octaves: up to 2^63 ns.
const TO_AN_OCTAVE: f64 = 16.0;
const BINS: usize = 63 * 16 + 1;
/// An interval longer than this many medians is a gap.
const GAP_MEDIANS: f64 = 5.0;

/// Intervals in bins of equal ratio.
#[derive(Clone, Debug)]
pub(super) struct IntervalBins {
    counts: Vec<u64>,
    sums_s: Vec<f64>,
    first_ns: Option<i64>,
    last_ns: i64,
    intervals: u64,
    repeated: u64,
    backwards: u64,
    longest_ns: i64,
    longest_at_ns: i64,
}

impl Default for IntervalBins {
    fn default() -> Self {
        Self {
            counts: vec![0; BINS],
            sums_s: vec![0.0; BINS],
            first_ns: None,
            last_ns: 0,
            intervals: 0,
            repeated: 0,
            backwards: 0,
            longest_ns: 0,
            longest_at_ns: 0,
        }
    }
}

impl IntervalBins {
    pub(super) fn push(&mut self, time_ns: i64) {
        if self.first_ns.is_none() {
            self.first_ns = Some(time_ns);
            self.last_ns = time_ns;
            return;
        }
        let interval_ns = time_ns.saturating_sub(self.last_ns);
        match interval_ns {
            0 => self.repeated += 1,
            ..0 => self.backwards += 1,
            _ => {
                let bin = bin(interval_ns);
                self.counts[bin] += 1;
                self.sums_s[bin] += seconds_from_nanos(interval_ns);
                self.intervals += 1;
                if interval_ns > self.longest_ns {
                    (self.longest_ns, self.longest_at_ns) = (interval_ns, self.last_ns);
                }
            }
        }
        // What follows a jump is measured from there: a jump counts once, however many samples follow it.
        self.last_ns = time_ns;
    }

    pub(super) fn first_ns(&self) -> i64 {
        self.first_ns.unwrap_or_default()
    }

    /// The mean of the bin in which the median lies, s; none without intervals.
    fn median_s(&self) -> Option<f64> {
        let mut passed = 0;
        let within = |(count, _): &(&u64, &f64)| {
            passed += **count;
            2 * passed >= self.intervals && **count > 0
        };
        let bins = self.counts.iter().zip(&self.sums_s);
        bins.into_iter().find(within).map(|(count, sum_s)| sum_s / *count as f64)
    }

    pub(super) fn rate_hz(&self) -> f64 {
        self.median_s().map_or(0.0, |median_s| 1.0 / median_s)
    }

    pub(super) fn longest_gap_s(&self) -> f64 {
        seconds_from_nanos(self.longest_ns)
    }

    /// What is to be said; of events a pause is no news.
    pub(super) fn warnings(&self, event: bool) -> Vec<String> {
        let mut found = vec![];
        let all = self.intervals + self.repeated + self.backwards;
        if self.backwards > 0 {
            found.push(format!(
                "time goes back {} times; a reader of the bag puts samples into the order of time",
                self.backwards
            ));
        }
        if self.repeated as f64 > REPEATED_SHARE * all as f64 {
            let runs = 1.0 + self.repeated as f64 / self.intervals.max(1) as f64;
            let way = if runs > 1.5 {
                format!(
                    "some {runs:.0} at each: has the export cut the fraction of the second? `time: {{repeated: spread}}` spreads them evenly"
                )
            } else {
                "here and there: has the export rounded the times? where rows are evenly spaced, `time: {rate_hz: …}` counts them instead"
                    .to_owned()
            };
            found.push(format!(
                "{} of {all} samples have the time of the one before, {way}; else the last of each counts",
                self.repeated
            ));
        }
        let Some(median_s) = self.median_s() else { return found };
        let gap_s = GAP_MEDIANS * median_s;
        let gaps: u64 = self
            .counts
            .iter()
            .zip(&self.sums_s)
            .filter(|(n, sum)| **n > 0 && **sum / **n as f64 > gap_s)
            .map(|(n, _)| n)
            .sum();
        if gaps > 0 && self.longest_gap_s() > GAP_S && !event {
            let after_s = seconds_from_nanos(self.longest_at_ns - self.first_ns());
            found.push(format!(
                "{gaps} gaps of more than {GAP_MEDIANS} intervals, the longest {:.3} s, {after_s:.1} s after its beginning; nothing is \
                 filled in",
                self.longest_gap_s()
            ));
        }
        found
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most 63 octaves")]
fn bin(interval_ns: i64) -> usize {
    ((interval_ns as f64).log2() * TO_AN_OCTAVE) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_is_the_median_and_gaps_are_counted() {
        let mut pace = IntervalBins::default();
        let mut time_ns = 0;
        for k in 0..1000 {
            time_ns += if k % 100 == 50 { 2_000_000_000 } else { 10_000_000 };
            pace.push(time_ns);
        }
        assert!((pace.rate_hz() - 100.0).abs() < 1e-9);
        let said = pace.warnings(false).join(" ");
        assert!(said.contains("10 gaps") && said.contains("the longest 2.000 s"), "{said}");
        assert!(pace.warnings(true).is_empty());
    }

    #[test]
    fn rounded_times_are_told_with_another_way_out() {
        let mut pace = IntervalBins::default();
        (0..1000).for_each(|k| pace.push((k * 7_753_100_i64 + 5_000_000).div_euclid(10_000_000) * 10_000_000));
        let said = pace.warnings(false).join(" ");
        assert!(said.contains("has the export rounded the times?") && said.contains("rate_hz"), "{said}");
    }

    #[test]
    fn whole_seconds_beside_faster_samples_are_told_with_the_way_out() {
        let mut pace = IntervalBins::default();
        (0..1000).for_each(|k| pace.push(k / 10 * 1_000_000_000));
        let said = pace.warnings(false).join(" ");
        assert!(
            said.contains("900 of 999") && said.contains("some 10 at each") && said.contains("repeated: spread"),
            "{said}"
        );
    }
}
