//! Parts of the second behind a colon, as some control systems write them: `18:05:00:000`.

use std::borrow::Cow;

/// Where the colon before a part of the second stands, and the part: three digits and more are no seconds, and fewer stand behind seconds alone.
pub(super) fn part(text: &str) -> Option<(usize, &str)> {
    text.match_indices(':').find_map(|(at, _)| {
        let behind = &text[at + 1..];
        let digits = behind.bytes().take_while(u8::is_ascii_digit).count();
        let time = text[..at].rsplit(|letter: char| !letter.is_ascii_digit() && letter != ':').next()?;
        let fields = time.split(':').map(str::len);
        let is_time = fields.clone().all(|len| (1..=2).contains(&len));
        let is_part = match fields.count() {
            3 => digits > 0,
            2 => digits > 2,
            _ => false,
        };
        (is_time && is_part).then(|| (at, &behind[..digits]))
    })
}

/// The time with a point before its part of the second; up to three digits are milliseconds.
pub(super) fn with_point(text: &str) -> Cow<'_, str> {
    match part(text) {
        Some((at, part)) => {
            let (before, behind) = (&text[..at], &text[at + 1 + part.len()..]);
            format!("{before}.{part:0>3}{behind}").into()
        }
        None => Cow::Borrowed(text),
    }
}

/// What to say of times whose parts of the second may be meant two ways: they have neither three digits, six or nine each, nor up to three.
pub(super) fn unclear<'a>(texts: impl Iterator<Item = &'a str>) -> Option<String> {
    let parts: Vec<&str> = texts.filter_map(part).map(|(_, part)| part).collect();
    let most = parts.iter().map(|part| part.len()).max()?;
    let clear = most == 3 || [6, 9].contains(&most) && parts.iter().all(|part| part.len() == most);
    (!clear).then(|| {
        format!(
            "the part of the second behind the last colon has up to {most} digits: milliseconds, or a fraction? export it with three digits, or give \
             a pattern such as `time: {{format: \"%H:%M:%S:%f\"}}` in the map where it is a fraction"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_of_the_second_gets_its_point() {
        for (text, expected) in [
            ("18:05:00:000", "18:05:00.000"),
            ("18:05:00:40", "18:05:00.040"),
            ("22.09.2026 8:05:00:125 PM", "22.09.2026 8:05:00.125 PM"),
            ("2026-09-22T18:05:00:125000+02:00", "2026-09-22T18:05:00.125000+02:00"),
            ("05:00:125", "05:00.125"),
            // An offset, a day of the year, a whole second.
            ("2026-09-22 18:05:00+02:00", "2026-09-22 18:05:00+02:00"),
            ("2026:265:18:05:00.5", "2026:265:18:05:00.5"),
            ("18:05:00", "18:05:00"),
        ] {
            assert_eq!(with_point(text), expected);
        }
    }

    #[test]
    fn digits_that_may_be_meant_two_ways_are_asked_about() {
        for (texts, clear) in [
            (["18:05:00:000", "18:05:00:040"], true),
            (["18:05:00:0", "18:05:00:125"], true),
            (["18:05:00:000000", "18:05:00:040000"], true),
            (["18:05:00:00", "18:05:00:04"], false),
            (["18:05:00:0", "18:05:00:40000"], false),
            (["18:05:00", "18:05:01"], true),
        ] {
            assert_eq!(unclear(texts.into_iter()).is_none(), clear, "{texts:?}");
        }
    }
}
