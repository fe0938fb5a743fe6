//! Evaluations that were done before, so that a search that was ended goes on where it stopped.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use govtwin_correction::table::FeatureTable;
use govtwin_files::digest::Digest;

use crate::commands::output::write_atomically;
use crate::commands::report_file::text_if_there;

/// More than the evaluations of many searches.
const LARGEST_BYTES: u64 = 1 << 26;

/// A point is known by its bits.
type Known = BTreeMap<String, f64>;

/// The journal of one kind of evaluation, in a file that holds several.
pub struct EvaluationJournal {
    path: PathBuf,
    key: String,
    all: BTreeMap<String, Known>,
}

impl EvaluationJournal {
    /// Opens the journal; a file that is missing or is none counts as empty. Other rows, another seed or another version of the
    /// program never share evaluations. One that cannot be read is an error: it would be written anew, and its evaluations lost.
    pub fn open(
        path: &Path,
        table: &FeatureTable,
        rows: &[usize],
        learned: impl std::fmt::Debug,
        seed: u64,
    ) -> anyhow::Result<Self> {
        let mut hash = Digest::default();
        hash.update(format!("{} {learned:?} {seed} {:?}", env!("CARGO_PKG_VERSION"), table.layout));
        for &row in rows {
            let mark = &table.marks[row];
            for value in table.row(row).iter().chain([&mark.measured, &mark.model]) {
                hash.update_f64(*value);
            }
            hash.update(mark.process.id());
        }
        let mut key = hash.text();
        key.truncate(32);
        let text = text_if_there(path, LARGEST_BYTES)?.unwrap_or_default();
        Ok(Self { path: path.to_owned(), key, all: serde_json::from_str(&text).unwrap_or_default() })
    }

    /// The loss of a point: as it was found before, or evaluated now and kept.
    pub fn loss(&mut self, point: &[f64], evaluate: impl FnOnce() -> anyhow::Result<f64>) -> anyhow::Result<f64> {
        let known = self.all.entry(self.key.clone()).or_default();
        if let Some(loss) = known.get(&words(point)) {
            return Ok(*loss);
        }
        let loss = evaluate()?;
        known.insert(words(point), loss);
        write_atomically(&self.path, serde_json::to_string(&self.all)?.as_bytes())?;
        Ok(loss)
    }
}

fn words(point: &[f64]) -> String {
    let words: Vec<String> = point.iter().map(f64::to_string).collect();
    words.join(" ")
}
