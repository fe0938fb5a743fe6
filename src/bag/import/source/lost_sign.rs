//! Signed numbers that an export writes without their sign: of 16 bits, 65530 is −6.

use super::channel::ChannelValue;

/// What numbers of 16 and 32 bits count before they begin anew.
const COUNTS: [f64; 2] = [65_536.0, 4_294_967_296.0];
/// A signal that moves has so many different numbers at least; a command may step between fewer, from one end to the other.
const FEWEST: usize = 16;
/// And so many in the upper half; one or two may stand for no value.
const FEWEST_NEGATIVE: usize = 3;

/// What the numbers of a column show of a lost sign.
#[derive(Clone, Debug)]
pub(in crate::import) struct SignLook {
    last: Option<f64>,
    /// The first different numbers.
    distinct: Vec<f64>,
    /// For each count.
    counts: [CountLook; COUNTS.len()],
}

/// The same for one count: all numbers are whole and below it, steps are below a quarter of it or above three quarters, and only the latter pass its half.
#[derive(Clone, Debug)]
struct CountLook {
    count: f64,
    possible: bool,
    /// The first different numbers of the upper half.
    negative: Vec<f64>,
    /// The greatest step, and the greatest of those that are one by the signs alone.
    step: f64,
    signed_step: f64,
}

impl Default for SignLook {
    fn default() -> Self {
        let look = |count| CountLook { count, possible: true, negative: vec![], step: 0.0, signed_step: 0.0 };
        Self { last: None, distinct: vec![], counts: COUNTS.map(look) }
    }
}

/// Keeps the first different numbers.
fn keep(numbers: &mut Vec<f64>, number: f64, most: usize) {
    if numbers.len() < most && !numbers.contains(&number) {
        numbers.push(number);
    }
}

impl SignLook {
    /// Whether more numbers can show anything.
    pub(in crate::import) fn is_open(&self) -> bool {
        self.counts.iter().any(|look| look.possible)
    }

    pub(in crate::import) fn take(&mut self, value: ChannelValue<'_>) {
        let number = match value {
            ChannelValue::Number(number) => number,
            ChannelValue::Whole(whole) => whole as f64,
            _ => return,
        };
        keep(&mut self.distinct, number, FEWEST);
        let last = self.last.replace(number).unwrap_or(number);
        self.counts.iter_mut().filter(|look| look.possible).for_each(|look| look.take(last, number));
    }

    /// What the numbers count, where those of its upper half are negative ones.
    pub(in crate::import) fn count(&self) -> Option<f64> {
        let found = self.counts.iter().find(|look| look.has_lost_sign());
        found.filter(|_| self.distinct.len() >= FEWEST).map(|look| look.count)
    }
}

impl CountLook {
    fn take(&mut self, last: f64, number: f64) {
        let is_negative = |number: f64| number >= self.count / 2.0;
        let (step, passes_half) = ((number - last).abs(), is_negative(number) != is_negative(last));
        let jumps = step > 0.75 * self.count;
        let is_one = number.fract() == 0.0 && (0.0..self.count).contains(&number);
        self.possible = is_one && (jumps || step < 0.25 * self.count && !passes_half);
        if is_negative(number) {
            keep(&mut self.negative, number, FEWEST_NEGATIVE);
        }
        let (greatest, step) = if jumps { (&mut self.signed_step, self.count - step) } else { (&mut self.step, step) };
        *greatest = greatest.max(step);
    }

    /// Whether numbers of both halves go on into each other as far as they do within one.
    fn has_lost_sign(&self) -> bool {
        let goes_on = self.signed_step > 0.0 && self.signed_step <= 2.0 * self.step;
        self.possible && goes_on && self.negative.len() >= FEWEST_NEGATIVE
    }
}

/// A number with its sign.
pub(in crate::import) fn signed(value: ChannelValue<'_>, count: Option<f64>) -> ChannelValue<'_> {
    let number = match value {
        ChannelValue::Number(number) => number,
        ChannelValue::Whole(whole) => whole as f64,
        other => return other,
    };
    match count {
        Some(count) if number >= count / 2.0 => ChannelValue::Number(number - count),
        _ => value,
    }
}

/// What to say of a column of such numbers.
pub(in crate::import) fn words(name: &str, count: f64) -> String {
    format!(
        "`{name}` jumps by {count} and is steady otherwise: numbers from {} on are taken as negative, less {count}",
        count / 2.0
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(numbers: impl Iterator<Item = f64>) -> Option<f64> {
        let mut look = SignLook::default();
        numbers.for_each(|number| look.take(ChannelValue::Number(number)));
        look.count()
    }

    #[test]
    fn a_lost_sign_is_found_by_its_jumps() {
        let course = |k: i32| (f64::from(k) * 0.1).sin() * 9000.0;
        let as_count = |count: f64| move |k: i32| course(k).round().rem_euclid(count);
        assert_eq!(count((0..200).map(as_count(65_536.0))), Some(65_536.0));
        assert_eq!(count((0..200).map(as_count(4_294_967_296.0))), Some(4_294_967_296.0));
        // Numbers with their sign, without one, and with decimals.
        assert_eq!(count((0..200).map(|k| course(k).round())), None);
        assert_eq!(count((0..200).map(|k| course(k).round() + 9000.0)), None);
        assert_eq!(count((0..200).map(|k| course(k) + 9000.0)), None);
        // What stands for no value.
        let with_stand_in = |k: i32| if k % 20 == 7 { 65_535.0 } else { course(k).round() + 9000.0 };
        assert_eq!(count((0..200).map(with_stand_in)), None);
        // A command of the whole range, in steps and by ramps.
        assert_eq!(count((0..200).map(|k| if k % 50 < 25 { 0.0 } else { 65_535.0 })), None);
        assert_eq!(count((0..200).map(|k| f64::from(k % 100) * 660.0)), None);
        let value = |number: f64| match signed(ChannelValue::Number(number), Some(65_536.0)) {
            ChannelValue::Number(number) => number,
            other => panic!("{other:?}"),
        };
        assert_eq!([0.0, 6.0, 32_767.0, 32_768.0, 65_530.0].map(value), [0.0, 6.0, 32_767.0, -32_768.0, -6.0]);
    }
}
