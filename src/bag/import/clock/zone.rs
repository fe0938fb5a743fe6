//! Zones of local times by name or offset.

use jiff::tz::{self, Offset, TimeZone};

/// Zones lie less than so many hours from universal time.
const BEYOND_H: i32 = 15;

/// A zone by its name, or a fixed offset.
pub(super) fn zone(text: &str) -> Result<TimeZone, String> {
    match offset(text) {
        Some(offset) => Ok(TimeZone::fixed(offset)),
        None if text.trim().trim_start_matches("UTC").trim_start_matches("GMT").starts_with(['+', '-', '\u{2212}']) => {
            Err(format!("time.zone: expected an offset such as +01:00, found `{text}`"))
        }
        None => named_zone(text),
    }
}

/// The offset that a text states: `UTC`, `UTC+1`, `GMT-0330`, `+05:30`.
pub(super) fn offset(text: &str) -> Option<Offset> {
    let text = text.trim().replace('\u{2212}', "-");
    let rest = text.strip_prefix("UTC").or_else(|| text.strip_prefix("GMT")).unwrap_or(&text).trim_start();
    if rest == "Z" || (rest.is_empty() && !text.is_empty()) {
        return Some(Offset::UTC);
    }
    let digits = rest.strip_prefix(['+', '-']).filter(|digits| digits.is_ascii())?;
    let (hours, minutes) = match digits.split_once(':') {
        Some(parts) => parts,
        None if digits.len() == 4 => digits.split_at(2),
        None => (digits, "0"),
    };
    let number = |text: &str, beyond: i32| -> Option<i32> {
        let is_number = text.bytes().all(|byte| byte.is_ascii_digit());
        text.parse().ok().filter(|number| is_number && *number < beyond)
    };
    let seconds = 3600 * number(hours, BEYOND_H)? + 60 * number(minutes, 60)?;
    Offset::from_seconds(if rest.starts_with('-') { -seconds } else { seconds }).ok()
}

/// The zone that the name of a column of time states as universal time or by its offset: `Time (UTC+02:00)`, `Time UTC`.
pub(in crate::import) fn of_header(name: &str) -> Option<String> {
    let name = name.to_uppercase();
    let at = ["UTC", "GMT"].into_iter().filter_map(|zone| name.rfind(zone)).max()?;
    let stated = name[at..].replace([' ', '\u{a0}'], "").replace('\u{2212}', "-");
    let stated = stated.trim_end_matches([')', ']']);
    (!name[..at].ends_with(char::is_alphanumeric) && offset(stated).is_some()).then(|| stated.to_owned())
}

fn named_zone(text: &str) -> Result<TimeZone, String> {
    TimeZone::get(text).map_err(|_| {
        let names: Vec<String> = tz::db().available().map(|name| name.as_str().to_owned()).collect();
        let near = names.iter().max_by(|a, b| {
            let likeness = |name: &str| strsim::jaro_winkler(&text.to_lowercase(), &name.to_lowercase());
            likeness(a).total_cmp(&likeness(b))
        });
        let hint = near.map_or(String::new(), |near| format!("did you mean `{near}`? "));
        format!("time.zone: there is no zone `{text}`; {hint}expected a name such as Europe/Zurich, or an offset such as +01:00")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_state_zones_by_offsets_alone() {
        for (name, stated) in [
            ("Time (UTC+02:00)", Some("UTC+02:00")),
            ("Timestamp (UTC)", Some("UTC")),
            ("Zeit [utc -3]", Some("UTC-3")),
            ("time_utc", Some("UTC")),
            ("Time (UTC+0200)", Some("UTC+0200")),
            ("Time UTC +0200", Some("UTC+0200")),
            ("Zeit (lokal, GMT-0330)", Some("GMT-0330")),
            ("Time (local)", None),
            ("Time (UTC or local)", None),
            ("Time (UTC+99)", None),
            ("Zeit", None),
        ] {
            assert_eq!(of_header(name).as_deref(), stated, "{name}");
        }
    }

    #[test]
    fn offsets_are_read_with_colons_and_without() {
        for (text, minutes) in [
            ("UTC", Some(0)),
            ("Z", Some(0)),
            ("UTC+0200", Some(120)),
            ("UTC +02:00", Some(120)),
            ("GMT+2", Some(120)),
            ("+02", Some(120)),
            ("-0330", Some(-210)),
            ("\u{2212}03:30", Some(-210)),
            ("+2026", None),
            ("+120", None),
            ("2", None),
            ("+", None),
            ("", None),
            ("CET", None),
        ] {
            assert_eq!(offset(text).map(|offset| offset.seconds() / 60), minutes, "{text}");
        }
    }
}
