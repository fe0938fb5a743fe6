//! The units and ranges that a header names: `p tank 4-20 mA = 0..100 bar` names two, of which the values are in one.

use super::convert::{is_travel, is_unit, plain, pressure, share};
use super::words::Words;

/// Signs and words between the ends of a range.
const TO: Words = Words("-|–|—|−|..|...|…|to|bis|a|à|til|till|~|～|/");
/// How far beyond the ends of a range values may be, in ranges.
const BEYOND: f64 = 0.1;

/// A unit that a header names, with the range beside it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct StatedUnit {
    /// The unit as the header has it.
    unit: String,
    /// Its range, the lesser end first.
    range: Option<[f64; 2]>,
}

impl StatedUnit {
    /// Whether values between two ends may be in this unit: within its range, or without one within what a position or an oil supply has.
    fn may_hold(&self, [least, most]: [f64; 2]) -> bool {
        let is_within = |[low, high]: [f64; 2]| {
            let beyond = BEYOND * (high - low);
            least >= low - beyond && most <= high + beyond
        };
        let full = share(&self.unit).map(|unit| 1.0 / unit.apply(1.0));
        match (self.range, full, plain(&self.unit).as_str()) {
            (Some(range), ..) => is_within(range),
            (_, Some(full), _) => is_within([-full, full]),
            (.., "ma") => is_within([0.0, 20.0]),
            (.., "v") => is_within([-10.0, 10.0]),
            _ => true,
        }
    }

    fn text(&self) -> String {
        match self.range {
            Some([low, high]) => format!("{low} to {high} {}", self.unit),
            None => self.unit.clone(),
        }
    }
}

/// The units that a header names, the one that is taken first, where there are several and values between these ends may be in another than it.
pub(super) fn several_units(header: &str, taken: &str, ends: Option<[f64; 2]>) -> Option<String> {
    let mut all: Vec<StatedUnit> = vec![];
    for one in named(header).into_iter().chain([StatedUnit { unit: taken.to_owned(), range: None }]) {
        match all.iter_mut().find(|known| is_same(&known.unit, &one.unit)) {
            _ if one.unit.is_empty() => {}
            Some(known) => known.range = known.range.or(one.range),
            None => all.push(one),
        }
    }
    let is_taken = |one: &&StatedUnit| is_same(&one.unit, taken);
    let may_hold = |one: &&StatedUnit| ends.is_none_or(|ends| one.may_hold(ends));
    let is_sure = all.iter().find(is_taken).is_some_and(|one| may_hold(&one))
        && !all.iter().any(|one| !is_taken(&one) && may_hold(&one));
    let texts: Vec<String> = all.iter().map(|one| format!("`{}`", one.text())).collect();
    (all.len() > 1 && !is_sure).then(|| texts.join(" and "))
}

fn is_same(first: &str, second: &str) -> bool {
    let same = |of: fn(&str) -> Option<super::convert::UnitConversion>| of(first).is_some() && of(first) == of(second);
    same(pressure) || same(share) || plain(first) == plain(second)
}

/// All units of a header: behind ranges, and alone in brackets. A number alone is a fact, as in `stroke 250 mm`.
fn named(header: &str) -> Vec<StatedUnit> {
    let is_one = |text: &str| is_unit(text) && (pressure(text).is_some() || share(text).is_some() || is_travel(text));
    let mut found = vec![];
    let inside = |part: &str| part.find([']', ')']).map(|end| part[..end].trim().to_owned());
    let brackets = header.split(['[', '(']).skip(1).filter_map(inside).filter(|text| is_one(text) && text != "-");
    let mut rest = header;
    let mut before = ' ';
    while let Some(letter) = rest.chars().next() {
        let number = (!before.is_alphanumeric()).then(|| leading_number(rest)).flatten();
        let Some((first, behind)) = number else {
            (before, rest) = (letter, &rest[letter.len_utf8()..]);
            continue;
        };
        let both = second_number(behind).or_else(|| Some((-first, behind)).filter(|_| letter == '±'));
        let range = both.map(|(second, _)| [first.min(second), first.max(second)]);
        let behind = both.map_or(behind, |(_, behind)| behind);
        let unit = behind.trim_start_matches([' ', ']', ')', '[', '(', ';', ',']);
        let unit = unit.split(|letter: char| letter.is_whitespace() || "[](){}=;,:".contains(letter)).next();
        if let Some(unit) = unit.filter(|unit| range.is_some() && is_one(unit)) {
            found.push(StatedUnit { unit: unit.to_owned(), range });
        }
        (before, rest) = (' ', behind);
    }
    found.extend(brackets.map(|unit| StatedUnit { unit, range: None }));
    found
}

/// The number that a text begins with, with either decimal sign, and what is behind it.
fn leading_number(text: &str) -> Option<(f64, &str)> {
    let (sign, digits) = match text.strip_prefix(['-', '−', '+', '±']) {
        Some(digits) => (if text.starts_with(['-', '−']) { -1.0 } else { 1.0 }, digits),
        None => (1.0, text),
    };
    let is_part = |(at, letter): (usize, char)| {
        letter.is_ascii_digit()
            || ".,".contains(letter) && digits[at + 1..].starts_with(|next: char| next.is_ascii_digit())
    };
    let end = digits.char_indices().find(|one| !is_part(*one)).map_or(digits.len(), |(at, _)| at);
    let number = digits.get(..end)?.replace(',', ".").parse::<f64>().ok()?;
    Some((sign * number, &digits[end..]))
}

/// The other end of a range, behind the first, and what is behind it.
fn second_number(text: &str) -> Option<(f64, &str)> {
    let text = text.trim_start();
    let all = TO.all().filter_map(|sign| text.strip_prefix(sign));
    let longest = all.min_by_key(|rest| rest.len())?;
    leading_number(longest.trim_start())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_units_of_a_header_are_found() {
        let texts = |header: &str| named(header).iter().map(StatedUnit::text).collect::<Vec<_>>().join("; ");
        for (header, expected) in [
            ("p tank 4-20 mA = 0..100 bar", "4 to 20 mA; 0 to 100 bar"),
            ("p tank [%] (0-160 bar)", "0 to 160 bar; %"),
            ("Spool ±10V [%]", "-10 to 10 V; %"),
            ("spool 4 bis 20 mA = 10..-10 mm", "4 to 20 mA; -10 to 10 mm"),
            ("servo [0,0-0,6 m]", "0 to 0.6 m"),
            ("servo 0 to 100%", "0 to 100 %"),
            ("servo (stroke 250 mm) [%]", "%"),
            ("p tank [0-160] bar", "0 to 160 bar"),
            ("GV1-2 pos 0-100 %", "0 to 100 %"),
            ("Units 3-4 servo [%]", "%"),
            ("servo (0-5 Hz) [%]", "%"),
            ("Pump 2 in [%]", "%"),
            ("Y ist", ""),
            ("油压 0～16 MPa [kPa]", "0 to 16 MPa; kPa"),
        ] {
            assert_eq!(texts(header), expected, "{header}");
        }
    }

    #[test]
    fn a_header_of_several_units_is_sure_only_where_the_values_are_of_one() {
        let asked = |header: &str, taken: &str, ends: [f64; 2]| several_units(header, taken, Some(ends)).is_some();
        for (header, taken, ends, expected) in [
            ("p tank 4-20 mA = 0..100 bar", "bar", [12.0, 15.0], true),
            ("p tank 4-20 mA = 0..100 bar", "bar", [50.0, 63.0], false),
            ("p tank [%] (0-160 bar)", "bar", [31.0, 40.0], true),
            ("servo 0-10 V = 0-100 %", "%", [0.0, 9.8], true),
            ("servo 0-10 V = 0-100 %", "%", [0.1, 98.0], false),
            ("servo (4-20 mA) [%]", "%", [4.5, 19.0], true),
            ("servo (4-20 mA) [%]", "%", [0.0, 100.0], false),
            ("servo [%] (0-100 %)", "%", [0.0, 9.0], false),
            ("servo [%]", "%", [0.0, 9.0], false),
            ("p [bar] 0-160 barg", "bar", [50.0, 60.0], false),
        ] {
            assert_eq!(asked(header, taken, ends), expected, "{header}, {taken}, {ends:?}");
        }
    }
}
