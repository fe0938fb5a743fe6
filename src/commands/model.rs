//! A residual model from its file.

use std::path::Path;

use anyhow::Context;
use govtwin_correction::model::Model;
use govtwin_files::read_bytes;

/// Larger files are no models: the largest search space makes some 10 MB.
const LARGEST_BYTES: u64 = 200_000_000;

/// Whether an option asks for no model instead of a file's.
pub fn is_none(path: &Path) -> bool {
    path == Path::new("none")
}

/// Reads a model, whole and sound.
pub fn load(path: &Path) -> anyhow::Result<Model> {
    let reading = || format!("cannot read the model {}", path.display());
    let raw = read_bytes(path, LARGEST_BYTES).with_context(reading)?;
    Model::from_text(&String::from_utf8_lossy(&raw)).with_context(|| path.display().to_string())
}
