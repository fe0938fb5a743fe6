//! Distributions of many numbers in little memory: exact for few different ones, then in buckets that grow.

/// The most different values, or buckets, that are kept.
const MOST_BUCKETS: usize = 4096;

/// Values are sorted into the buckets so many at a time.
const TOGETHER: usize = 8192;

/// Bits behind the leading one that a bucket keeps at first where values no longer stand each for itself: 1 part in 16,384.
const FINEST_BITS: u32 = 14;

/// Values in ns by size. Up to 4096 different ones are kept as they are; beyond, values within a bucket count as their mean.
#[derive(Clone, Debug, Default)]
pub(super) struct Distribution {
    /// In rising order, each of its own key.
    buckets: Vec<KeyBucket>,
    /// Not in a bucket yet.
    waiting: Vec<i64>,
    /// Bits that a bucket keeps; `None` where each value has a bucket.
    bits: Option<u32>,
}

/// Values of one key.
#[derive(Clone, Copy, Debug)]
struct KeyBucket {
    least_ns: i64,
    count: u64,
    sum_ns: i128,
}

impl KeyBucket {
    fn mean_ns(&self) -> i64 {
        let mean_ns = self.sum_ns / i128::from(self.count).max(1);
        i64::try_from(mean_ns).unwrap_or(if mean_ns < 0 { i64::MIN } else { i64::MAX })
    }

    fn add(&mut self, other: &Self) {
        self.count += other.count;
        self.sum_ns += other.sum_ns;
    }
}

impl Distribution {
    /// Takes a value.
    pub(super) fn push(&mut self, value_ns: i64) {
        self.waiting.push(value_ns);
        if self.waiting.len() == TOGETHER {
            self.settle();
        }
    }

    /// How many values there are.
    pub(super) fn count(&mut self) -> u64 {
        self.count_where(|_| true)
    }

    /// The value of this rank, counted from 0 at the least; 0 where there is none.
    pub(super) fn at_rank(&mut self, rank: u64) -> i64 {
        self.settle();
        let mut before = 0;
        for bucket in &self.buckets {
            before += bucket.count;
            if before > rank {
                return bucket.mean_ns();
            }
        }
        0
    }

    /// The upper median; 0 where there is no value.
    pub(super) fn median(&mut self) -> i64 {
        let half = self.count() / 2;
        self.at_rank(half)
    }

    /// How many values a condition holds for.
    pub(super) fn count_where(&mut self, holds: impl Fn(i64) -> bool) -> u64 {
        self.settle();
        self.buckets.iter().filter(|bucket| holds(bucket.mean_ns())).map(|bucket| bucket.count).sum()
    }

    /// The distance from a value that this share of the values keeps, in hundredths.
    pub(super) fn distance_at(&mut self, from_ns: i64, hundredths: u64) -> i64 {
        self.settle();
        let distance = |bucket: &KeyBucket| (bucket.mean_ns().saturating_sub(from_ns).saturating_abs(), bucket.count);
        let mut distances: Vec<(i64, u64)> = self.buckets.iter().map(distance).collect();
        distances.sort_unstable();
        let count: u64 = distances.iter().map(|(_, count)| count).sum();
        let rank = count.saturating_sub(1) * hundredths / 100;
        let mut before = 0;
        let at = distances.iter().find(|(_, count)| {
            before += count;
            before > rank
        });
        at.map_or(0, |(distance_ns, _)| *distance_ns)
    }

    /// Puts what waits into the buckets.
    fn settle(&mut self) {
        if self.waiting.is_empty() {
            return;
        }
        let mut waiting = std::mem::take(&mut self.waiting);
        waiting.sort_unstable();
        let before = std::mem::take(&mut self.buckets);
        self.buckets = in_order(before, runs(&waiting, self.bits));
        waiting.clear();
        self.waiting = waiting;
        while self.buckets.len() > MOST_BUCKETS {
            self.bits = Some(self.bits.map_or(FINEST_BITS, |bits| bits.saturating_sub(1)));
            self.merge();
        }
    }

    /// Makes one bucket of those with one key by the bits that count now, which lie side by side.
    fn merge(&mut self) {
        let bits = self.bits;
        for bucket in &mut self.buckets {
            bucket.least_ns = key(bucket.least_ns, bits);
        }
        self.buckets.dedup_by(|next, first| {
            let same = next.least_ns == first.least_ns;
            if same {
                first.add(next);
            }
            same
        });
    }
}

/// The buckets of values in rising order.
fn runs(values: &[i64], bits: Option<u32>) -> Vec<KeyBucket> {
    let mut found: Vec<KeyBucket> = vec![];
    for value_ns in values {
        let one = KeyBucket { least_ns: key(*value_ns, bits), count: 1, sum_ns: i128::from(*value_ns) };
        match found.last_mut() {
            Some(last) if last.least_ns == one.least_ns => last.add(&one),
            _ => found.push(one),
        }
    }
    found
}

/// Two lists in rising order as one; what is in both becomes one bucket.
fn in_order(some: Vec<KeyBucket>, others: Vec<KeyBucket>) -> Vec<KeyBucket> {
    let mut merged = Vec::with_capacity(some.len() + others.len());
    let mut left = some.into_iter().peekable();
    for other in others {
        while let Some(bucket) = left.next_if(|bucket| bucket.least_ns < other.least_ns) {
            merged.push(bucket);
        }
        match left.next_if(|bucket| bucket.least_ns == other.least_ns) {
            Some(mut bucket) => {
                bucket.add(&other);
                merged.push(bucket);
            }
            None => merged.push(other),
        }
    }
    merged.extend(left);
    merged
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
        assert!(wide.buckets.windows(2).all(|pair| pair[0].least_ns < pair[1].least_ns));
        assert!(wide.at_rank(20_000) < wide.at_rank(100_000) && wide.at_rank(100_000) < wide.at_rank(180_000));
    }
}
