//! The units of a folder, and their recordings.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use govtwin_diagnosis::likelihood::qualification::qualify_all;
use govtwin_model::effects::{EffectSpec, of_the_chain};
use govtwin_model::parameters::Unit;
use govtwin_model::recording::Recording;
use govtwin_model::twin::Cut;

use crate::commands::bags::{self, Bag, TopicArgs};

/// One unit to diagnose.
#[derive(Clone, Debug)]
pub struct UnitFolder {
    /// Name of its folder.
    pub name: String,
    /// Its folder.
    pub dir: PathBuf,
    /// Where its streams are.
    pub topics: TopicArgs,
    /// An effect that the catalogue lacks for this unit.
    pub without: Option<String>,
    /// Its true values, by which the regret of the search is measured.
    pub true_values: Option<PathBuf>,
    /// Recordings made later, which no diagnosis reads.
    pub later: Option<PathBuf>,
}

/// The file of true values in a unit's folder.
const TRUE_VALUES: &str = "truth.yaml";

/// The folder of recordings made later, in a unit's folder.
const LATER: &str = "later";

/// Every folder in a folder that holds bags, by name; with the true values beside the bags where verdicts are to be scored.
pub fn find(dir: &Path, topics: &TopicArgs, scored: bool) -> anyhow::Result<Vec<UnitFolder>> {
    let mut cases = vec![];
    let entries = dir.read_dir().with_context(|| format!("cannot read the folder {}", dir.display()))?;
    for entry in entries {
        let path = entry.with_context(|| format!("cannot read the folder {}", dir.display()))?.path();
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let hidden = name.starts_with('.');
        if !hidden && bags::holds_bags(&path)? {
            let true_values = Some(path.join(TRUE_VALUES)).filter(|file| scored && file.is_file());
            let later = Some(path.join(LATER)).filter(|folder| folder.is_dir());
            cases.push(UnitFolder { name, dir: path, topics: topics.clone(), without: None, true_values, later });
        }
    }
    cases.sort_by(|a, b| a.name.cmp(&b.name));
    if cases.is_empty() {
        bail!("{}: expected folders with .mcap files in them, found none", dir.display());
    }
    Ok(cases)
}

impl UnitFolder {
    /// Its bags, by name, without those made later.
    pub fn bags(&self) -> anyhow::Result<Vec<Bag>> {
        let mut bags = bags::find(std::slice::from_ref(&self.dir))?;
        bags.retain(|bag| self.later.as_ref().is_none_or(|later| !bag.path.starts_with(later)));
        Ok(bags)
    }

    /// Its recordings as the diagnosis reads them by the sheet of the unit, without what it does not qualify.
    pub fn recordings(&self, unit: &Unit) -> anyhow::Result<Vec<Recording>> {
        let paths: Vec<PathBuf> = self.bags()?.into_iter().map(|bag| bag.path).collect();
        let read = bags::read(&paths, &self.topics.topics(), unit)?;
        let intake = qualify_all(read.recordings, |_| Cut::None);
        if intake.qualified.is_empty() {
            bail!("no recording can be used:\n  {}", intake.refused.join("\n  "));
        }
        Ok(intake.qualified.into_iter().map(|(recording, _)| recording).collect())
    }

    /// The catalogue that its diagnosis may use.
    pub fn catalogue(&self) -> Vec<&'static EffectSpec> {
        of_the_chain().filter(|spec| self.without.as_deref() != Some(spec.id)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bags_made_later_are_no_part_of_a_unit() {
        let bag = Path::new(env!("CARGO_MANIFEST_DIR")).join("bags/reference/startup_01.mcap");
        let dir = tempfile::tempdir().unwrap();
        let unit = dir.path().join("one");
        std::fs::create_dir_all(unit.join(LATER)).unwrap();
        for file in [unit.join("startup.mcap"), unit.join(LATER).join("startup.mcap")] {
            std::fs::copy(&bag, file).unwrap();
        }
        let found = find(dir.path(), &TopicArgs::default(), false).unwrap();
        assert_eq!(found.iter().map(|unit| unit.name.as_str()).collect::<Vec<_>>(), ["one"]);
        let bags: Vec<PathBuf> = found[0].bags().unwrap().into_iter().map(|bag| bag.path).collect();
        assert_eq!(bags, [unit.join("startup.mcap")]);
        assert_eq!(found[0].later, Some(unit.join(LATER)));
    }

    #[test]
    fn recordings_are_those_that_the_diagnosis_reads() {
        let bags_of = |from: &str| Path::new(env!("CARGO_MANIFEST_DIR")).join("bags").join(from);
        let dir = tempfile::tempdir().unwrap();
        for (from, to) in
            [("reference/shutdown_01.mcap", "shutdown.mcap"), ("reference/startup_01.mcap", "startup.mcap")]
        {
            std::fs::copy(bags_of(from), dir.path().join(to)).unwrap();
        }
        std::fs::write(dir.path().join("torn.mcap"), "no bag").unwrap();
        let case = UnitFolder {
            name: String::new(),
            dir: dir.path().to_owned(),
            topics: TopicArgs::default(),
            without: None,
            true_values: None,
            later: None,
        };
        let sheet = govtwin_model::params::reference();
        let found = case.recordings(&sheet).unwrap();
        let read = bags::read(&[dir.path().to_owned()], &case.topics.topics(), &sheet).unwrap().recordings;
        assert_eq!(found.len(), 2, "what cannot be read is left out");
        for (found, read) in found.iter().zip(&read) {
            // As text, since what was not measured is NaN.
            assert_eq!(format!("{found:?}"), format!("{read:?}"));
            // Commands run from sample to sample, on the twin's own tick.
            assert!(found.frames[1].time_ns - found.frames[0].time_ns <= 1_000_000, "{}", found.name);
        }
    }
}
