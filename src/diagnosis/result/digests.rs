//! A digest of each section of a report, by which a change shows.

use std::collections::BTreeMap;

use govtwin_files::digest::sha256;
use serde_json::{Value, json};

use super::schema::ReportError;

/// Key of the digests of a report's sections.
pub(super) const DIGESTS: &str = "digests";

/// Keys that have no digest: the digests themselves, and how long it took, which alone differs from run to run.
const WITHOUT: [&str; 2] = [DIGESTS, "seconds"];

/// Whole numbers below this are floats as well, to the last digit.
const WHOLE: f64 = 9_007_199_254_740_992.0;

/// SHA-256 of each section: of each key, or of those below it.
fn digests(report: &Value) -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    for (key, section) in report.as_object().into_iter().flatten().filter(|(key, _)| !WITHOUT.contains(&key.as_str())) {
        match section {
            Value::Object(below) => {
                all.extend(below.iter().map(|(last, value)| (format!("{key}.{last}"), digest(value))));
            }
            _ => drop(all.insert(key.clone(), digest(section))),
        }
    }
    all
}

/// SHA-256 of a value, however its numbers are written: 1.0 and 1 are the same.
fn digest(value: &Value) -> String {
    fn plain(value: &Value) -> Value {
        match value {
            Value::Number(number) => {
                let number = number.as_f64().filter(|number| number.abs() < WHOLE);
                number.map_or_else(|| value.clone(), |number| json!(number))
            }
            Value::Array(all) => all.iter().map(plain).collect(),
            Value::Object(all) => all.iter().map(|(key, value)| (key.clone(), plain(value))).collect(),
            _ => value.clone(),
        }
    }
    sha256(plain(value).to_string())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_programs_may_write_numbers_otherwise_but_not_other_numbers() {
        let written = sealed(json!({"size": 2.0, "rows": [{"low": 1000.0, "name": "a"}]})).to_string();
        let read = |from: &str, to: &str| unchanged(&serde_json::from_str(&written.replace(from, to)).unwrap());
        assert!(read("2.0", "2").is_ok() && read("1000.0", "1e3").is_ok());
        assert!(read("2.0", "2.5").is_err() && read("1000.0", "1001").is_err() && read("\"a\"", "\"b\"").is_err());
    }
}
