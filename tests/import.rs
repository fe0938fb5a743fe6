//! Importing what other tools write: files of each of them, round trips to the last bit, and files that are broken.

#[path = "import/broken.rs"]
mod broken;
#[cfg(feature = "cli")]
#[path = "import/cli.rs"]
mod cli;
#[path = "import/faster.rs"]
mod faster;
#[path = "import/findings.rs"]
mod findings;
#[path = "import/kinds.rs"]
mod kinds;
#[cfg(feature = "cli")]
#[path = "import/round_trip.rs"]
mod round_trip;
#[path = "import/suggest.rs"]
mod suggest;
#[path = "import/tools.rs"]
mod tools;

use std::path::{Path, PathBuf};

use govtwin_bag::import::{Import, ImportError, ImportOutcome, ImportedRow, Map};

/// A file that other tools wrote, by `make.py` beside it.
fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/import").join(name)
}

/// A shipped recording.
fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("bags").join(name)
}

fn map(text: &str) -> Map {
    Map::parse(text, Path::new("map.yaml")).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

/// All rows of files by a map, and what there is to say of them.
fn rows(files: &[PathBuf], text: &str) -> Result<(Vec<ImportedRow>, ImportOutcome), ImportError> {
    let mut rows = vec![];
    let import = Import::open(files, &map(text))?;
    let outcome = import.run(
        &mut |row| {
            rows.push(*row);
            Ok::<(), ImportError>(())
        },
        &mut |_| (),
    )?;
    Ok((rows, outcome))
}

/// A file with this content, in a folder that goes with the first of the two.
fn file(name: &str, content: impl AsRef<[u8]>) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    (folder, path)
}

/// Rows of a table in memory.
fn rows_of(content: impl AsRef<[u8]>, text: &str) -> Result<(Vec<ImportedRow>, ImportOutcome), ImportError> {
    let (_folder, path) = file("t.csv", content);
    rows(&[path], text)
}
