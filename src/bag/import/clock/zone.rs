//! Zones of local times by name or offset.

use jiff::tz::{self, Offset, TimeZone};

/// A zone by its name, or a fixed offset such as `UTC+1` or `+05:30`.
pub(super) fn zone(text: &str) -> Result<TimeZone, String> {
    let rest = text.trim().trim_start_matches("UTC").trim_start_matches("GMT");
    if rest.is_empty() || rest == "Z" {
        return Ok(TimeZone::UTC);
    }
    let sign = match rest.as_bytes().first() {
        Some(b'+') => 1,
        Some(b'-') => -1,
        _ => return named_zone(text),
    };
    let (hours, minutes) = rest[1..].split_once(':').unwrap_or((&rest[1..], "0"));
    let number = |text: &str| text.parse::<i32>().ok().filter(|number| (0..60).contains(number));
    let offset = number(hours).zip(number(minutes)).map(|(hours, minutes)| sign * (3600 * hours + 60 * minutes));
    let offset = offset.and_then(|seconds| Offset::from_seconds(seconds).ok());
    offset.map(TimeZone::fixed).ok_or_else(|| format!("time.zone: expected an offset such as +01:00, found `{text}`"))
}

/// The zone that the name of a column of time states as universal time or by its offset: `Time (UTC+02:00)`, `Time UTC`.
pub(in crate::import) fn of_header(name: &str) -> Option<String> {
    let name = name.trim();
    let inside = name.strip_suffix([')', ']']).and_then(|rest| rest.rsplit_once(['(', '['])).map(|(_, inside)| inside);
    let stated = inside.or_else(|| name.rsplit([' ', '_']).next())?;
    let stated = stated.to_uppercase().replace([' ', '\u{a0}'], "").replace('\u{2212}', "-");
    let rest = stated.strip_prefix("UTC").or_else(|| stated.strip_prefix("GMT"))?;
    let is_offset = rest.is_empty() || rest.starts_with(['+', '-']);
    (is_offset && zone(&stated).is_ok()).then_some(stated)
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
            ("Time (local)", None),
            ("Time (UTC or local)", None),
            ("Time (UTC+99)", None),
            ("Zeit", None),
        ] {
            assert_eq!(of_header(name).as_deref(), stated, "{name}");
        }
    }
}
