//! The units and ranges that a header names: `p tank 4-20 mA = 0..100 bar` names two, of which the values are in one.

use super::convert::{UnitConversion, is_travel, is_unit, plain, pressure, share};
use super::words::Words;
use crate::qualification::TANK_PA;

/// Words between the ends of a range.
const TO: Words = Words("to|bis|a|à|au|til|till|и|до|至|到");
/// Units that are words or names where a word follows: `0-100 at HPU 3`.
const WORDS: Words = Words("in|a|m|at");
/// Signs that are a minus before a number.
const MINUS: [char; 8] = ['-', '−', '–', '—', '‐', '‑', '‒', '―'];
/// How far beyond the ends of a range values may be, in ranges.
const BEYOND: f64 = 0.1;
/// Share of the values that are within a range if they are of its unit: others stand for faults.
const WITHIN: f64 = 0.95;

/// A unit that a header names, with the range beside it, the lesser end first.
#[derive(Clone, Debug, PartialEq)]
struct StatedUnit {
    unit: String,
    range: Option<[f64; 2]>,
    /// The ends between which values may be in it.
    limits: [f64; 2],
    /// Values that may be in it.
    held: u64,
}

impl StatedUnit {
    /// A unit whose values are within its range, or without one within what a position, a transmitter or an oil supply has.
    fn new(unit: String, range: Option<[f64; 2]>) -> Self {
        let widened = |[low, high]: [f64; 2]| [low - BEYOND * (high - low), high + BEYOND * (high - low)];
        let limits = match (range, share(&unit), pressure(&unit), plain(&unit).as_str()) {
            (Some(range), ..) => widened(range),
            (_, Some(share), ..) => widened([-1.0, 1.0].map(|end| end / share.apply(1.0))),
            (_, _, Some(pressure), _) => {
                let zero_pa = pressure.apply(0.0);
                [*TANK_PA.start(), *TANK_PA.end()].map(|pa| (pa - zero_pa) / (pressure.apply(1.0) - zero_pa))
            }
            (.., "ma") => widened([0.0, 20.0]),
            (.., "v") => widened([-10.0, 10.0]),
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        };
        Self { unit, range, limits, held: 0 }
    }

    fn text(&self) -> String {
        match self.range {
            Some([low, high]) => format!("`{low} to {high} {}`", self.unit),
            None => format!("`{}`", self.unit),
        }
    }
}

/// The units that a header names, where there are several, with how many values may be in each.
#[derive(Clone, Debug)]
pub(super) struct SeveralUnits {
    units: Vec<StatedUnit>,
    taken: String,
    count: u64,
}

impl SeveralUnits {
    /// Of a header, with the unit that is taken; none where no other is named.
    pub(super) fn of(header: &str, taken: &str) -> Option<Self> {
        let mut units = named(header);
        if !taken.is_empty() && !units.iter().any(|one| is_same(&one.unit, taken)) {
            units.push(StatedUnit::new(taken.to_owned(), None));
        }
        (units.len() > 1).then(|| Self { units, taken: taken.to_owned(), count: 0 })
    }

    /// Takes in a value as the file has it.
    pub(super) fn take(&mut self, value: f64) {
        self.count += 1;
        for one in &mut self.units {
            one.held += u64::from((one.limits[0]..=one.limits[1]).contains(&value));
        }
    }

    /// What the header names and what the values may be of, in words; none where they may be of the unit that is taken alone, or of none.
    pub(super) fn doubt(&self) -> Option<String> {
        let may_be = |one: &&StatedUnit| one.held as f64 >= WITHIN * self.count as f64;
        let likely: Vec<&StatedUnit> = self.units.iter().filter(may_be).collect();
        if likely.iter().all(|one| is_same(&one.unit, &self.taken)) {
            return None;
        }
        let all: Vec<String> = self.units.iter().map(StatedUnit::text).collect();
        let likely: Vec<String> = likely.into_iter().map(StatedUnit::text).collect();
        Some(format!("its header names {}; its values may be of {}", all.join(" and "), likely.join(" or ")))
    }
}

/// Whether two units are one, gauge or absolute.
fn is_same(first: &str, second: &str) -> bool {
    let alike = |of: fn(&str) -> Option<UnitConversion>| {
        of(first).zip(of(second)).is_some_and(|(first, second)| first.is_multiple(second))
    };
    alike(pressure) || alike(share) || plain(first) == plain(second)
}

/// Whether a text is a unit of a signal, and no sign that parts words.
fn is_one(text: &str) -> bool {
    !["-", "1"].contains(&text)
        && is_unit(text)
        && (pressure(text).is_some() || share(text).is_some() || is_travel(text))
}

/// All units of a header: behind ranges, alone in brackets, and shares in words. A number alone is a fact, as in `stroke 250 mm`, unless it is equal to another.
fn named(header: &str) -> Vec<StatedUnit> {
    let letters: Vec<char> = header.chars().collect();
    let mut found: Vec<(String, Vec<f64>)> = vec![];
    let mut alone: Vec<String> = vec![];
    let mut add = |unit: &str, numbers: &[f64]| match found.iter_mut().find(|(known, _)| is_same(known, unit)) {
        Some((_, known)) => known.extend(numbers),
        None => found.push((unit.to_owned(), numbers.to_vec())),
    };
    let mut numbers: Vec<f64> = vec![];
    let (mut at, mut end) = (0, 0);
    while at < letters.len() {
        let parted = at == 0 || !letters[at - 1].is_alphanumeric();
        let Some((size, behind)) = number_at(&letters, at).filter(|_| parted) else {
            at += 1;
            continue;
        };
        let between: String = letters[end..at].iter().collect();
        let between = between.trim();
        if between.contains(char::is_alphanumeric) && !TO.has(&between.to_lowercase()) {
            numbers.clear();
        }
        if between.contains('±') || between.ends_with("+/-") || between.ends_with("+-") {
            numbers.push(-size);
        }
        // Directly before a number, and behind another sign than itself or a blank, it is no dash.
        let is_minus = at > 0 && MINUS.contains(&letters[at - 1]);
        let before = between.trim_end_matches(MINUS);
        let is_first = numbers.is_empty() && (at < 2 || !letters[at - 2].is_alphanumeric());
        let is_behind = !numbers.is_empty() && !before.is_empty() && !before.ends_with(['+', '/', '±']);
        numbers.push(if is_minus && (is_first || is_behind) { -size } else { size });
        (at, end) = (behind, behind);
        if let Some((unit, behind)) = unit_at(&letters, at) {
            add(&unit, &numbers);
            numbers.clear();
            (at, end) = (behind, behind);
        }
    }
    let brackets = header
        .split(['[', '('])
        .skip(1)
        .filter_map(|part| Some(part.split_once([']', ')'])?.0.trim()))
        .filter(|text| is_one(text));
    let words = header.split_whitespace().filter(|word| share(word).is_some() && is_one(word));
    for unit in brackets.chain(words) {
        alone.push(unit.to_owned());
        add(unit, &[]);
    }
    let equal = header.contains(['=', '≙', '→']);
    let of = |(unit, mut numbers): (String, Vec<f64>)| {
        if equal && numbers.len() == 1 {
            numbers.push(0.0);
        }
        let [low, high] = [numbers.iter().copied().reduce(f64::min), numbers.iter().copied().reduce(f64::max)];
        let range = low.zip(high).filter(|(low, high)| low < high).map(|(low, high)| [low, high]);
        (range.is_some() || alone.iter().any(|one| is_same(one, &unit))).then(|| StatedUnit::new(unit, range))
    };
    found.into_iter().filter_map(of).collect()
}

/// The number without a sign that stands at a place, and the place behind it. A sign between groups of three digits is no decimal sign.
fn number_at(letters: &[char], at: usize) -> Option<(f64, usize)> {
    let is_digit = |place: usize| letters.get(place).is_some_and(char::is_ascii_digit);
    let mut end = at;
    while is_digit(end)
        || (end > at && [Some(&'.'), Some(&','), Some(&'\'')].contains(&letters.get(end)) && is_digit(end + 1))
    {
        end += 1;
    }
    let text: String = letters[at..end].iter().collect();
    let (whole, part) = text.split_once(['.', ',', '\'']).unwrap_or((&text, ""));
    let is_group = part.len() == 3 && !whole.trim_matches('0').is_empty();
    let plain = if is_group { format!("{whole}{part}") } else { format!("{whole}.{part}") };
    plain.parse().ok().filter(|_| end > at).map(|number| (number, end))
}

/// The unit behind a number, and the place behind it: next to it, or behind blanks and brackets.
fn unit_at(letters: &[char], at: usize) -> Option<(String, usize)> {
    let begin = at + letters[at..].iter().take_while(|letter| " ])[(;,".contains(**letter)).count();
    let take = |is_part: &dyn Fn(char) -> bool| {
        let text: String = letters[begin..].iter().take_while(|letter| is_part(**letter)).collect();
        let end = begin + text.chars().count();
        (text, end)
    };
    let whole = take(&|letter| !letter.is_whitespace() && !"[](){}=;:,_".contains(letter));
    let word = take(&|letter| letter.is_alphabetic() || "%‰°".contains(letter));
    // `VDC`, the last two letters of which may be written so or so.
    let direct = word.0.len().checked_sub(2).and_then(|at| word.0.split_at_checked(at));
    let current = direct.filter(|(_, end)| end.eq_ignore_ascii_case("dc")).map(|(unit, _)| (unit.to_owned(), word.1));
    let is_whole = |end: usize| letters.get(end).is_none_or(|next| !next.is_alphanumeric());
    let (unit, end) = [Some(whole), Some(word.clone()), current]
        .into_iter()
        .flatten()
        .find(|(unit, end)| is_one(unit) && is_whole(*end))?;
    let next = letters[end..].iter().find(|letter| !letter.is_whitespace());
    let is_word = begin > at && WORDS.has(&plain(&unit)) && next.is_some_and(|next| next.is_alphanumeric());
    (!is_word).then_some((unit, end))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_units_of_a_header_are_found() {
        let texts =
            |header: &str| named(header).iter().map(StatedUnit::text).collect::<Vec<_>>().join("; ").replace('`', "");
        for (header, expected) in [
            ("p tank 4-20 mA = 0..100 bar", "4 to 20 mA; 0 to 100 bar"),
            ("p tank [%] (0-160 bar)", "0 to 160 bar; %"),
            ("Öldruck in % (0-160 bar)", "0 to 160 bar; %"),
            ("Öldruck in Prozent von 0..160 bar", "0 to 160 bar; Prozent"),
            ("Pressão 4 a 20 mA (0 a 160 bar)", "4 to 20 mA; 0 to 160 bar"),
            ("Spool ±10V [%]", "-10 to 10 V; %"),
            ("spool +/-10 V [%]", "-10 to 10 V; %"),
            ("spool –10…+10 V [%]", "-10 to 10 V; %"),
            ("spool 4 bis 20 mA = 10..-10 mm", "4 to 20 mA; -10 to 10 mm"),
            ("servo [0,0-0,6 m]", "0 to 0.6 m"),
            ("servo 0 to 100%", "0 to 100 %"),
            ("servo (stroke 250 mm) [%]", "%"),
            ("servo 10 V = 100 %", "0 to 10 V; 0 to 100 %"),
            ("p tank [0-160] bar", "0 to 160 bar"),
            ("p tank 4mA..20mA = 0bar..160bar", "4 to 20 mA; 0 to 160 bar"),
            ("p Kessel 0/4..20mA [bar]", "0 to 20 mA; bar"),
            ("p tank 0(4)...20 mA [bar]", "0 to 20 mA; bar"),
            ("spool 4/12/20 mA [%]", "4 to 20 mA; %"),
            ("Pressione olio 4÷20 mA = 0÷160 bar", "4 to 20 mA; 0 to 160 bar"),
            ("p tank 4‑20 mA / 0‑160 bar", "4 to 20 mA; 0 to 160 bar"),
            ("servo 1-5Vdc [%]", "1 to 5 V; %"),
            ("servo 1-5 \u{212a}dc [%]", "%"),
            ("p tank_4_20mA_0_160bar", "4 to 20 mA; 0 to 160 bar"),
            ("p tank 0-16,000 kPa", "0 to 16000 kPa"),
            ("p tank 0-160 kgf/cm2 [psi]", "0 to 160 kgf/cm2; psi"),
            ("油压 0～16 MPa [kPa]", "0 to 16 MPa; kPa"),
            ("Druck 0,5-2,5 V [bar]", "0.5 to 2.5 V; bar"),
            ("GV1-2 pos 0-100 %", "0 to 100 %"),
            ("Units 3-4 servo [%]", "%"),
            ("servo (0-5 Hz) [%]", "%"),
            ("servo 0-100 m3 [%]", "%"),
            ("Pump 2 in [%]", "%"),
            ("Units 1-8 in plant: p tank [MPa]", "MPa"),
            ("p tank 0-100 at HPU 3 [bar]", "bar"),
            ("servo 0-100 - G3 %", "%"),
            ("Y ist", ""),
        ] {
            assert_eq!(texts(header), expected, "{header}");
        }
    }

    #[test]
    fn a_header_of_several_units_is_sure_only_where_the_values_are_of_the_one_that_is_taken() {
        for (header, taken, ends, expected) in [
            ("p tank 4-20 mA = 0..100 bar", "bar", [12.0, 15.0], true),
            ("p tank 4-20 mA = 0..100 bar", "bar", [50.0, 63.0], false),
            ("p tank [%] (0-160 bar)", "bar", [31.0, 40.0], true),
            ("p tank [psi] (0-160 bar)", "bar", [880.0, 920.0], true),
            ("p tank [bar] (4-20 mA) alarm 66-75 bar", "bar", [61.0, 63.0], false),
            ("p tank abs [0-160 bar]", "bar abs", [62.0, 64.0], false),
            ("servo 0-10 V = 0-100 %", "%", [0.0, 9.8], true),
            ("servo 0-10 V = 0-100 %", "%", [0.1, 98.0], false),
            ("servo (4-20 mA) [%]", "%", [4.5, 19.0], true),
            ("servo (4-20 mA) [%]", "%", [0.0, 100.0], false),
            ("servo ±0.5 mm [%]", "%", [0.0, 100.0], false),
            ("servo [%] (0-100 %)", "%", [0.0, 9.0], false),
            ("servo [%]", "%", [0.0, 9.0], false),
            ("p [bar] 0-160 barg", "bar", [50.0, 60.0], false),
        ] {
            let units = SeveralUnits::of(header, taken).map(|mut units| {
                (0..100).for_each(|k| units.take(ends[0] + (ends[1] - ends[0]) * f64::from(k) / 99.0));
                // A broken wire says nothing of units.
                units.take(-9999.0);
                units
            });
            assert_eq!(units.and_then(|units| units.doubt()).is_some(), expected, "{header}, {taken}, {ends:?}");
        }
    }
}
