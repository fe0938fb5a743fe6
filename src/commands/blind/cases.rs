//! The units of a folder, and their recordings.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use govtwin::bag::{self, ReadOptions};
use govtwin::effects::{EffectSpec, of_the_chain};
use govtwin::recording::Recording;

use crate::commands::bags::{self, Bag};

/// One unit to diagnose.
#[derive(Clone, Debug)]
pub struct Case {
    /// Name of its folder.
    pub name: String,
    /// Its folder.
    pub dir: PathBuf,
    /// An effect that the catalogue lacks for this unit.
    pub without: Option<String>,
}

/// Every folder in a folder that holds bags, by name.
pub fn find(dir: &Path) -> anyhow::Result<Vec<Case>> {
    let mut cases = vec![];
    let entries = dir.read_dir().with_context(|| format!("cannot read the folder {}", dir.display()))?;
    for entry in entries {
        let path = entry.with_context(|| format!("cannot read the folder {}", dir.display()))?.path();
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let hidden = name.starts_with('.');
        if path.is_dir() && !hidden && bags::find(std::slice::from_ref(&path)).is_ok() {
            cases.push(Case { name, dir: path, without: None });
        }
    }
    cases.sort_by(|a, b| a.name.cmp(&b.name));
    if cases.is_empty() {
        bail!("{}: expected folders with .mcap files in them, found none", dir.display());
    }
    Ok(cases)
}

impl Case {
    /// Its bags, by name.
    pub fn bags(&self) -> anyhow::Result<Vec<Bag>> {
        bags::find(std::slice::from_ref(&self.dir))
    }

    /// Its recordings, by name.
    pub fn recordings(&self) -> anyhow::Result<Vec<Recording>> {
        self.bags()?
            .iter()
            .map(|one| {
                let mut loaded = bag::read(&one.path, &ReadOptions::default())?;
                loaded.recording.name.clone_from(&one.name);
                Ok(loaded.recording)
            })
            .collect()
    }

    /// The catalogue that its diagnosis may use.
    pub fn catalogue(&self) -> Vec<&'static EffectSpec> {
        of_the_chain().filter(|spec| self.without.as_deref() != Some(spec.id)).collect()
    }
}
