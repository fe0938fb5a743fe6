//! One signal of a source: from a cell to a value of a row, with what could not be used counted.

use crate::import::map::{SignalMap, TripRule};
use crate::import::row::{ImportedRow, Target};

/// What a cell or field holds.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    not(feature = "parquet"),
    expect(dead_code, reason = "only Parquet tells times and whole numbers from others")
)]
pub(in crate::import) enum ChannelValue<'a> {
    /// Nothing.
    Missing,
    /// A number.
    Number(f64),
    /// A whole number that may be too long for a floating-point one.
    Whole(i64),
    /// Text.
    Text(&'a str),
    /// A time, ns since 1970, UTC.
    Time(i64),
    /// A time of a wall clock, ns as if its zone were UTC.
    Local(i64),
}

/// Cells that could not be used.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(in crate::import) struct Bad {
    pub(in crate::import) count: u64,
    /// Where, and what stands there.
    pub(in crate::import) first: Option<(u64, String)>,
}

impl Bad {
    pub(in crate::import) fn note(&mut self, place: u64, text: &str) {
        self.count += 1;
        if self.first.is_none() {
            self.first = Some((place, text.chars().take(40).collect()));
        }
    }
}

/// A signal of a source.
#[derive(Clone, Debug)]
pub(in crate::import) struct SourceChannel {
    /// Its number in the map.
    pub(in crate::import) signal: usize,
    pub(in crate::import) map: SignalMap,
    latched: bool,
    /// A trip is to stay; where a source puts rows in order, it takes care of that itself.
    pub(in crate::import) latches: bool,
    keeps_latch: bool,
    pub(in crate::import) bad: Bad,
    /// Currents by which a transmitter says that it is broken.
    pub(in crate::import) broken: Bad,
}

/// What a transmitter of 4 to 20 mA gives while it is sound (NAMUR NE 43), mA.
const SOUND_MA: std::ops::RangeInclusive<f64> = 3.6..=21.0;

impl SourceChannel {
    pub(in crate::import) fn new(signal: usize, map: &SignalMap) -> Self {
        let (bad, broken) = (Bad::default(), Bad::default());
        Self { signal, map: map.clone(), latched: false, latches: map.latch, keeps_latch: map.latch, bad, broken }
    }

    /// The same for a source that sees to it itself that a trip stays.
    pub(in crate::import) fn without_latch(signal: usize, map: &SignalMap) -> Self {
        Self { keeps_latch: false, ..Self::new(signal, map) }
    }

    /// Whether its values are the current of a transmitter.
    fn is_current(&self) -> bool {
        let ends = self.map.conversion.range.map(|[low, high]| [low.min(high), low.max(high)]);
        ends == Some([4.0, 20.0])
    }

    /// Whether a trip was seen that is to stay.
    pub(in crate::import) fn is_latched(&self) -> bool {
        self.latched
    }

    /// Goes on with a trip that was seen before, where trips are to stay.
    pub(in crate::import) fn latch(&mut self) {
        self.latched |= self.keeps_latch;
    }

    /// Puts a value into a row.
    pub(in crate::import) fn take(&mut self, value: ChannelValue<'_>, place: u64, row: &mut ImportedRow) {
        let value = match value {
            ChannelValue::Whole(whole) => ChannelValue::Number(whole as f64),
            other => other,
        };
        // What is no number says nothing: neither a position nor that the unit has not tripped.
        if value == ChannelValue::Missing || matches!(value, ChannelValue::Number(raw) if raw.is_nan()) {
            return;
        }
        if self.map.target == Target::Esv {
            let tripped = self.map.shutdown.iter().any(|event| happens(event, value));
            self.latched |= tripped && self.keeps_latch;
            row.set(Target::Esv, if tripped || self.latched { 0.0 } else { 1.0 });
            return;
        }
        match value {
            ChannelValue::Number(raw) if self.is_current() && raw.is_finite() && !SOUND_MA.contains(&raw) => {
                self.broken.note(place, &raw.to_string());
            }
            ChannelValue::Number(raw) if raw.is_finite() => row.set(self.map.target, self.map.conversion.apply(raw)),
            ChannelValue::Number(raw) => self.bad.note(place, &raw.to_string()),
            ChannelValue::Text(text) => self.bad.note(place, text),
            _ => self.bad.note(place, "a time"),
        }
    }
}

/// Whether a cell says that an event happens.
fn happens(event: &TripRule, value: ChannelValue<'_>) -> bool {
    let number = match value {
        ChannelValue::Number(number) => Some(number),
        ChannelValue::Text(text) => truth(text).or_else(|| text.trim().parse().ok()),
        _ => None,
    };
    match event {
        TripRule::Above(level) => number.is_some_and(|number| number > *level),
        TripRule::Below(level) => number.is_some_and(|number| number < *level),
        TripRule::Is(wanted) => {
            let same = matches!(value, ChannelValue::Text(text) if text.trim().eq_ignore_ascii_case(wanted));
            let wanted = truth(wanted).or_else(|| wanted.parse().ok());
            same || wanted.is_some_and(|wanted: f64| number == Some(wanted))
        }
    }
}

fn truth(text: &str) -> Option<f64> {
    let text = text.trim();
    let is = |word: &str| text.eq_ignore_ascii_case(word);
    if is("true") {
        Some(1.0)
    } else if is("false") {
        Some(0.0)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn events_are_recognised_as_text_number_and_level() {
        let is = |text: &str| TripRule::Is(text.to_owned());
        for (event, value, expected) in [
            (is("TRIP"), ChannelValue::Text(" trip "), true),
            (is("TRIP"), ChannelValue::Text("TRIPPED"), false),
            (is("1"), ChannelValue::Number(1.0), true),
            (is("1"), ChannelValue::Text("1.0"), true),
            (is("1"), ChannelValue::Text("true"), true),
            (is("true"), ChannelValue::Number(1.0), true),
            (TripRule::Above(0.5), ChannelValue::Text("0.7"), true),
            (TripRule::Above(0.5), ChannelValue::Number(0.5), false),
            (TripRule::Below(20.0), ChannelValue::Number(3.0), true),
        ] {
            assert_eq!(happens(&event, value), expected, "{event:?} {value:?}");
        }
    }

    #[test]
    fn a_latched_trip_stays() {
        let mut map = SignalMap::of_column(Target::Esv, "trip");
        map.shutdown = vec![TripRule::Is("1".into())];
        map.latch = true;
        let mut channel = SourceChannel::new(0, &map);
        let states: Vec<f64> = [0.0, 1.0, 0.0]
            .into_iter()
            .map(|value| {
                let mut row = ImportedRow::at(0);
                channel.take(ChannelValue::Number(value), 1, &mut row);
                row.values[Target::Esv.place()]
            })
            .collect();
        assert_eq!(states, [1.0, 0.0, 0.0]);
    }
}
