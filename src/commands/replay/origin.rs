//! What a bag's folder says of where its data comes from.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

/// A text file that says it, in the bag's folder or one of those above it.
const FILE_NAME: &str = "ORIGIN.txt";

/// How many folders are asked, from the bag's own upwards.
const FOLDERS: usize = 5;

/// More than anybody reads in a note.
const LONGEST_BYTES: u64 = 2000;

/// The first paragraph of the nearest [`FILE_NAME`].
pub fn of(bag: &Path) -> Option<String> {
    let full = bag.canonicalize().ok()?;
    let file = full.ancestors().take(FOLDERS).map(|folder| folder.join(FILE_NAME)).find(|file| file.is_file())?;
    let mut bytes = Vec::new();
    File::open(file).ok()?.take(LONGEST_BYTES).read_to_end(&mut bytes).ok()?;
    let text = String::from_utf8_lossy(&bytes);
    let words: Vec<&str> =
        text.lines().take_while(|line| !line.trim().is_empty()).flat_map(str::split_whitespace).collect();
    (!words.is_empty()).then(|| words.join(" "))
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
