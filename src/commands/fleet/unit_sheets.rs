//! The units table with all that it names: sheets and maps, checked, and as files that go beside the plan.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use govtwin_bag::import::Map;
use govtwin_diagnosis::fleet::entry::Options;
use govtwin_diagnosis::fleet::plan::How;
use govtwin_diagnosis::fleet::units::{self, UnitRow};
use govtwin_files::digest::sha256;
use govtwin_files::read_text;
use govtwin_model::parameters::Unit;
use govtwin_model::params::{self, Overlay, nearest};
use govtwin_model::provenance::FileUsed;

/// More than a table of a million units holds.
const LARGEST_BYTES: u64 = 1 << 28;

/// The units, and what goes beside the plan.
#[derive(Default)]
pub struct Units {
    /// The rows.
    pub rows: Vec<UnitRow>,
    /// How each is judged, by name.
    pub how: BTreeMap<String, How>,
    /// The sheets that are named, by their text in the table.
    pub sheets: BTreeMap<String, Unit>,
    /// The maps, by their text in the table.
    pub maps: BTreeMap<String, PathBuf>,
    /// Sheets and maps as they are to stand beside the plan, by path.
    pub beside: BTreeMap<String, Vec<u8>>,
}

/// A file as it is to stand beside the plan: its path and bytes.
type Copied = (String, Vec<u8>);

/// Reads the table; every sheet and map that it names is loaded, and all that is wrong is told at once.
pub fn read(path: &Path, seed: u64, without: &[String]) -> anyhow::Result<Units> {
    let shown = path.display();
    let text = read_text(path, LARGEST_BYTES).with_context(|| format!("cannot read {shown}"))?;
    let near = |word: &str, known: &[&str]| nearest(word, known.iter().copied()).map(str::to_owned);
    let rows = match units::read(&text, near) {
        Ok(rows) => rows,
        Err(error) => bail!("{shown}:\n  {error}"),
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut all = Units::default();
    let mut files: BTreeMap<String, FileUsed> = BTreeMap::new();
    let mut wrong = Vec::new();
    for row in &rows {
        let mut file = |text: &str, load: &mut dyn FnMut(&Path) -> anyhow::Result<Copied>| -> Option<FileUsed> {
            if text.is_empty() {
                return None;
            }
            if let Some(known) = files.get(text) {
                return Some(known.clone());
            }
            match load(&folder.join(text)) {
                Ok((path, bytes)) => {
                    let used = FileUsed { path: path.clone(), bytes: bytes.len() as u64, sha256: sha256(&bytes) };
                    all.beside.insert(path, bytes);
                    files.insert(text.to_owned(), used.clone());
                    Some(used)
                }
                Err(error) => {
                    wrong.push(format!("line {}: unit `{}`: {error:#}", row.line, row.unit));
                    None
                }
            }
        };
        let sheet = file(&row.sheet, &mut |path| {
            let (unit, bytes) = merged(path)?;
            all.sheets.insert(row.sheet.clone(), unit);
            Ok((format!("sheets/{}.yaml", &sha256(&bytes)[..16]), bytes))
        });
        let map = file(&row.map, &mut |path| {
            Map::load(path)?;
            let bytes =
                govtwin_files::read_bytes(path, 1 << 20).with_context(|| format!("cannot read {}", path.display()))?;
            all.maps.insert(row.map.clone(), path.to_owned());
            Ok((format!("maps/{}.yaml", &sha256(&bytes)[..16]), bytes))
        });
        let mut without = [without, &row.without].concat();
        without.sort();
        without.dedup();
        for id in row.without.iter().filter(|id| govtwin_model::effects::find(id).is_none()) {
            wrong.push(format!(
                "line {}: unit `{}`: there is no effect `{id}`; `govtwin effects` lists them",
                row.line, row.unit
            ));
        }
        all.how.insert(row.unit.clone(), How { sheet, map, options: Options { seed, without } });
    }
    if !wrong.is_empty() {
        bail!("{shown}:\n  {}", wrong.join("\n  "));
    }
    Ok(Units { rows, ..all })
}

/// A sheet merged with those that it stands on, as one file of its own.
fn merged(path: &Path) -> anyhow::Result<(Unit, Vec<u8>)> {
    let sheet = params::load_sheet(path)?;
    let overlay = Overlay {
        unit: sheet.unit.clone(),
        name: sheet.name.clone(),
        source: String::new(),
        head: vec!["A unit's sheet, merged by `govtwin fleet plan`.".to_owned()],
        comments: BTreeMap::new(),
    };
    Ok((sheet.unit, params::overlay_text(path, &overlay)?.into_bytes()))
}
