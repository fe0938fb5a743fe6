//! Numbers as tables write them: decimal comma, groups of digits, and times without a rounded digit.

use std::borrow::Cow;

use super::words::Words;

/// Texts that stand for no value everywhere, in lower case; `#NV` is Excel's German `#N/A`.
const MISSING: Words =
    Words("nan|na|n/a|null|none|-|--|---|#n/a|#nv|#value!|#wert!|bad|no data|nodata|missing|undefined|nul|<null>");

/// Signs before the exponent of a number of double precision, `1.5D-03`.
const FORTRAN: [char; 2] = ['D', 'd'];
/// More digits than any time has.
const MOST_DIGITS: usize = 24;

/// How numbers are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Numbers {
    pub(super) decimal: char,
    pub(super) thousands: Option<char>,
    /// Further texts that stand for no value.
    pub(super) missing: Vec<String>,
}

/// What a cell holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum NumberCell {
    /// Nothing.
    Missing,
    /// A number, finite.
    Number(f64),
    /// Something else.
    Other,
}

impl Numbers {
    pub(super) fn is_missing(&self, text: &str) -> bool {
        let short = text.len() <= 10;
        text.is_empty()
            || (short && MISSING.has(&text.to_ascii_lowercase()))
            || self.missing.iter().any(|missing| missing == text)
    }

    /// A cell as a number; blanks round it do not count.
    pub(super) fn cell(&self, text: &str) -> NumberCell {
        let text = text.trim();
        // Digits begin nearly every cell, and no other text that Rust would take for a number.
        let begins = text
            .chars()
            .next()
            .is_some_and(|letter| letter.is_ascii_digit() || "+-.,'(=".contains(letter) || is_minus(letter));
        if begins
            && !self.missing.iter().any(|missing| missing == text)
            && let Ok(number) = self.plain(text).parse::<f64>()
            && number.is_finite()
        {
            return NumberCell::Number(number);
        }
        if self.is_missing(text) { NumberCell::Missing } else { NumberCell::Other }
    }

    /// The text with a decimal point, a plain minus sign before it, and without groups.
    pub(super) fn plain<'a>(&self, text: &'a str) -> Cow<'a, str> {
        let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"+-.,:".contains(&byte);
        let simple = text.bytes().all(is_plain) && !text.ends_with('-') && !text.contains(FORTRAN);
        if simple && self.decimal == '.' && self.thousands.is_none() {
            return Cow::Borrowed(text);
        }
        let text = if simple { text.to_owned() } else { self.respelled(text) };
        let mut plain = String::with_capacity(text.len());
        for letter in text.chars() {
            if letter == self.decimal {
                plain.push('.');
            } else if letter == '.' && self.thousands != Some('.') {
                // A point where the comma is the decimal sign is no number.
                plain.push('?');
            } else if Some(letter) != self.thousands {
                plain.push(letter);
            }
        }
        Cow::Owned(plain)
    }

    /// Signs and groups of digits as they can mean one thing alone: minus signs of typography, a minus behind the number or brackets round it,
    /// the apostrophe that spreadsheets put before text, exponents behind a `D`, and blanks or apostrophes between groups of three digits.
    fn respelled(&self, text: &str) -> String {
        let text = text.trim();
        // A formula of a spreadsheet that is one text: `="70.8"`.
        let text = text.strip_prefix('=').map_or(text, |rest| rest.trim_matches('"'));
        let text = text.strip_prefix('\'').filter(|rest| !rest.is_empty()).unwrap_or(text);
        let inside = text.strip_prefix('(').and_then(|rest| rest.strip_suffix(')'));
        let behind =
            text.strip_suffix(is_minus).filter(|rest| rest.starts_with(|letter: char| letter.is_ascii_digit()));
        let (text, minus) = match inside.or(behind) {
            Some(number) => (number.trim(), "-"),
            None => (text, ""),
        };
        let letters: Vec<char> = text.chars().collect();
        let digits = |from: usize| letters.iter().skip(from).take_while(|letter| letter.is_ascii_digit()).count();
        let mut plain = String::from(minus);
        for (k, letter) in letters.iter().enumerate() {
            let between = k > 0 && letters[k - 1].is_ascii_digit() && digits(k + 1) == 3;
            if (is_blank(*letter) || is_apostrophe(*letter)) && between && *letter != self.decimal {
                continue;
            }
            let is_exponent = FORTRAN.contains(letter) && k > 0 && matches!(letters[k - 1], '0'..='9' | '.' | ',');
            plain.push(match letter {
                _ if is_exponent => 'e',
                _ if is_minus(*letter) => '-',
                _ => *letter,
            });
        }
        // A sign may stand apart from its number.
        match plain.strip_prefix('-').map(str::trim_start) {
            Some(number) => format!("-{number}"),
            None => plain,
        }
    }
}

/// Hyphen, minus, dashes and their wide forms.
fn is_minus(letter: char) -> bool {
    matches!(
        letter,
        '-' | '\u{ad}' | '\u{2010}'
            ..='\u{2015}' | '\u{207b}' | '\u{2212}' | '\u{2796}' | '\u{fe58}' | '\u{fe63}' | '\u{ff0d}'
    )
}

/// The sign between groups of three digits of a number that has a decimal sign behind them, so that it can be nothing else.
pub(super) fn groups(text: &str, decimal: char) -> Option<char> {
    let group = if decimal == ',' { '.' } else { ',' };
    let text = text.trim().trim_start_matches(|letter| is_minus(letter) || letter == '+');
    let (whole, part) = text.split_once(decimal)?;
    let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    let mut parts = whole.split(group);
    let first = parts.next().filter(|first| is_digits(first) && first.len() <= 3)?;
    let rest: Vec<&str> = parts.collect();
    let grouped = !rest.is_empty() && rest.iter().all(|part| is_digits(part) && part.len() == 3);
    (grouped && is_digits(part) && !first.is_empty()).then_some(group)
}

/// Blanks of all widths.
fn is_blank(letter: char) -> bool {
    matches!(letter, ' ' | '\u{a0}' | '\u{2000}'..='\u{200a}' | '\u{202f}' | '\u{205f}' | '\u{3000}')
}

fn is_apostrophe(letter: char) -> bool {
    matches!(letter, '\'' | '\u{2019}' | '\u{2bc}' | '\u{b4}')
}

/// A decimal number in units of so many ns, as whole ns to the nearest, without a detour through floating point.
pub(super) fn decimal_ns(text: &str, unit_ns: i128) -> Option<i64> {
    decimal(text, unit_ns).and_then(|total| i64::try_from(total).ok())
}

/// The same where the ns are counted from a zero so long ago that they have no room in 64 bits.
pub(super) fn decimal(text: &str, unit_ns: i128) -> Option<i128> {
    let text = text.trim();
    let (text, sign) = match text.as_bytes().first()? {
        b'-' => (&text[1..], -1),
        b'+' => (&text[1..], 1),
        _ => (text, 1_i128),
    };
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    if whole.is_empty() && fraction.is_empty() {
        return None;
    }
    let mut value: i128 = 0;
    let mut places = exponent;
    for (kept, (k, byte)) in whole.bytes().chain(fraction.bytes()).enumerate().enumerate() {
        if !byte.is_ascii_digit() {
            return None;
        }
        let behind = k >= whole.len();
        if kept < MOST_DIGITS {
            value = value * 10 + i128::from(byte - b'0');
            places -= i32::from(behind);
        } else {
            places += i32::from(!behind);
        }
    }
    let mut divide: i128 = 1;
    while places < 0 {
        if divide > 10_i128.pow(28) {
            value /= 10;
        } else {
            divide *= 10;
        }
        places += 1;
    }
    for _ in 0..places {
        value = value.checked_mul(10)?;
    }
    // The rest has no more than 24 digits, which a day in ns takes to 38: just what there is room for.
    let (units, rest) = (value / divide, value % divide);
    let part = (rest.checked_mul(unit_ns)?.checked_add(divide / 2)?) / divide;
    let total = units.checked_mul(unit_ns)?.checked_add(part)?;
    Some(sign * total)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_every_country_are_read() {
        let numbers = |decimal, thousands| Numbers { decimal, thousands, missing: vec!["Bad Input".into()] };
        for (decimal, thousands, text, value) in [
            ('.', None, " 1.5e-3 ", 1.5e-3),
            (',', None, "-0,25", -0.25),
            (',', Some('.'), "1.234.567,5", 1_234_567.5),
            ('.', Some(','), "1,234.5", 1234.5),
            ('.', Some('\''), "1'234.5", 1234.5),
            (',', Some(' '), "1\u{a0}234,5", 1234.5),
            ('.', None, ".5", 0.5),
            (',', None, "3E+2", 300.0),
            ('.', None, "\u{2212}0.134", -0.134),
            (',', None, "\u{2013}0,5", -0.5),
            ('.', None, "\u{2014}0.5", -0.5),
            ('.', None, "\u{2796}0.5", -0.5),
            ('.', None, "\u{ad}0.5", -0.5),
            ('.', None, "'-2.00", -2.0),
            ('.', None, "'2.00", 2.0),
            ('.', None, "=\"-2.00\"", -2.0),
            ('.', None, "12.5-", -12.5),
            ('.', None, "(12.5)", -12.5),
            ('.', None, "- 12.5", -12.5),
            (',', None, "6\u{202f}323,0", 6323.0),
            (',', Some(' '), "6\u{202f}323,0", 6323.0),
            (',', None, "1 234 567,25", 1_234_567.25),
            ('.', None, "6\u{2019}323.0", 6323.0),
            ('.', None, "6'323", 6323.0),
            ('.', None, "1e-3", 1e-3),
            ('.', None, "-0.15D-02", -1.5e-3),
            ('.', None, "1.d+3", 1000.0),
            (',', None, "1,5D02", 150.0),
        ] {
            assert_eq!(numbers(decimal, thousands).cell(text), NumberCell::Number(value), "{text}");
        }
        for text in ["", "NaN", "#N/A", "Bad", "Bad Input", "-", " null "] {
            assert_eq!(numbers('.', None).cell(text), NumberCell::Missing, "{text}");
        }
        for text in [
            "1,5",
            "abc",
            "1.2.3",
            "inf",
            "0x10",
            "12:30",
            "1 23",
            "1'2",
            "1D",
            "0xD3",
            "2024-05-02",
            "5-6",
            "1 234 56",
        ] {
            assert_eq!(numbers('.', None).cell(text), NumberCell::Other, "{text}");
        }
        assert_eq!(numbers(',', None).cell("1.5"), NumberCell::Other, "a point beside a decimal comma");
    }

    #[test]
    fn groups_are_seen_before_a_decimal_sign_alone() {
        for (text, decimal, group) in [
            ("6.323,0", ',', Some('.')),
            ("-1,234,567.25", '.', Some(',')),
            ("6,323", '.', None),
            ("6,32.5", '.', None),
            ("6323.5", '.', None),
            ("1,2345.5", '.', None),
        ] {
            assert_eq!(groups(text, decimal), group, "{text}");
        }
    }

    #[test]
    fn times_keep_every_digit() {
        const S: i128 = 1_000_000_000;
        for (text, unit_ns, ns) in [
            ("1700000000.123456789", S, 1_700_000_000_123_456_789),
            ("1.700000000123456789e9", S, 1_700_000_000_123_456_789),
            ("1700000000123", 1_000_000, 1_700_000_000_123_000_000),
            ("-0.5", S, -500_000_000),
            ("0.0000000004", S, 0),
            ("0.0000000005", S, 1),
            ("45000.5", 86_400 * S, 3_888_043_200_000_000_000),
            ("7.35e5", 1, 735_000),
            ("0.33333333333333333333333333333333333333", 86_400 * S, 28_800_000_000_000),
        ] {
            assert_eq!(decimal_ns(text, unit_ns), Some(ns), "{text}");
        }
        for text in ["", "-", ".", "1e400", "abc", "1:2", "99999999999999999999"] {
            assert_eq!(decimal_ns(text, S), None, "{text}");
        }
    }
}
