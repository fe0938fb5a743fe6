//! One signal of a source: from a cell to a value of a row, with what could not be used counted.

use crate::import::convert::{plain, pressure};
use crate::import::map::{SignalMap, TripRule};
use crate::import::row::{ImportedRow, Target};
use crate::import::stated::SeveralUnits;

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
    /// Of such a transmitter: what makes its values mA.
    to_ma: Option<f64>,
    /// Units that its header names, where the map leaves open which counts.
    pub(in crate::import) several: Option<SeveralUnits>,
    /// Of the ESV: the first two states, of which none means a trip; none once one did.
    states: Option<Vec<String>>,
}

/// What a transmitter of 4 to 20 mA gives while it is sound (NAMUR NE 43), mA.
const SOUND_MA: std::ops::RangeInclusive<f64> = 3.6..=21.0;

impl SourceChannel {
    pub(in crate::import) fn new(signal: usize, map: &SignalMap) -> Self {
        let (bad, broken) = (Bad::default(), Bad::default());
        let to_ma = current(map, "");
        Self {
            signal,
            map: map.clone(),
            latched: false,
            latches: map.latch,
            keeps_latch: map.latch,
            bad,
            broken,
            to_ma,
            several: None,
            states: Some(Vec::new()),
        }
    }

    /// The same for a source that sees to it itself that a trip stays.
    pub(in crate::import) fn without_latch(signal: usize, map: &SignalMap) -> Self {
        Self { keeps_latch: false, ..Self::new(signal, map) }
    }

    /// The same of a column under a header that states a unit, which counts where the map states none.
    pub(in crate::import) fn under(self, header: &str, stated: &str) -> Self {
        let conversion = &self.map.conversion;
        let is_of_map = !self.map.unit.is_empty() || conversion.range.is_some() || conversion.scale != 1.0;
        let several =
            (self.map.target != Target::Esv && !is_of_map).then(|| SeveralUnits::of(header, stated)).flatten();
        Self { to_ma: current(&self.map, stated), several, ..self }
    }

    /// The same by a map that is completed.
    pub(in crate::import) fn by(self, map: SignalMap) -> Self {
        Self { map, ..self }
    }

    /// Whether a trip was seen that is to stay.
    pub(in crate::import) fn is_latched(&self) -> bool {
        self.latched
    }

    /// Goes on with a trip that was seen before, where trips are to stay.
    pub(in crate::import) fn latch(&mut self) {
        self.latched |= self.keeps_latch;
    }

    /// Keeps the first two states of an ESV until it trips.
    fn see_state(&mut self, value: ChannelValue<'_>, tripped: bool) {
        let Some(states) = self.states.as_mut().filter(|_| !tripped) else {
            self.states = None;
            return;
        };
        let state = match value {
            _ if states.len() > 1 => return,
            ChannelValue::Text(text) => text.trim().to_owned(),
            ChannelValue::Number(number) => number.to_string(),
            _ => return,
        };
        if !states.contains(&state) {
            states.push(state);
        }
    }

    /// Two states of an ESV of which the map calls none a trip, in words; a number may stay on one side of a level.
    pub(in crate::import) fn never_trips(&self) -> Option<String> {
        let states @ [one, other] = self.states.as_deref()? else { return None };
        let words: Vec<String> = self.map.shutdown.iter().map(|rule| missed(rule, states)).collect();
        let all = words.iter().all(|words| !words.is_empty());
        all.then(|| format!("changes from `{one}` to `{other}`, and no cell is {}", words.join(" or ")))
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
            self.see_state(value, tripped);
            self.latched |= tripped && self.keeps_latch;
            row.set(Target::Esv, if tripped || self.latched { 0.0 } else { 1.0 });
            return;
        }
        match value {
            ChannelValue::Number(raw)
                if raw.is_finite() && self.to_ma.is_some_and(|to_ma| !SOUND_MA.contains(&(raw * to_ma))) =>
            {
                self.broken.note(place, &raw.to_string());
            }
            ChannelValue::Number(raw) if raw.is_finite() => {
                if let Some(several) = &mut self.several {
                    several.take(raw);
                }
                row.set(self.map.target, self.map.conversion.apply(raw));
            }
            ChannelValue::Number(raw) => self.bad.note(place, &raw.to_string()),
            ChannelValue::Text(text) => self.bad.note(place, text),
            _ => self.bad.note(place, "a time"),
        }
    }
}

/// Ends of a range that is one of 4 to 20 mA, or half of it, as somebody has calibrated it, mA.
const LIVE_ZERO_MA: std::ops::RangeInclusive<f64> = 3.5..=21.0;
const ENDS_MA: [std::ops::RangeInclusive<f64>; 2] = [3.7..=4.3, 19.5..=20.5];

/// What makes the values of a transmitter of 4 to 20 mA mA, by the unit that the header or the map states and by the ends of its range; none where the
/// values are another thing, or a current that begins at 0.
fn current(map: &SignalMap, stated: &str) -> Option<f64> {
    let stated = plain(if stated.is_empty() { &map.unit } else { stated });
    let to_ma = match stated.as_str() {
        "a" => 1e3,
        _ => 1.0,
    };
    let conversion = &map.conversion;
    let [one, other] = match conversion.range {
        Some(range) => range,
        // Scale and offset make 0 and 1, or %, of it.
        None if map.target != Target::Esv && conversion.scale != 1.0 => {
            [0.0, 1.0].map(|end| (end - conversion.offset) / conversion.scale)
        }
        None => return None,
    };
    let ends = [one.min(other) * to_ma, one.max(other) * to_ma];
    let is_end = |end: &f64| ENDS_MA.iter().any(|near| near.contains(end));
    let inside = ends.iter().all(|end| LIVE_ZERO_MA.contains(end));
    let in_current = ["ma", "a"].contains(&stated.as_str());
    // A range without a unit must be the very one; one of volts or millimetres is another thing.
    let plain_range = stated.is_empty() || pressure(&stated).is_some();
    let found = if in_current { inside && ends.iter().any(is_end) } else { plain_range && ends == [4.0, 20.0] };
    found.then_some(to_ma)
}

/// A rule that no state met, in words; none of a level on whose other side numbers lie.
fn missed(rule: &TripRule, states: &[String]) -> String {
    let is_number = |state: &String| truth(state).is_some() || state.parse::<f64>().is_ok();
    match rule {
        TripRule::Is(text) => format!("`{text}`"),
        TripRule::Above(_) | TripRule::Below(_) if states.iter().any(is_number) => String::new(),
        TripRule::Above(level) => format!("a number above {level}"),
        TripRule::Below(level) => format!("a number below {level}"),
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
    fn a_current_with_a_live_zero_is_known_by_unit_and_range() {
        let of = |range: Option<[f64; 2]>, scale: f64, offset: f64, stated: &str| {
            let mut map = SignalMap::of_column(Target::ServomotorPosition, "y");
            (map.conversion.range, map.conversion.scale, map.conversion.offset) = (range, scale, offset);
            current(&map, stated)
        };
        for (range, stated, found) in [
            (Some([4.0, 20.0]), "mA", Some(1.0)),
            (Some([20.0, 4.0]), "", Some(1.0)),
            (Some([3.98, 20.05]), "mA", Some(1.0)),
            (Some([12.0, 20.0]), "mA", Some(1.0)),
            (Some([0.004, 0.02]), "A", Some(1e3)),
            (Some([0.0, 20.0]), "mA", None),
            (Some([4.0, 20.0]), "V", None),
            (Some([4.0, 20.0]), "mm", None),
            (None, "mA", None),
        ] {
            assert_eq!(of(range, 1.0, 0.0, stated), found, "{range:?} {stated}");
        }
        assert_eq!(of(None, 0.0625, -0.25, "mA"), Some(1.0));
        assert_eq!(of(None, 0.05, 0.0, "mA"), None);
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
