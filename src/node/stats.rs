//! What the integration thread counts as it runs, and the report at its end; nothing here takes memory after start.

use std::fmt::Write;

use hdrhistogram::Histogram;
use serde::Serialize;

use super::policy::NodeInput;
use govtwin_correction::adapt::Adaptation;
use govtwin_correction::guard::GuardCounts;

/// Longest time that is told apart, ns; longer ones count as this.
const LONGEST_NS: u64 = 60_000_000_000;

/// Counts of the integration thread.
#[derive(Clone, Debug)]
pub struct Stats {
    lateness: Histogram<u64>,
    work: Histogram<u64>,
    ages: [Histogram<u64>; NodeInput::COUNT],
    /// Ticks done.
    pub ticks: u64,
    /// Ticks whose work ended after the next tick's deadline.
    pub overruns: u64,
    /// Ticks left out after a long stall; the twin stepped over them in one.
    pub skipped: u64,
    /// Results that found the way out full.
    pub lost_outputs: u64,
    /// Whether the fail-safe asked the node to end.
    pub ended_by_fail_safe: bool,
    /// Whether a caller asked the node to end.
    pub ended_by_caller: bool,
    /// What the guard and the adaptation of a learned residual did, at the end.
    pub residual: Option<(GuardCounts, Option<Adaptation>)>,
}

/// Percentiles of one quantity, us.
#[derive(Clone, Copy, Debug, Serialize, PartialEq)]
pub struct Percentiles {
    /// Median.
    pub p50_us: f64,
    /// 99 %.
    pub p99_us: f64,
    /// 99.9 %.
    pub p99_9_us: f64,
    /// Largest.
    pub max_us: f64,
}

/// The report of a run.
#[derive(Clone, Debug, Serialize, PartialEq)]
pub struct RunSummary {
    /// Ticks done.
    pub ticks: u64,
    /// Wake-up after the deadline.
    pub lateness: Percentiles,
    /// Time from wake-up to the tick's end.
    pub work: Percentiles,
    /// Age of the newest command at each tick.
    pub command_age: Percentiles,
    /// Age of the newest ESV state at each tick.
    pub esv_age: Percentiles,
    /// Age of the newest tank pressure at each tick.
    pub tank_pressure_age: Percentiles,
    /// Age of the newest load force at each tick.
    pub load_age: Percentiles,
    /// See [`Stats::overruns`].
    pub overruns: u64,
    /// See [`Stats::skipped`].
    pub skipped: u64,
    /// See [`Stats::lost_outputs`].
    pub lost_outputs: u64,
    /// Resident memory of the process, bytes.
    pub resident_bytes: u64,
    /// What the guard of a learned residual did.
    pub guard: Option<GuardCounts>,
    /// What its adaptation did.
    pub adaptation: Option<Adaptation>,
}

impl Default for Stats {
    fn default() -> Self {
        #[expect(
            clippy::expect_used,
            reason = "bounds and digits are constants within the library's limits; a test builds one"
        )]
        let histogram = || Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("constant bounds");
        Self {
            lateness: histogram(),
            work: histogram(),
            ages: NodeInput::ALL.map(|_| histogram()),
            ticks: 0,
            overruns: 0,
            skipped: 0,
            lost_outputs: 0,
            ended_by_fail_safe: false,
            ended_by_caller: false,
            residual: None,
        }
    }
}

impl Stats {
    /// Counts one wake-up: its deadline, when it came, when its work ended, and the period, ns.
    pub fn woke(&mut self, deadline_ns: i64, woke_ns: i64, done_ns: i64, period_ns: i64) {
        self.lateness.saturating_record(positive(woke_ns - deadline_ns));
        self.work.saturating_record(positive(done_ns - woke_ns));
        self.overruns += u64::from(done_ns - deadline_ns > period_ns);
    }

    /// Counts one tick with the ages of its inputs, ns; an input never heard has none.
    pub fn ticked(&mut self, ages_ns: &[Option<i64>; NodeInput::COUNT]) {
        self.ticks += 1;
        for (histogram, age_ns) in self.ages.iter_mut().zip(ages_ns) {
            if let Some(age_ns) = age_ns {
                histogram.saturating_record(positive(*age_ns));
            }
        }
    }

    /// Adds what was counted after the nodes began anew; of an adaptation, which began anew too, only that remains.
    pub(crate) fn add(&mut self, later: &Self) {
        self.lateness += &later.lateness;
        self.work += &later.work;
        for (ages, later) in self.ages.iter_mut().zip(&later.ages) {
            *ages += later;
        }
        self.ticks += later.ticks;
        self.overruns += later.overruns;
        self.skipped += later.skipped;
        self.lost_outputs += later.lost_outputs;
        self.ended_by_fail_safe |= later.ended_by_fail_safe;
        self.ended_by_caller |= later.ended_by_caller;
        self.residual = match (self.residual, later.residual) {
            (Some((mut guard, _)), Some((later, adaptation))) => {
                guard.add(&later);
                Some((guard, adaptation))
            }
            (before, later) => later.or(before),
        };
    }

    /// Largest lateness so far, us.
    pub(crate) fn worst_lateness_us(&self) -> f64 {
        micros(self.lateness.max())
    }

    /// The report.
    pub fn summary(&self, resident_bytes: u64) -> RunSummary {
        RunSummary {
            ticks: self.ticks,
            lateness: percentiles(&self.lateness),
            work: percentiles(&self.work),
            command_age: percentiles(&self.ages[0]),
            esv_age: percentiles(&self.ages[1]),
            tank_pressure_age: percentiles(&self.ages[2]),
            load_age: percentiles(&self.ages[3]),
            overruns: self.overruns,
            skipped: self.skipped,
            lost_outputs: self.lost_outputs,
            resident_bytes,
            guard: self.residual.map(|(guard, _)| guard),
            adaptation: self.residual.and_then(|(_, adaptation)| adaptation),
        }
    }
}

impl RunSummary {
    /// The report in words.
    pub fn text(&self) -> String {
        let mut text = format!(
            "{} ticks, {} overruns, {} skipped, {} results lost, {:.1} MiB resident\n",
            self.ticks,
            self.overruns,
            self.skipped,
            self.lost_outputs,
            self.resident_bytes as f64 / 1_048_576.0
        );
        // Writing to a `String` cannot fail.
        let _ = writeln!(text, "{:<22}{:>12}{:>12}{:>12}{:>12}", "us", "p50", "p99", "p99.9", "max");
        for (name, row) in [
            ("wake-up lateness", self.lateness),
            ("work per tick", self.work),
            ("age of command", self.command_age),
            ("age of ESV state", self.esv_age),
            ("age of tank pressure", self.tank_pressure_age),
            ("age of load force", self.load_age),
        ] {
            let _ = writeln!(
                text,
                "{name:<22}{:>12.1}{:>12.1}{:>12.1}{:>12.1}",
                row.p50_us, row.p99_us, row.p99_9_us, row.max_us
            );
        }
        if let Some(guard) = &self.guard {
            let _ = writeln!(
                text,
                "residual: {} rows, {} clamped, {} faded, {} shrunk, {} outside, {} bad",
                guard.rows, guard.clamped, guard.faded, guard.shrunk, guard.outside, guard.bad
            );
        }
        if let Some(adaptation) = &self.adaptation {
            let _ = writeln!(text, "adaptation: {}", adaptation.words());
        }
        text
    }
}

/// Percentiles of a histogram of nanoseconds; zeros where it is empty.
fn percentiles(histogram: &Histogram<u64>) -> Percentiles {
    let at = |quantile| if histogram.is_empty() { 0.0 } else { micros(histogram.value_at_quantile(quantile)) };
    Percentiles { p50_us: at(0.5), p99_us: at(0.99), p99_9_us: at(0.999), max_us: at(1.0) }
}

fn positive(value_ns: i64) -> u64 {
    u64::try_from(value_ns).unwrap_or(0)
}

fn micros(value_ns: u64) -> f64 {
    value_ns as f64 * 1e-3
}

#[cfg(test)]
mod tests {
    use super::{GuardCounts, Stats};

    #[test]
    fn percentiles_of_a_known_run() {
        let mut stats = Stats::default();
        for tick in 1..=1000_i64 {
            stats.woke(0, tick * 1000, tick * 1000 + 500, 1_000_000);
            stats.ticked(&[Some(2_000_000), None, None, None]);
        }
        let summary = stats.summary(0);
        assert!((summary.lateness.p50_us - 500.0).abs() < 1.0, "{summary:?}");
        assert!((summary.lateness.p99_us - 990.0).abs() < 2.0);
        assert!((summary.lateness.max_us - 1000.0).abs() < 2.0);
        assert!((summary.command_age.p99_9_us - 2000.0).abs() < 3.0);
        assert_eq!(summary.esv_age.max_us.to_bits(), 0.0_f64.to_bits());
        assert_eq!((summary.ticks, summary.overruns), (1000, 1));
    }

    #[test]
    fn counts_of_a_new_beginning_are_added() {
        let (mut whole, mut later) = (Stats::default(), Stats::default());
        let guard = |rows| (GuardCounts { rows, ..GuardCounts::default() }, None);
        for (stats, tick_ns, rows) in [(&mut whole, 1_000_000, 3), (&mut later, 3_000_000, 4)] {
            stats.woke(0, tick_ns, tick_ns, 1);
            stats.ticked(&[Some(tick_ns), None, None, None]);
            stats.residual = Some(guard(rows));
        }
        later.ended_by_fail_safe = true;
        whole.add(&later);
        let summary = whole.summary(0);
        assert_eq!((summary.ticks, summary.overruns, whole.ended_by_fail_safe), (2, 2, true));
        assert!((summary.lateness.max_us - 3000.0).abs() < 5.0 && (summary.command_age.p50_us - 1000.0).abs() < 2.0);
        assert_eq!(whole.residual, Some(guard(7)));
    }

    #[test]
    fn an_empty_run_reports_zeros() {
        let summary = Stats::default().summary(0);
        assert_eq!(summary.lateness.max_us.to_bits(), 0.0_f64.to_bits());
        assert!(summary.text().contains("0 ticks"));
    }
}
