//! The origin of the data that a bag's folder states.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use anyhow::Context;
use govtwin_files::look_at;

/// A text file that says it, in the bag's folder or one of those above it.
const FILE_NAME: &str = "ORIGIN.txt";

/// How many folders are asked, from the bag's own upwards.
const FOLDERS: usize = 5;

/// More than anybody reads in a note.
const LONGEST_BYTES: u64 = 2000;

/// The first paragraph of the nearest [`FILE_NAME`], where it can be read.
pub fn of(bag: &Path) -> Option<String> {
    read(bag).unwrap_or_default()
}

/// The first paragraph of the nearest [`FILE_NAME`], where there is one.
pub fn read(bag: &Path) -> anyhow::Result<Option<String>> {
    let full = bag.canonicalize().with_context(|| format!("cannot look at {}", bag.display()))?;
    let mut bytes = Vec::new();
    for file in full.ancestors().take(FOLDERS).map(|folder| folder.join(FILE_NAME)) {
        let reading = || format!("cannot read {}", file.display());
        if look_at(&file).with_context(reading)?.is_some_and(|kind| kind.is_file()) {
            let opened = File::open(&file).with_context(reading)?;
            opened.take(LONGEST_BYTES).read_to_end(&mut bytes).with_context(reading)?;
            break;
        }
    }
    let text = String::from_utf8_lossy(&bytes);
    let words: Vec<&str> =
        text.lines().take_while(|line| !line.trim().is_empty()).flat_map(str::split_whitespace).collect();
    Ok((!words.is_empty()).then(|| words.join(" ")))
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_nearest_note_speaks_with_its_first_paragraph() {
        let dir = tempfile::tempdir().unwrap();
        let bag = dir.path().join("unit/case/a.mcap");
        std::fs::create_dir_all(bag.parent().unwrap()).unwrap();
        std::fs::write(&bag, "").unwrap();
        assert_eq!(super::of(&bag), None);
        std::fs::write(dir.path().join("ORIGIN.txt"), "Synthetic\ndata.\n\nMore.").unwrap();
        assert_eq!(super::of(&bag).as_deref(), Some("Synthetic data."));
        std::fs::write(dir.path().join("unit/ORIGIN.txt"), "Measured.").unwrap();
        assert_eq!(super::of(&bag).as_deref(), Some("Measured."));
    }
}
