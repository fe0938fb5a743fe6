//! Words in times: months, halves of the day and abbreviations of zones.

use std::borrow::Cow;

use jiff::tz::Offset;

use super::zone::offset;
use crate::import::words::Words;

/// Beginnings of the names of months, in the order of the year: English, German, French, Italian, Spanish and Portuguese, Scandinavian, Dutch.
const MONTHS: [(&str, Words); 12] = [
    ("Jan", Words("jan|jän|gen|ene")),
    ("Feb", Words("feb|fév|fev")),
    ("Mar", Words("mar|mär|mrz|maa|mrt")),
    ("Apr", Words("apr|avr|abr")),
    ("May", Words("may|mai|maj|mei|mag")),
    ("Jun", Words("jun|juin|giu")),
    ("Jul", Words("jul|juil|lug")),
    ("Aug", Words("aug|aoû|aou|ago")),
    ("Sep", Words("sep|set")),
    ("Oct", Words("oct|okt|ott|out")),
    ("Nov", Words("nov")),
    ("Dec", Words("dec|dez|déc|dic|des")),
];
/// Halves of the day as people write them besides `AM` and `PM`.
const HALVES: [(&str, Words); 2] =
    [("AM", Words("a. m.|a.m.|a.\u{a0}m.|上午")), ("PM", Words("p. m.|p.m.|p.\u{a0}m.|下午"))];
/// Abbreviations of zones that mean one offset alone, h.
const ZONES: [(i8, Words); 8] = [
    (0, Words("UTC|GMT|WET")),
    (1, Words("WEST|CET|MEZ")),
    (2, Words("CEST|MESZ|EET")),
    (3, Words("EEST")),
    (9, Words("JST")),
    (-4, Words("EDT")),
    (-6, Words("MDT")),
    (-7, Words("PDT")),
];

/// The same with the names of months and halves of the day in English, short.
pub(super) fn english(text: &str) -> String {
    let halves = HALVES.iter().flat_map(|(half, words)| words.all().map(move |of_others| (of_others, half)));
    let text = halves.fold(text.to_owned(), |text, (of_others, half)| {
        if text.to_lowercase().contains(of_others) { text.to_lowercase().replace(of_others, half) } else { text }
    });
    let mut out = String::with_capacity(text.len());
    let mut word = String::new();
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        if letter.is_alphabetic() {
            word.push(letter);
            if letters.peek().is_some_and(|next| next.is_alphabetic()) {
                continue;
            }
            let lower = word.to_lowercase();
            let month = MONTHS.iter().find(|(_, begins)| begins.all().any(|begin| lower.starts_with(begin)));
            out.push_str(month.map_or(&word, |(month, _)| month));
            // A point behind an abbreviation.
            if month.is_some() {
                letters.next_if_eq(&'.');
            }
            word.clear();
        } else if letter == '.' && letters.peek() == Some(&' ') {
            // A point behind the number of a day.
        } else {
            out.push(letter);
        }
    }
    out
}

/// The offset that a word alone means: an abbreviation such as `CEST`, or what states it, as `UTC+0200` does.
pub(super) fn offset_of(word: &str) -> Option<Offset> {
    let hours = ZONES.iter().find(|(_, zones)| zones.has(word)).map(|(hours, _)| *hours);
    hours.map_or_else(|| offset(word), |hours| Offset::from_hours(hours).ok())
}

/// A local time and the offset that the word behind it means; a year may stand behind that.
pub(super) fn with_zone(text: &str) -> Option<(Cow<'_, str>, Offset)> {
    let (local, word) = parted(text)?;
    Some((local, offset_of(word)?))
}

/// A local time and the abbreviation of a zone behind it that means several offsets, or none that is known.
pub(super) fn with_unknown_zone(text: &str) -> Option<(Cow<'_, str>, &str)> {
    parted(text).filter(|(_, word)| offset_of(word).is_none())
}

/// A time and the word behind it that may be a zone: an offset, or capitals that may be an abbreviation.
fn parted(text: &str) -> Option<(Cow<'_, str>, &str)> {
    const BLANKS: [char; 2] = [' ', '\u{a0}'];
    let is_zone = |local: &str, word: &str| {
        let is_month = MONTHS.iter().any(|(_, begins)| begins.has(&word.to_lowercase()));
        let letters = (2..=5).contains(&word.len()) && word.bytes().all(|byte| byte.is_ascii_uppercase());
        letters && !is_month && !["AM", "PM"].contains(&word) || local.contains(':') && offset(word).is_some()
    };
    let (local, word) = text.trim_end().rsplit_once(BLANKS)?;
    let zone = word.trim_matches(['(', ')', '[', ']']);
    if is_zone(local, zone) {
        let local = local.trim_end();
        // `UTC +02:00` in two words.
        let of_offset = local.strip_suffix("UTC").or_else(|| local.strip_suffix("GMT"));
        return Some((Cow::Borrowed(of_offset.map_or(local, str::trim_end)), zone));
    }
    let year = Some(word).filter(|word| word.len() == 4 && word.bytes().all(|byte| byte.is_ascii_digit()))?;
    let (local, word) = local.rsplit_once(BLANKS).filter(|(local, word)| is_zone(local, word))?;
    Some((Cow::Owned(format!("{} {year}", local.trim_end())), word))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn months_and_halves_of_the_day_are_english() {
        for (text, expected) in [
            ("22. Mai 2026 18:38:20.5", "22 May 2026 18:38:20.5"),
            ("22-Okt-26 18:38:20", "22-Oct-26 18:38:20"),
            ("22 sept. 2026 18:38", "22 Sep 2026 18:38"),
            ("1 de août 2026", "1 de Aug 2026"),
            ("05/13/2024 1:00:00 p. m.", "05/13/2024 1:00:00 PM"),
            ("5/13/2024 1:00:00 PM", "5/13/2024 1:00:00 PM"),
        ] {
            assert_eq!(english(text), expected);
        }
        assert_eq!(with_zone("2026-09-22 18:38:20 CEST").unwrap().1.seconds(), 7200);
        assert!(with_zone("2026-09-22 18:38:20").is_none());
        let (local, offset) = with_zone("Tue Sep 22 18:38:20 EDT 2026").unwrap();
        assert_eq!((local.as_ref(), offset.seconds()), ("Tue Sep 22 18:38:20 2026", -4 * 3600));
        for zone in ["UTC+0200", "UTC+02:00", "(UTC+2)", "UTC +02:00", "+02:00", "+0200"] {
            let text = format!("22.09.2026 18:38:20 {zone}");
            let (local, offset) = with_zone(&text).unwrap();
            assert_eq!((local.as_ref(), offset.seconds()), ("22.09.2026 18:38:20", 7200), "{zone}");
        }
        assert_eq!(with_unknown_zone("22.09.2026 18:38:20 IST").unwrap().1, "IST");
        for text in ["22.09.2026 18:38:20 CEST", "09/22/2026 6:38:20 PM", "22-SEP-26", "22 SEP 2026"] {
            assert!(with_unknown_zone(text).is_none(), "{text}");
        }
    }
}
