//! Distributions of many numbers in little memory: exact for few different ones, then in buckets that grow.

/// The most different values, or buckets, that are kept.
const MOST_BUCKETS: usize = 4096;

/// Values are sorted into the buckets so many at a time.
const TOGETHER: usize = 8192;

/// Bits behind the leading one that a bucket keeps at first where values no longer stand each for itself: 1 part in 16,384.
const FINEST_BITS: u32 = 14;

/// Values of one key.
#[derive(Clone, Copy, Debug)]
struct Bucket {
    key: i64,
    count: u64,
    sum_ns: i128,
}

/// Values in ns by size. Up to 4096 different ones are kept as they are; beyond, values within a bucket count as their mean.
#[derive(Clone, Debug, Default)]
pub(super) struct Distribution {
    /// In the order of their keys.
    buckets: Vec<Bucket>,
    /// Not in a bucket yet.
    waiting: Vec<i64>,
    /// Bits that a key keeps; `None` where each value has a bucket.
    bits: Option<u32>,
}

impl Distribution {
    /// Takes a value.
    pub(super) fn push(&mut self, value_ns: i64) {
        self.waiting.push(value_ns);
        if self.waiting.len() == TOGETHER {
            self.settle();
        }
    }

    /// Puts what waits into the buckets.
    fn settle(&mut self) {
        self.waiting.sort_unstable();
        for alike in self.waiting.chunk_by(|one, other| key(*one, self.bits) == key(*other, self.bits)) {
            let sum_ns = alike.iter().map(|value_ns| i128::from(*value_ns)).sum();
            self.buckets.push(Bucket { key: key(alike[0], self.bits), count: alike.len() as u64, sum_ns });
        }
        self.waiting.clear();
        // Two rising runs, which a stable sort merges.
        self.buckets.sort_by_key(|bucket| bucket.key);
        self.join();
        while self.buckets.len() > MOST_BUCKETS {
            self.bits = Some(self.bits.map_or(FINEST_BITS, |bits| bits.saturating_sub(1)));
            for bucket in &mut self.buckets {
                bucket.key = key(bucket.key, self.bits);
            }
            self.join();
        }
    }

    /// Makes one of the neighbours that have one key.
    fn join(&mut self) {
        self.buckets.dedup_by(|next, kept| {
            let alike = next.key == kept.key;
            if alike {
                (kept.count, kept.sum_ns) = (kept.count + next.count, kept.sum_ns + next.sum_ns);
            }
            alike
        });
    }

    /// The mean of each bucket, in rising order, and its count.
    fn means(&mut self) -> impl Iterator<Item = (i64, u64)> {
        self.settle();
        self.buckets.iter().map(|Bucket { count, sum_ns, .. }| {
            let mean_ns = sum_ns / i128::from(*count).max(1);
            (i64::try_from(mean_ns).unwrap_or(if mean_ns < 0 { i64::MIN } else { i64::MAX }), *count)
        })
    }

    /// How many values there are.
    pub(super) fn count(&mut self) -> u64 {
        self.count_where(|_| true)
    }

    /// The value of this rank, counted from 0 at the least; 0 where there is none.
    pub(super) fn at_rank(&mut self, rank: u64) -> i64 {
        at_rank(self.means(), rank)
    }

    /// The upper median; 0 where there is no value.
    pub(super) fn median(&mut self) -> i64 {
        let half = self.count() / 2;
        self.at_rank(half)
    }

    /// How many values a condition holds for.
    pub(super) fn count_where(&mut self, holds: impl Fn(i64) -> bool) -> u64 {
        self.means().filter(|(mean_ns, _)| holds(*mean_ns)).map(|(_, count)| count).sum()
    }

    /// The distance from a value that this share of the values keeps, in hundredths.
    pub(super) fn distance_at(&mut self, from_ns: i64, hundredths: u64) -> i64 {
        let distance_ns = |mean_ns: i64| mean_ns.saturating_sub(from_ns).saturating_abs();
        let mut distances: Vec<_> = self.means().map(|(mean_ns, count)| (distance_ns(mean_ns), count)).collect();
        distances.sort_unstable();
        at_rank(distances.into_iter(), self.count().saturating_sub(1) * hundredths / 100)
    }
}

/// The value of a rank among values that rise, each with its count.
fn at_rank(mut rising: impl Iterator<Item = (i64, u64)>, rank: u64) -> i64 {
    let mut before = 0;
    let found = rising.find(|(_, count)| {
        before += count;
        before > rank
    });
    found.map_or(0, |(value_ns, _)| value_ns)
}

/// The bucket of a value: its leading bits, and its sign.
fn key(value_ns: i64, bits: Option<u32>) -> i64 {
    let Some(bits) = bits else { return value_ns };
    let size = value_ns.unsigned_abs();
    let dropped = (64 - size.leading_zeros()).saturating_sub(bits + 1);
    let kept = i64::try_from(size >> dropped << dropped).unwrap_or(i64::MAX);
    if value_ns < 0 { -kept } else { kept }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_are_exact_and_many_are_near() {
        let mut few = Distribution::default();
        for value in [10, -5, 10, 30, 7] {
            few.push(value);
        }
        assert_eq!((few.count(), few.median(), few.at_rank(0), few.at_rank(4)), (5, 10, -5, 30));
        assert_eq!(
            (few.count_where(|value| value > 9), few.distance_at(10, 75), few.distance_at(10, 100)),
            (3, 15, 20)
        );
        assert_eq!(Distribution::default().median(), 0);

        // Intervals of 10 ms with jitter, each of its own.
        let mut many = Distribution::default();
        for step in 0..1_000_000_i64 {
            many.push(10_000_000 + (step * 7919) % 1_000_003 - 500_000);
        }
        assert!(many.count() == 1_000_000 && many.buckets.len() <= MOST_BUCKETS);
        let median = many.median();
        assert!((median - 10_000_000).abs() < 2_000, "{median}");
        let jitter = many.distance_at(median, 99);
        assert!((jitter - 495_000).abs() < 2_000, "{jitter}");

        // Over all magnitudes and both signs the buckets stay few, and in order.
        let mut wide = Distribution::default();
        let mut value = 1_u64;
        for _ in 0..200_000 {
            value = value.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            wide.push(value.cast_signed() >> (value % 63));
        }
        assert!(wide.count() == 200_000 && wide.buckets.len() <= MOST_BUCKETS);
        let means: Vec<i64> = wide.means().map(|(mean_ns, _)| mean_ns).collect();
        assert!(means.is_sorted());
        assert!(wide.at_rank(20_000) < wide.at_rank(100_000) && wide.at_rank(100_000) < wide.at_rank(180_000));
    }
}
