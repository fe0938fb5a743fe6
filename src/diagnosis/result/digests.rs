//! A digest of each section of a report, by which a change shows.

use std::collections::BTreeMap;

use govtwin_files::digest::sha256;
use serde_json::{Value, json};

use super::schema::ReportError;

/// Key of the digests of a report's sections.
pub(super) const DIGESTS: &str = "digests";

/// Keys that have no digest: the digests themselves, and how long it took, which alone differs from run to run.
const WITHOUT: [&str; 2] = [DIGESTS, "seconds"];

/// SHA-256 of each section: of each key, or of those below it.
fn digests(report: &Value) -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    for (key, section) in report.as_object().into_iter().flatten().filter(|(key, _)| !WITHOUT.contains(&key.as_str())) {
        match section {
            Value::Object(below) => {
                all.extend(below.iter().map(|(last, value)| (format!("{key}.{last}"), sha256(value.to_string()))));
            }
            _ => drop(all.insert(key.clone(), sha256(section.to_string()))),
        }
    }
    all
}

/// A report with the digest of each section, by which a change shows.
#[must_use]
pub fn sealed(mut report: Value) -> Value {
    report[DIGESTS] = json!(digests(&report));
    report
}

/// Refuses a report without digests, or with a section that is not the one that was written.
pub(super) fn unchanged(report: &Value) -> Result<(), ReportError> {
    let stated = report[DIGESTS].as_object().ok_or(ReportError::Unsealed)?;
    let found = digests(report);
    for section in stated.keys().chain(found.keys()) {
        let stated = stated.get(section).and_then(Value::as_str).unwrap_or("none").to_owned();
        let found = found.get(section).map_or("none", String::as_str).to_owned();
        if stated != found {
            return Err(ReportError::Changed { section: section.clone(), stated, found });
        }
    }
    Ok(())
}
