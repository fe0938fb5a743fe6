//! Ranges that headers state, as `[0..250 mm]` and `4-20 mA = -10..10 mm`.

use std::fmt;

use super::convert::is_unit;

/// A range and its unit as a header writes it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StatedRange<'a> {
    /// Its ends, in the unit.
    pub ends: [f64; 2],
    /// The unit.
    pub unit: &'a str,
}

impl StatedRange<'_> {
    /// Whether all values between two lie in it, or hardly beyond.
    pub fn holds(&self, [least, most]: [f64; 2]) -> bool {
        let [low, high] = self.ends;
        let beyond = 0.05 * (high - low).abs();
        least >= low.min(high) - beyond && most <= low.max(high) + beyond
    }
}

impl fmt::Display for StatedRange<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ([low, high], unit) = (self.ends, self.unit);
        write!(f, "{low}..{high} {unit}")
    }
}

/// All ranges in the name of a column, in its order.
pub fn ranges(name: &str) -> Vec<StatedRange<'_>> {
    name.split(['[', ']', '(', ')', '=', ';', '\u{2192}']).filter_map(range_at_end).collect()
}

/// The range that a text ends with: two numbers with points, a dash or `to` between them, or one behind `±`, and a unit.
pub fn range_at_end(text: &str) -> Option<StatedRange<'_>> {
    let text = text.trim();
    let behind_digit = |(at, letter): (usize, char)| {
        let unit = text[at + letter.len_utf8()..].trim_start();
        (letter.is_ascii_digit() && is_unit(unit)).then(|| (&text[..=at], unit))
    };
    let (numbers, unit) = text.char_indices().rev().find_map(behind_digit)?;
    let numbers = [" to ", " bis ", "\u{2026}", "~"].iter().fold(numbers.to_owned(), |text, to| text.replace(to, ".."));
    let numbers = numbers.replace(['\u{2212}', '\u{2013}', '\u{2014}'], "-").replace(',', ".");
    let numbers = numbers.rsplit(|letter: char| !letter.is_ascii_digit() && !" .+-\u{b1}".contains(letter)).next()?;
    let number = |text: &str| text.trim().trim_matches('.').parse::<f64>().ok();
    let ends = if let Some((_, most)) = numbers.rsplit_once('\u{b1}') {
        [-number(most)?, number(most)?]
    } else {
        // A dash behind a digit is no sign.
        let is_dash = |at: usize| numbers[..at].trim_end().ends_with(|letter: char| letter.is_ascii_digit());
        let dash = || numbers.match_indices('-').map(|(at, _)| at).find(|at| is_dash(*at));
        let (low, high) = match numbers.split_once("..") {
            Some(parts) => parts,
            None => dash().map(|at| (&numbers[..at], &numbers[at + 1..]))?,
        };
        [number(low.trim_end().rsplit(' ').next()?)?, number(high)?]
    };
    (ends[0] != ends[1]).then_some(StatedRange { ends, unit })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_as_people_write_them() {
        for (name, expected) in [
            ("Guide vane [0..250 mm]", &["0..250 mm"][..]),
            ("Servo (0-100 %)", &["0..100 %"]),
            ("Servo (0–100%)", &["0..100 %"]),
            ("Spool 4-20 mA = -10..10 mm", &["4..20 mA", "-10..10 mm"]),
            ("Spool [\u{b1}10 V]", &["-10..10 V"]),
            ("Spool [-10 - +10 V]", &["-10..10 V"]),
            ("Y 1 0 to 0,6 m", &["0..0.6 m"]),
            ("p [0…160 bar]", &["0..160 bar"]),
            ("p (0-160 kg/cm2)", &["0..160 kg/cm2"]),
            ("p [0.1 bar]", &[]),
            ("p 2 bar", &[]),
            ("MEB10 CG-001 mm", &[]),
            ("Y-2 [mm]", &[]),
        ] {
            assert_eq!(ranges(name).iter().map(ToString::to_string).collect::<Vec<_>>(), expected, "{name}");
        }
        let range = range_at_end("0..250 mm").unwrap();
        assert!(range.holds([-3.0, 255.0]) && !range.holds([-3.0, 300.0]));
    }
}
