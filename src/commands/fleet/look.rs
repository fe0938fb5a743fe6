//! What the objects of a source are: recordings, by their content, or why not.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use anyhow::Context;
use govtwin_bag::{Positions, ReadOptions, Stream};
use govtwin_diagnosis::fleet::entry::BagUsed;
use govtwin_diagnosis::fleet::plan::{FoundRecording, LeftOut, Reason};
use govtwin_diagnosis::fleet::units::UnitRow;
use govtwin_files::store::{Object, Store};
use govtwin_model::parameters::Unit;
use govtwin_model::provenance::FileUsed;

use super::period::Period;
use crate::commands::bags::MapArgs;
use crate::commands::provenance;

/// The first bytes of an MCAP file.
const MCAP: &[u8] = b"\x89MCAP0\r\n";
/// The first bytes of an SQLite file.
const SQLITE: &[u8] = b"SQLite format 3\0";
/// The file that makes a folder one bag.
const METADATA: &str = "metadata.yaml";
/// Names that only recordings have.
const SUFFIXES: [&str; 3] = [".mcap", ".db3", ".bag"];
/// Key in a bag's own metadata that names the unit that it is of.
const UNIT: &str = "unit";

/// Something that may be a recording: a file, or the folder of a bag.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// Its path in the source.
    pub path: String,
    /// Its files, `metadata.yaml` of a bag's folder among them.
    pub files: Vec<Object>,
}

/// Objects as items: those of a folder with `metadata.yaml` are one bag.
pub fn items(objects: &[Object]) -> Vec<Item> {
    let folder = |path: &str| path.rsplit_once('/').map_or("", |(folder, _)| folder).to_owned();
    let of_bags: BTreeSet<String> = objects
        .iter()
        .filter(|one| one.path.rsplit('/').next() == Some(METADATA))
        .map(|one| folder(&one.path))
        .collect();
    let mut bags: BTreeMap<String, Vec<Object>> = BTreeMap::new();
    let mut items = Vec::new();
    for object in objects {
        let folder = folder(&object.path);
        if of_bags.contains(&folder) {
            bags.entry(folder).or_default().push(object.clone());
        } else {
            items.push(Item { path: object.path.clone(), files: vec![object.clone()] });
        }
    }
    items.extend(bags.into_iter().map(|(path, files)| Item { path, files }));
    items.sort_by(|a, b| a.path.cmp(&b.path));
    items
}

/// The unit in whose folder a path lies.
pub fn owner<'a>(path: &str, by_folder: &BTreeMap<&str, &'a UnitRow>) -> Option<&'a UnitRow> {
    let ends = path.match_indices('/').map(|(at, _)| at).chain([path.len()]);
    let mut folders = [""].into_iter().chain(ends.map(|end| &path[..end]));
    folders.find_map(|folder| by_folder.get(folder)).copied()
}

/// How the recordings of a unit are read.
pub struct Reading<'a> {
    /// The unit's row.
    pub row: &'a UnitRow,
    /// Its sheet; none for the shipped unit.
    pub sheet: Option<&'a Unit>,
    /// Its import map.
    pub map: Option<&'a PathBuf>,
    /// How long a period is.
    pub period: Period,
}

/// Looks at an item of a unit.
pub fn look(item: &Item, source: &Store, reading: &Reading) -> anyhow::Result<Result<FoundRecording, LeftOut>> {
    let out = |reason: Reason, words: String| LeftOut {
        path: item.path.clone(),
        unit: reading.row.unit.clone(),
        reason,
        words,
    };
    let folder = tempfile::tempdir().context("no temporary folder for recordings")?;
    let mut files = Vec::new();
    let mut known = false;
    let mut top = None;
    for object in &item.files {
        let local = source.local(&object.path);
        let path = local.clone().unwrap_or_else(|| folder.path().join(&object.path));
        if local.is_none() {
            std::fs::create_dir_all(path.parent().unwrap_or(folder.path()))
                .context("no temporary folder for recordings")?;
            source.fetch(&object.path, &path)?;
        }
        top.get_or_insert_with(|| {
            if item.path == object.path { path.clone() } else { path.parent().map(Path::to_owned).unwrap_or_default() }
        });
        let head = match head(&path) {
            Ok(head) => head,
            Err(error) => return Ok(Err(out(Reason::Unreadable, error.to_string()))),
        };
        known |= head.starts_with(MCAP) || head.starts_with(SQLITE);
        if item.files.len() > 1 && object.path.ends_with(METADATA) {
            continue;
        }
        let used = match provenance::file(&path) {
            Ok(used) => used,
            Err(error) => return Ok(Err(out(Reason::Unreadable, format!("{error:#}")))),
        };
        files.push(FileUsed { path: object.path.clone(), ..used });
    }
    let Some(path) = top else { return Ok(Err(out(Reason::NoRecording, "nothing in it".to_owned()))) };
    if !known && reading.map.is_none() {
        let named =
            item.files.iter().any(|object| SUFFIXES.iter().any(|suffix| object.path.to_lowercase().ends_with(suffix)));
        let (reason, words) = if named {
            (Reason::Unreadable, "is called like a recording, and begins neither as MCAP nor as SQLite does")
        } else {
            (Reason::NoRecording, "begins neither as MCAP nor as SQLite does; a table needs a map in the column `map`")
        };
        return Ok(Err(out(reason, words.to_owned())));
    }
    let shown = |words: String| words.replace(&format!("{}/", folder.path().display()), "");
    match recorded(&path, reading) {
        Ok((first_ns, states)) => {
            let period = reading.period.of(first_ns);
            Ok(Ok(FoundRecording {
                unit: reading.row.unit.clone(),
                period,
                bag: BagUsed { path: item.path.clone(), files },
                states,
            }))
        }
        Err(error) => Ok(Err(out(Reason::Unreadable, shown(format!("{error:#}"))))),
    }
}

fn head(path: &Path) -> std::io::Result<Vec<u8>> {
    govtwin_files::check_regular(path)?;
    let mut head = Vec::new();
    File::open(path)?.take(SQLITE.len() as u64).read_to_end(&mut head)?;
    Ok(head)
}

/// When a recording begins, ns, and the unit that it states to be of.
fn recorded(path: &Path, reading: &Reading) -> anyhow::Result<(i64, Option<String>)> {
    let mapped = MapArgs { map: reading.map.cloned() }.open(&[path.to_owned()])?;
    let bag = mapped.paths.first().context("nothing was imported")?;
    let positions = reading.sheet.map_or(Positions::AnyUnit, |unit| Positions::of(unit.recorded));
    let options = ReadOptions { positions, required: vec![Stream::ServoState], ..ReadOptions::default() };
    let (survey, overview) = govtwin_bag::look(bag, &options)?;
    let overview = overview?;
    let first_ns = survey.first_ns.context("no message in it")?;
    Ok((first_ns, overview.health.about(UNIT).map(str::to_owned)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_with_metadata_are_one_item_and_units_own_what_lies_in_their_folders() {
        let object = |path: &str| Object { path: path.to_owned(), bytes: 1 };
        let objects = ["a/run/metadata.yaml", "a/run/run_0.mcap", "a/x.mcap", "b.mcap"].map(object);
        let found: Vec<_> = items(&objects).into_iter().map(|item| (item.path, item.files.len())).collect();
        assert_eq!(found, [("a/run".to_owned(), 2), ("a/x.mcap".to_owned(), 1), ("b.mcap".to_owned(), 1)]);
        let rows = ["a", "a b", "c/d"].map(|folder| UnitRow {
            folder: folder.to_owned(),
            unit: folder.to_owned(),
            ..UnitRow::default()
        });
        let by_folder: BTreeMap<&str, &UnitRow> = rows.iter().map(|row| (row.folder.as_str(), row)).collect();
        let of = |path: &str| owner(path, &by_folder).map(|row| row.unit.as_str());
        assert_eq!(
            (of("a/run"), of("a"), of("a b/x"), of("c/d/e/f"), of("c/x"), of("b.mcap")),
            (Some("a"), Some("a"), Some("a b"), Some("c/d"), None, None)
        );
    }
}
