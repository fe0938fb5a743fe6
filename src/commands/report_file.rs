//! What a report of a diagnosis was made from, read back within bounds.

use std::path::Path;

use anyhow::Context;
use govtwin::files::read_text;
use govtwin::provenance::Provenance;

/// More than a report of one unit has with all its evidence.
pub const LARGEST_BYTES: u64 = 1 << 24;

/// What a report was made from; none where it does not say.
pub fn provenance(path: &Path) -> anyhow::Result<Option<Provenance>> {
    #[derive(serde::Deserialize)]
    struct Made {
        provenance: Option<Provenance>,
    }
    let text = read_text(path, LARGEST_BYTES).with_context(|| format!("cannot read {}", path.display()))?;
    let made: Made = serde_json::from_str(&text).with_context(|| path.display().to_string())?;
    Ok(made.provenance)
}
