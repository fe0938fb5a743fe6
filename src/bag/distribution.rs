//! Distributions of many numbers in little memory: exact for few different ones, then in buckets that grow.

/// The most different values, or buckets, that are kept.
const MOST_BUCKETS: usize = 4096;

/// Bits behind the leading one that a bucket keeps at first where values no longer stand each for itself: 1 part in 16,384.
const FINEST_BITS: u32 = 14;

/// Values in ns by size. Up to 4096 different ones are kept as they are; beyond, values within a bucket count as their mean.
#[derive(Clone, Debug, Default)]
pub(super) struct Distribution {
    /// Each of its own key; in rising order once it is asked for one.
    buckets: Vec<Bucket>,
    /// Where the buckets are: behind the place that the hash of a key names, the number of its bucket and one more, or 0. A power of two, and
    /// at least twice as many as there are buckets.
    places: Vec<u16>,
    /// Bits that a bucket keeps; `None` where each value stands for itself.
    bits: Option<u32>,
}

/// Values of one key.
#[derive(Clone, Copy, Debug)]
struct Bucket {
    least_ns: i64,
    count: u64,
    sum_ns: i128,
}

impl Bucket {
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
        let one = Bucket { least_ns: key(value_ns, self.bits), count: 1, sum_ns: i128::from(value_ns) };
        if self.places.is_empty() {
            self.lay();
        }
        let place = self.place(one.least_ns);
        let Some(number) = self.places.get_mut(place) else { return };
        if let Some(bucket) = self.buckets.get_mut(usize::from(*number).wrapping_sub(1)) {
            bucket.add(&one);
            return;
        }
        self.buckets.push(one);
        *number = numbered(self.buckets.len());
        if self.buckets.len() > MOST_BUCKETS {
            self.merge();
        }
        if 2 * self.buckets.len() > self.places.len() {
            self.lay();
        }
    }

    /// The place of a key, or the empty one where it would be.
    fn place(&self, key: i64) -> usize {
        let last = self.places.len().saturating_sub(1);
        let hash = key.cast_unsigned().wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mut place = usize::try_from(hash >> 40).unwrap_or_default() & last;
        while let Some(number @ 1..) = self.places.get(place)
            && self.buckets.get(usize::from(*number) - 1).is_some_and(|bucket| bucket.least_ns != key)
        {
            place = (place + 1) & last;
        }
        place
    }

    /// Gives each bucket its place anew.
    fn lay(&mut self) {
        self.places.clear();
        self.places.resize((4 * self.buckets.len()).next_power_of_two().max(16), 0);
        for number in 0..self.buckets.len() {
            let place = self.place(self.buckets[number].least_ns);
            self.places[place] = numbered(number + 1);
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
        let distance = |bucket: &Bucket| (bucket.mean_ns().saturating_sub(from_ns).saturating_abs(), bucket.count);
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

    /// Puts the buckets into rising order.
    fn settle(&mut self) {
        if !self.buckets.is_sorted_by_key(|bucket| bucket.least_ns) {
            self.buckets.sort_unstable_by_key(|bucket| bucket.least_ns);
            self.lay();
        }
    }

    /// Makes one bucket of those with one key by fewer bits, until they are few.
    fn merge(&mut self) {
        while self.buckets.len() > MOST_BUCKETS {
            self.bits = Some(self.bits.map_or(FINEST_BITS, |bits| bits.saturating_sub(1)));
            for bucket in &mut self.buckets {
                bucket.least_ns = key(bucket.least_ns, self.bits);
            }
            self.buckets.sort_unstable_by_key(|bucket| bucket.least_ns);
            self.buckets.dedup_by(|next, first| {
                let same = next.least_ns == first.least_ns;
                if same {
                    first.add(next);
                }
                same
            });
        }
        self.lay();
    }
}

/// The number of a bucket, counted from 1; there are never more than fit.
fn numbered(count: usize) -> u16 {
    u16::try_from(count).unwrap_or(u16::MAX)
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
        wide.settle();
        assert!(wide.buckets.windows(2).all(|pair| pair[0].least_ns < pair[1].least_ns));
        assert!(wide.at_rank(20_000) < wide.at_rank(100_000) && wide.at_rank(100_000) < wide.at_rank(180_000));
    }
}
