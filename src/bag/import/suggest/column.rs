//! One column of a file that nobody has mapped: what it holds, in memory that does not grow with the file.

use super::names;
use crate::import::convert::{plain, unit_by_name};
use crate::import::dialect::bracketed;
use crate::import::findings::Range;
use crate::import::source::channel::ChannelValue;

/// Most buckets of an envelope; beyond, pairs become one.
const MOST_BUCKETS: usize = 4096;
/// Width of a bucket at first, ns: less than between the rows of any recording.
const FIRST_WIDTH_NS: i64 = 1000;
/// So many different values or texts are kept.
const MOST_DISTINCT: usize = 4;

/// Values of some time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bucket {
    /// The least of them.
    pub least: f64,
    /// The greatest.
    pub most: f64,
    sum: f64,
    count: f64,
}

impl Bucket {
    /// Their mean.
    pub fn mean(&self) -> f64 {
        self.sum / self.count
    }

    fn merge(&mut self, other: &Self) {
        self.least = self.least.min(other.least);
        self.most = self.most.max(other.most);
        self.sum += other.sum;
        self.count += other.count;
    }
}

/// A signal over time as buckets of one width, whose edges are whole widths since 1970.
#[derive(Clone, Debug, PartialEq)]
pub struct Envelope {
    width_ns: i64,
    first: i64,
    buckets: Vec<Option<Bucket>>,
}

impl Default for Envelope {
    fn default() -> Self {
        Self { width_ns: FIRST_WIDTH_NS, first: 0, buckets: vec![] }
    }
}

impl Envelope {
    fn take(&mut self, time_ns: i64, value: f64) {
        let mut at = time_ns.div_euclid(self.width_ns);
        if self.buckets.is_empty() {
            self.first = at;
        }
        let far = |at: i64, first: i64, len: usize| {
            let end = first + i64::try_from(len).unwrap_or(i64::MAX);
            (at.max(end - 1) - at.min(first)) >= i64::try_from(MOST_BUCKETS).unwrap_or(i64::MAX)
        };
        while far(at, self.first, self.buckets.len()) {
            self.widen();
            at = time_ns.div_euclid(self.width_ns);
        }
        while at < self.first {
            self.buckets.insert(0, None);
            self.first -= 1;
        }
        let Ok(place) = usize::try_from(at - self.first) else { return };
        if place >= self.buckets.len() {
            self.buckets.resize(place + 1, None);
        }
        let one = Bucket { least: value, most: value, sum: value, count: 1.0 };
        match &mut self.buckets[place] {
            Some(bucket) => bucket.merge(&one),
            empty => *empty = Some(one),
        }
    }

    /// Makes every two buckets one.
    pub(super) fn widen(&mut self) {
        let mut wide: Vec<Option<Bucket>> = vec![];
        let first = self.first.div_euclid(2);
        for (k, bucket) in self.buckets.iter().enumerate() {
            let at = (self.first + i64::try_from(k).unwrap_or(i64::MAX)).div_euclid(2) - first;
            let Ok(place) = usize::try_from(at) else { continue };
            if place >= wide.len() {
                wide.resize(place + 1, None);
            }
            match (&mut wide[place], bucket) {
                (Some(into), Some(bucket)) => into.merge(bucket),
                (empty, Some(bucket)) => *empty = Some(*bucket),
                _ => {}
            }
        }
        self.width_ns = self.width_ns.saturating_mul(2);
        self.first = first;
        self.buckets = wide;
    }

    /// The width of a bucket, ns.
    pub fn width_ns(&self) -> i64 {
        self.width_ns
    }

    /// Buckets that hold something, each with the middle of its time, ns.
    pub fn points(&self) -> impl Iterator<Item = (i64, &Bucket)> {
        let middle = move |k: i64| (self.first + k) * self.width_ns + self.width_ns / 2;
        (0..).zip(&self.buckets).filter_map(move |(k, bucket)| Some((middle(k), bucket.as_ref()?)))
    }

    /// The mean of the bucket of a number.
    pub(super) fn mean_at(&self, at: i64) -> Option<f64> {
        let place = usize::try_from(at - self.first).ok()?;
        self.buckets.get(place)?.as_ref().map(Bucket::mean)
    }

    /// Numbers of the first bucket and of the one behind the last.
    pub(super) fn span(&self) -> (i64, i64) {
        (self.first, self.first + i64::try_from(self.buckets.len()).unwrap_or(0))
    }
}

/// A column or field and what it holds.
#[derive(Clone, Debug)]
pub struct SuggestedColumn {
    /// Its name; of a bag the path of the field.
    pub name: String,
    /// The unit that the file states, in a place of its own or at the end of the name; empty where it does not.
    pub unit: String,
    /// Which figure of a signal it holds by its name and unit.
    pub(super) figure: names::Figure,
    /// Its numbers.
    pub range: Range,
    /// Cells with text that is no number.
    pub texts: u64,
    /// The first of them with digits, which may be a number of another spelling.
    pub unread: Option<String>,
    /// The first different texts.
    pub words: Vec<String>,
    /// The first different numbers.
    pub distinct: Vec<f64>,
    /// The signal over time.
    pub envelope: Envelope,
    last: Option<f64>,
    /// Samples that differ from the one before.
    pub changes: u64,
}

impl SuggestedColumn {
    pub(super) fn new(name: &str, unit: &str) -> Self {
        let in_name = || bracketed(name).map_or_else(|| names::unit(name), |(_, unit)| unit);
        let unit = if unit.is_empty() { in_name() } else { unit };
        // `min` of a signal is no unit.
        let of_unit = names::figure(unit);
        Self {
            name: name.to_owned(),
            unit: unit_by_name(name, if of_unit == names::Figure::Value { unit } else { "" }),
            figure: names::figure(name).max(of_unit),
            range: Range::default(),
            texts: 0,
            unread: None,
            words: vec![],
            distinct: vec![],
            envelope: Envelope::default(),
            last: None,
            changes: 0,
        }
    }

    pub(super) fn take(&mut self, time_ns: i64, value: ChannelValue<'_>) {
        let number = match value {
            ChannelValue::Number(number) if number.is_finite() => number,
            ChannelValue::Whole(whole) => whole as f64,
            ChannelValue::Text(text) => {
                self.texts += 1;
                let digits = text.chars().filter(|letter| letter.is_numeric()).count();
                if self.unread.is_none() && 2 * digits > text.trim().chars().count() {
                    self.unread = Some(text.trim().chars().take(40).collect());
                }
                let known = self.words.iter().position(|word| word == text.trim());
                if known.is_none() && self.words.len() < MOST_DISTINCT {
                    self.words.push(text.trim().chars().take(40).collect());
                }
                let state = known.unwrap_or(self.words.len().saturating_sub(1));
                // States by their numbers; beside numbers, words are none.
                if self.range.count == 0 {
                    self.envelope.take(time_ns, state as f64);
                }
                return;
            }
            _ => return,
        };
        self.range.take(number);
        if self.distinct.len() < MOST_DISTINCT && !self.distinct.contains(&number) {
            self.distinct.push(number);
        }
        self.changes += u64::from(self.last.is_some_and(|last| last != number));
        self.last = Some(number);
        self.envelope.take(time_ns, number);
    }

    /// Whether it is the current of transmitters of 4 to 20 mA: hardly a value between 0 and the faults below 3.6, so that those below and above say that one is broken.
    pub fn is_live_zero(&self) -> bool {
        let to_ma = match plain(&self.unit).as_str() {
            "ma" => 1.0,
            "a" => 1e3,
            _ => return false,
        };
        let means: Vec<f64> = self.envelope.points().map(|(_, bucket)| bucket.most * to_ma).collect();
        let count = |range: std::ops::RangeInclusive<f64>| means.iter().filter(|mean| range.contains(mean)).count();
        count(3.6..=21.0) * 10 >= means.len() * 8 && count(0.5..=3.3) * 100 <= means.len() && !means.is_empty()
    }

    /// Two states or fewer, as numbers or as words.
    pub fn is_binary(&self) -> bool {
        let words = self.range.count == 0 && (1..=3).contains(&self.words.len()) && self.texts > 0;
        words || (self.texts == 0 && (1..=2).contains(&self.distinct.len()))
    }

    /// The states of a switch: words, or the numbers 0 and 1. Other two numbers may be a step.
    pub fn is_switch(&self) -> bool {
        self.is_binary() && self.distinct.iter().all(|value| [0.0, 1.0].contains(value))
    }

    /// Holds numbers that are not all the same.
    pub fn moves(&self) -> bool {
        self.range.span() > 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_envelope_keeps_extremes_and_means_in_bounded_memory() {
        let mut envelope = Envelope::default();
        for k in 0..2_000_000_i64 {
            envelope.take(1_700_000_000_000_000_000 + k * 10_000_000, (k % 100) as f64);
        }
        assert!(envelope.buckets.len() <= MOST_BUCKETS && envelope.buckets.len() > MOST_BUCKETS / 4);
        let inner: Vec<&Bucket> = envelope.points().skip(1).map(|(_, bucket)| bucket).take(100).collect();
        assert!(inner.iter().all(|bucket| bucket.least == 0.0 && bucket.most == 99.0));
        assert!(inner.iter().all(|bucket| (bucket.mean() - 49.5).abs() < 6.0));
        // Times that go back find their place.
        envelope.take(1_699_999_999_000_000_000, -5.0);
        assert_eq!(envelope.points().next().unwrap().1.least, -5.0);
    }
}
