//! Whether a size that is estimated again and again has moved: a self-starting cumulative sum, with a stated rate of false alarms.
//!
//! Of each estimate x_i with standard deviation s_i the distance r_i = (x_i − m) / s_i from the weighted mean m of all estimates of its group so
//! far, itself among them. Where nothing moves every order of these estimates is as probable as any other, whatever distribution they have, so that
//! the rank of the newest distance among all of them is uniform, and independent of the ranks before it (Parent 1965; McDonald 1990, "A CUSUM
//! procedure based on sequential ranks", *Naval Research Logistics* 37(5):627). The rank R of i distances becomes the normal score
//! z_i = Φ⁻¹((R − ½) / i), over the root mean square of the scores of all i ranks (Conover, Tercero-Gómez & Cordero-Franco 2017, "The sequential normal scores transformation", *Sequential Analysis*
//! 36(3):397). Tails, skew and sizes that end at a bound change nothing in it, nor do intervals that are too narrow or too wide; the intervals decide
//! which estimates the mean follows, and by how much a distance counts. The sums run over all groups in the order of time:
//!
//! ```text
//! S⁺ = max(0, S⁺ + z − k),   S⁻ = max(0, S⁻ − z − k),   k = ½
//! ```
//!
//! and raise an alarm at h, which follows from the number of estimates between two false alarms that is wanted (Siegmund 1985, *Sequential Analysis*,
//! section 2.6): one side lasts (e^{2k(h + 1.166)} − 2k(h + 1.166) − 1) / (2k²) estimates on average, both sides half as long. Growth that is slow
//! against the distance of the estimates drags the mean along and is seen later than a jump.
//!
//! Scores of few estimates are small: the first of a group counts nothing, and one outlier alone raises no alarm, however large.
//!
//! Groups are for estimates that differ although nothing moves, such as those of different kinds of process: each group has its own mean and ranks,
//! and the sums, which see standard normal numbers alone, combine all of them.

use statrs::distribution::{ContinuousCDF, Normal};

/// Shift that is not counted, standard deviations: half of the smallest shift that is to be seen soon.
const ALLOWANCE: f64 = 0.5;
/// What a sum goes beyond its limit on average (Siegmund's correction), standard deviations.
const BEYOND: f64 = 1.166;
/// Half-width of an interval of nine in ten, standard deviations, to the digits of the limits that it is compared with.
pub(crate) const NORMAL_90_EXACT: f64 = 1.644_853_6;

/// One estimate of a size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeEstimate {
    /// The size, in its own unit.
    pub size: f64,
    /// Lower end of its interval of nine in ten, in its own unit.
    pub low: f64,
    /// Upper end, in its own unit.
    pub high: f64,
    /// Which estimates it is compared with: those of the same group, such as a kind of process.
    pub group: usize,
}

/// The chart after an estimate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChartPoint {
    /// Rank of its distance from the group's mean among all of the group, as a standard normal number; 0 of the group's first.
    pub z: f64,
    /// Sums after it.
    pub sums: Sums,
    /// Mean of the group's estimates before it, in the size's own unit; of its first the size itself.
    pub mean: f64,
    /// Whether a sum is at its limit or beyond.
    pub alarm: bool,
    /// Index of the estimate with which the movement began, where there is an alarm.
    pub since: Option<usize>,
}

/// The mean of estimates so far, weighted by their variances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Level {
    /// The mean, in the size's own unit.
    pub mean: f64,
    /// Reciprocal of its variance; 0 of none.
    weight: f64,
}

impl Level {
    /// How far an estimate lies from the mean, over what both are known by; none of the first.
    pub fn residual(&self, size: f64, sd: f64) -> Option<f64> {
        (self.weight > 0.0).then(|| (size - self.mean) / (sd * sd + 1.0 / self.weight).sqrt())
    }

    /// Takes an estimate in.
    pub fn take(&mut self, size: f64, sd: f64) {
        let own = 1.0 / (sd * sd);
        self.weight += own;
        self.mean += (size - self.mean) * own / self.weight;
    }
}

/// Cumulative sums of standard normal numbers, standard deviations.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sums {
    /// For growth.
    pub growth: f64,
    /// For shrinkage.
    pub shrinkage: f64,
}

impl Sums {
    /// Takes a number in.
    pub fn take(&mut self, z: f64) {
        self.growth = (self.growth + z - ALLOWANCE).max(0.0);
        self.shrinkage = (self.shrinkage - z - ALLOWANCE).max(0.0);
    }

    /// The larger of both.
    pub fn largest(&self) -> f64 {
        self.growth.max(self.shrinkage)
    }

    /// Whether it is rather growth.
    pub(crate) fn is_growth(&self) -> bool {
        self.growth >= self.shrinkage
    }
}

/// Estimates until both sums together first give a false alarm at this limit, on average.
pub(crate) fn run_length(limit: f64) -> f64 {
    let exponent = 2.0 * ALLOWANCE * (limit + BEYOND);
    0.5 * (exponent.exp() - exponent - 1.0) / (2.0 * ALLOWANCE * ALLOWANCE)
}

/// The limit of both sums for so many estimates between two false alarms.
pub fn limit(between_false_alarms: f64) -> f64 {
    let (mut low, mut high) = (0.0, 60.0);
    for _ in 0..80 {
        let middle = 0.5 * (low + high);
        if run_length(middle) < between_false_alarms { low = middle } else { high = middle }
    }
    high
}

/// What is known of a group: its estimates where nothing had moved yet.
#[derive(Clone, Debug, Default)]
struct Group {
    level: Level,
    /// Sizes with their standard deviations.
    estimates: Vec<(f64, f64)>,
}

impl Group {
    /// The normal score of a further estimate.
    fn score(&self, size: f64, sd: f64) -> f64 {
        let mut level = self.level;
        level.take(size, sd);
        let own = (size - level.mean) / sd;
        let (mut below, mut equal) = (0_u32, 0_u32);
        for (size, sd) in &self.estimates {
            let other = (size - level.mean) / sd;
            below += u32::from(other < own);
            equal += u32::from(other.total_cmp(&own).is_eq());
        }
        // Of equal ones the middle rank: where all are equal nothing moves.
        let count = u32::try_from(self.estimates.len()).unwrap_or(u32::MAX - 1) + 1;
        score(f64::from(below) + 0.5 * f64::from(equal) + 1.0, count)
    }

    fn take(&mut self, size: f64, sd: f64) {
        self.level.take(size, sd);
        self.estimates.push((size, sd));
    }
}

/// The normal score of a rank, counted from 1, among so many, over the root mean square of the scores of all of them.
fn score(rank: f64, count: u32) -> f64 {
    let Ok(normal) = Normal::new(0.0, 1.0) else { return 0.0 };
    let of = |rank: f64| normal.inverse_cdf((rank - 0.5) / f64::from(count));
    // Those above the middle are those below it again.
    let squares = 2.0 * (1..=count / 2).map(|rank| of(f64::from(rank)).powi(2)).sum::<f64>();
    if squares > 0.0 { of(rank) * (f64::from(count) / squares).sqrt() } else { 0.0 }
}

/// The chart of estimates in their order, with so many of them between two false alarms where nothing moves.
pub fn chart(estimates: &[SizeEstimate], between_false_alarms: f64) -> Vec<ChartPoint> {
    let limit = limit(between_false_alarms);
    let mut groups: Vec<Group> = vec![];
    let mut sums = Sums::default();
    let (mut growth_since, mut shrinkage_since) = (None, None);
    let mut points: Vec<ChartPoint> = Vec::with_capacity(estimates.len());
    for (i, one) in estimates.iter().enumerate() {
        if one.group >= groups.len() {
            groups.resize(one.group + 1, Group::default());
        }
        let group = &mut groups[one.group];
        let sd = ((one.high - one.low) / (2.0 * NORMAL_90_EXACT)).max(1e-6 * one.size.abs()).max(1e-15);
        let moved = points.last().is_some_and(|point| point.alarm);
        let mean = if group.estimates.is_empty() { one.size } else { group.level.mean };
        let z = group.score(one.size, sd);
        sums.take(z);
        growth_since = growth_since.or(Some(i)).filter(|_| sums.growth > 0.0);
        shrinkage_since = shrinkage_since.or(Some(i)).filter(|_| sums.shrinkage > 0.0);
        // Estimates after the change are no part of the reference.
        if !moved {
            group.take(one.size, sd);
        }
        let alarm = sums.largest() >= limit;
        let since = if sums.is_growth() { growth_since } else { shrinkage_since };
        points.push(ChartPoint { z, sums, mean, alarm, since: since.filter(|_| alarm) });
    }
    points
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution as _, Normal};

    use super::{ChartPoint, SizeEstimate, chart, limit};

    /// Estimates of a size that moves as given, with intervals that are `stated` times as wide as they should be.
    fn estimates(seed: u64, count: usize, stated: f64, size: impl Fn(usize) -> f64) -> Vec<SizeEstimate> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let of = |i: usize| {
            let sd = 0.05 * rng.random_range(0.5..2.0);
            let size = size(i) + sd * normal.sample(&mut rng);
            let half = 1.645 * sd * stated;
            SizeEstimate { size, low: size - half, high: size + half, group: 0 }
        };
        (0..count).map(of).collect()
    }

    fn first_alarm(points: &[ChartPoint]) -> Option<usize> {
        points.iter().position(|point| point.alarm)
    }

    #[test]
    fn limits_are_those_of_tables() {
        // h = 4 and 5 at k = ½: 168 and 465 estimates (Montgomery, Introduction to Statistical Quality Control, table 9.3).
        assert!((limit(168.0) - 4.0).abs() < 0.03, "{}", limit(168.0));
        assert!((limit(465.0) - 5.0).abs() < 0.03, "{}", limit(465.0));
    }

    #[test]
    fn false_alarms_are_as_rare_as_stated_whatever_the_intervals_claim() {
        for stated in [0.3, 1.0, 3.0] {
            let (runs, length) = (400, 100);
            let alarms = (0..runs)
                .filter(|&seed| first_alarm(&chart(&estimates(seed, length, stated, |_| 1.0), 200.0)).is_some());
            // A chart that lasts 200 estimates on average ends within 100 in 1 − e^(−1/2) = 39 % of runs, fewer as it starts at 0.
            let share = alarms.count() as f64 / runs as f64;
            assert!((0.27..0.47).contains(&share), "{stated}: {share}");
        }
    }

    #[test]
    fn false_alarms_do_not_depend_on_the_scatter() {
        let exponential = |seed: u64| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed);
            let of = |_| {
                // One in ten is ten times as far, and nothing lies below 1.
                let far = if rng.random_bool(0.1) { 10.0 } else { 1.0 };
                let size = 1.0 - far * rng.random_range(0.0_f64..1.0).max(1e-9).ln();
                SizeEstimate { size, low: size - 1.0, high: size + 1.0, group: 0 }
            };
            (0..100).map(of).collect::<Vec<_>>()
        };
        let alarms = (0..400).filter(|&seed| first_alarm(&chart(&exponential(seed), 200.0)).is_some()).count();
        let share = alarms as f64 / 400.0;
        assert!((0.27..0.47).contains(&share), "{share}");
    }

    #[test]
    fn a_size_that_jumps_or_grows_is_noticed_soon_and_dated() {
        let jump = chart(&estimates(1, 40, 1.0, |i| if i < 20 { 1.0 } else { 1.2 }), 1000.0);
        let seen = first_alarm(&jump).unwrap();
        assert!((20..28).contains(&seen), "{seen}");
        assert!(jump[seen].since.unwrap().abs_diff(20) <= 6 && jump[seen].sums.is_growth());
        // Once moved it stays so: the mean does not follow.
        assert!(jump[seen..].iter().all(|point| point.alarm) && (jump[39].mean - 1.0).abs() < 0.06);
        let growth = chart(&estimates(2, 60, 1.0, |i| 1.0 + 0.01 * (i as f64 - 20.0).max(0.0)), 1000.0);
        assert!((22..48).contains(&first_alarm(&growth).unwrap()));
        let shrinks = chart(&estimates(3, 40, 1.0, |i| if i < 20 { 1.0 } else { 0.8 }), 1000.0);
        let seen = first_alarm(&shrinks).unwrap();
        assert!(!shrinks[seen].sums.is_growth());
    }

    /// Estimates of a size whose four groups differ by more than their intervals, each with a scatter of its own.
    fn grouped(seed: u64, count: usize, size: impl Fn(usize) -> f64) -> Vec<SizeEstimate> {
        let of = |(i, one): (usize, SizeEstimate)| {
            let group = i % 4;
            let moved = |value: f64| size(i) + 0.3 * group as f64 + (1.0 + group as f64) * (value - size(i));
            SizeEstimate { size: moved(one.size), low: moved(one.low), high: moved(one.high), group }
        };
        estimates(seed, count, 1.0, &size).into_iter().enumerate().map(of).collect()
    }

    #[test]
    fn groups_that_differ_keep_the_rate_and_growth_in_all_of_them_adds_up() {
        let alarms =
            (0..400).filter(|&seed| first_alarm(&chart(&grouped(seed, 100, |_| 1.0), 200.0)).is_some()).count();
        // Each group's first estimates count little, which makes it fewer than the 39 % of a chart that lasts 200 on average.
        let share = alarms as f64 / 400.0;
        assert!((0.22..0.44).contains(&share), "{share}");
        // A step of one deviation or two, by group, is seen within a few estimates of all groups together, not of each.
        let estimates = grouped(5, 80, |i| if i < 40 { 1.0 } else { 1.2 });
        let jump = chart(&estimates, 1000.0);
        let seen = first_alarm(&jump).unwrap();
        assert!((40..56).contains(&seen) && jump[seen].sums.is_growth(), "{seen}");
        // Were they one group, what they differ by would count as scatter, and hide it longer.
        let mixed: Vec<SizeEstimate> = estimates.iter().map(|one| SizeEstimate { group: 0, ..*one }).collect();
        assert!(first_alarm(&chart(&mixed, 1000.0)).is_none_or(|late| late > seen));
    }

    #[test]
    fn few_or_equal_estimates_raise_nothing() {
        assert!(chart(&[], 100.0).is_empty());
        let same = vec![SizeEstimate { size: 0.0, low: 0.0, high: 0.0, group: 0 }; 30];
        assert!(chart(&same, 100.0).iter().all(|point| !point.alarm));
        let wild = [1.0, 1.01, 0.99, 1.0, 50.0].map(|size| SizeEstimate {
            size,
            low: size - 0.01,
            high: size + 0.01,
            group: 0,
        });
        assert!(first_alarm(&chart(&wild, 1000.0)).is_none(), "one wild estimate alone");
    }
}
