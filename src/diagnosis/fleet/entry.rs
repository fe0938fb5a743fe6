//! One piece of work: a unit in a period, its recordings by their digests, its sheet, and the key of its result.

use serde::{Deserialize, Serialize};

use govtwin_files::digest::Digest;
use govtwin_model::provenance::FileUsed;

/// The schema of a line of a plan.
pub const SCHEMA: &str = "govtwin-fleet-entry/1";

/// A unit in a period.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// [`SCHEMA`].
    pub schema: String,
    /// The unit's name, of the units table.
    pub unit: String,
    /// The period, such as `2024-03`.
    pub period: String,
    /// Where the recordings are: a folder, or the address of an object store.
    pub source: String,
    /// The recordings, by name.
    pub bags: Vec<BagUsed>,
    /// The data sheet, beside the plan; none for the shipped unit.
    pub sheet: Option<FileUsed>,
    /// The import map, beside the plan.
    pub map: Option<FileUsed>,
    /// What decides the result besides.
    pub options: Options,
    /// Names the result: a digest of recordings, sheet, map, options and program version.
    pub key: String,
}

/// A recording of an entry.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BagUsed {
    /// The file, or the folder of a bag, below the source.
    pub path: String,
    /// Its files, below the source.
    pub files: Vec<FileUsed>,
}

/// Options of a diagnosis that decide its result.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Options {
    /// Seed of the resampling behind intervals.
    pub seed: u64,
    /// Effects left out of the catalogue.
    #[serde(default)]
    pub without: Vec<String>,
}

/// An entry that is none.
#[derive(Debug, thiserror::Error)]
pub enum EntryError {
    /// Not JSON, or not of the schema.
    #[error("expected an entry of the schema {SCHEMA}, a line of the plan that `govtwin fleet plan` writes: {0}")]
    Malformed(#[from] serde_json::Error),
    /// Another schema.
    #[error("expected an entry of the schema {SCHEMA}, found `{0}`; was the plan made by another version?")]
    Schema(String),
    /// The key is not that of its content.
    #[error(
        "{unit}, {period}: the key of the entry is not that of its recordings, sheet and options under {program}; was the plan changed, or \
         made by another version? Make it anew with `govtwin fleet plan`"
    )]
    Key {
        /// The unit.
        unit: String,
        /// The period.
        period: String,
        /// This program.
        program: String,
    },
}

impl Entry {
    /// Reads a line of a plan, and checks that its key is that of its content under this program.
    ///
    /// # Errors
    /// Where it is no entry, or was changed, or was planned by another version.
    pub fn read(line: &str, program: &str) -> Result<Self, EntryError> {
        let entry: Self = serde_json::from_str(line)?;
        if entry.schema != SCHEMA {
            return Err(EntryError::Schema(entry.schema));
        }
        if entry.key != entry.digest(program) {
            return Err(EntryError::Key { unit: entry.unit, period: entry.period, program: program.to_owned() });
        }
        Ok(entry)
    }

    /// The same with its schema and key.
    #[must_use]
    pub fn keyed(mut self, program: &str) -> Self {
        SCHEMA.clone_into(&mut self.schema);
        self.key = self.digest(program);
        self
    }

    /// Digest of what decides the result: bytes of recordings, sheet and map, program version, options. Names and places do not count.
    fn digest(&self, program: &str) -> String {
        let mut recordings: Vec<Vec<&str>> = self.bags.iter().map(|bag| digests(&bag.files)).collect();
        recordings.sort_unstable();
        let of = |file: &Option<FileUsed>| file.as_ref().map(|file| file.sha256.clone());
        let content = (SCHEMA, program, recordings, of(&self.sheet), of(&self.map), &self.options);
        let mut digest = Digest::default();
        // Lists of texts and whole numbers always have a JSON.
        digest.update(serde_json::to_vec(&content).unwrap_or_default());
        digest.text()
    }

    /// The entry in words.
    pub fn name(&self) -> String {
        format!("{}, {}", self.unit, self.period)
    }

    /// The line of a plan.
    pub fn line(&self) -> String {
        serde_json::to_string(self).unwrap_or_default() + "\n"
    }
}

fn digests(files: &[FileUsed]) -> Vec<&str> {
    let mut all: Vec<&str> = files.iter().map(|file| file.sha256.as_str()).collect();
    all.sort_unstable();
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(path: &str, sha256: &str) -> FileUsed {
        FileUsed { path: path.to_owned(), bytes: 1, sha256: sha256.to_owned() }
    }

    fn entry() -> Entry {
        let bag = |path: &str, sha256: &str| BagUsed { path: path.to_owned(), files: vec![file(path, sha256)] };
        let bags = vec![bag("a/1.mcap", "11"), bag("a/2.mcap", "22")];
        Entry { unit: "a".into(), period: "2024".into(), bags, ..Entry::default() }.keyed("govtwin 1")
    }

    #[test]
    fn the_key_is_of_content_and_not_of_names() {
        let one = entry();
        let mut moved = one.clone();
        moved.unit = "b".into();
        moved.source = "elsewhere".into();
        moved.bags.reverse();
        moved.bags[0].path = "b/2.mcap".into();
        assert_eq!(moved.keyed("govtwin 1").key, one.key);
        let change = |change: &dyn Fn(&mut Entry)| {
            let mut other = one.clone();
            change(&mut other);
            other.keyed("govtwin 1").key
        };
        for other in [
            change(&|entry| entry.bags[0].files[0].sha256 = "33".into()),
            change(&|entry| drop(entry.bags.pop())),
            change(&|entry| entry.sheet = Some(file("s", "44"))),
            change(&|entry| entry.map = Some(file("s", "44"))),
            change(&|entry| entry.options.seed = 2),
            change(&|entry| entry.options.without = vec!["backlash".into()]),
            one.clone().keyed("govtwin 2").key,
        ] {
            assert_ne!(other, one.key);
        }
    }

    #[test]
    fn a_line_reads_back_and_a_changed_one_is_refused() {
        let one = entry();
        assert_eq!(Entry::read(&one.line(), "govtwin 1").unwrap(), one);
        assert!(matches!(Entry::read(&one.line(), "govtwin 2"), Err(EntryError::Key { .. })));
        assert!(matches!(
            Entry::read(&one.line().replace("\"22\"", "\"23\""), "govtwin 1"),
            Err(EntryError::Key { .. })
        ));
        assert!(matches!(
            Entry::read(&one.line().replace("entry/1", "entry/2"), "govtwin 1"),
            Err(EntryError::Schema(_))
        ));
        assert!(matches!(Entry::read("{", "govtwin 1"), Err(EntryError::Malformed(_))));
        assert!(matches!(Entry::read(&one.line().replacen('{', "{\"x\":1,", 1), "p"), Err(EntryError::Malformed(_))));
    }
}
