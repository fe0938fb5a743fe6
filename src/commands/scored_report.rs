//! Reading reports to be scored: of a bounded size, of this schema, and nothing in them is more than data.

use std::path::Path;

use anyhow::{Context, bail};
use govtwin::benchmark::report_verdict::ReportVerdict;
use govtwin::diagnosis::result::schema::SCHEMA;

use super::report_file;

/// Reads a report.
pub fn read(path: &Path) -> anyhow::Result<ReportVerdict> {
    check(&report_file::text(path)?).with_context(|| path.display().to_string())
}

/// What the text of a report says. One without a schema is a baseline's, which `govtwin blind` writes itself.
fn check(text: &str) -> anyhow::Result<ReportVerdict> {
    #[derive(serde::Deserialize)]
    struct Head {
        schema: Option<String>,
    }
    let report = ReportVerdict::read(text)?;
    let head: Head = serde_json::from_str(text)?;
    if let Some(found) = head.schema.filter(|found| found != SCHEMA) {
        bail!("expected a report of the schema {SCHEMA}, found `{found}`; was it made by another version?");
    }
    Ok(report)
}

#[cfg(test)]
mod tests {
    use super::check;

    #[test]
    fn reports_of_another_schema_or_without_a_verdict_are_refused() {
        assert!(check(r#"{"schema": "govtwin-diagnosis/1", "verdict": "unknown"}"#).is_ok());
        assert!(check(r#"{"verdict": "unknown"}"#).is_ok());
        let error = check(r#"{"schema": "govtwin-diagnosis/2", "verdict": "unknown"}"#).unwrap_err().to_string();
        assert!(error.contains("schema govtwin-diagnosis/1, found `govtwin-diagnosis/2`"), "{error}");
        assert!(check(r#"{"schema": "govtwin-diagnosis/1"}"#).is_err());
        // Nesting without end is no report either.
        assert!(check(&format!("{{\"verdict\": {}", "[".repeat(1 << 20))).is_err());
    }
}
