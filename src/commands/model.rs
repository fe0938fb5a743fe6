//! A residual model from its file.

use std::path::Path;

use anyhow::Context;
use govtwin::residual::model::Model;

/// Larger files are no models: the largest search space makes some 10 MB.
const LARGEST_BYTES: u64 = 200_000_000;

/// Reads a model, whole and sound.
pub fn load(path: &Path) -> anyhow::Result<Model> {
    let reading = || format!("cannot read the model {}", path.display());
    let bytes = path.metadata().with_context(reading)?.len();
    anyhow::ensure!(bytes <= LARGEST_BYTES, "{}: {bytes} bytes; a model has at most {LARGEST_BYTES}", path.display());
    let raw = std::fs::read(path).with_context(reading)?;
    Model::from_text(&String::from_utf8_lossy(&raw)).with_context(|| path.display().to_string())
}
